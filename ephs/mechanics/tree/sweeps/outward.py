"""The outward sweep: frames, twists, accelerations at ṙ = 0 and loads of all links."""

from ephs.mechanics.tree.sweeps.joints import frame, rate_inside
from ephs.mechanics.tree.sweeps.records import Joint, Link, State, Tree
from ephs.semantics.spaces.se3 import bracket, cobracket, twist_inward
from ephs.semantics.spaces.vectors import (
    Entries,
    add,
    apply,
    combine,
    cross,
    hat,
    product,
    scale,
    sub,
    symmetric,
)
from ephs.semantics.stage import Evaluator, Integer, Real, Vector


def momentum(link: Link, u: Entries) -> list[Real]:
    """I u of a link's own inertia and a twist."""
    turning, moving = u[:3], u[3:]
    angular = add(apply(symmetric(link.inertia), turning), cross(link.moment, moving))
    return [*angular, *add(scale(link.mass, moving), cross(turning, link.moment))]


def outward(on: Evaluator, tree: Tree, q: Vector, r: Vector, lead: Vector | None = None) -> None:
    """Fill the states of all links at the elements q and rates r; inertias are set to the links' own.

    The load of a link is I b − ad*_u(I u), with its twist u and the acceleration b that it has at ṙ = 0, or, of joints
    with prescribed motions, at the rates' derivatives ``lead``. Gravity is an acceleration of the ground.
    """
    _ground(tree)

    def one(i: Integer) -> None:
        tree.visit(on, i, lambda joint, link: _step(on, tree, i, joint, link, q, r, lead))

    tree.each(on, one)


def _ground(tree: Tree) -> None:
    ground = tree.states[tree.size]
    ground.turn, ground.at = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [0.0] * 3
    ground.twist, ground.change = [0.0] * 6, [0.0] * 6
    ground.bias = [0.0, 0.0, 0.0, *scale(-1.0, tree.gravity)]


def _step(
    on: Evaluator, tree: Tree, i: Integer, joint: Joint, link: Link, q: Vector, r: Vector, lead: Vector | None
) -> None:  # fmt: skip
    state, parent = tree.states[i], tree.states[link.parent]
    rotation, place = frame(on, joint, link, q)
    rate = rate_inside(on, joint, link, q, [r[link.r_at + k] for k in range(joint.dim)])
    along = combine(joint.basis, rate) if joint.dim else [0.0] * 6
    state.rotation, state.place = rotation, place
    around = parent.turn
    state.turn, state.at = product(around, rotation), add(parent.at, apply(around, place))
    twist = add(twist_inward(rotation, place, parent.twist), along)
    bias = add(twist_inward(rotation, place, parent.bias), bracket(twist, along))
    if joint.driven and lead is not None:
        led = rate_inside(on, joint, link, q, [lead[link.r_at + k] for k in range(joint.dim)])
        bias = add(bias, combine(joint.basis, led))
    state.twist, state.bias = twist, bias
    state.load = sub(momentum(link, bias), cobracket(twist, momentum(link, twist)))
    _own_inertia(state, link)


def _own_inertia(state: State, link: Link) -> None:
    state.angular, state.mixed = link.inertia, hat(link.moment)
    m = link.mass
    state.linear = [m, 0.0, 0.0, m, 0.0, m]
