"""Momenta of islands, groups of links that nothing holds in some directions, and the rigid motions that change them.

A rigid motion of an island is a twist of the ground's frame in the span of a basis N. It moves none of the joints
within the island, nor what acts in them, so that the momenta Nᵀ Σ Ad*_{x⁻¹} I u are kept (Noether). In the metric of
the mass matrix it is the least change of the rates that changes the momenta by as much: loops stay closed, and what is
left of the rates has no momenta.
"""

from collections.abc import Sequence
from typing import Final

from ephs.mechanics.tree.sweeps.joints import frame, rate_inside, rate_outside
from ephs.mechanics.tree.sweeps.outward import momentum
from ephs.mechanics.tree.sweeps.records import Joint, Link, Tree
from ephs.semantics.spaces.se3 import cobracket, twist_inward, wrench_outward
from ephs.semantics.spaces.vectors import (
    Entries,
    Rows,
    add,
    apply,
    apply_transposed,
    combine,
    cross,
    dot,
    product,
    scale,
    sub,
    symmetric,
    transposed,
)
from ephs.semantics.stage import Evaluator, Integer, Integers, Matrix, Real, Vector

SUMS: Final = 16
"""Numbers of an island: mass, first moments, inertia about the ground's origin (upper triangle), momentum."""
FLAT: Final = 1e-13
"""Pivot beside the largest entry of an inertia below which nothing turns or moves: rounding, times six."""


def rigid(
    on: Evaluator,
    tree: Tree,
    q: Vector,
    r: Vector,
    island: Integers,
    bases: Vector,
    target: Vector,
    sums: Matrix,
    momenta: Vector,
    torque: Vector,
    along: Sequence[int],
) -> None:
    """Change the rates by rigid motions of islands, so that their momenta are as ``target`` says.

    Of the memory, frames become those in the ground's frame, and twists those of r at q.

    Parameters
    ----------
    island
        (links,) number of a link's island, −1: held.
    bases
        (islands · 36,) rows of N, (6, 6) with columns of zeros, each island's.
    target
        (islands · 6,) momenta along N.
    sums
        (islands, SUMS) memory.
    momenta
        (islands · 6,) receives the momenta of the rates as they came.
    torque
        (islands · 6,) receives Nᵀ ad*_ξ I ξ, the forces at which an island turns by itself where it moves rigidly with
        the momenta wanted: minus the gradient of its energy by rigid motions with these momenta.
    along
        Entries of twists that are not known to be zero: N has no more columns than these.
    """
    ground = tree.states[tree.size]
    ground.rotation, ground.place = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [0.0] * 3
    ground.twist = [0.0] * 6

    def empty(k: Integer) -> None:
        for j in range(SUMS):
            sums[k, j] = 0.0

    def one(i: Integer) -> None:
        tree.visit(on, i, lambda joint, link: _add(on, tree, i, joint, link, q, r, island, sums))

    def each(k: Integer) -> None:
        _solve(on, k, bases, target, sums, momenta, torque, along)

    def turn(i: Integer) -> None:
        def through(joint: Joint, link: Link) -> None:
            def root() -> None:
                state, k = tree.states[i], island[i]
                twist = twist_inward(state.rotation, state.place, [sums[k, j] for j in range(6)])
                rho = [dot(column, twist) / dot(column, column) for column in joint.basis]
                for j, x in enumerate(rate_outside(on, joint, link, q, rho)):
                    r[link.r_at + j] = r[link.r_at + j] + x

            on.when(on.both(on.same(link.parent, tree.size), island[i] >= 0), root)

        tree.visit(on, i, through)

    on.loop(sums.rows, empty)
    tree.each(on, one)
    on.loop(sums.rows, each)
    tree.each(on, turn)


def _add(
    on: Evaluator, tree: Tree, i: Integer, joint: Joint, link: Link, q: Vector, r: Vector, island: Integers,
    sums: Matrix,
) -> None:  # fmt: skip
    """Place a link, and add it to its island."""
    state, parent = tree.states[i], tree.states[link.parent]
    rotation, place = frame(on, joint, link, q)
    rate = rate_inside(on, joint, link, q, [r[link.r_at + k] for k in range(joint.dim)])
    along = combine(joint.basis, rate) if joint.dim else [0.0] * 6
    twist = add(twist_inward(rotation, place, parent.twist), along)
    around = parent.rotation
    place = add(parent.place, apply(around, place))
    rotation = product(around, rotation)
    state.rotation, state.place, state.twist = rotation, place, twist

    def count() -> None:
        k, moment = island[i], apply(rotation, link.moment)
        first = add(scale(link.mass, place), moment)
        turning = product(product(rotation, symmetric(link.inertia)), transposed(rotation))
        # parallel axes: J + 2 (p·c) 1 − p cᵀ − c pᵀ + m (p·p 1 − p pᵀ), with the first moments c in the link's frame
        both = add(scale(link.mass, place), scale(2.0, moment))
        size = dot(place, both)
        inertia = [
            turning[a][b] + (size if a == b else 0.0) - 0.5 * (place[a] * both[b] + both[a] * place[b])
            for a in range(3)
            for b in range(a, 3)
        ]
        carried = wrench_outward(rotation, place, momentum(link, twist))
        for j, x in enumerate([link.mass, *first, *inertia, *carried]):
            sums[k, j] = sums[k, j] + x

    on.when(island[i] >= 0, count)


def _solve(
    on: Evaluator, k: Integer, bases: Vector, target: Vector, sums: Matrix, momenta: Vector, torque: Vector,
    along: Sequence[int],
) -> None:  # fmt: skip
    """Put the rigid twist that is missing into the first six of an island's sums; write its momenta and torque."""
    count = len(along)
    basis = [[bases[36 * k + (6 * a + b)] if a in along else 0.0 for b in range(count)] for a in range(6)]
    mass, first = sums[k, 0], [sums[k, j] for j in range(1, 4)]
    inertia = symmetric([sums[k, j] for j in range(4, 10)])

    def carried(u: Entries) -> list[Real]:
        turning, moving = u[:3], u[3:]
        angular = add(apply(inertia, turning), cross(first, moving))
        return [*angular, *sub(scale(mass, moving), cross(first, turning))]

    columns = transposed(basis)
    images = [carried(column) for column in columns]
    held = [[dot(columns[a], images[b]) for b in range(count)] for a in range(count)]
    found = apply_transposed(basis, [sums[k, 10 + j] for j in range(6)])
    wanted = [target[6 * k + j] for j in range(count)]
    factors = _factors(on, held)
    missing = apply(basis, _solved(factors, sub(wanted, found)))
    whole = apply(basis, _solved(factors, wanted))
    for j, x in enumerate(apply_transposed(basis, cobracket(whole, carried(whole)))):
        torque[6 * k + j] = x
    for j, x in enumerate(found):
        momenta[6 * k + j] = x
    for j, x in enumerate(missing):
        sums[k, j] = x


def _factors(on: Evaluator, matrix: Rows) -> tuple[Rows, list[Real]]:
    """L, with ones on its diagonal, and 1/D of L D Lᵀ; zeros where a direction has no inertia."""
    count, most = len(matrix), matrix[0][0]
    for j in range(1, count):
        most = on.maximum(most, matrix[j][j])
    lower: Rows = [[0.0] * count for _ in range(count)]
    inverse: list[Real] = []
    for j in range(count):
        scaled = [lower[j][k] * inverse[k] for k in range(j)]
        pivot = matrix[j][j] - dot(scaled, lower[j][:j]) if j else matrix[j][j]
        sound = pivot > FLAT * most
        inverse.append(on.select(sound, 1.0 / on.select(sound, pivot, 1.0), 0.0))
        for i in range(j + 1, count):
            lower[i][j] = matrix[i][j] - dot(scaled, lower[i][:j]) if j else matrix[i][j]
    return lower, inverse


def _solved(factors: tuple[Rows, list[Real]], right: Entries) -> list[Real]:
    """The solution, of least entries where a direction has no inertia."""
    lower, inverse = factors
    x, count = list(right), len(inverse)
    for i in range(count):
        for j in range(i):
            x[i] = x[i] - lower[i][j] * (inverse[j] * x[j])
    x = [inverse[i] * x[i] for i in range(count)]
    for i in range(count - 1, -1, -1):
        for j in range(i + 1, count):
            x[i] = x[i] - inverse[i] * (lower[j][i] * x[j])
    return x
