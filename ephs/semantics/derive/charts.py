"""States on groups as plain numbers: a point moved by an increment, at the middle, and over the whole step.

Over a step each number of a point is a `Slope`: of a position the step turns by the mean of the rotation, of a
quaternion by the one at the middle, so that nothing cancels and the ends may be exchanged.
"""

from collections.abc import Sequence

from ephs.semantics.derive.errors import DeriveError
from ephs.semantics.derive.functions import polynomial, root_cosine, root_sine
from ephs.semantics.derive.slopes import Slope
from ephs.semantics.spaces import codes
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.numbers import Real

__all__ = ["moved", "over"]

Numbers = Sequence[Real]
Rows = list[list[Real]]


def moved(on: Evaluator, code: int, x: Numbers, v: Numbers) -> list[Real]:
    """x·exp(v), (size,)."""
    if code == codes.VECTOR:
        return [a + b for a, b in zip(x, v, strict=True)]
    if code == codes.SE2:
        return [x[0] + v[0], *_shifted(x[1:], _planar(on, x[0], v[0]), v[1:])]
    quaternion = _turned(on, x[:4], v[:3], 1.0)
    if code == codes.SO3:
        return quaternion
    if code == codes.SO3xR3:
        return [*quaternion, *(a + b for a, b in zip(x[4:], v[3:], strict=True))]
    if code == codes.SE3:
        return [*quaternion, *_shifted(x[4:], _mean_rotation(on, x[:4], v[:3]), v[3:])]
    raise DeriveError("coordinates", code=code, expected="those of `ephs.semantics.spaces.codes`")


def over(on: Evaluator, code: int, x: Numbers, v: Numbers, first: int) -> list[Real]:
    """The numbers of a point over the step v, (size,), with the increments numbered from `first`."""
    if code == codes.VECTOR:
        return [Slope(a, a + b, {first + i: 1.0}) for i, (a, b) in enumerate(zip(x, v, strict=True))]
    if code == codes.SE2:
        angle = Slope(x[0], x[0] + v[0], {first: 1.0})
        return [angle, *_along(x[1:], _planar(on, x[0], v[0]), v[1:], first + 1)]
    turn = _along_rotation(on, x[:4], v[:3], first)
    if code == codes.SO3:
        return turn
    if code == codes.SO3xR3:
        return [*turn, *over(on, codes.VECTOR, x[4:], v[3:], first + 3)]
    if code == codes.SE3:
        return [*turn, *_along(x[4:], _mean_rotation(on, x[:4], v[:3]), v[3:], first + 3)]
    raise DeriveError("coordinates", code=code, expected="those of `ephs.semantics.spaces.codes`")


def _shifted(x: Numbers, rows: Rows, v: Numbers) -> list[Real]:
    return [a + _dot(row, v) for a, row in zip(x, rows, strict=True)]


def _along(x: Numbers, rows: Rows, v: Numbers, first: int) -> list[Real]:
    return [
        Slope(a, a + _dot(row, v), {first + j: s for j, s in enumerate(row)}) for a, row in zip(x, rows, strict=True)
    ]


def _dot(a: Numbers, b: Numbers) -> Real:
    total: Real = 0.0
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total


def _square(v: Numbers) -> Real:
    return _dot(v, v)


def product(a: Numbers, b: Numbers) -> list[Real]:
    """The product of two quaternions, scalar first."""
    return [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]


def _turned(on: Evaluator, x: Numbers, v: Numbers, share: float) -> list[Real]:
    """The quaternion x·exp(share·v)."""
    half = 0.5 * share
    square = half * half * _square(v)
    sine = half * root_sine(on, square)
    return product(x, [root_cosine(on, square), *(sine * each for each in v)])


def _along_rotation(on: Evaluator, x: Numbers, v: Numbers, first: int) -> list[Real]:
    """x¹ − x⁰ = xᵐ (0, 2 sin(θ/4) v/θ) with the quaternion xᵐ at the middle."""
    middle, end = _turned(on, x, v, 0.5), _turned(on, x, v, 1.0)
    chord = 0.5 * root_sine(on, 0.0625 * _square(v))
    columns = [product(middle, [0.0, *(chord if i == j else 0.0 for j in range(3))]) for i in range(3)]
    return [Slope(x[k], end[k], {first + i: columns[i][k] for i in range(3)}) for k in range(4)]


def _planar(on: Evaluator, angle: Real, turn: Real) -> Rows:
    """The mean of R(φ) over the step: R at the middle times sin(v/2)/(v/2)."""
    half = 0.5 * turn
    sine = root_sine(on, half * half)
    c, s = sine * on.cos(angle + half), sine * on.sin(angle + half)
    return [[c, -s], [s, c]]


def _mean_rotation(on: Evaluator, x: Numbers, v: Numbers) -> Rows:
    """R⁰ V(v) = R⁰ (1 + β ṽ + γ ṽ²)."""
    square = _square(v)
    sine = root_sine(on, 0.25 * square)
    beta, gamma = 0.5 * sine * sine, _gamma(on, square)
    skew: Rows = [[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]]
    twice = _multiply(skew, skew)
    mean = [[(1.0 if i == j else 0.0) + beta * skew[i][j] + gamma * twice[i][j] for j in range(3)] for i in range(3)]
    return _multiply(rotation(x), mean)


_GAMMA = (1 / 6, -1 / 120, 1 / 5040, -1 / 362880, 1 / 39916800, -1 / 6227020800, 1 / 1307674368000)


def _gamma(on: Evaluator, square: Real) -> Real:
    """(θ − sin θ)/θ³ of θ²."""
    near = square < 0.5
    away = on.select(near, 1.0, square)
    return on.select(near, polynomial(_GAMMA, square), (1.0 - root_sine(on, away)) / away)


def _multiply(a: Rows, b: Rows) -> Rows:
    return [[a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j] for j in range(3)] for i in range(3)]


def rotation(q: Numbers) -> Rows:
    """The rotation matrix of a unit quaternion."""
    w, x, y, z = q
    return [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
