"""The relation of a joint over a step: on the group of its pair, or between velocities in the middle of the step.

The derivatives are written out: those of the product of five exponentials by their logarithms are carried to its left
end. Matrices of SE(3) that are Ad, ad and differentials have the form [[D, 0], [B, D]], and are kept as (D, B).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias, final

from ephs.semantics.derive.arguments import Arguments
from ephs.semantics.derive.charts import moved
from ephs.semantics.derive.maps import Block, Maps
from ephs.semantics.spaces import se3, so3
from ephs.semantics.spaces.staged_groups import STAGED, included
from ephs.semantics.spaces.vectors import (
    Columns,
    Entries,
    Rows,
    add,
    apply,
    combine,
    dot,
    hat,
    plus,
    product,
    scale,
    sub,
    transposed,
)
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.numbers import Integer, Real, Truth

OK: Final = 0
TURN: Final = 1
HALF_TURN: Final = 9.8696
"""π², rounded down."""
LEAST: Final = 1e-280
"""Squares of efforts above which the relation is corrected along them."""
STEERING: Final = 1e-8
"""Squares of efforts times steps above which the correction has a slope: it is of third order, and its slope in slow
motions is rounding, which Newton's method does not need."""
Halves: TypeAlias = tuple[Rows, Rows]


@final
@dataclass(frozen=True, slots=True)
class Holonomic:
    """F(e) = 0 with C_h e = F(e), palindromic; ports p_j1, p_j2, p_r, reads q_r, six multipliers.

    Parameters
    ----------
    code, size
        Of the pair's group: how many numbers a point has.
    basis
        B, column by column.
    maps
        Of the efforts: the relation is that of T e and Tᵀ f.
    on_group
        Whether the joint stays closed over the step; else C e = 0 in its middle, and it drifts.
    """

    code: int
    size: int
    basis: tuple[tuple[float, ...], ...]
    maps: Maps | None = None
    on_group: bool = True

    @property
    def dimensions(self) -> tuple[int, int, int, int]:
        """Numbers of efforts, conditions, increments and state coordinates."""
        d = len(self.basis)
        return 12 + d if self.maps is None else self.maps.outside, 6, d, self.size

    @property
    def numbers(self) -> int:
        """Number of parameters."""
        return 0 if self.maps is None else self.maps.numbers

    def stage(self, on: Evaluator, a: Arguments, *, bare: bool) -> Integer:
        """Write flows, conditions and their derivatives by efforts, multipliers and increments, bare too."""
        n, _, d, size = self.dimensions
        maps = self.maps or Maps((Block(6, 6, "same"), Block(6, 6, "same"), *[Block(d, d, "same")] * (d > 0)))
        through = maps.rows([a.p[i] for i in range(self.numbers)])
        x, step, outer = [a.x0[i] for i in range(size)], [a.v[i] for i in range(d)], [a.e[i] for i in range(n)]
        h, force = a.scal[0], [a.lam[i] for i in range(6)]
        effort = maps.inward(through, outer)
        over = Passage.over_step(on, self.code, self.basis, x, step, h, effort[:6], effort[6:12], effort[12:])
        rate, whole, turned = over.rate, over.whole, over.turned
        residual, slopes, reads = (over.residual, over.slopes, over.reads) if self.on_group else (rate, whole, turned)

        # C_h = C + (F − C e) eᵀ/⟨e|e⟩, seen from outside.
        missed = sub(residual, rate)
        square = dot(effort, effort)
        known, steering = square > LEAST, square * h * h > STEERING
        under = 1.0 / on.select(known, square, 1.0)
        share = on.select(known, dot(missed, force) * under, 0.0)
        constraint = [maps.outward(through, row) for row in whole]
        slope = [maps.outward(through, row) for row in slopes]
        own = maps.outward(through, effort)
        extra = scale(under, sub(combine([sub(*rows) for rows in zip(slope, constraint, strict=True)], force),
                                 scale(2.0 * share, own)))  # fmt: skip

        width = n + 6 + d
        for i in range(n):
            a.f[i] = dot([row[i] for row in constraint], force) + share * own[i]
            for k in range(6):
                a.jac[i * width + n + k] = constraint[k][i] + on.select(known, own[i] * missed[k] * under, 0.0)
        for k in range(6):
            a.c[k] = residual[k]
            for j, entry in enumerate([*slope[k], *[0.0] * 6, *[column[k] for column in reads]]):
                a.jac[(n + k) * width + j] = entry
        metric = [maps.outward(through, column) for column in transposed(_matrix(maps, through))]
        # ∂(Cᵀλ)/∂v: −Ad_{I⁻¹}ᵀ ad_ζᵀ λ, and the share of F − C e.
        turns = [maps.outward(through, [*column, *[0.0] * (6 + d)]) for column in over.pulled(force)[1]]

        def steered() -> None:
            for i in range(n):
                for j in range(n):
                    a.jac[i * width + j] = own[i] * extra[j] + share * metric[i][j]
            for j in range(d):
                change = dot(sub(reads[j], turned[j]), force) * under
                for i in range(n):
                    a.jac[i * width + n + 6 + j] = own[i] * change + turns[j][i]

        def slow() -> None:
            for i in range(n):
                for j in range(n):
                    a.jac[i * width + j] = 0.0
                for j in range(d):
                    a.jac[i * width + n + 6 + j] = turns[j][i]

        on.when(steering, steered, slow)
        return on.select(over.far, TURN, OK)


@final
@dataclass(frozen=True, slots=True)
class Passage:
    """A joint over a step at given velocities of its frames, (6,) each, and along its freedoms.

    Parameters
    ----------
    carried, rate, whole
        Ad_{I⁻¹} of the frame in the middle of the step; C e there, and C (6, 12 + d).
    residual, slopes
        F = log[exp(side) exp(mid) exp(inner) exp(mid) exp(side)] / h, and ∂F/∂e (6, 12 + d).
    moving, turned, reads
        By increments of q_r, column by column: the middle frame's motion, that of C e, that of F.
    far
        Whether an exponent is half a turn or more.
    """

    carried: Halves
    rate: Entries
    whole: Rows
    residual: Entries
    slopes: Rows
    moving: Rows
    turned: Rows
    reads: Rows
    far: Truth

    @staticmethod
    def over_step(
        on: Evaluator, code: int, basis: tuple[tuple[float, ...], ...], x: Entries, step: Entries, h: Real,
        one: Entries, two: Entries, along: Entries,
    ) -> "Passage":  # fmt: skip
        """The joint of a pair's group over a step of h from x."""
        d = len(basis)
        columns: Rows = [list(column) for column in basis]
        # The frame in the middle of the step, and C e there.
        half = scale(0.5, step)
        middle = included(on, code, basis, moved(on, code, x, half))
        carried = _inverse_adjoint(*middle)
        seen, turning = _applied(carried, one), combine(columns, along) if d else [0.0] * 6
        rate = add(sub(seen, two), turning)

        side, mid, inner = scale(-0.5 * h, two), scale(0.5 * h, turning), scale(h, seen)
        exp_side, exp_mid = se3.exp(on, side), se3.exp(on, mid)
        g2 = se3.compose(on, exp_side, exp_mid)
        g3 = se3.compose(on, g2, se3.exp(on, inner))
        g4 = se3.compose(on, g3, exp_mid)
        total = se3.log(on, se3.compose(on, g4, exp_side))
        still = on.both(h <= 0.0, h >= 0.0)  # at an instant F is C e
        residual = on.select(still, rate, scale(1.0 / on.select(still, 1.0, h), total))

        # ∂F: right-trivialised variations of the factors, carried to the left end.
        back = _halved(se3.dexp_inv(on, total))
        turn = _times(back, _times(_adjoint(g2), _halved(se3.dexp(on, inner))))
        by_side = _halved(se3.dexp(on, side))
        outward = _sum(by_side, _times(_adjoint(g4), by_side))
        by_mid, around = _halved(se3.dexp(on, mid)), _sum(_adjoint(exp_side), _adjoint(g3))
        by_rate = [scale(0.5, _applied(back, _applied(around, _applied(by_mid, column)))) for column in columns]
        slopes = _beside(_times(turn, carried), _scaled(-0.5, _times(back, outward)), by_rate)
        whole = _beside(carried, ([[-1.0 * (i == j) for j in range(3)] for i in range(3)], _ZEROS), columns)
        # Through the middle frame: δa = ad_a B δη, with δη = dexp_left(v/2) δv/2.
        differential = STAGED[code].dexp(on, scale(-1.0, half))
        moving = [scale(0.5, combine(columns, column)) for column in transposed(differential)]
        turned = [se3.bracket(seen, column) for column in moving]
        reads = [_applied(turn, column) for column in turned]
        far = on.either(half_turn(inner), on.either(half_turn(side), half_turn(mid)))
        return Passage(carried, rate, whole, residual, slopes, moving, turned, reads, far)

    def pulled(self, force: Entries) -> tuple[list[Real], Rows]:
        """Ad_{I⁻¹}ᵀ of a wrench on frame 1, and its derivatives by increments of q_r, column by column."""
        return _transposed(self.carried, force), [
            scale(-1.0, _transposed(self.carried, se3.cobracket(column, force))) for column in self.moving
        ]


def half_turn(v: Entries) -> Truth:
    """Whether an exponent's rotation is half a turn or more."""
    return dot(v[:3], v[:3]) >= HALF_TURN


_ZEROS: Final[Rows] = [[0.0] * 3 for _ in range(3)]


def _halved(rows: Columns) -> Halves:
    return [list(row[:3]) for row in rows[:3]], [list(row[:3]) for row in rows[3:]]


def _inverse_adjoint(rotation: Columns, place: Entries) -> Halves:
    """Ad_{x⁻¹} of a frame: (Rᵀ, −Rᵀ p̂)."""
    back = transposed(rotation)
    return back, [scale(-1.0, row) for row in product(back, hat(place))]


def _adjoint(pose: Sequence[Real]) -> Halves:
    """Ad of a pose: (R, p̂ R)."""
    rotation = so3.matrix(pose[:4])
    return rotation, product(hat(pose[4:]), rotation)


def _times(a: Halves, b: Halves) -> Halves:
    return product(a[0], b[0]), plus(product(a[1], b[0]), product(a[0], b[1]))


def _sum(a: Halves, b: Halves) -> Halves:
    return plus(a[0], b[0]), plus(a[1], b[1])


def _scaled(factor: float, a: Halves) -> Halves:
    return [scale(factor, row) for row in a[0]], [scale(factor, row) for row in a[1]]


def _applied(a: Halves, u: Entries) -> list[Real]:
    return [*apply(a[0], u[:3]), *add(apply(a[1], u[:3]), apply(a[0], u[3:]))]


def _transposed(a: Halves, f: Entries) -> list[Real]:
    return [*add(combine(a[0], f[:3]), combine(a[1], f[3:])), *combine(a[0], f[3:])]


def _beside(one: Halves, two: Halves, columns: Columns) -> Rows:
    """Six rows: two matrices, and columns."""
    out: Rows = []
    for i in range(3):
        out.append([*one[0][i], 0.0, 0.0, 0.0, *two[0][i], 0.0, 0.0, 0.0, *[column[i] for column in columns]])
    for i in range(3):
        out.append([*one[1][i], *one[0][i], *two[1][i], *two[0][i], *[column[3 + i] for column in columns]])
    return out


def _matrix(maps: Maps, through: Sequence[Rows]) -> Rows:
    """T (inside, outside)."""
    units = [[float(i == j) for i in range(maps.outside)] for j in range(maps.outside)]
    return transposed([maps.inward(through, unit) for unit in units])
