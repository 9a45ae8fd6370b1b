"""The relation of an irreversible element, and its Onsager matrix, from their tape."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from ephs.semantics.derive.arguments import Arguments
from ephs.semantics.derive.maps import Maps
from ephs.semantics.derive.relating import (
    DOMAIN,
    HUGE,
    OK,
    TEMPERATURE,
    Bounds,
    StatePort,
    Through,
    given,
    inside,
    written,
)
from ephs.semantics.derive.tape import Tape, evaluate
from ephs.semantics.spaces.vectors import dot
from ephs.semantics.stage.duals import Duals
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.numbers import Integer, Real, Truth

# Flows of entropy between temperatures, by the differences of these.


def conducted(row: Sequence[Real], warmth: Sequence[Real], i: int) -> Real:
    """Flow of entropy at a place among others of given temperatures: Σ Mᵢⱼ (θⱼ − θᵢ)/θᵢ.

    That is Σ Mᵢⱼ (θⱼ − θ₀)/θ₀, as Σ Mᵢⱼ θⱼ = 0, without the difference of large numbers which that is between nearly
    equal temperatures: what such flows produce is a square of what these differ by.
    """
    total: Real = 0.0
    for j, (weight, theta) in enumerate(zip(row, warmth, strict=True)):
        if j != i:
            total = total + weight * (theta - warmth[i])
    return total / warmth[i]


@final
@dataclass(frozen=True, slots=True)
class IrreversibleStep:
    """Flows f = M(x, eᴱ) e/θ₀ at the middle of the step; between temperatures alone by their differences.

    Parameters
    ----------
    matrix
        Tape of M (n, n), of the energy efforts and of the numbers of the states that are read, in the order of `takes`.
    takes
        Of the tape's inputs: (True, which effort) or (False, which number of the states).
    ports
        Those that are read.
    reference, hot, potentials
        As of a `Storage`.
    domain, between
        Bounds of the numbers of the states, and of the energy efforts, at the middle of the step.
    maps
        As of a `Reversible`.
    """

    matrix: Tape
    takes: tuple[tuple[bool, int], ...]
    ports: tuple[StatePort, ...]
    reference: tuple[tuple[float, float], ...]
    hot: tuple[int, ...] = ()
    potentials: tuple[int, ...] = ()
    domain: Bounds = ()
    between: Bounds = ()
    maps: Maps | None = None

    @property
    def dimensions(self) -> tuple[int, int, int, int]:
        """Numbers of efforts, conditions, increments and state coordinates."""
        n = len(self.reference) if self.maps is None else self.maps.outside
        return n, 0, sum(port.dim for port in self.ports), sum(port.size for port in self.ports)

    @property
    def numbers(self) -> int:
        """Number of parameters."""
        return self._own + (0 if self.maps is None else self.maps.numbers)

    @property
    def _own(self) -> int:
        return len(self.potentials) + self.matrix.parameters

    def stage(self, on: Evaluator, a: Arguments, *, bare: bool) -> Integer:
        """Write flows and, unless bare, their derivatives by efforts and increments."""
        n, partials = len(self.reference), Duals(on, 0 if bare else sum(self.dimensions[:3]))
        there = self._at_middle(partials, a)
        if len(self.hot) == n:
            flows = [conducted(there.rows[i * n : i * n + n], there.energy, i) for i in range(n)]
        else:
            theta = partials.dual(a.scal[1])
            flows = [dot(there.rows[i * n : i * n + n], there.efforts) / theta for i in range(n)]
        good = written(partials, self, a, there.through.outward(flows), rests=True)
        return on.select(there.cold, TEMPERATURE, on.select(on.both(good, there.inside), OK, DOMAIN))

    def onsager(self, on: Evaluator, a: Arguments) -> Integer:
        """Write M/θ₀ (n, n), seen through the maps, in place of derivatives."""
        n, outside, plain = len(self.reference), self.dimensions[0], Duals(on, 0)
        there, theta = self._at_middle(plain, a), plain.dual(a.scal[1])
        good = there.inside
        for j in range(outside):
            unit = there.through.inward([plain.dual(float(i == j)) for i in range(outside)])
            flows = [dot(there.rows[i * n : i * n + n], unit) / theta for i in range(n)]
            for i, entry in enumerate(there.through.outward(flows)):
                a.jac[i * outside + j] = value = plain.dual(entry).value
                good = on.both(good, on.absolute(value) <= HUGE)
        return on.select(there.cold, TEMPERATURE, on.select(good, OK, DOMAIN))

    def _at_middle(self, on: Duals, a: Arguments) -> "_OnsagerPoint":
        """M at the middle of the step."""
        p, x, e, _ = given(on, self, a)
        through = Through(self.maps, p[self._own :])
        e = through.inward(e)
        energy: list[Real] = []
        cold: Truth = False
        for i, (hot, wide) in enumerate(self.reference):
            shift: Real = on.dual(hot * a.scal[1] + wide * a.scal[2])
            if i in self.potentials:
                shift = shift + p[self.potentials.index(i)]
            energy.append(e[i] + shift)
            if i in self.hot:
                cold = on.either(cold, on.dual(energy[i]).value <= 0.0)
        inputs = [energy[i] if effort else x[i] for effort, i in self.takes]
        rows = evaluate(on, self.matrix, inputs, p[len(self.potentials) : self._own])
        within = on.both(
            inside(on.base, self.domain, [on.dual(each).value for each in x]),
            inside(on.base, self.between, [on.dual(each).value for each in energy]),
        )
        return _OnsagerPoint(e, energy, rows, through, cold, within)


@final
@dataclass(frozen=True, slots=True)
class _OnsagerPoint:
    """M of an irreversible element at a point: efforts, energy efforts, rows, and what the point says."""

    efforts: list[Real]
    energy: list[Real]
    rows: list[Real]
    through: Through
    cold: Truth
    inside: Truth
