"""Systems in integral causality: every effort is that of one storage, or prescribed, so that rates follow from states.

Efforts are eliminated then, and what an implicit method solves has one unknown a state. Storages with quadratic energy
and components of constant structure, which most of a large network are, are two sparse matrices; the others' kernels
are called. Both are compiled, several stages a call.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from types import MappingProxyType
from typing import Any, final

import numpy as np
from scipy.sparse import csc_array, csr_array, eye_array

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.linear.dense import add_to
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Program,
    Real,
    Vector,
    staged,
)
from ephs.solve.equations.model import Model
from ephs.solve.equations.sparse import Index
from ephs.solve.methods.continuous import AccumulatorRates, Continuous, Matrices
from ephs.solve.methods.places import Part, each_input
from ephs.solve.methods.records import (
    COMPONENT,
    REVERSIBLE,
    STORING,
    Columns,
    OuterPort,
    Scratch,
    efforts_of,
    rates_of,
)
from ephs.solve.methods.residuals import FAULTS, called, evaluation_program
from ephs.solve.posing.errors import SolveError
from ephs.solve.running.snapshot import parts


def _product(on: Evaluator, start: Integers, column: Integers, value: Vector, i: Integer, x: Vector) -> Real:
    """Row i of a sparse matrix times x."""
    total = on.variable(0.0)

    def term(p: Integer) -> None:
        total.value = total.value + value[p] * x[column[p]]

    on.loop(start[i + 1], term, start=start[i])
    return total.value


@staged
def rates(
    on: Evaluator, t: Columns, storing: Integers, others: Integers, place: Integers, rest: Vector, start: Integers,
    column: Integers, value: Vector, starts: Integers, columns: Integers, values: Vector, xs: Matrix, inputs: Matrix,
    found: Matrix, z: Vector, scal: Vector, m: Scratch,
) -> Integer:  # fmt: skip
    """Rates at states, row by row; 0 or a fault of `ephs.solve.methods.residuals.evaluated`.

    Parameters
    ----------
    storing, others
        Components whose kernels are called: storages, and what efforts drive.
    place
        (efforts,): the rate that the balance at an effort gives, −1 where the effort is prescribed.
    rest, start, column, value
        Efforts of the other storages: a constant, and a matrix by rows that is applied to the states.
    starts, columns, values
        Flows into the other components, likewise from efforts.
    z
        Receives rates, efforts and outer flows of the last row.
    """
    fault, n_rate = on.counter(0), t.counts[0]
    efforts = z.part(n_rate, place.size)

    def stage(k: Integer) -> None:
        x = xs.row(k)

        def prescribed(port: OuterPort, j: Integer, place: Integer) -> None:
            def effort() -> None:
                efforts[port.at + j] = inputs[k, place]

            on.when(on.same(port.prescribed, 1), effort)

        def supplied(port: OuterPort, j: Integer, place: Integer) -> None:
            row = n_rate + port.at + j

            def effort() -> None:
                z[port.unknown + j] = m.residual[row]

            on.when(on.same(port.prescribed, 1), effort, lambda: add_to(m.residual, row, -inputs[k, place]))

        def known(i: Integer) -> None:
            efforts[i] = rest[i] + _product(on, start, column, value, i, x)

        def balance(i: Integer) -> None:
            m.residual[n_rate + i] = _product(on, starts, columns, values, i, efforts)

        def component(i: Integer, *, stores: bool) -> None:
            part = Part.of(t, i)
            status = called(on, part, x, z, scal, m)

            def port(j: Integer) -> None:
                if stores:
                    z[part.balance(j)], m.energy[i] = m.e[j], m.c[0]
                else:
                    m.flows[part.e_at + j] = m.f[j]
                    add_to(m.residual, part.balance(j), m.f[j])

            def fail() -> None:
                fault.value = COMPONENT + status + FAULTS * i

            on.when(on.same(status, 0), lambda: on.loop(part.n, port), fail)

        def advance(i: Integer) -> None:
            def give() -> None:
                rate = -m.residual[n_rate + i]
                z[place[i]], found[k, place[i]] = rate, rate

            on.when(place[i] >= 0, give)

        on.loop(place.size, known)
        each_input(on, t, prescribed)
        on.loop(storing.size, lambda i: component(storing[i], stores=True))
        on.loop(place.size, balance)
        on.loop(others.size, lambda i: component(others[i], stores=False))
        each_input(on, t, supplied)
        on.loop(place.size, advance)

    def sound(k: Integer) -> None:
        on.when(on.same(fault.value, 0), lambda: stage(k))

    on.loop(xs.rows, sound)
    return fault.value


@cache
def integral_program() -> Program:
    """Return the program of the rates."""
    return Program("integral", rates=Entry(rates))


@final
class Integral:
    """The equations w = F(x) of a model in integral causality. It keeps memory: use one for each thread.

    Parameters
    ----------
    place
        (efforts,) the rate of the storage at each effort, −1 where it is prescribed.
    apart
        Components that are left out.

    Attributes
    ----------
    unknowns
        Of a stage: the rates.
    pivots
        How SuperLU is to choose pivots: I − hμ ∂F/∂x has its own on the diagonal, and fills least ordered by degree.
    """

    pivots: Mapping[str, Any] = MappingProxyType(
        {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.1, "options": {"SymmetricMode": True}}
    )

    def __init__(self, model: Model, place: Index, apart: Index) -> None:
        t = model.tables
        self.model, self.unknowns, self._place = model, int(t.counts[0]), place
        constant, kept = _constant(model), np.ones(t.kind.size, dtype=bool)
        kept[apart] = False
        self._whole = Continuous(model.only(np.flatnonzero(kept)) if apart.size else model)
        linear = Continuous(model.only(np.flatnonzero(constant)))
        width = place.size
        zeros, none = np.zeros(model.descriptor.point_size), 0.0 * model.input_values()
        z = np.zeros(model.unknowns)
        rest = np.zeros(width)
        owned = place >= 0
        rest[owned] = -linear.residual(zeros, z, none)[place[owned]]
        slopes, flows, _ = self._parts(linear.matrices(zeros, z, none))
        self._memory, self._z = model.memory(), z
        # of each state its storage, and the place of its effort
        self._effort, self._owner = np.zeros((2, self.unknowns), dtype=np.int64)
        self._effort[place[owned]] = self.unknowns + np.flatnonzero(owned)
        stored = np.flatnonzero(t.kind == STORING)
        self._owner[rates_of(t, stored)] = np.repeat(stored, t.dims[stored, 2])
        kinds = t.kind == STORING
        self._calls = [np.flatnonzero(kept & ~constant & chosen) for chosen in (kinds, ~kinds)]
        resting = replace(t, address=model.resting(np.concatenate(self._calls)))
        self._tables = parts(resting), *self._calls, place, rest, *_by_rows(slopes), *_by_rows(flows)
        self._bound: dict[int, Any] = {}
        self._sums, self._given = np.zeros(4 + t.kind.size), model.input_values()
        self._account = evaluation_program().compiled()["account"].bind(
            parts(t), self._z, 1.0, self._given, parts(self._memory), self._sums
        )  # fmt: skip

    @staticmethod
    def of(model: Model, apart: Index | None = None) -> "Integral | None":
        """The equations without some components, None where the model is not in integral causality."""
        t = model.tables
        place, owners = np.full(int(t.counts[1]), -1), np.zeros(int(t.counts[1]), dtype=np.int64)
        stored = np.flatnonzero(t.kind == STORING)
        efforts = efforts_of(t, stored)
        place[efforts] = rates_of(t, stored)
        np.add.at(owners, efforts, 1)
        for at, dim, prescribed, _ in t.outer:
            owners[at : at + dim] += prescribed
        if t.counts[2] or not (owners == 1).all():
            return None
        return Integral(model, place, np.zeros(0, dtype=np.int64) if apart is None else apart)

    def guess(self, x: Array) -> Array:
        """(unknowns,) none yet."""
        return np.zeros(x.size)

    def residuals(self, xs: Array, zs: Array, inputs: Array) -> Array:
        """(stages, unknowns) w − F(x)."""
        return zs - self.rates(xs, inputs)

    def matrices(self, x: Array, z: Array, inputs: Array) -> Matrices:
        """The derivatives of w − F(x)."""
        self.rates(x[None], inputs[None])
        slopes, flows, reads = self._parts(self._whole.matrices(x, self._z, inputs))
        balance = csr_array(flows @ slopes + reads)
        return Matrices(csc_array(eye_array(x.size)), csc_array(balance[self._effort - self.unknowns]))

    def instant(self, x: Array, z: Array, inputs: Array) -> AccumulatorRates:
        """Powers and energies at x."""
        self.rates(x[None], inputs[None])
        t, m = self.model.tables, self._memory
        energies = np.zeros(t.kind.size)
        np.add.at(energies, self._owner, 0.5 * x * self._z[self._effort])
        energies[self._calls[0]] = m.energy[self._calls[0]]
        self._sums[:], self._given[: inputs.size] = 0.0, inputs
        self._account()
        return AccumulatorRates(self._sums.copy(), m.flows.copy(), self._z.copy(), energies)

    def _parts(self, found: Matrices) -> tuple[csr_array, csr_array, csr_array]:
        """∂e/∂x, and of the flows at balances ∂/∂e and ∂/∂x."""
        n_rate, width, owned = self.unknowns, self._place.size, np.flatnonzero(self._place >= 0)
        unknowns, states = csr_array(found.unknowns), csr_array(found.states)
        balances, by_rate = slice(n_rate, n_rate + width), slice(0, n_rate)
        own = csr_array((np.ones(owned.size), (owned, self._place[owned])), shape=(width, n_rate))
        slopes = own @ (-states[by_rate, by_rate])
        return csr_array(slopes), csr_array(unknowns[balances, balances]), csr_array(states[balances, by_rate])

    def rates(self, xs: Array, inputs: Array) -> Array:
        """(stages, unknowns) F(x), in memory that the next call overwrites.

        Raises
        ------
        SolveError
            A component cannot be evaluated there.
        """
        stages = xs.shape[0]
        if stages not in self._bound:
            arrays = [np.zeros((stages, width)) for width in (self.unknowns, inputs.shape[1], self.unknowns)]
            call = integral_program().compiled()["rates"].bind(
                *self._tables, *arrays, self._z, self.model.scal(0.0), parts(self._memory)
            )  # fmt: skip
            self._bound[stages] = call, arrays
        call, (states, given, found) = self._bound[stages]
        states[:], given[:] = xs, inputs
        fault = int(call())
        if fault:
            raise SolveError.of_component(fault % FAULTS, self.model, fault // FAULTS)
        return found


def _constant(model: Model) -> Any:
    """(components,) whether a component's equations are linear with constant coefficients."""
    n = model.descriptor.numbering
    of = [one.kernel is not None and one.kernel.name in ("constant_structure", "quadratic") for one in n.primitives]
    return np.array(of, dtype=bool)[n.primitive] & np.isin(model.tables.kind, (STORING, REVERSIBLE))


def _by_rows(a: csr_array) -> tuple[Index, Index, Array]:
    a.eliminate_zeros()
    return np.asarray(a.indptr, np.int64), np.asarray(a.indices, np.int64), np.asarray(a.data, float)
