"""Relative motion in a joint: its frame, its twist, and rates of joints that are walked backward.

Velocities are left-trivialised and body-fixed, so that the basis B of a joint's subgroup is constant: a link's twist is
Ad_{x⁻¹} of its parent's and B ρ. Walked from its first body to its second one, a joint has ρ = r. Walked the other way
its element is inverted and B ρ = −Ad_x B r, so that ρ = −L r with L = B⁺ Ad_x B; L̇ r = B⁺ Ad_x [B r, B r] = 0, so that
accelerations follow the same rule, and forces the transposed inverse.
"""

from ephs.mechanics.tree.sweeps.records import Joint, Link
from ephs.semantics.spaces.se3 import twist_inward, twist_outward
from ephs.semantics.spaces.staged_groups import about_z, included
from ephs.semantics.spaces.vectors import Rows, add, apply, apply_transposed, dot, product, scale, transposed
from ephs.semantics.stage import Evaluator, Real, Vector


def _element(on: Evaluator, joint: Joint, link: Link, q: Vector) -> tuple[Rows, list[Real]]:
    """The frame of the joint's element as it is stored, or, of abelian pairs, as it is walked."""
    element = scale(link.sense, [q[link.q_at + k] for k in range(joint.size)])
    if joint.revolute:
        return about_z(on, element[0] + link.shift), [0.0, 0.0, 0.0]
    return included(on, joint.code, joint.basis, element)


def frame(on: Evaluator, joint: Joint, link: Link, q: Vector) -> tuple[Rows, list[Real]]:
    """The link's frame in its parent's."""
    rotation, place = _element(on, joint, link, q)
    if joint.backward:
        rotation = transposed(rotation)
        place = scale(-1.0, apply(rotation, place))
    return product(link.rotation, rotation), add(link.place, apply(link.rotation, place))


def _carried(on: Evaluator, joint: Joint, link: Link, q: Vector, *, back: bool) -> Rows:
    """L = B⁺ Ad_x B at the joint's element x, or its inverse: that of x⁻¹."""
    rotation, place = _element(on, joint, link, q)
    through = twist_inward if back else twist_outward
    images = [through(rotation, place, column) for column in joint.basis]
    return [[dot(column, image) / dot(column, column) for image in images] for column in joint.basis]


def rate_inside(on: Evaluator, joint: Joint, link: Link, q: Vector, r: list[Real]) -> list[Real]:
    """ρ of the rates r."""
    if not joint.backward:
        return scale(link.sense, r)
    return scale(-1.0, apply(_carried(on, joint, link, q, back=False), r))


def rate_outside(on: Evaluator, joint: Joint, link: Link, q: Vector, rho: list[Real]) -> list[Real]:
    """r of ρ: `rate_inside` undone."""
    if not joint.backward:
        return scale(link.sense, rho)
    return scale(-1.0, apply(_carried(on, joint, link, q, back=True), rho))


def force_inside(on: Evaluator, joint: Joint, link: Link, q: Vector, force: list[Real]) -> list[Real]:
    """The force on ρ of a force on r, of equal power."""
    if not joint.backward:
        return scale(link.sense, force)
    return scale(-1.0, apply_transposed(_carried(on, joint, link, q, back=True), force))


def force_outside(on: Evaluator, joint: Joint, link: Link, q: Vector, force: list[Real]) -> list[Real]:
    """The force on r of a force on ρ: `force_inside` undone."""
    if not joint.backward:
        return scale(link.sense, force)
    return scale(-1.0, apply_transposed(_carried(on, joint, link, q, back=False), force))
