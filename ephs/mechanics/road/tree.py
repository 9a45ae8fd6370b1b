"""The outward sweep: frames, twists, accelerations at ṙ = 0 and loads of all links.

Vectors of a link are in world axes, about the origin of its own frame. Twists and wrenches pass from link to link by
shifts alone, and a joint that is walked backward differs in a sign: walked from its first body to its second one, rates
r of a joint with the basis B turn and move the link by Ad B r of the second frame, and by −Ad B r walked the other way.
"""

from dataclasses import dataclass
from typing import final

from ephs.mechanics.road.records import JointKind, LinkConstants, LinkState, Tree
from ephs.semantics.spaces.se3 import bracket, cobracket
from ephs.semantics.spaces.staged_groups import about_z, included
from ephs.semantics.spaces.vectors import (
    Columns,
    Entries,
    Rows,
    add,
    apply,
    combine,
    cross,
    dot,
    hat,
    product,
    scale,
    sub,
    symmetric,
    transposed,
)
from ephs.semantics.stage import Evaluator, Integer, Matrix, Real, Vector


def shift(u: Entries, way: Entries) -> list[Real]:
    """A twist about an origin that is moved along a way."""
    return [*u[:3], *add(u[3:], cross(u[:3], way))]


def shift_back(f: Entries, way: Entries) -> list[Real]:
    """A wrench about the origin where a way begins, from that about its end: the transpose of `shift`."""
    return [*add(f[:3], cross(way, f[3:])), *f[3:]]


def turned(turn: Columns, u: Entries) -> list[Real]:
    """A twist or a wrench in the axes around a frame, from those in the frame's own."""
    return [*apply(turn, u[:3]), *apply(turn, u[3:])]


@final
@dataclass(frozen=True, slots=True)
class Inertia:
    """Mass, moment (3,) and inertia (upper triangle) about a point, in world axes."""

    mass: Real
    moment: list[Real]
    angular: list[Real]

    @staticmethod
    def of(link: LinkConstants, turn: Columns) -> "Inertia":
        """Return that of a link about the origin of its frame, whose axes are the columns of a rotation."""
        half = product(turn, symmetric(link.inertia))
        angular = [dot(half[i], turn[j]) for i in range(3) for j in range(i, 3)]
        return Inertia(link.mass, apply(turn, link.moment), angular)

    def about(self, way: Entries) -> "Inertia":
        """Return the same about a point from which a way (3,) leads to that of before."""
        moment = add(self.moment, scale(self.mass, way))
        both = [[self.moment[i] * way[j] + way[i] * moment[j] for j in range(3)] for i in range(3)]
        size = both[0][0] + both[1][1] + both[2][2]
        moved = [(size if i == j else 0.0) - both[i][j] for i in range(3) for j in range(i, 3)]
        return Inertia(self.mass, moment, add(self.angular, moved))

    @property
    def numbers(self) -> list[Real]:
        """Mass, moment and inertia, (10,)."""
        return [self.mass, *self.moment, *self.angular]

    def momentum(self, u: Entries) -> list[Real]:
        """I u of a twist about the point."""
        angular = add(apply(symmetric(self.angular), u[:3]), cross(self.moment, u[3:]))
        return [*angular, *add(scale(self.mass, u[3:]), cross(u[:3], self.moment))]


def axes_of(joint: JointKind, link: LinkConstants, state: LinkState) -> list[list[Real]]:
    """Twists (d, 6) of a link by units of its joint's rates."""
    if joint.backward:
        return state.axes[: joint.dim]
    return [scale(link.sense, turned(state.turn, column)) for column in joint.basis]


def freedoms_of(joint: JointKind, link: LinkConstants, state: LinkState) -> list[list[Real]]:
    """Twists (d, 6) that span those of a joint: units along world axes where its freedoms are those of any axes."""
    if not joint.round or joint.armature:
        return axes_of(joint, link, state)
    return [[float(j == k) for k in range(6)] for j in range(joint.dim)]


def rates_along(joint: JointKind, link: LinkConstants, state: LinkState, along: list[Real]) -> list[Real]:
    """The rates (d,) of a joint, from those along `freedoms_of`."""
    if not joint.round or joint.armature:
        return along
    return [dot(axis[: joint.dim], along) for axis in axes_of(joint, link, state)]


def forces_along(joint: JointKind, link: LinkConstants, state: LinkState, force: list[Real]) -> list[Real]:
    """Forces (d,) on the rates along `freedoms_of`, from those on the joint's rates."""
    if not joint.round or joint.armature:
        return force
    return combine(axes_of(joint, link, state), force)[: joint.dim]


def moved_by(joint: JointKind, link: LinkConstants, state: LinkState, rates: Entries) -> list[Real]:
    """The twist of a link that rates (d,) of its joint make."""
    if joint.backward:
        return combine(state.axes[: joint.dim], rates)
    return turned(state.turn, combine(joint.basis, scale(link.sense, rates)))


def rates_of(joint: JointKind, link: LinkConstants, state: LinkState, parent: LinkState, twist: Entries) -> list[Real]:
    """The rates (d,) of a joint that moves its link by a twist in its own subgroup."""
    if joint.backward:  # the frame in which the basis is constant is the parent's
        way = sub(add(parent.at, apply(parent.turn, link.place)), state.at)
        around, inside = product(parent.turn, link.rotation), scale(-1.0, shift(twist, way))
    else:
        around, inside = state.turn, scale(link.sense, twist)
    seen = turned(transposed(around), inside)
    return [dot(column, seen) / dot(column, column) for column in joint.basis]


def outward(on: Evaluator, tree: Tree, q: Vector, r: Vector, lead: Vector | None = None) -> None:
    """Fill the states of all links at the elements q and rates r; inertias are set to the links' own.

    The load of a link is I b − ad*_u(I u), with its twist u and the acceleration b that it has at ṙ = 0, or, of joints
    with prescribed motions, at the rates' derivatives ``lead``. Gravity is an acceleration of the ground. Nothing
    accelerates beyond that yet.
    """
    ground = tree.states[tree.size]
    ground.turn, ground.at = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [0.0] * 3
    ground.twist, ground.change, ground.reach = [0.0] * 6, [0.0] * 6, 0.0
    ground.bias = [0.0, 0.0, 0.0, *scale(-1.0, tree.gravity)]

    def each_link(i: Integer) -> None:
        tree.visit(on, i, lambda joint, link: _step(on, tree, i, joint, link, q, r, lead))

    tree.each(on, each_link)


def _step(
    on: Evaluator,
    tree: Tree,
    i: Integer,
    joint: JointKind,
    link: LinkConstants,
    q: Vector,
    r: Vector,
    lead: Vector | None,
) -> None:
    state, parent = tree.states[i], tree.states[link.parent]
    _frame(on, tree, joint, link, state, parent, q)
    moving = moved_by(joint, link, state, [r[link.r_at + k] for k in range(joint.dim)]) if joint.dim else [0.0] * 6
    twist, bias = add(shift(parent.twist, state.down), moving), shift(parent.bias, state.down)
    bias = add(bias, bracket(twist, moving))
    if joint.driven and lead is not None:
        bias = add(bias, moved_by(joint, link, state, [lead[link.r_at + k] for k in range(joint.dim)]))
    state.twist, state.bias, state.change = twist, bias, [0.0] * 6
    own, m = Inertia.of(link, state.turn), link.mass
    state.angular, state.mixed, state.linear = own.angular, hat(own.moment), [m, 0.0, 0.0, m, 0.0, m]
    state.load = sub(own.momentum(bias), cobracket(twist, own.momentum(twist)))


def _frame(
    on: Evaluator, tree: Tree, joint: JointKind, link: LinkConstants, state: LinkState, parent: LinkState, q: Vector
) -> None:
    """The link's frame; the axes of a joint that is walked backward."""
    rotation, place = _element(on, joint, link, q)
    around, down = product(parent.turn, link.rotation), apply(parent.turn, link.place)
    turn = product(around, transposed(rotation) if joint.backward else rotation)
    state.turn = [*turn[:2], [0.0, 0.0, 1.0]] if tree.planar else turn  # said once more, to be known while staging
    if joint.backward:
        back = scale(-1.0, apply(turn, place))
        down = add(down, back)
        axes = [shift(scale(-1.0, turned(around, column)), back) for column in joint.basis]
        state.axes = [*axes, *state.axes[joint.dim :]]
    else:
        down = add(down, apply(around, place))
    state.down, state.at = down, add(parent.at, down)


def _element(on: Evaluator, joint: JointKind, link: LinkConstants, q: Vector) -> tuple[Rows, list[Real]]:
    """The frame of the joint's element as it is stored, or, of abelian pairs, as it is walked."""
    element = scale(link.sense, [q[link.q_at + k] for k in range(joint.size)])
    if joint.revolute:
        return about_z(on, element[0] + link.shift), [0.0, 0.0, 0.0]
    return included(on, joint.code, joint.basis, element)


def spread(on: Evaluator, tree: Tree, x: Vector) -> None:
    """The twists that rates x of the joints make, to where links keep their accelerations."""

    def each_link(i: Integer) -> None:
        def through(joint: JointKind, link: LinkConstants) -> None:
            state = tree.states[i]
            change = shift(tree.states[link.parent].change, state.down)
            rates = [x[link.r_at + j] for j in range(joint.dim)]
            state.change = add(change, moved_by(joint, link, state, rates)) if joint.dim else change

        tree.visit(on, i, through)

    tree.each(on, each_link)


def axes(on: Evaluator, tree: Tree, columns: Matrix) -> None:
    """The twists (n, 6) about the ground's origin that units of the joints' rates make."""

    def each_link(i: Integer) -> None:
        def through(joint: JointKind, link: LinkConstants) -> None:
            state = tree.states[i]
            back = scale(-1.0, state.at)
            for j, axis in enumerate(axes_of(joint, link, state)):
                for k, x in enumerate(shift(axis, back)):
                    columns[link.r_at + j, k] = x

        tree.visit(on, i, through)

    tree.each(on, each_link)


def energy(on: Evaluator, tree: Tree, q: Vector, r: Vector, momenta: Matrix, spin: Vector, out: Vector) -> None:
    """Write kinetic energy, potential energy and the sum of its terms' sizes in J to ``out``.

    Heights count from the origin of the ground's frame; what they are rounded by is a part of the lengths on the way
    from there, which the sizes count. Momenta I u (links, 6) go to ``momenta``, those of rates that have inertia of
    their own to ``spin`` (degrees of freedom,). The memory is that of `outward`; what `inward` found of joints stays.
    """
    outward(on, tree, q, r)
    pull = _length(on, tree.gravity)
    out[0], out[1], out[2] = 0.0, 0.0, 0.0

    def each_link(i: Integer) -> None:
        def through(joint: JointKind, link: LinkConstants) -> None:
            state, parent = tree.states[i], tree.states[link.parent]
            reach = parent.reach + _length(on, state.down)
            state.reach = reach
            own = Inertia.of(link, state.turn)
            carried = own.momentum(state.twist)
            for k, x in enumerate(carried):
                momenta[i, k] = x
            out[0] = out[0] + 0.5 * dot(state.twist, carried)
            if joint.armature:
                rate = r[link.r_at]
                spin[link.r_at] = link.armature * rate
                out[0] = out[0] + 0.5 * (link.armature * rate) * rate
            out[1] = out[1] - dot(tree.gravity, add(scale(own.mass, state.at), own.moment))
            out[2] = out[2] + pull * (link.mass * reach + _length(on, link.moment))

        tree.visit(on, i, through)

    tree.each(on, each_link)


def _length(on: Evaluator, x: Entries) -> Real:
    """The sum of the sizes of a vector's entries, which is no less than its length."""
    return on.absolute(x[0]) + on.absolute(x[1]) + on.absolute(x[2])
