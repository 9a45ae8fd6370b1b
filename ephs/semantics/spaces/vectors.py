"""Vectors and small matrices of numbers of any kind: lists of three, lists of rows.

Every function is one formula over numbers that add and multiply: floats, arrays, dual numbers, symbols. Zeros and ones
that are known while a program is staged vanish from it, so that nothing here has variants for sparse arguments.
"""

from collections.abc import Sequence
from typing import TypeAlias

from ephs.semantics.stage import Evaluator, Real, Truth

Entries: TypeAlias = Sequence[Real]
Vector3: TypeAlias = list[Real]
Rows: TypeAlias = list[list[Real]]
Columns: TypeAlias = Sequence[Sequence[Real]]


def dot(a: Entries, b: Entries) -> Real:
    """Σ aᵢ bᵢ, in the order of the entries."""
    total: Real = 0.0
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total


def cross(a: Entries, b: Entries) -> Vector3:
    """a × b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def add(a: Entries, b: Entries) -> list[Real]:
    """a + b, entry by entry."""
    return [x + y for x, y in zip(a, b, strict=True)]


def sub(a: Entries, b: Entries) -> list[Real]:
    """a − b, entry by entry."""
    return [x - y for x, y in zip(a, b, strict=True)]


def scale(a: Real, b: Entries) -> list[Real]:
    """a b of a number and a vector."""
    return [a * x for x in b]


def combine(columns: Columns, weights: Entries) -> list[Real]:
    """Σ wⱼ cⱼ of columns (d, n) with weights (d,)."""
    return [dot(entries, weights) for entries in zip(*columns, strict=True)]


def apply(matrix: Columns, v: Entries) -> list[Real]:
    """M v of a matrix by rows."""
    return [dot(row, v) for row in matrix]


def apply_transposed(matrix: Columns, v: Entries) -> list[Real]:
    """Mᵀ v of a matrix by rows."""
    return combine(matrix, v)


def product(a: Columns, b: Columns) -> Rows:
    """A B."""
    columns = list(zip(*b, strict=True))
    return [[dot(row, column) for column in columns] for row in a]


def transposed(a: Columns) -> Rows:
    """Aᵀ."""
    return [list(column) for column in zip(*a, strict=True)]


def plus(a: Columns, b: Columns) -> Rows:
    """A + B."""
    return [add(x, y) for x, y in zip(a, b, strict=True)]


def hat(a: Entries) -> Rows:
    """The matrix of v ↦ a × v."""
    return [[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]]


def symmetric(entries: Entries) -> Rows:
    """The symmetric matrix of an upper triangle, row by row."""
    size = int((8 * len(entries) + 1) ** 0.5) // 2
    at = {(i, j): k for k, (i, j) in enumerate((i, j) for i in range(size) for j in range(i, size))}
    return [[entries[at[min(i, j), max(i, j)]] for j in range(size)] for i in range(size)]


def upper(matrix: Columns) -> list[Real]:
    """The upper triangle of a square matrix, row by row."""
    return [matrix[i][j] for i in range(len(matrix)) for j in range(i, len(matrix))]


def symmetric_inverse(on: Evaluator, matrix: Columns) -> tuple[Rows, Truth]:
    """The inverse of a symmetric matrix, and whether the matrix is positive definite.

    Up to three rows by their minors, larger ones by halves: with the leading half A, the other one D and B between
    them, the inverse has the block of the Schur complement D − BᵀA⁻¹B. Where the matrix is not positive definite the
    inverse means nothing.
    """
    size = len(matrix)
    if size > 3:
        return _by_halves(on, matrix, size // 2)
    cofactors = _cofactors(matrix)
    determinant = dot(matrix[0], cofactors[0])
    sound = determinant > 0.0
    for minor in [matrix[0][0], matrix[0][0] * matrix[1][1] - matrix[0][1] * matrix[1][0] if size > 2 else 1.0][
        : size - 1
    ]:
        sound = on.both(sound, minor > 0.0)
    inverse = 1.0 / on.select(sound, determinant, 1.0)
    return [scale(inverse, row) for row in cofactors], sound


def _cofactors(m: Columns) -> Rows:
    match len(m):
        case 1:
            return [[1.0]]
        case 2:
            return [[m[1][1], -m[0][1]], [-m[0][1], m[0][0]]]
        case _:
            a, b, c, d, e, f = upper(m)
            k0, k1, k2 = d * f - e * e, c * e - b * f, b * e - c * d
            return symmetric([k0, k1, k2, a * f - c * c, b * c - a * e, a * d - b * b])


def _by_halves(on: Evaluator, m: Columns, half: int) -> tuple[Rows, Truth]:
    size = len(m)
    lead, sound = symmetric_inverse(on, [row[:half] for row in m[:half]])
    beside = [row[half:] for row in m[:half]]  # B
    carried = product(lead, beside)  # A⁻¹B
    rest = [[m[half + i][half + j] for j in range(size - half)] for i in range(size - half)]
    for i in range(size - half):
        for j in range(i, size - half):
            rest[i][j] = rest[i][j] - dot([row[i] for row in beside], [row[j] for row in carried])
            rest[j][i] = rest[i][j]
    low, also = symmetric_inverse(on, rest)
    corner = product(carried, low)  # A⁻¹B S⁻¹
    out = [
        [*[lead[i][j] + dot(corner[i], carried[j]) for j in range(half)], *[-x for x in corner[i]]] for i in range(half)
    ]
    out += [[*[-corner[j][i] for j in range(half)], *low[i]] for i in range(size - half)]
    return symmetric(upper(out)), on.both(sound, also)
