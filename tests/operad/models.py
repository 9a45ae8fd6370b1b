"""Patterns that several tests use: the damped oscillator, and two bodies on a joint."""

from ephs.operad import Pattern, quantity

MOMENTUM = quantity.body_momentum
POSE = quantity.pose

OSCILLATOR = Pattern.from_text("q: displacement; p: momentum, exposed; pe(q); ke(p); pkc(q, p)")
DAMPED = Pattern.from_text("p: momentum; s: entropy; osc(p); mf(p, s); env(s)")
BODY = Pattern.from_text("q: pose; p: body_momentum, exposed; pe(q); pkc(q, p); ke(p); lp(p)")
JOINT = Pattern.from_text(
    "p1: body_momentum, exposed; p2: body_momentum, exposed; p_j1: body_momentum; "
    "p_j2: body_momentum; p_r: joint_momentum(revolute); q_r: relative_pose(revolute); s: entropy; "
    "o1(p1, p_j1); o2(p2, p_j2); hc(~q_r, p_j1, p_j2, p_r); pe(q_r); pkc(q_r, p_r); mf(p_r, s); "
    "env(s)"
)
MBS = Pattern.from_text("p1: body_momentum; p2: body_momentum; b1(p=p1); b2(p=p2); j(p1, p2)")
