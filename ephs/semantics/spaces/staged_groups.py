"""The groups by their codes, over numbers of any kind; the code is known while a program is staged."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, TypeAlias, final

from ephs.semantics.spaces import codes, se2, se3, so3
from ephs.semantics.spaces.vectors import Entries, Rows, add, combine, scale, sub
from ephs.semantics.stage import Evaluator, Real

Step: TypeAlias = Callable[[Evaluator, Entries, Entries], list[Real]]
Differential: TypeAlias = Callable[[Evaluator, Entries], Rows]


@final
@dataclass(frozen=True, slots=True)
class StagedGroup:
    """Operations of a group that steps and charts use.

    Attributes
    ----------
    retract
        x·exp(v) of an element (size,) and an increment (dim,).
    increment
        log(a⁻¹·b) of two elements.
    dexp
        Right-trivialised differential of exp, (dim, dim); the left-trivialised one is that of −v.
    dexp_inv
        Its inverse.
    abelian
        Elements are vectors, and all the differentials are identities.
    """

    retract: Step
    increment: Step
    dexp: Differential
    dexp_inv: Differential
    abelian: bool = False

    def dexp_left_inv(self, on: Evaluator, v: Entries) -> Rows:
        """The change of log(x₀⁻¹x) = v that a left-trivialised change of x makes."""
        return self.dexp_inv(on, scale(-1.0, v))


def _identity(on: Evaluator, v: Entries) -> Rows:
    return [[float(i == j) for j in range(len(v))] for i in range(len(v))]


def _beside(block: Differential) -> Differential:
    def whole(on: Evaluator, v: Entries) -> Rows:
        turning = [[*row, 0.0, 0.0, 0.0] for row in block(on, v[:3])]
        return turning + [[float(i == j) for j in range(6)] for i in range(3, 6)]

    return whole


STAGED: Final[Mapping[int, StagedGroup]] = MappingProxyType(
    {
        codes.VECTOR: StagedGroup(
            lambda on, a, v: add(a, v), lambda on, a, b: sub(b, a), _identity, _identity, abelian=True
        ),
        codes.SO3: StagedGroup(
            lambda on, a, v: so3.multiply(on, a, so3.exp(on, v)), so3.difference, so3.dexp, so3.dexp_inv
        ),
        codes.SE2: StagedGroup(se2.retract, se2.increment, se2.dexp, se2.dexp_inv),
        codes.SE3: StagedGroup(se3.retract, se3.increment, se3.dexp, se3.dexp_inv),
        codes.SO3xR3: StagedGroup(
            lambda on, a, v: [*so3.multiply(on, a[:4], so3.exp(on, v[:3])), *add(a[4:], v[3:])],
            lambda on, a, b: [*so3.difference(on, a[:4], b[:4]), *sub(b[4:], a[4:])],
            _beside(so3.dexp),
            _beside(so3.dexp_inv),
        ),
    }
)


def included(on: Evaluator, code: int, basis: Sequence[Sequence[float]], x: Entries) -> tuple[Rows, list[Real]]:
    """The frame (R, p) of a pair's element x: the second joint frame in the first.

    ``basis`` has the columns of B. Abelian pairs turn about one axis and slide; about z a sine and a cosine are enough,
    other axes take the exponential map.
    """
    if code == codes.SO3:
        return so3.matrix(x), [0.0, 0.0, 0.0]
    if code == codes.SE3:
        return so3.matrix(x[:4]), list(x[4:])
    if code == codes.SE2:
        return about_z(on, x[0]), [x[1], x[2], 0.0]
    used = [any(column[k] != 0.0 for column in basis) for k in range(6)]
    twist: list[Real] = combine(basis, x) if basis else [0.0] * 6
    if used[0] or used[1]:
        pose = se3.exp(on, twist)
        return so3.matrix(pose[:4]), pose[4:]
    if not used[2]:
        return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], twist[3:]
    if used[3] or used[4]:
        motion = se2.exp(on, twist[2:5])
        return about_z(on, twist[2]), [motion[1], motion[2], twist[5]]
    return about_z(on, twist[2]), [0.0, 0.0, twist[5]]


def about_z(on: Evaluator, angle: Real) -> Rows:
    """The rotation by an angle about z."""
    c, s = on.cos(angle), on.sin(angle)
    return [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
