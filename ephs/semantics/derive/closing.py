"""The relation of a stabilised joint's second multiplier: poses are corrected to close the joint after the step."""

from dataclasses import dataclass
from typing import final

from ephs.semantics.derive.arguments import Arguments
from ephs.semantics.derive.holonomic import OK, TURN, Passage
from ephs.semantics.spaces.vectors import Rows, add, apply, combine, dot, product, scale
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.numbers import Integer, Real


@final
@dataclass(frozen=True, slots=True)
class Closing:
    """f = −W C*γ and 0 = F of the poses' increments; power ports q1, q2 and q_r, whose states it reads.

    The parameters are T = Ad_{o⁻¹} (6, 6) and W T* (6, 6) of each body that has a port, and W (d, d) of q_r.

    Parameters
    ----------
    code, size, basis
        As of a `Holonomic`.
    ends
        Whether body 1, and body 2, has a port; one that has none does not move.
    """

    code: int
    size: int
    basis: tuple[tuple[float, ...], ...]
    ends: tuple[bool, bool]

    @property
    def dimensions(self) -> tuple[int, int, int, int]:
        """Numbers of efforts, conditions, increments and state coordinates."""
        posed, d = sum(self.ends), len(self.basis)
        return 6 * posed + d, 6, 6 * posed + d, 7 * posed + self.size

    @property
    def numbers(self) -> int:
        """Number of parameters."""
        return 72 * sum(self.ends) + len(self.basis) ** 2

    def stage(self, on: Evaluator, a: Arguments, *, bare: bool) -> Integer:
        """Write flows, conditions and their derivatives by multipliers and increments."""
        n, k, m, _ = self.dimensions
        d, posed, width = len(self.basis), sum(self.ends), n + k + m
        h, lam, v = a.scal[0], [a.lam[i] for i in range(6)], [a.v[i] for i in range(m)]
        x, step = [a.x0[7 * posed + i] for i in range(self.size)], v[6 * posed :]
        still = on.both(h <= 0.0, h >= 0.0)
        rate = on.select(still, 0.0, 1.0 / on.select(still, 1.0, h))

        def table(first: int, rows: int, columns: int) -> Rows:
            return [[a.p[first + i * columns + j] for j in range(columns)] for i in range(rows)]

        number = 0
        maps: list[tuple[Rows, Rows] | None] = []
        velocities: list[list[Real]] = []
        for there in self.ends:
            maps.append((table(72 * number, 6, 6), table(72 * number + 36, 6, 6)) if there else None)
            own = maps[-1]
            velocities.append(scale(rate, apply(own[0], v[6 * number : 6 * number + 6])) if own else [0.0] * 6)
            number += there
        mobility, inside = table(72 * posed, d, d), range(6)
        over = Passage.over_step(on, self.code, self.basis, x, step, h, velocities[0], velocities[1], scale(rate, step))
        columns: Rows = [list(column) for column in self.basis]
        force, turns = over.pulled(lam)

        for i in range(n):
            for j in range(width):
                a.jac[i * width + j] = 0.0
        at = 0
        for side, own in enumerate(maps):
            if own is None:
                continue
            # −W T* C₁*γ on body 1, W T*γ on body 2, whose part of C is −1
            sign, pulled = (-1.0, force) if side == 0 else (1.0, lam)
            for i, entry in enumerate(apply(own[1], pulled)):
                a.f[at + i] = sign * entry
            by_lam = own[1] if side else product(own[1], [[row[q] for row in over.whole] for q in inside])
            for i in range(6):
                for j in range(6):
                    a.jac[(at + i) * width + n + j] = sign * by_lam[i][j]
            for j, turn in enumerate([] if side else turns):
                for i, entry in enumerate(apply(own[1], turn)):
                    a.jac[(at + i) * width + n + 6 + 6 * posed + j] = -1.0 * entry
            at += 6
        along = [dot(column, lam) for column in columns]
        for i in range(d):
            a.f[at + i] = -1.0 * dot(mobility[i], along)
            for j in range(6):
                a.jac[(at + i) * width + n + j] = -1.0 * dot(mobility[i], [column[j] for column in columns])
        for row in range(6):
            a.c[row] = on.select(still, 0.0, over.residual[row])
            entries: list[Real] = [0.0] * (n + 6)
            for side, own in enumerate(maps):
                if own is not None:
                    entries += scale(rate, combine(own[0], over.slopes[row][6 * side : 6 * side + 6]))
            own_slopes = scale(rate, over.slopes[row][12:]) if d else []
            entries += add(own_slopes, [column[row] for column in over.reads]) if d else []
            for j, entry in enumerate(entries):
                a.jac[(n + row) * width + j] = entry
        return on.select(over.far, TURN, OK)
