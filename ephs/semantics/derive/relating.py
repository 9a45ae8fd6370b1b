"""What relations have in common: ports, efforts and flows seen through maps, derivatives, bounds."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Protocol, TypeAlias, final

from ephs.semantics.derive.arguments import Arguments
from ephs.semantics.derive.charts import moved
from ephs.semantics.derive.maps import Maps
from ephs.semantics.stage.duals import Duals
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.numbers import Real, Truth

OK: Final = 0
TEMPERATURE: Final = 2
EXTENT: Final = 4
DOMAIN: Final = 5
HUGE: Final = 1.7976931348623157e308
Numbers: TypeAlias = Sequence[Real]
Bounds: TypeAlias = tuple[tuple[int, float, float], ...]
"""Index of a number, its lower and its upper bound."""


@final
@dataclass(frozen=True, slots=True)
class StatePort:
    """A port whose state is read.

    Parameters
    ----------
    code, size, dim
        Of its group: how many numbers a point and an increment have.
    positive
        Whether its state is a positive number, such as a volume.
    """

    code: int
    size: int
    dim: int
    positive: bool = False


def spans_of(ports: Sequence[StatePort]) -> Iterator[tuple[StatePort, slice, slice]]:
    """Each port with the places of its numbers among those of all points, and among increments."""
    at = first = 0
    for port in ports:
        yield port, slice(at, at + port.size), slice(first, first + port.dim)
        at, first = at + port.size, first + port.dim


class Related(Protocol):
    """A relation at the middle of a step, by its sizes."""

    @property
    def ports(self) -> tuple[StatePort, ...]:
        """Those that are read."""
        ...

    @property
    def dimensions(self) -> tuple[int, int, int, int]:
        """Numbers of efforts, conditions, increments and state coordinates."""
        ...

    @property
    def numbers(self) -> int:
        """Number of parameters."""
        ...


@final
class Through:
    """Efforts and flows seen through the maps of a relation, with the maps' numbers."""

    def __init__(self, maps: Maps | None, numbers: Numbers) -> None:
        self.maps, self.rows = maps, [] if maps is None else maps.rows(numbers)

    def inward(self, efforts: list[Real]) -> list[Real]:
        """T e."""
        return efforts if self.maps is None else self.maps.inward(self.rows, efforts)

    def outward(self, flows: list[Real]) -> list[Real]:
        """Tᵀ f."""
        return flows if self.maps is None else self.maps.outward(self.rows, flows)


def given(on: Duals, relation: Related, a: Arguments) -> tuple[list[Real], list[Real], list[Real], list[Real]]:
    """Parameters, states at the middle, efforts and multipliers, with directions (e, λ, v)."""
    n, k, m, size = relation.dimensions
    e: list[Real] = [on.along(a.e[i], i) for i in range(n)]
    lam: list[Real] = [on.along(a.lam[i], n + i) for i in range(k)]
    half: list[Real] = [on.along(0.5 * a.v[i], n + k + i, 0.5) for i in range(m)]
    start: list[Real] = [on.dual(a.x0[i]) for i in range(size)]
    x: list[Real] = []
    for port, own, by in spans_of(relation.ports):
        x += moved(on, port.code, start[own], half[by])
    return [on.dual(a.p[i]) for i in range(relation.numbers)], x, e, lam


def written(on: Duals, relation: Related, a: Arguments, values: Numbers, *, rests: bool = False) -> Truth:
    """Store flows, conditions and their derivatives; whether all values are finite.

    With ``rests``, slopes 0·∞ are 0, which is no number: those of flows M e where e is 0 and slopes of M are infinite,
    as of |v|^½ v at rest.
    """
    n, k, m, _ = relation.dimensions
    width = n + k + m
    for i, entry in enumerate(values):
        found = on.dual(entry)
        if i < n:
            a.f[i] = found.value
        else:
            a.c[i - n] = found.value
        for j, slope in enumerate(found.slopes):
            known = isinstance(slope, float) or not rests
            a.jac[i * width + j] = slope if known else on.base.select(on.base.absolute(slope) >= 0.0, slope, 0.0)
    return finite(on.base, [on.dual(entry).value for entry in values])


def finite(on: Evaluator, values: Numbers) -> Truth:
    """Tell whether all values are finite."""
    good: Truth = True
    for value in values:
        good = on.both(good, on.absolute(value) <= HUGE)
    return good


def inside(on: Evaluator, bounds: Bounds, values: Numbers) -> Truth:
    """Tell whether values are within bounds."""
    good: Truth = True
    for i, low, high in bounds:
        good = on.both(good, on.both(values[i] > low, values[i] < high))
    return good
