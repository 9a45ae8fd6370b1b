"""The discrete relation of an element from its tape: a storage's efforts over a step, others' flows and conditions.

They have the arguments of `ephs.semantics.descriptor.kernel_table`. The Jacobian comes from the same function, run
with numbers that know their partial derivatives.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, TypeAlias, final

from ephs.semantics.derive.arguments import Arguments
from ephs.semantics.derive.charts import over
from ephs.semantics.derive.closing import Closing
from ephs.semantics.derive.holonomic import Holonomic
from ephs.semantics.derive.irreversible import IrreversibleStep
from ephs.semantics.derive.linear import Linear
from ephs.semantics.derive.logarithm_loss import LogarithmLoss
from ephs.semantics.derive.logarithms import LogarithmStep
from ephs.semantics.derive.maps import Maps
from ephs.semantics.derive.relating import (
    DOMAIN,
    EXTENT,
    OK,
    TEMPERATURE,
    Bounds,
    Numbers,
    StatePort,
    Through,
    finite,
    given,
    inside,
    spans_of,
    written,
)
from ephs.semantics.derive.slopes import Slopes, lifted
from ephs.semantics.derive.tape import Tape, evaluate, over_step
from ephs.semantics.spaces.vectors import dot
from ephs.semantics.stage.duals import Duals
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.kinds import pointer
from ephs.semantics.stage.memory import HeldCells, Vector
from ephs.semantics.stage.numbers import Integer, Real, Truth
from ephs.semantics.stage.programs import Call, Entry, Program


@final
@dataclass(frozen=True, slots=True)
class StorageStep:
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
    ports: tuple[StatePort, ...]
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
        for port, own, by in spans_of(self.ports):
            states += over(on, port.code, x[own], v[by], by.start)
        given = [lifted(each) for each in parameters]
        found = over_step(Slopes(on), self.energy, states, given)
        return [found.slopes.get(i, 0.0) for i in range(len(v))], found.end, [lifted(each).end for each in states]

    def stage(self, on: Evaluator, a: Arguments, *, bare: bool) -> Integer:
        """Write efforts, their derivatives by the step, and the energy; no derivatives where it is bare."""
        n, _, _, size = self.dimensions
        x, p = [a.x0[i] for i in range(size)], [a.p[i] for i in range(self.numbers)]
        duals = Duals(on, 0 if bare else n)
        step = [duals.along(a.v[i], i) for i in range(n)]
        start, numbers = [duals.dual(each) for each in x], [duals.dual(each) for each in p[len(self.potentials) :]]
        efforts, energy, end = self.slopes(duals, start, step, numbers)
        good = finite(on, [duals.dual(energy).value])
        good = on.both(good, inside(on, self.domain, x))
        good = on.both(good, inside(on, self.domain, [duals.dual(each).value for each in end]))
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
            good = on.both(good, finite(on, [value]))
        a.c[0] = duals.dual(energy).value
        empty: Truth = False
        for port, own, by in spans_of(self.ports):
            if port.positive:
                for i in range(port.dim):
                    ends = on.minimum(x[own][i], x[own][i] + a.v[by.start + i])
                    empty = on.either(empty, ends <= 0.0)
        return on.select(empty, EXTENT, on.select(cold, TEMPERATURE, on.select(good, OK, DOMAIN)))


@final
@dataclass(frozen=True, slots=True)
class ReversibleStep:
    """Flows f = L(x) e + C(x)ᵀ λ and conditions C(x) e at the middle of the step.

    Parameters
    ----------
    structure
        Tape of L (n, n) above C (k, n), of the numbers of the states that are read.
    ports
        Those that are read.
    domain
        As of a `StorageStep`, at the middle of the step.
    maps
        Of the efforts: the relation is that of T e and Tᵀ f.
    """

    structure: Tape
    ports: tuple[StatePort, ...]
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
        p, x, e, lam = given(partials, self, a)
        own, through = self.structure.parameters, Through(self.maps, p[self.structure.parameters :])
        e = through.inward(e)
        rows = evaluate(partials, self.structure, x, p[:own])
        flows: list[Real] = []
        for i in range(n):
            flow = dot(rows[i * n : i * n + n], e)
            flows.append(flow + dot([rows[(n + j) * n + i] for j in range(k)], lam))
        values = through.outward(flows)
        values += [dot(rows[i * n : i * n + n], e) for i in range(n, n + k)]
        good = on.both(
            written(partials, self, a, values), inside(on, self.domain, [partials.dual(each).value for each in x])
        )
        return on.select(good, OK, DOMAIN)


Relation: TypeAlias = (
    StorageStep | LogarithmStep | LogarithmLoss | ReversibleStep | IrreversibleStep | Holonomic | Closing
)


def sizes(relation: Relation) -> dict[str, int]:
    """Number of coordinates of each argument after the first."""
    n, k, m, size = relation.dimensions
    stores = isinstance(relation, StorageStep | LogarithmStep)
    f, c, jac = (n * n, 1, 0) if stores else (n, k, (n + k) * (n + k + m))
    p = relation.numbers
    return {"scal": 3, "p": p, "x0": size, "v": m, "e": n, "lam": k, "f": f, "c": c, "jac": jac, "work": 0}


@cache
def program(relation: Relation) -> Program:
    """The program of a relation; its entry `value` has the signature of `ephs.semantics.descriptor.kernel_table`."""
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
def onsager(relation: IrreversibleStep) -> Program:
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
            v = Vector(HeldCells([0.0] * size["v"]), 0, size["v"])
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
