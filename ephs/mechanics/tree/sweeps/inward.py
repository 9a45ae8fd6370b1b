"""The inward sweep: articulated inertias and loads, each joint's degrees of freedom eliminated on the way to the
ground.

With the articulated inertia I of a link, its load P and its acceleration δa beyond the bias, the wrench that its parent
exerts is I δa + P. The joint's rates are free under the forces τ: with U = I S and D = Sᵀ U, the parent sees the link
as I − U D⁻¹ Uᵀ and P + U D⁻¹ (τ − SᵀP). Featherstone, *Rigid Body Dynamics Algorithms*, chapter 7, gives the recursion.
"""

from collections.abc import Callable

from ephs.mechanics.tree.sweeps.joints import force_inside
from ephs.mechanics.tree.sweeps.records import Joint, Link, State, Tree
from ephs.semantics.spaces.se3 import wrench_outward
from ephs.semantics.spaces.vectors import (
    Columns,
    Entries,
    Rows,
    add,
    apply,
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


def inward(on: Evaluator, tree: Tree, i: Integer, fault: Variable[Integer]) -> None:
    """Eliminate the joint of link i from its articulated inertia, which its parent takes up.

    ``fault`` becomes 1 + i where a degree of freedom of the joint moves no mass, unless it tells of another link
    already.
    """

    def one(joint: Joint, link: Link) -> None:
        state = tree.states[i]
        inertia = _blocks(state)
        if joint.dim and not joint.driven:
            inertia, sound = _eliminated(on, joint, link, state, inertia)
            fault.value = on.select(on.either(sound, fault.value > 0), fault.value, i + 1)
        on.when(link.parent < tree.size, lambda: _take_up(tree.states[link.parent], state, inertia))

    tree.visit(on, i, one)


def _blocks(state: State) -> Rows:
    """The articulated inertia, (6, 6)."""
    angular, mixed, linear = symmetric(state.angular), state.mixed, symmetric(state.linear)
    return [
        *[[*a, *c] for a, c in zip(angular, mixed, strict=True)],
        *[[*c, *m] for c, m in zip(transposed(mixed), linear, strict=True)],
    ]


def _eliminated(on: Evaluator, joint: Joint, link: Link, state: State, inertia: Rows) -> tuple[Rows, Truth]:
    """I − U D⁻¹ Uᵀ, and whether D is positive definite; rows of freedoms that are entries of a twist are zero."""
    force = [apply(inertia, column) for column in joint.basis]
    own = [link.armature if joint.armature else 0.0] * joint.dim
    met = [
        [dot(column, f) + float(i == j) * own[i] for j, f in enumerate(force)] for i, column in enumerate(joint.basis)
    ]
    inverse, sound = symmetric_inverse(on, met)
    units = joint.units
    gain = [
        [float(units[k] == j) if k in units else value for k, value in enumerate(row)]
        for j, row in enumerate(product(inverse, force))
    ]
    state.inverse = [*upper(inverse), *state.inverse[joint.dim * (joint.dim + 1) // 2 :]]
    state.gain = [*gain, *state.gain[joint.dim :]]
    left: Rows = [[0.0] * 6 for _ in range(6)]
    for a in range(6):
        for b in range(a, 6):
            if a not in units and b not in units:
                left[a][b] = left[b][a] = inertia[a][b] - dot([u[a] for u in force], [g[b] for g in gain])
    return left, sound


def _take_up(parent: State, state: State, inertia: Rows) -> None:
    """Add an inertia of a link to its parent's, seen from there.

    With the link's frame (R, p) and N = R M Rᵀ, E = R C Rᵀ + p̂ N, the parent's blocks grow by
    R A Rᵀ + p̂ (R C Rᵀ)ᵀ − E p̂, E and N.
    """
    turn, p = state.rotation, state.place
    angular, mixed, linear = ([row[b : b + 3] for row in inertia[a : a + 3]] for a, b in ((0, 0), (0, 3), (3, 3)))
    linear = symmetric(_congruent(turn, linear))
    mixed = product(product(turn, mixed), transposed(turn))
    lifted = transposed([add(c, cross(p, n)) for c, n in zip(transposed(mixed), linear, strict=True)])
    beside = [cross(p, row) for row in mixed]  # columns of p̂ (R C Rᵀ)ᵀ
    behind = [cross(p, row) for row in lifted]  # rows of −E p̂
    both = [beside[j][i] + behind[i][j] for i in range(3) for j in range(i, 3)]
    parent.angular = add(parent.angular, add(_congruent(turn, angular), both))
    parent.mixed = [add(x, y) for x, y in zip(parent.mixed, lifted, strict=True)]
    parent.linear = add(parent.linear, upper(linear))


def _congruent(turn: Columns, matrix: Columns) -> list[Real]:
    """The upper triangle of R M Rᵀ of a symmetric matrix."""
    half = product(turn, matrix)
    return [dot(half[i], turn[j]) for i in range(3) for j in range(i, 3)]


def load_inward(
    on: Evaluator, tree: Tree, q: Vector, force: Callable[[Integer, Joint, Link], list[Real]], i: Integer
) -> None:
    """Eliminate the joint of link i from its load, which its parent takes up; force(i, joint, link) is on its rates."""

    def one(joint: Joint, link: Link) -> None:
        state = tree.states[i]
        load: Entries = state.load
        if joint.dim and not joint.driven:
            tau = force_inside(on, joint, link, q, force(i, joint, link))
            free = [t - dot(column, load) for t, column in zip(tau, joint.basis, strict=True)]
            inverse = symmetric(state.inverse[: joint.dim * (joint.dim + 1) // 2])
            state.push = [*apply(inverse, free), *state.push[joint.dim :]]
            units, gains = joint.units, combine(state.gain[: joint.dim], free)
            load = [tau[units[k]] if k in units else p + g for k, (p, g) in enumerate(zip(load, gains, strict=True))]

        def take_up() -> None:
            parent = tree.states[link.parent]
            parent.load = add(parent.load, wrench_outward(state.rotation, state.place, load))

        on.when(link.parent < tree.size, take_up)

    tree.visit(on, i, one)
