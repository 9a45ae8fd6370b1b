"""Patterns that several tests use: the damped oscillator, and two bodies on a joint."""

from ephs.operad import Pattern, junction, quantity

MOMENTUM = quantity.body_momentum
POSE = quantity.pose

OSCILLATOR = Pattern(
    junctions={"q": junction(quantity.displacement), "p": junction(quantity.momentum, exposed=True)},
    boxes={"pe": {"q": "q"}, "ke": {"p": "p"}, "pkc": {"q": "q", "p": "p"}},
)
DAMPED = Pattern(
    junctions={"p": junction(quantity.momentum), "s": junction(quantity.entropy)},
    boxes={"osc": {"p": "p"}, "mf": {"p": "p", "s": "s"}, "env": {"s": "s"}},
)
BODY = Pattern(
    junctions={"q": junction(POSE), "p": junction(MOMENTUM, exposed=True)},
    boxes={"pe": {"q": "q"}, "pkc": {"q": "q", "p": "p"}, "ke": {"p": "p"}, "lp": {"p": "p"}},
)
JOINT = Pattern(
    junctions={
        "p1": junction(MOMENTUM, exposed=True),
        "p2": junction(MOMENTUM, exposed=True),
        "p_j1": junction(MOMENTUM),
        "p_j2": junction(MOMENTUM),
        "p_r": junction(quantity.joint_momentum("revolute")),
        "q_r": junction(quantity.relative_pose("revolute")),
        "s": junction(quantity.entropy),
    },
    boxes={
        "o1": {"p1": "p1", "p_j1": "p_j1"},
        "o2": {"p2": "p2", "p_j2": "p_j2"},
        "hc": {"q_r": "~q_r", "p_j1": "p_j1", "p_j2": "p_j2", "p_r": "p_r"},
        "pe": {"q_r": "q_r"},
        "pkc": {"q_r": "q_r", "p_r": "p_r"},
        "mf": {"p_r": "p_r", "s": "s"},
        "env": {"s": "s"},
    },
)
MBS = Pattern(
    junctions={"p1": junction(MOMENTUM), "p2": junction(MOMENTUM)},
    boxes={"b1": {"p": "p1"}, "b2": {"p": "p2"}, "j": {"p1": "p1", "p2": "p2"}},
)
