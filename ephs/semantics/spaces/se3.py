"""Motions of space as formulas over numbers of any kind: poses, frames, twists, wrenches, exp and its differentials.

A pose is [w, x, y, z, px, py, pz]; a frame is the same as a rotation matrix R and a place p. Twists are (ω, υ),
wrenches (torque, force), both lists of six. With x = (R, p):

    Ad_x u = (R ω, R υ + p × R ω)                Ad*_x f = (Rᵀ(n − p × f), Rᵀ f)
    ad_u w = (ω × w_ω, ω × w_υ − w_ω × υ)        ad*_u p = (p_ω × ω + p_υ × υ, p_υ × ω)
"""

from ephs.semantics.spaces import so3
from ephs.semantics.spaces.series import beta, beta1, cot, cot1, gamma, gamma1
from ephs.semantics.spaces.vectors import Entries, Rows, add, cross, dot, plus, scale, sub
from ephs.semantics.stage import Evaluator, Real


def compose(on: Evaluator, a: Entries, b: Entries) -> list[Real]:
    """Product a·b of poses."""
    return [*so3.multiply(on, a[:4], b[:4]), *add(a[4:], so3.rotate(a[:4], b[4:]))]


def inverse(a: Entries) -> list[Real]:
    """Inverse of a pose."""
    back = so3.conjugate(a[:4])
    return [*back, *scale(-1.0, so3.rotate(back, a[4:]))]


def between(on: Evaluator, a: Entries, b: Entries) -> list[Real]:
    """The pose a⁻¹·b of b in the frame of a."""
    back = so3.conjugate(a[:4])
    return [*so3.multiply(on, back, b[:4]), *so3.rotate(back, sub(b[4:], a[4:]))]


def adjoint(pose: Entries, u: Entries) -> list[Real]:
    """Ad_x u of a pose and a twist."""
    turning = so3.rotate(pose[:4], u[:3])
    return [*turning, *add(so3.rotate(pose[:4], u[3:]), cross(pose[4:], turning))]


def bracket(u: Entries, w: Entries) -> list[Real]:
    """ad_u w of twists."""
    return [*cross(u[:3], w[:3]), *sub(cross(u[:3], w[3:]), cross(w[:3], u[3:]))]


def cobracket(u: Entries, p: Entries) -> list[Real]:
    """ad*_u p of a twist and a momentum: the transpose of ad_u."""
    return [*add(cross(p[:3], u[:3]), cross(p[3:], u[3:])), *cross(p[3:], u[:3])]


def exp(on: Evaluator, v: Entries) -> list[Real]:
    """Exponential map, six numbers to a pose."""
    x = dot(v[:3], v[:3])
    return [*so3.exp(on, v[:3]), *so3.polynomial(v[:3], beta(on, x), gamma(on, x), v[3:])]


def log(on: Evaluator, a: Entries) -> list[Real]:
    """Principal logarithm of a pose; rotation vectors of length ≤ π."""
    v = so3.log(on, a[:4])
    return [*v, *so3.polynomial(v, -0.5, cot(on, dot(v, v)), a[4:])]


def retract(on: Evaluator, a: Entries, v: Entries) -> list[Real]:
    """The pose a·exp(v)."""
    return compose(on, a, exp(on, v))


def increment(on: Evaluator, a: Entries, b: Entries) -> list[Real]:
    """log(a⁻¹·b)."""
    return log(on, between(on, a, b))


def _over_dual_numbers(v: Entries, f: Real, f1: Real, g: Real, g1: Real) -> Rows:
    """1 + f ω̂ + g ω̂² at ω + ε υ, its ε part in the lower left block: a (6, 6) matrix."""
    turning, moving = v[:3], v[3:]
    x, d = dot(turning, turning), dot(turning, moving)
    same = so3.block(1.0 - g * x, scale(f, turning), g, turning)
    skew = add(scale(f, moving), scale(d * f1, turning))
    mixed = so3.block(-d * (2.0 * g + g1 * x), skew, d * g1, turning)
    mixed = plus(mixed, [[g * (turning[i] * moving[j] + moving[i] * turning[j]) for j in range(3)] for i in range(3)])
    return [*[[*row, 0.0, 0.0, 0.0] for row in same], *[[*m, *s] for m, s in zip(mixed, same, strict=True)]]


def dexp(on: Evaluator, v: Entries) -> Rows:
    """Right-trivialised differential of exp: (d exp v) exp(v)⁻¹ = dexp_v dv; the left-trivialised one is that of −v."""
    x = dot(v[:3], v[:3])
    return _over_dual_numbers(v, beta(on, x), beta1(on, x), gamma(on, x), gamma1(on, x))


def dexp_inv(on: Evaluator, v: Entries) -> Rows:
    """Inverse of `dexp`; singular where the rotation reaches 2π."""
    x = dot(v[:3], v[:3])
    return _over_dual_numbers(v, -0.5, 0.0, cot(on, x), cot1(on, x))
