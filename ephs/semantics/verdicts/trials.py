"""The states and efforts at which a structure is tried, made from choices, whatever the source of the choices.

Choices are balanced: two temperatures come with a < b, a > b and a ≈ b, velocities with both signs, magnitudes from
1e-8 to 1e8. The first choice is always the simplest, so that lowering choices leads to numbers of human size.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from types import CodeType, FunctionType
from typing import TYPE_CHECKING, cast, final

import numpy as np

from ephs.operad import Path, Quantity
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.derive.recording import values_read
from ephs.semantics.primitives.forms import tape_of
from ephs.semantics.spaces import SO3, codes, manifold

if TYPE_CHECKING:
    from ephs.semantics.primitives.primitives import Point, Primitive

Choose = Callable[[int], int]
"""A choice among so many: 0 is the simplest."""
SIMPLE = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 0.5, 1.5, 2.5, 3.5, 4.5, 20, 50, 100, 200, 300, 400, 1000)
"""Magnitudes of human size."""
ANGLES = (0, 1, -1, 0.5, -0.5, 2, -2, 3, -3, 0.1, -0.1, 1e-3, -1e-3)
"""Components of rotation vectors."""
_LADDER = [1.0, 0.0, -1.0, *(sign * size for size in map(float, SIMPLE[1:]) for sign in (1.0, -1.0))]
"""The same from the simplest on, with signs."""
SMALL = 4
"""Coordinates that are all given small whole numbers at once, to find the smallest counterexample."""
ROTATING = (codes.SO3, codes.SE3, codes.SO3xR3)
"""Groups whose points begin with a quaternion."""
DECADES = (0, -1, 1, -2, 2, -3, 3, -4, 4, -5, 5, -6, 6, -7, 7, -8, 8)
HOT = "entropy effort"
TEMPERATURES = (273.15, 293.15, 298.15, 300.0)
"""Temperatures in K at which tables are usual."""
NEAR = 1e-3
"""Relative distance from a special number at which it is near."""
SPECIAL = 64
"""Numbers of a function that are tried, at most."""
EVALUATIONS = 4
"""Evaluations of a structure in a trial: at a state, at its reversal, and at the other quaternions."""
WORK = 100_000
"""Operations of a record that trials of one kind take, at most: a fraction of a second."""
REFERENCES = (Reference(1.0, 0.0), Reference(), Reference(300.0, 300.0))
"""With θ₀ = 1 K and π₀ = 0, numbers of human size are exact as efforts of exergy, too."""


@final
@dataclass(frozen=True, slots=True)
class Witness:
    """A counterexample.

    Parameters
    ----------
    states, efforts
        Port -> number, or numbers of a vector; efforts are those of energy: velocities, absolute temperatures.
    entry
        Of the matrix, where one is wrong.
    size
        How large the defect is there.
    """

    states: Mapping[str, float | tuple[float, ...]]
    efforts: Mapping[str, float | tuple[float, ...]]
    entry: tuple[int, ...] = ()
    size: float = 0.0

    def __str__(self) -> str:
        both = self.states.keys() & self.efforts.keys()
        named = [(f"{name}.x" if name in both else name, value) for name, value in self.states.items()]
        return ", ".join(f"{name} = {_text(value)}" for name, value in [*self.efforts.items(), *named]) or "any state"


def _text(value: float | tuple[float, ...]) -> str:
    return f"[{', '.join(map(_text, value))}]" if isinstance(value, tuple) else f"{value:.9g}"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """States of the ports that a primitive reads, exergetic efforts (n,) at its power ports, and the reference."""

    states: "Point"
    efforts: Array
    reference: Reference

    def witness(self, primitive: "Primitive", entry: tuple[int, ...] = (), size: float = 0.0) -> Witness:
        """Text for a message."""
        efforts: dict[str, float | tuple[float, ...]] = {}
        if primitive.kind == "irreversible":
            energy = self.efforts + primitive.bundle.intensive(self.reference)
            efforts = {
                str(port): _plain([float(f"{e:.12g}") for e in energy[where]])
                for port, where, _ in primitive.bundle.items()
            }
        return Witness({str(port): _plain(x) for port, x in self.states.items()}, efforts, entry, size)

    def nearer(self, primitive: "Primitive", share: float) -> "Trial":
        """The same efforts at states nearer to the identity; states that are positive stay."""
        if share == 1.0:
            return self
        states: dict[Path, Array] = {}
        for port, x in self.states.items():
            quantity = primitive.interface[port].quantity
            space = manifold(quantity.space)
            low, _ = extent(primitive, port, quantity)
            states[port] = x if low > -math.inf else space.retract(space.identity(), share * space.log(x))
        return replace(self, states=states)


def _plain(x: Iterable[float]) -> float | tuple[float, ...]:
    numbers = tuple(float(value) + 0.0 for value in x)
    return numbers[0] if len(numbers) == 1 else numbers


def extent(primitive: "Primitive", port: Path, quantity: Quantity) -> tuple[float, float]:
    """Declared bounds of a port's states, or of an irreversible primitive's energy efforts."""
    for declared, low, high in primitive.domain:
        if declared == port:
            return low, high
    reads = port in primitive.reads
    if reads:
        return quantity.domain
    return (0.0, math.inf) if quantity.kind == "entropy" else (-math.inf, math.inf)


@final
@dataclass(frozen=True, slots=True)
class Coordinate:
    """A coordinate of a trial: its bounds and the coordinates comparable with it; ``angle`` of a rotation."""

    low: float
    high: float
    kind: str
    angle: bool = False

    def takes(self, special: float) -> bool:
        """Whether a special number is one for this coordinate: within its bounds, a temperature for temperatures."""
        suits = self.kind == HOT or special not in TEMPERATURES
        return suits and not self.angle and self.low < special < self.high

    def within(self, number: float) -> float:
        """A number of about this size between the bounds."""
        low, high = self.low, self.high
        if low == -math.inf and high == math.inf:
            return number
        if high < math.inf and low > -math.inf:
            return low + (high - low) * (0.5 + math.atan(number) / math.pi)
        return low + abs(number) if low > -math.inf else high - abs(number)


def coordinates(primitive: "Primitive") -> list[Coordinate]:
    """The numbers of a trial: energy efforts of an irreversible primitive, then the states that are read."""
    out: list[Coordinate] = []
    if primitive.kind == "irreversible":
        for port, where, quantity in primitive.bundle.items():
            low, high = (-math.inf, math.inf)
            if port not in primitive.reads:
                low, high = extent(primitive, port, quantity)
            out += [Coordinate(low, high, f"{quantity.kind} effort")] * (where.stop - where.start)
    for port in primitive.reads:
        quantity = primitive.interface[port].quantity
        space = manifold(quantity.space)
        low, high = extent(primitive, port, quantity)
        turning = {codes.VECTOR: 0, codes.SE2: 1}.get(space.code, 3)
        out += [Coordinate(-math.pi, math.pi, "angle", True)] * turning
        out += [Coordinate(low, high, quantity.kind)] * (space.dim - turning)
    return out


def affordable(primitive: "Primitive", count: int) -> int:
    """So many trials of a structure, fewer where its record is long."""
    tape = None if primitive.kernel is None else tape_of(primitive.kernel)
    return count if tape is None else max(1, min(count, WORK // (EVALUATIONS * len(tape.operations) + 1)))


def special_numbers(primitive: "Primitive", more: Iterable[float] = ()) -> tuple[float, ...]:
    """Numbers beside which a structure may change: those that its function is written with, and usual temperatures."""
    found = [*TEMPERATURES, *more]
    if primitive.formula is not None:
        found += _written((primitive.formula.function, primitive.formula.gradient), set())
    found += [float(value) for _, value in primitive.parameters if isinstance(value, int | float)]
    return tuple(dict.fromkeys(x for x in found if math.isfinite(x) and x))[:SPECIAL]


def _written(value: object, seen: set[int]) -> list[float]:
    """The numbers in a function's code, in what it closes over, and in the functions that it calls."""
    match value:  # numbers may be made on the way, so that one has the identity of another before it
        case bool() | np.complexfloating():
            return []
        case int() | float() | np.number():
            return [float(value)]
        case _:
            pass
    if id(value) in seen or len(seen) > SPECIAL:
        return []
    seen.add(id(value))
    parts: list[object] = []
    match value:
        case tuple() | list():
            parts = list(cast("Iterable[object]", value))
        case np.ndarray():
            parts = value.ravel().tolist() if value.size <= SMALL**2 else []
        case CodeType():
            parts = list(value.co_consts)
        case FunctionType():
            parts = [value.__code__, *(value.__defaults__ or ()), *(value.__kwdefaults__ or {}).values()]
            closed = value.__code__.co_freevars
            parts += [
                each
                for name, each in values_read(value).items()
                if name in closed or isinstance(each, int | float | FunctionType)
            ]
        case _:
            pass
    return [number for part in parts for number in _written(part, seen)]


def trial_of(primitive: "Primitive", numbers: Sequence[float], reference: Reference) -> Trial:
    """The trial with these numbers; rotations as rotation vectors."""
    bundle, at = primitive.bundle, 0
    energy = np.zeros(bundle.size)
    if primitive.kind == "irreversible":
        energy, at = np.array(numbers[: bundle.size]), bundle.size
    states: dict[Path, Array] = {}
    for port in primitive.reads:
        space = manifold(primitive.interface[port].quantity.space)
        v = np.array(numbers[at : at + space.dim])
        turned = SO3.exp(v[:3]) if space.code in ROTATING else v[:0]
        states[port], at = np.concatenate([turned, v[3:] if turned.size else v]), at + space.dim
    return Trial(states, energy - bundle.intensive(reference), reference)


def beside(primitive: "Primitive", special: Iterable[float]) -> Iterator[list[float]]:
    """The simplest numbers with one of them at each special number, near it, and next to it, on both sides."""
    simple, _ = chosen(primitive, lambda _: 0)
    where = coordinates(primitive)
    for value in special:
        for i, coordinate in enumerate(where):
            if coordinate.takes(value):
                ends = (math.nextafter(value, math.inf), math.nextafter(value, -math.inf))
                for number in (value, value * (1.0 - NEAR), value * (1.0 + NEAR), *ends):
                    yield [*simple[:i], number, *simple[i + 1 :]]


def chosen(primitive: "Primitive", choose: Choose, special: Sequence[float] = ()) -> tuple[list[float], Reference]:
    """The numbers of a trial and its reference, from choices; some of them next to special numbers."""
    reference = REFERENCES[choose(len(REFERENCES))]
    seen: dict[str, list[float]] = {}
    numbers: list[float] = []
    for coordinate in coordinates(primitive):
        mine = [value for value in special if coordinate.takes(value)]
        numbers.append(_number(choose, coordinate, seen.setdefault(coordinate.kind, []), mine))
    return numbers, reference


def _number(choose: Choose, coordinate: Coordinate, seen: list[float], special: Sequence[float]) -> float:
    """A number between two bounds: of human size, of any size, or next to one that was chosen before, or is special."""
    low, high = coordinate.low, coordinate.high
    way = choose(5 if special else 4)
    if coordinate.angle:
        found = float(ANGLES[choose(len(ANGLES))])
    elif way == 4 or (seen and way == 3):
        among = special if way == 4 else seen
        base, gap = among[choose(len(among))], (0.0, 1.0, -1.0)[choose(3)]
        found = base * (1.0 + gap * 10.0 ** -(1 + choose(9)))
    elif high - low < math.inf and way:
        found = low + (high - low) * (choose(65) + 0.5) / 65.0
    else:
        size = float(SIMPLE[choose(len(SIMPLE))]) if way < 2 else _magnitude(choose)
        sign = (1.0, -1.0, 0.0)[choose(3)] if low == -math.inf and high == math.inf else 1.0
        found = sign * size if low == -math.inf < high == math.inf else low + size if low > -math.inf else high - size
    if not low < found < high:
        found = 0.5 * (low + high) if high - low < math.inf else low + 1.0 if low > -math.inf else high - 1.0
    seen.append(found)
    return found


def _magnitude(choose: Choose) -> float:
    return 10.0 ** DECADES[choose(len(DECADES))] * (1.0 + choose(90) / 10.0)


def simpler(number: float, coordinate: Coordinate) -> Iterator[float]:
    """Simpler numbers than this one, the simplest first: small integers, powers of ten, fewer digits."""
    ladder = list(map(float, ANGLES)) if coordinate.angle else _LADDER
    if number in ladder:
        ladder = ladder[: ladder.index(number)]
    elif not coordinate.angle:
        decade = math.floor(math.log10(abs(number)))
        far = [f * 10.0**k for k in range(0, decade, 1 if decade > 0 else -1) for f in (1.0, 2.0, 5.0)]
        far += [10.0**decade, 2.0 * 10.0**decade, 5.0 * 10.0**decade]
        short = [float(f"{number:.{digits}e}") for digits in range(8)]
        ladder = [*ladder, *(math.copysign(value, number) for value in far), *short]
        ladder = ladder[: ladder.index(number)] if number in ladder else ladder
    yield from (value for value in dict.fromkeys(ladder) if coordinate.low < value < coordinate.high)


def smallest(coordinates: Sequence[Coordinate]) -> Iterator[tuple[float, ...]]:
    """Small whole numbers for all coordinates, those of the least sum first."""
    rows = list(product(*([1.0, 2.0, 3.0] if not c.angle else [0.0, 1.0] for c in coordinates[:SMALL])))
    rest = tuple(0.0 if c.angle else 1.0 for c in coordinates[SMALL:])
    for row in sorted(rows, key=sum):
        if all(c.low < value < c.high for c, value in zip(coordinates, (*row, *rest), strict=True)):
            yield (*row, *rest)
