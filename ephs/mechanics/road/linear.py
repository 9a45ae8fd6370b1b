"""The linear system of a tree: articulated inertias and loads inwards, rates of joints and accelerations outwards.

With the articulated inertia I of a link, its load P and its acceleration δa beyond the bias, the wrench that its parent
exerts is I δa + P. The joint's rates are free under the forces τ: with U = I S and D = Sᵀ U, the parent sees the link
as I − U D⁻¹ Uᵀ and P + U D⁻¹ (τ − SᵀP). Featherstone, *Rigid Body Dynamics Algorithms*, chapter 7, gives the recursion.
"""

from collections.abc import Callable
from typing import TypeAlias

from ephs.mechanics.road.records import JointKind, LinkConstants, LinkState, Tree
from ephs.mechanics.road.rows import MULTIPLIER, LoopRows
from ephs.mechanics.road.tree import (
    forces_along,
    freedoms_of,
    moved_by,
    outward,
    rates_along,
    shift,
    shift_back,
)
from ephs.semantics.spaces import vectors
from ephs.semantics.spaces.vectors import (
    Entries,
    add,
    apply,
    apply_transposed,
    combine,
    cross,
    dot,
    product,
    symmetric,
    symmetric_inverse,
    transposed,
    upper,
)
from ephs.semantics.stage import Evaluator, Integer, Real, Truth, Variable, Vector

Force: TypeAlias = Callable[[Integer, JointKind, LinkConstants], list[Real]]
"""The forces (d,) on the rates of a link's joint: called with the link's number, its joint and its constants."""


def no_force(i: Integer, joint: JointKind, link: LinkConstants) -> list[Real]:
    """Nothing acts in the joints."""
    return [0.0] * joint.dim


def inward(on: Evaluator, tree: Tree, i: Integer, fault: Variable[Integer]) -> None:
    """Eliminate the joint of link i from its articulated inertia, which its parent takes up.

    ``fault`` becomes 1 + i where a degree of freedom of the joint moves no mass, unless it tells of another link
    already.
    """

    def at_joint(joint: JointKind, link: LinkConstants) -> None:
        state = tree.states[i]
        inertia = _blocks(state)
        if joint.dim and not joint.driven:
            inertia, sound = _eliminated(on, tree, joint, link, state, inertia)
            fault.value = on.select(on.either(sound, fault.value > 0), fault.value, i + 1)
        on.when(link.parent < tree.size, lambda: _take_up(tree.states[link.parent], state, inertia))

    tree.visit(on, i, at_joint)


def _blocks(state: LinkState) -> vectors.Rows:
    """The articulated inertia, (6, 6)."""
    angular, mixed, linear = symmetric(state.angular), state.mixed, symmetric(state.linear)
    return [
        *[[*a, *c] for a, c in zip(angular, mixed, strict=True)],
        *[[*c, *m] for c, m in zip(transposed(mixed), linear, strict=True)],
    ]


def _eliminated(
    on: Evaluator, tree: Tree, joint: JointKind, link: LinkConstants, state: LinkState, inertia: vectors.Rows
) -> tuple[vectors.Rows, Truth]:
    """I − U D⁻¹ Uᵀ, and whether D is positive definite; rows of freedoms that are entries of a twist are zero."""
    axes = freedoms_of(joint, link, state)
    force = [apply(inertia, axis) for axis in axes]
    own = [link.armature if joint.armature else 0.0] * joint.dim
    met = [[dot(axis, f) + float(i == j) * own[i] for j, f in enumerate(force)] for i, axis in enumerate(axes)]
    inverse, sound = symmetric_inverse(on, met)
    units = tree.units(joint)
    gain = [
        [(axes[j][k] if units[k] == j else 0.0) if k in units else value for k, value in enumerate(row)]
        for j, row in enumerate(product(inverse, force))
    ]
    state.inverse = [*upper(inverse), *state.inverse[joint.dim * (joint.dim + 1) // 2 :]]
    state.gain = [*gain, *state.gain[joint.dim :]]
    left: vectors.Rows = [[0.0] * 6 for _ in range(6)]
    for a in range(6):
        for b in range(a, 6):
            if a not in units and b not in units:
                left[a][b] = left[b][a] = inertia[a][b] - dot([u[a] for u in force], [g[b] for g in gain])
    return left, sound


def _take_up(parent: LinkState, state: LinkState, inertia: vectors.Rows) -> None:
    """Add an inertia of a link to its parent's, about whose origin its blocks A, C and M are, with the way d to the
    link and E = C + d̂ M, A + d̂ Cᵀ − E d̂, E and M.
    """
    d = state.down
    angular, mixed, linear = ([row[b : b + 3] for row in inertia[a : a + 3]] for a, b in ((0, 0), (0, 3), (3, 3)))
    lifted = transposed([add(c, cross(d, n)) for c, n in zip(transposed(mixed), linear, strict=True)])
    beside = [cross(d, row) for row in mixed]  # columns of d̂ Cᵀ
    behind = [cross(d, row) for row in lifted]  # rows of −E d̂
    both = [angular[i][j] + (beside[j][i] + behind[i][j]) for i in range(3) for j in range(i, 3)]
    parent.angular = add(parent.angular, both)
    parent.mixed = [add(x, y) for x, y in zip(parent.mixed, lifted, strict=True)]
    parent.linear = add(parent.linear, upper(linear))


def load_inward(on: Evaluator, tree: Tree, force: Force, i: Integer) -> None:
    """Eliminate the joint of link i from its load, which its parent takes up; force(i, joint, link) is on its rates."""

    def at_joint(joint: JointKind, link: LinkConstants) -> None:
        state = tree.states[i]
        load: Entries = state.load
        if joint.dim and not joint.driven:
            axes, tau = freedoms_of(joint, link, state), forces_along(joint, link, state, force(i, joint, link))
            free = [t - dot(axis, load) for t, axis in zip(tau, axes, strict=True)]
            inverse = symmetric(state.inverse[: joint.dim * (joint.dim + 1) // 2])
            state.push = [*apply(inverse, free), *state.push[joint.dim :]]
            units, gains = tree.units(joint), combine(state.gain[: joint.dim], free)
            load = [
                axes[units[k]][k] * tau[units[k]] if k in units else p + g
                for k, (p, g) in enumerate(zip(load, gains, strict=True))
            ]

        def take_up() -> None:
            parent = tree.states[link.parent]
            parent.load = add(parent.load, shift_back(load, state.down))

        on.when(link.parent < tree.size, take_up)

    tree.visit(on, i, at_joint)


def accelerate_outward(on: Evaluator, tree: Tree, rate: Vector, i: Integer) -> None:
    """ṙ of link i's joint and the link's acceleration beyond its bias, where the parent's is known."""

    def at_joint(joint: JointKind, link: LinkConstants) -> None:
        state = tree.states[i]
        change = shift(tree.states[link.parent].change, state.down)
        rates: list[Real] = [0.0] * joint.dim
        if not joint.driven:
            gain, push = state.gain, state.push
            rates = rates_along(joint, link, state, [push[j] - dot(gain[j], change) for j in range(joint.dim)])
        state.change = add(change, moved_by(joint, link, state, rates)) if joint.dim else change
        for j, value in enumerate(rates):
            rate[link.r_at + j] = value

    tree.visit(on, i, at_joint)


def accelerations(on: Evaluator, tree: Tree, q: Vector, r: Vector, rate: Vector, force: Force = no_force) -> Integer:
    """ṙ at the elements q and rates r, into rate; 0, or 1 + a link whose joint moves no mass."""
    outward(on, tree, q, r)
    fault = on.counter(0)

    def gather(i: Integer) -> None:
        inward(on, tree, i, fault)
        load_inward(on, tree, force, i)

    tree.each(on, gather, down=True)
    tree.each(on, lambda i: accelerate_outward(on, tree, rate, i))
    return fault.value


def _needed(state: LinkState) -> list[Real]:
    """The wrench I δa + P on a link and what it carries."""
    turning, moving, mixed = state.change[:3], state.change[3:], state.mixed
    torque = add(apply(symmetric(state.angular), turning), apply(mixed, moving))
    force = add(apply_transposed(mixed, turning), apply(symmetric(state.linear), moving))
    return add(state.load, [*torque, *force])


def driven_power(on: Evaluator, tree: Tree, rows: LoopRows, r: Vector, force: Vector) -> Real:
    """The power of the joints whose motion is prescribed, beside that of the forces in them."""
    total = on.variable(0.0)

    def each_link(i: Integer) -> None:
        def through(joint: JointKind, link: LinkConstants) -> None:
            if not joint.driven:
                return
            state, rate = tree.states[i], [r[link.r_at + j] for j in range(joint.dim)]
            along = moved_by(joint, link, state, rate)
            own = dot([force[link.r_at + j] for j in range(joint.dim)], rate)
            total.value = total.value + (dot(along, _needed(state)) - own)

            def pulled(s: Integer) -> None:
                multiplier = rows.value[rows.slot[2 * s], MULTIPLIER]
                total.value = total.value - multiplier * dot(along, rows.at_slot(s))

            on.loop(rows.last(i), pulled, start=rows.ended(i))

        tree.visit(on, i, through)

    tree.each(on, each_link)
    return total.value
