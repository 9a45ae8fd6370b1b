"""Resource sharers: open ordinary differential equations whose vector fields add where states are shared.

Every box has states, and each of its ports shows one. A pattern glues the states at a junction and at linked ones, and
a glued state changes by the sum of what its members do (Baez, Pollard; Libkind, Baas, Patterson, Fairbanks). Whether
a port bears power makes no difference here.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, TypeAlias, final

from ephs.operad import Algebra, AlgebraMap, Directory, Interface, Path, Pattern
from ephs.semantics.algebra.interfaces import interface_of
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.meaning.partition import pushout

# Dual numbers: a value with its slope along one direction, for exact derivatives of rational functions.


@final
@dataclass(frozen=True, slots=True)
class Dual:
    """value + slope · ε with ε² = 0."""

    value: Any
    slope: Any = 0

    @staticmethod
    def constant(number: Any) -> "Dual":
        """A number, as a constant where it is none already."""
        return number if isinstance(number, Dual) else Dual(number)

    def __add__(self, other: Any) -> "Dual":
        right = Dual.constant(other)
        return Dual(self.value + right.value, self.slope + right.slope)

    def __mul__(self, other: Any) -> "Dual":
        right = Dual.constant(other)
        return Dual(self.value * right.value, self.value * right.slope + self.slope * right.value)

    def __truediv__(self, other: Any) -> "Dual":
        right = Dual.constant(other)
        quotient = self.value / right.value
        return Dual(quotient, (self.slope - quotient * right.slope) / right.value)

    def __neg__(self) -> "Dual":
        return Dual(-self.value, -self.slope)

    def __sub__(self, other: Any) -> "Dual":
        return self + -Dual.constant(other)

    def __rsub__(self, other: Any) -> "Dual":
        return Dual.constant(other) - self

    def __rtruediv__(self, other: Any) -> "Dual":
        return Dual.constant(other) / self

    __radd__ = __add__
    __rmul__ = __mul__

    def __pow__(self, power: int) -> "Dual":
        return Dual(self.value**power, power * self.value ** (power - 1) * self.slope)


State: TypeAlias = frozenset[Path]
"""A shared state, by the paths of its members."""
Values: TypeAlias = Mapping[State, tuple[Any, ...]]
VectorField: TypeAlias = Callable[[Values], Values]
"""States to rates; of floats, fractions or what else computes with +, −, · and /."""
SAMPLES = 3
"""Points at which two vector fields are compared."""
ROUNDING = 8.0 * 2.0**-52
"""Rounding of a sum, relative to its absolute terms and for each of them."""


@final
@dataclass(frozen=True, slots=True)
class Sharer:
    """An open differential equation.

    Parameters
    ----------
    interface
        The ports.
    states
        The states with their dimensions.
    shows
        Port -> the state that it shows.
    rates
        The vector field: from values of all states to rates of all states.
    """

    interface: Interface
    states: Mapping[State, int]
    shows: Directory[State]
    rates: VectorField = field(repr=False)

    @staticmethod
    def of(
        interface: Interface,
        shows: Mapping[str, str],
        rates: Callable[[Mapping[str, tuple[Any, ...]]], Mapping[str, tuple[Any, ...]]],
        hidden: Mapping[str, int] | None = None,
    ) -> "Sharer":
        """An open differential equation whose states have names.

        Parameters
        ----------
        shows
            Port -> name of the state that it shows, whose dimension is the port's.
        rates
            From values by name to rates by name; a state that is left out has rate zero.
        hidden
            Names and dimensions of further states.

        Raises
        ------
        SemanticsError
            A port that shows no state, or states of two dimensions.
        """
        names = dict(hidden or {})
        for port, of in interface.items():
            name, dim = shows.get(str(port)), of.quantity.space.dim
            if name is None or names.setdefault(name, dim) != dim:
                expected = ", ".join(f"{known} of dimension {n}" for known, n in sorted(names.items()))
                raise SemanticsError(
                    "no-state", port, found=name, expected=f"a state of dimension {dim}, known: {expected}"
                )
        single = {name: frozenset((Path.of(name),)) for name in names}

        def changed(values: Values) -> Values:
            found = rates({name: values[state] for name, state in single.items()})
            return {state: tuple(found.get(name, (0,) * names[name])) for name, state in single.items()}

        shown = Directory.trusted({port: single[shows[str(port)]] for port in interface})
        return Sharer(interface, {single[name]: dim for name, dim in names.items()}, shown, changed)


def _compose(pattern: Pattern, parts: Mapping[Path, Sharer]) -> Sharer:
    """The pushforward of states: those on one junction, or on linked ones, become one, and rates add."""
    shown = {
        box: [([port for port, found in part.shows.items() if found == state], state) for state in part.states]
        for box, part in parts.items()
    }
    states: dict[State, int] = {}
    shows: dict[Path, State] = {}
    places: dict[Path, dict[State, State]] = {box: {} for box in parts}
    for ports, members in pushout(pattern, shown):
        whole = frozenset(box / path for box, state in members for path in state)
        shows |= dict.fromkeys(ports, whole)
        for box, state in members:
            places[box][state] = whole
            states[whole] = parts[box].states[state]

    def rates(values: Values) -> Values:
        total: dict[State, tuple[Any, ...]] = {}
        for box, place in places.items():
            for state, rate in parts[box].rates({state: values[at] for state, at in place.items()}).items():
                old = total.get(place[state])
                total[place[state]] = rate if old is None else tuple(a + b for a, b in zip(old, rate, strict=True))
        return total

    return Sharer(pattern.interface, states, Directory.trusted(shows), rates)


def _equal(left: Sharer, right: Sharer) -> bool:
    """Same states at the same ports, and vector fields that agree at a few points, to the rounding of sums."""
    if (left.interface, left.states, left.shows) != (right.interface, right.states, right.shows):
        return False
    order = sorted(left.states, key=sorted)
    for k in range(SAMPLES):
        at = {
            state: tuple(Fraction((3 * n + 5 * i + 7 * k) % 11 - 5, 2) for i in range(left.states[state]))
            for n, state in enumerate(order)
        }
        one, other = left.rates(at), right.rates(at)
        found = [(a, b) for state in order for a, b in zip(one[state], other[state], strict=True)]
        scale = sum((abs(a) + abs(b) for a, b in found), 0)
        terms = sum(map(len, order))
        if any(a != b and abs(a - b) > ROUNDING * terms * scale for a, b in found):
            return False
    return True


def _rename(element: Sharer, names: Mapping[Path, Path]) -> Sharer:
    new = {state: frozenset(path.moved(names) for path in state) for state in element.states}

    def rates(values: Values) -> Values:
        found = element.rates({state: values[renamed] for state, renamed in new.items()})
        return {new[state]: rate for state, rate in found.items()}

    states = {new[state]: dim for state, dim in element.states.items()}
    return Sharer(element.interface, states, element.shows.map(lambda state: new[state]), rates)


resource_sharers: Algebra[Sharer] = Algebra("resource sharers", interface_of(Sharer), _compose, _equal, _rename)
"""Open differential equations, equal if their states are the same and their vector fields agree at sampled points.

A vector field is also the increment of a discrete system, x ↦ x + Δ(x): increments add like rates.
"""


def euler(h: float | Fraction) -> AlgebraMap[Sharer, Sharer]:
    """Euler's rule: the increment h F(x) over a step h. A map of algebras, since it is linear in F."""

    def step(element: Sharer) -> Sharer:
        return _changed(element, lambda values: _scaled(h, element.rates(values)))

    return AlgebraMap(resource_sharers, resource_sharers, step, f"Euler's rule, h = {h}")


def runge_kutta(h: float | Fraction) -> AlgebraMap[Sharer, Sharer]:
    """The midpoint rule of Runge, Δ(x) = h F(x + h/2 F(x)): no map of algebras.

    A part takes its middle where it would be by itself; the whole takes it where all together lead.
    """

    def step(element: Sharer) -> Sharer:
        def increment(values: Values) -> Values:
            half = _scaled(h / 2, element.rates(values))
            middle = {
                state: tuple(x + v for x, v in zip(value, half[state], strict=True)) for state, value in values.items()
            }
            return _scaled(h, element.rates(middle))

        return _changed(element, increment)

    return AlgebraMap(resource_sharers, resource_sharers, step, f"Runge's rule, h = {h}")


def _changed(element: Sharer, rates: VectorField) -> Sharer:
    return Sharer(element.interface, element.states, element.shows, rates)


def _scaled(h: float | Fraction, rates: Values) -> Values:
    return {state: tuple(h * number for number in rate) for state, rate in rates.items()}


def _tangent(element: Sharer) -> Sharer:
    """States (x, v), rates (F(x), DF(x) v)."""

    def rates(values: Values) -> Values:
        dual = {
            state: tuple(Dual(x, v) for x, v in zip(value[:n], value[n:], strict=True))
            for state, n in element.states.items()
            for value in (values[state],)
        }
        found = {state: tuple(map(Dual.constant, rate)) for state, rate in element.rates(dual).items()}
        return {state: (*(d.value for d in rate), *(d.slope for d in rate)) for state, rate in found.items()}

    return Sharer(element.interface, {state: 2 * n for state, n in element.states.items()}, element.shows, rates)


tangent: AlgebraMap[Sharer, Sharer] = AlgebraMap(resource_sharers, resource_sharers, _tangent, "tangent")
"""Linearising along any state: (x, v) ↦ (F(x), DF(x) v), by dual numbers.

At an equilibrium of the whole it is the linearisation there. The parts are linearised at the whole's state; each at an
equilibrium of its own is something else, as parts need not rest where the whole does.
"""
