"""States on groups as plain numbers: a point moved by an increment, at the middle, and over the whole step.

Over a step each number of a point is a `Slope`: of a position the step turns by the mean of the rotation, of a
quaternion by the one at the middle, so that nothing cancels and the ends may be exchanged.
"""

from ephs.semantics.derive.errors import DeriveError
from ephs.semantics.derive.slopes import Slope
from ephs.semantics.spaces import codes, se2, se3, so3
from ephs.semantics.spaces.series import alpha
from ephs.semantics.spaces.vectors import Entries, Rows, add, apply, cross, dot, product, scale
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.numbers import Real


def moved(on: Evaluator, code: int, x: Entries, v: Entries) -> list[Real]:
    """x·exp(v), (size,)."""
    if code == codes.VECTOR:
        return add(x, v)
    if code == codes.SE2:
        return se2.retract(on, x, v)
    if code == codes.SE3:
        return se3.retract(on, x, v)
    quaternion = so3.multiply(on, x[:4], so3.exp(on, v[:3]))
    if code in (codes.SO3, codes.SO3xR3):
        return [*quaternion, *add(x[4:], v[3:])]
    raise DeriveError("coordinates", code=code, expected="those of `ephs.semantics.spaces.codes`")


def over(on: Evaluator, code: int, x: Entries, v: Entries, first: int) -> list[Real]:
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


def _along(x: Entries, rows: Rows, v: Entries, first: int) -> list[Real]:
    """Numbers that the increments change by rows."""
    ends = add(x, apply(rows, v))
    slopes = [{first + j: slope for j, slope in enumerate(row)} for row in rows]
    return [Slope(*each) for each in zip(x, ends, slopes, strict=True)]


def _along_rotation(on: Evaluator, x: Entries, v: Entries, first: int) -> list[Real]:
    """x¹ − x⁰ = xᵐ (0, 2 sin(θ/4) v/θ) with the quaternion xᵐ at the middle."""
    middle = so3.multiply(on, x, so3.exp(on, scale(0.5, v)))
    chord = 0.5 * alpha(on, 0.0625 * dot(v, v))
    units = [[chord if i == j else 0.0 for j in range(3)] for i in range(3)]
    columns = [[-dot(middle[1:], u), *add(scale(middle[0], u), cross(middle[1:], u))] for u in units]
    end = so3.multiply(on, x, so3.exp(on, v))
    return [Slope(x[k], end[k], {first + i: columns[i][k] for i in range(3)}) for k in range(4)]


def _planar(on: Evaluator, angle: Real, turn: Real) -> Rows:
    """The mean of R(φ) over the step: R at the middle times sin(v/2)/(v/2)."""
    half = 0.5 * turn
    sine = alpha(on, half * half)
    c, s = sine * on.cos(angle + half), sine * on.sin(angle + half)
    return [[c, -s], [s, c]]


def _mean_rotation(on: Evaluator, x: Entries, v: Entries) -> Rows:
    """R⁰ V(v)."""
    return product(so3.matrix(x), so3.dexp(on, v))
