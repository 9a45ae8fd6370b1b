"""The discrete relation of an element from its tape: a storage's efforts over a step, others' flows and conditions.

They have the arguments of `ephs.semantics.kernel_table`. The Jacobian comes from the same function, run with numbers
that know their partial derivatives.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Final, TypeAlias, final

from ephs.semantics.derive.arguments import Arguments
from ephs.semantics.derive.charts import moved, over
from ephs.semantics.derive.closing import Closing
from ephs.semantics.derive.conduction import conducted
from ephs.semantics.derive.holonomic import Holonomic
from ephs.semantics.derive.linear import Linear
from ephs.semantics.derive.maps import Maps
from ephs.semantics.derive.slopes import Slopes, lifted
from ephs.semantics.derive.tape import Tape, evaluate, over_step
from ephs.semantics.spaces.vectors import dot
from ephs.semantics.stage.duals import Duals
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.kinds import pointer
from ephs.semantics.stage.memory import Held, Vector
from ephs.semantics.stage.numbers import Integer, Real, Truth
from ephs.semantics.stage.programs import Call, Entry, Program

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
class Port:
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


@final
@dataclass(frozen=True, slots=True)
class Storage:
    """The effort of a storage over a step: the slope of its energy, less the effort of the environment.

    Parameters
    ----------
    energy
        Tape of E, of the numbers of all states.
    reference
        (n,) how much θ₀, and how much π₀, there is in each effort of the environment.
    hot
        Efforts that are temperatures, which are to be positive.
    potentials
        Efforts that have a reference potential besides; these are the first numbers among the parameters.
    domain
        (number of the states, least, greatest) between which both ends are to lie.
    """

    energy: Tape
    ports: tuple[Port, ...]
    reference: tuple[tuple[float, float], ...]
    hot: tuple[int, ...] = ()
    potentials: tuple[int, ...] = ()
    domain: Bounds = ()

    @property
    def dimensions(self) -> tuple[int, int, int, int]:
        """Numbers of efforts, conditions, increments and state coordinates."""
        n = sum(port.dim for port in self.ports)
        return n, 0, n, sum(port.size for port in self.ports)

    @property
    def numbers(self) -> int:
        """Number of parameters."""
        return len(self.potentials) + self.energy.parameters

    def slopes(self, on: Evaluator, x: Numbers, v: Numbers, parameters: Numbers) -> tuple[list[Real], Real, list[Real]]:
        """∇̄E (n,), the energy at the end, and the states there, from the parameters of the energy."""
        states: list[Real] = []
        at = first = 0
        for port in self.ports:
            states += over(on, port.code, x[at : at + port.size], v[first : first + port.dim], first)
            at, first = at + port.size, first + port.dim
        given = [lifted(each) for each in parameters]
        found = over_step(Slopes(on), self.energy, states, given)
        return [found.slopes.get(i, 0.0) for i in range(first)], found.end, [lifted(each).end for each in states]

    def stage(self, on: Evaluator, a: Arguments, *, bare: bool) -> Integer:
        """Write efforts, their derivatives by the step, and the energy; no derivatives where it is bare."""
        n, _, _, size = self.dimensions
        x, p = [a.x0[i] for i in range(size)], [a.p[i] for i in range(self.numbers)]
        duals = Duals(on, 0 if bare else n)
        step = [duals.along(a.v[i], i) for i in range(n)]
        start, numbers = [duals.dual(each) for each in x], [duals.dual(each) for each in p[len(self.potentials) :]]
        efforts, energy, end = self.slopes(duals, start, step, numbers)
        good = _finite(on, [duals.dual(energy).value])
        good = on.both(good, _inside(on, self.domain, x))
        good = on.both(good, _inside(on, self.domain, [duals.dual(each).value for each in end]))
        cold: Truth = False
        for i, effort in enumerate(efforts):
            found = duals.dual(effort)
            value = found.value
            for j, slope in enumerate(found.slopes):
                a.f[i * n + j] = slope
            hot, wide = self.reference[i]
            if i in self.hot:
                cold = on.either(cold, value <= 0.0)
            if i in self.potentials:
                value = value - p[self.potentials.index(i)]
            value = value - hot * a.scal[1] - wide * a.scal[2]
            a.e[i] = value
            good = on.both(good, _finite(on, [value]))
        a.c[0] = duals.dual(energy).value
        empty: Truth = False
        at = first = 0
        for port in self.ports:
            if port.positive:
                for i in range(port.dim):
                    ends = on.minimum(x[at + i], x[at + i] + a.v[first + i])
                    empty = on.either(empty, ends <= 0.0)
            at, first = at + port.size, first + port.dim
        return on.select(empty, EXTENT, on.select(cold, TEMPERATURE, on.select(good, OK, DOMAIN)))


@final
@dataclass(frozen=True, slots=True)
class Reversible:
    """Flows f = L(x) e + C(x)ᵀ λ and conditions C(x) e at the middle of the step.

    Parameters
    ----------
    structure
        Tape of L (n, n) above C (k, n), of the numbers of the states that are read.
    ports
        Those that are read.
    domain
        As of a `Storage`, at the middle of the step.
    maps
        Of the efforts: the relation is that of T e and Tᵀ f.
    """

    structure: Tape
    ports: tuple[Port, ...]
    domain: Bounds = ()
    maps: Maps | None = None

    @property
    def dimensions(self) -> tuple[int, int, int, int]:
        """Numbers of efforts, conditions, increments and state coordinates."""
        rows, n = self.structure.shape
        outside = n if self.maps is None else self.maps.outside
        return outside, rows - n, sum(port.dim for port in self.ports), sum(port.size for port in self.ports)

    @property
    def numbers(self) -> int:
        """Number of parameters."""
        return self.structure.parameters + (0 if self.maps is None else self.maps.numbers)

    def stage(self, on: Evaluator, a: Arguments, *, bare: bool) -> Integer:
        """Write flows, conditions and, unless bare, their derivatives by efforts, multipliers and increments."""
        n, k = self.structure.shape[1], self.structure.shape[0] - self.structure.shape[1]
        partials = Duals(on, 0 if bare else sum(self.dimensions[:3]))
        p, x, e, lam = _given(partials, self, a)
        own, through = self.structure.parameters, _Through(self.maps, p[self.structure.parameters :])
        e = through.inward(e)
        rows = evaluate(partials, self.structure, x, p[:own])
        flows: list[Real] = []
        for i in range(n):
            flow = dot(rows[i * n : i * n + n], e)
            flows.append(flow + dot([rows[(n + j) * n + i] for j in range(k)], lam))
        values = through.outward(flows)
        values += [dot(rows[i * n : i * n + n], e) for i in range(n, n + k)]
        good = on.both(
            _written(partials, self, a, values), _inside(on, self.domain, [partials.dual(each).value for each in x])
        )
        return on.select(good, OK, DOMAIN)


@final
@dataclass(frozen=True, slots=True)
class Irreversible:
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
    ports: tuple[Port, ...]
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
        there = self._at(partials, a)
        if len(self.hot) == n:
            flows = [conducted(there.rows[i * n : i * n + n], there.energy, i) for i in range(n)]
        else:
            theta = partials.dual(a.scal[1])
            flows = [dot(there.rows[i * n : i * n + n], there.efforts) / theta for i in range(n)]
        good = _written(partials, self, a, there.through.outward(flows))
        return on.select(there.cold, TEMPERATURE, on.select(on.both(good, there.inside), OK, DOMAIN))

    def onsager(self, on: Evaluator, a: Arguments) -> Integer:
        """Write M/θ₀ (n, n), seen through the maps, in place of derivatives."""
        n, outside, plain = len(self.reference), self.dimensions[0], Duals(on, 0)
        there, theta = self._at(plain, a), plain.dual(a.scal[1])
        good = there.inside
        for j in range(outside):
            unit = there.through.inward([plain.dual(float(i == j)) for i in range(outside)])
            flows = [dot(there.rows[i * n : i * n + n], unit) / theta for i in range(n)]
            for i, entry in enumerate(there.through.outward(flows)):
                a.jac[i * outside + j] = value = plain.dual(entry).value
                good = on.both(good, on.absolute(value) <= HUGE)
        return on.select(there.cold, TEMPERATURE, on.select(good, OK, DOMAIN))

    def _at(self, on: Duals, a: Arguments) -> "_Point":
        """M at the middle of the step."""
        p, x, e, _ = _given(on, self, a)
        through = _Through(self.maps, p[self._own :])
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
        inside = on.both(
            _inside(on.base, self.domain, [on.dual(each).value for each in x]),
            _inside(on.base, self.between, [on.dual(each).value for each in energy]),
        )
        return _Point(e, energy, rows, through, cold, inside)


@final
@dataclass(frozen=True, slots=True)
class _Point:
    """M of an irreversible element at a point: efforts, energy efforts, rows, and what the point says."""

    efforts: list[Real]
    energy: list[Real]
    rows: list[Real]
    through: "_Through"
    cold: Truth
    inside: Truth


Relation: TypeAlias = Storage | Reversible | Irreversible | Holonomic | Closing


@final
class _Through:
    """Efforts and flows seen through the maps of a relation, with the maps' numbers."""

    def __init__(self, maps: Maps | None, numbers: Numbers) -> None:
        self.maps, self.rows = maps, [] if maps is None else maps.rows(numbers)

    def inward(self, efforts: list[Real]) -> list[Real]:
        """T e."""
        return efforts if self.maps is None else self.maps.inward(self.rows, efforts)

    def outward(self, flows: list[Real]) -> list[Real]:
        """Tᵀ f."""
        return flows if self.maps is None else self.maps.outward(self.rows, flows)


def _given(
    on: Duals, relation: Reversible | Irreversible, a: Arguments
) -> tuple[list[Real], list[Real], list[Real], list[Real]]:
    """Parameters, states at the middle, efforts and multipliers, with directions (e, λ, v)."""
    n, k, m, size = relation.dimensions
    e: list[Real] = [on.along(a.e[i], i) for i in range(n)]
    lam: list[Real] = [on.along(a.lam[i], n + i) for i in range(k)]
    half: list[Real] = [on.along(0.5 * a.v[i], n + k + i, 0.5) for i in range(m)]
    start: list[Real] = [on.dual(a.x0[i]) for i in range(size)]
    x: list[Real] = []
    at = first = 0
    for port in relation.ports:
        x += moved(on, port.code, start[at : at + port.size], half[first : first + port.dim])
        at, first = at + port.size, first + port.dim
    return [on.dual(a.p[i]) for i in range(relation.numbers)], x, e, lam


def _written(on: Duals, relation: Reversible | Irreversible, a: Arguments, values: Numbers) -> Truth:
    """Store flows, conditions and their derivatives; whether all values are finite."""
    n, k, m, _ = relation.dimensions
    width = n + k + m
    for i, entry in enumerate(values):
        found = on.dual(entry)
        if i < n:
            a.f[i] = found.value
        else:
            a.c[i - n] = found.value
        for j, slope in enumerate(found.slopes):
            a.jac[i * width + j] = slope
    return _finite(on.base, [on.dual(entry).value for entry in values])


def _finite(on: Evaluator, values: Numbers) -> Truth:
    good: Truth = True
    for value in values:
        good = on.both(good, on.absolute(value) <= HUGE)
    return good


def _inside(on: Evaluator, bounds: Bounds, values: Numbers) -> Truth:
    good: Truth = True
    for i, low, high in bounds:
        good = on.both(good, on.both(values[i] > low, values[i] < high))
    return good


def sizes(relation: Relation) -> dict[str, int]:
    """Number of coordinates of each argument after the first."""
    n, k, m, size = relation.dimensions
    stores = isinstance(relation, Storage)
    f, c, jac = (n * n, 1, 0) if stores else (n, k, (n + k) * (n + k + m))
    p = relation.numbers
    return {"scal": 3, "p": p, "x0": size, "v": m, "e": n, "lam": k, "f": f, "c": c, "jac": jac, "work": 0}


@cache
def program(relation: Relation) -> Program:
    """The program of a relation; its entry `value` has the signature of `ephs.semantics.kernel_table`."""
    return _program(relation, _with_derivatives, name="element")


@cache
def bare(relation: Relation) -> Program:
    """The same without the derivatives that a relation writes, which its tangents do not need."""
    return _program(relation, _bare, name="bare")


@cache
def at_rest(relation: Relation) -> Program:
    """The bare relation over a step of zero length: increments are zero, whatever the arguments."""
    return _program(relation, _bare, name="resting", rest=True)


@cache
def onsager(relation: Irreversible) -> Program:
    """The program that writes M/θ₀ (n, n) of an irreversible element at rest in place of derivatives."""

    def write(_: Relation, on: Evaluator, a: Arguments) -> Integer:
        return relation.onsager(on, a)

    return _program(relation, write, name="onsager", rest=True)


def _program(
    relation: Relation, write: Callable[[Relation, Evaluator, Arguments], Integer], *, name: str, rest: bool = False
) -> Program:
    size = sizes(relation)

    def value(on: Evaluator, dims: Any, scal: Any, p: Any, x0: Any, v: Any, e: Any, lam: Any, f: Any, c: Any,
              jac: Any, work: Any) -> Integer:  # fmt: skip
        if rest:
            v = Vector(Held([0.0] * size["v"]), 0, size["v"])
        return write(relation, on, Arguments(scal, p, x0, v, e, lam, f, c, jac, work))

    kinds = {name: pointer("reals", count) for name, count in size.items()}
    return Program(name, value=Entry(value, dims=pointer("integers", 4), **kinds))


def _with_derivatives(relation: Relation, on: Evaluator, a: Arguments) -> Integer:
    return relation.stage(on, a, bare=False)


def _bare(relation: Relation, on: Evaluator, a: Arguments) -> Integer:
    if isinstance(relation, Holonomic | Closing):  # writes to memory that is never read are eliminated
        a = replace(a, jac=on.scratch(sizes(relation)["jac"]))
    return relation.stage(on, a, bare=True)


def entry_of(relation: Relation | Linear, *, derivatives: bool = True, rest: bool = False) -> tuple[Program, str]:
    """The program of a relation over a step, with the derivatives that it writes or without, or at rest; its entry."""
    if isinstance(relation, Linear):
        return relation.program, relation.name
    return (at_rest if rest else program if derivatives else bare)(relation), "value"


@cache
def compiled(relation: Relation | Linear, *, rest: bool = False) -> Call:
    """The relation in machine code; its `address` is valid for the lifetime of the result, which is cached here."""
    made, name = entry_of(relation, rest=rest)
    return made.compiled()[name]
