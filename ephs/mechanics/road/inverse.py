"""Inverse dynamics: generalised forces of accelerations, and its linear parts.

The same gathering of loads gives the forces that accelerations need, columns of the mass matrix (the accelerations are
units, all else is zero), and covectors on links as rows on the rates.
"""

from collections.abc import Callable, Sequence
from typing import TypeAlias

from ephs.mechanics.road.records import JointKind, LinkConstants, Tree
from ephs.mechanics.road.tree import Inertia, axes_of, moved_by, shift_back, spread
from ephs.semantics.spaces.se3 import bracket
from ephs.semantics.spaces.vectors import add, dot, sub
from ephs.semantics.stage import Evaluator, Integer, Matrix, Real, Vector

Take: TypeAlias = Callable[[Integer, JointKind, LinkConstants, list[Real], list[Real]], None]
"""Called with a link's number, joint and constants, the load on it, and the force that this is on the joint's rates."""


def gather(on: Evaluator, tree: Tree, take: Take) -> None:
    """Carry the links' loads inwards, and let ``take`` see what each joint bears."""

    def each_link(i: Integer) -> None:
        def through(joint: JointKind, link: LinkConstants) -> None:
            state = tree.states[i]
            load = state.load
            force = [dot(axis, load) for axis in axes_of(joint, link, state)]
            take(i, joint, link, load, force)

            def take_up() -> None:
                parent = tree.states[link.parent]
                parent.load = add(parent.load, shift_back(load, state.down))

            on.when(link.parent < tree.size, take_up)

        tree.visit(on, i, through)

    tree.each(on, each_link, down=True)


def _accelerated(on: Evaluator, tree: Tree, *, alone: bool) -> None:
    """Add I δa of all links to their loads; alone: in place of them."""

    def each_link(i: Integer) -> None:
        def through(joint: JointKind, link: LinkConstants) -> None:
            state = tree.states[i]
            inertial = Inertia.of(link, state.turn).momentum(state.change)
            state.load = inertial if alone else add(state.load, inertial)

        tree.visit(on, i, through)

    tree.each(on, each_link)


def needed_forces(on: Evaluator, tree: Tree, out: Vector) -> None:
    """Add the forces on the rates (n,) that the links need, where `outward` and `spread` have been.

    Wrenches on links are taken off their loads before.
    """
    _accelerated(on, tree, alone=False)

    def take(i: Integer, joint: JointKind, link: LinkConstants, load: list[Real], force: list[Real]) -> None:
        for j, value in enumerate(force):
            out[link.r_at + j] = out[link.r_at + j] + value

    gather(on, tree, take)


def armatures(on: Evaluator, tree: Tree, rates: Vector, out: Vector) -> None:
    """Add the inertias that joints' rates have themselves, times rates (n,), to forces or momenta (n,)."""

    def each_link(i: Integer) -> None:
        def through(joint: JointKind, link: LinkConstants) -> None:
            if joint.armature:
                out[link.r_at] = out[link.r_at] + link.armature * rates[link.r_at]

        tree.visit(on, i, through)

    if any(joint.armature for joint in tree.joints):
        tree.each(on, each_link)


def weigh(on: Evaluator, tree: Tree) -> None:
    """Put the weights of links alone into their loads, where `outward` has been."""
    ground = tree.states[tree.size].bias[3:]

    def each_link(i: Integer) -> None:
        def through(joint: JointKind, link: LinkConstants) -> None:
            state = tree.states[i]
            state.load = Inertia.of(link, state.turn).momentum([0.0, 0.0, 0.0, *ground])

        tree.visit(on, i, through)

    tree.each(on, each_link)


def action(on: Evaluator, tree: Tree, r: Vector, p: Vector, g: Vector) -> None:
    """The momenta ∂L/∂r, and ∂L/∂q with other forces, left-trivialised, where loads are what acts, negated.

    A change δ of a joint's element moves its link by S δ, and with it all that is carried further out: δu = [u, S δ]
    for the link's twist u, without the joint's own part S r where S does not move with the joint.

    Parameters
    ----------
    g
        (n,): holds what acts on the rates, negated.
    """

    def take(i: Integer, joint: JointKind, link: LinkConstants, load: list[Real], force: list[Real]) -> None:
        for j, value in enumerate(force):
            g[link.r_at + j] = -(g[link.r_at + j] + value)

    gather(on, tree, take)

    def moving(i: Integer) -> None:
        def through(joint: JointKind, link: LinkConstants) -> None:
            state = tree.states[i]
            state.load = Inertia.of(link, state.turn).momentum(state.twist)

        tree.visit(on, i, through)

    tree.each(on, moving)

    def joint_action(i: Integer, joint: JointKind, link: LinkConstants, load: list[Real], force: list[Real]) -> None:
        state = tree.states[i]
        twist = state.twist
        if joint.dim and not joint.backward:
            twist = sub(twist, moved_by(joint, link, state, [r[link.r_at + k] for k in range(joint.dim)]))
        for j, (axis, value) in enumerate(zip(axes_of(joint, link, state), force, strict=True)):
            p[link.r_at + j] = value
            g[link.r_at + j] = g[link.r_at + j] + dot(load, bracket(twist, axis))

    gather(on, tree, joint_action)
    armatures(on, tree, r, p)


def masses(on: Evaluator, tree: Tree, unit: Vector, mass: Matrix) -> None:
    """The mass matrix (n, n), where `outward` has been; ``unit`` (n,) is memory."""

    def clear(k: Integer) -> None:
        unit[k] = 0.0

    def column(k: Integer) -> None:
        unit[k] = 1.0
        spread(on, tree, unit)
        unit[k] = 0.0
        _accelerated(on, tree, alone=True)

        def take(i: Integer, joint: JointKind, link: LinkConstants, load: list[Real], force: list[Real]) -> None:
            for j, value in enumerate(force):
                mass[k, link.r_at + j] = value

        gather(on, tree, take)
        unit[k] = 1.0
        armatures(on, tree, unit, mass.row(k))
        unit[k] = 0.0

    on.loop(unit.size, clear)
    on.loop(unit.size, column)


def row_of_covector(
    on: Evaluator, tree: Tree, link: Integer, seen: Sequence[int], covector: list[Real], row: Vector,
    count: Callable[[Integer, Real], None],
) -> None:  # fmt: skip
    """Add a covector on a link's twist to a row on the rates.

    Parameters
    ----------
    link
        −1: the ground, whose twist no rate changes.
    seen
        Entries of a twist that the mechanism's motion has.
    count
        Called with the place of each rate and what the row's entry there is at most.
    """

    def clear(i: Integer) -> None:
        tree.states[i].load = [0.0] * 6

    def load_link() -> None:
        tree.states[link].load = covector

    def take(i: Integer, joint: JointKind, at: LinkConstants, load: list[Real], force: list[Real]) -> None:
        size = on.sqrt(sum((load[k] * load[k] for k in seen), 0.0))
        for j, (column, value) in enumerate(zip(joint.basis, force, strict=True)):
            row[at.r_at + j] = row[at.r_at + j] + value
            count(at.r_at + j, size * sum(x * x for x in column) ** 0.5)

    on.loop(tree.size, clear)
    on.when(link >= 0, load_link)
    gather(on, tree, take)
