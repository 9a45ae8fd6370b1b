"""Momenta of islands, groups of links that nothing holds in some directions, and the rigid motions that change them.

A rigid motion of an island is a twist of the ground's frame in the span of a basis N. It moves none of the joints
within the island, nor what acts in them, so that the momenta Nᵀ Σ Ad*_{x⁻¹} I u are kept (Noether). In the metric of
the mass matrix it is the least change of the rates that changes the momenta by as much: loops stay closed, and what is
left of the rates has no momenta.
"""

from collections.abc import Sequence
from typing import Final

from ephs.mechanics.road.records import JointKind, LinkConstants, LinkState, Tree
from ephs.mechanics.road.tree import Inertia, outward, rates_of, shift, shift_back
from ephs.semantics.spaces.se3 import cobracket
from ephs.semantics.spaces.vectors import (
    Entries,
    Rows,
    apply,
    apply_transposed,
    dot,
    sub,
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

    The memory is that of `outward`; what `inward` found of joints stays.

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
    outward(on, tree, q, r)

    def empty(k: Integer) -> None:
        for j in range(SUMS):
            sums[k, j] = 0.0

    def each_link(i: Integer) -> None:
        tree.visit(on, i, lambda joint, link: _add(on, tree.states[i], link, island[i], sums))

    def each(k: Integer) -> None:
        _solve(on, k, bases, target, sums, momenta, torque, along)

    def turn(i: Integer) -> None:
        def through(joint: JointKind, link: LinkConstants) -> None:
            def root() -> None:
                state, k = tree.states[i], island[i]
                twist = shift([sums[k, j] for j in range(6)], state.at)
                for j, x in enumerate(rates_of(joint, link, state, tree.states[tree.size], twist)):
                    r[link.r_at + j] = r[link.r_at + j] + x

            on.when(on.both(on.same(link.parent, tree.size), island[i] >= 0), root)

        tree.visit(on, i, through)

    on.loop(sums.rows, empty)
    tree.each(on, each_link)
    on.loop(sums.rows, each)
    tree.each(on, turn)


def _add(on: Evaluator, state: LinkState, link: LinkConstants, k: Integer, sums: Matrix) -> None:
    """Add a link to its island, number k."""

    def count() -> None:
        own = Inertia.of(link, state.turn)
        carried = shift_back(own.momentum(state.twist), state.at)
        for j, x in enumerate([*own.about(state.at).numbers, *carried]):
            sums[k, j] = sums[k, j] + x

    on.when(k >= 0, count)


def _solve(
    on: Evaluator, k: Integer, bases: Vector, target: Vector, sums: Matrix, momenta: Vector, torque: Vector,
    along: Sequence[int],
) -> None:  # fmt: skip
    """Put the rigid twist that is missing into the first six of an island's sums; write its momenta and torque."""
    count = len(along)
    basis = [[bases[36 * k + (6 * a + b)] if a in along else 0.0 for b in range(count)] for a in range(6)]
    whole = Inertia(sums[k, 0], [sums[k, j] for j in range(1, 4)], [sums[k, j] for j in range(4, 10)])
    columns = transposed(basis)
    images = [whole.momentum(column) for column in columns]
    held = [[dot(columns[a], images[b]) for b in range(count)] for a in range(count)]
    found = apply_transposed(basis, [sums[k, 10 + j] for j in range(6)])
    wanted = [target[6 * k + j] for j in range(count)]
    factors = _factors(on, held)
    missing = apply(basis, _solved(factors, sub(wanted, found)))
    moving = apply(basis, _solved(factors, wanted))
    for j, x in enumerate(apply_transposed(basis, cobracket(moving, whole.momentum(moving)))):
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
