"""Flows of a mechanism's attachments, and their derivatives, by the contracted network of constant relations.

`ephs.mechanics.tree.finding.network` says what the efforts z are. Storages give theirs, components are called with
the rows of N z, and Nᵀ carries their flows back. Entries of z that only balances determine follow by Newton's method.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from ephs.semantics.descriptor.kernel_table import SIGNATURE
from ephs.semantics.stage import (
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Real,
    Record,
    Vector,
    function,
    integer,
    integers,
)
from ephs.semantics.stage.memory import ArrayReals

NO_REALS: Final = ArrayReals(np.zeros(0))
ROW: Final = 4
"""Integers of a row of a network."""


class Stores(Record):
    """A storage: its relation, the place of its first state, and where its slopes are kept."""

    law = function(SIGNATURE)
    dims = integers(4)
    at = integer()
    component = integer()
    state = integer()
    effort = integer()
    kept = integer()


class Called(Record):
    """A component that depends on states or makes entropy.

    Attributes
    ----------
    entry
        Its first row among the rows of N: efforts, then multipliers.
    read, vary
        Its first places in the lists of what is read, and of what changes it.
    kept
        Where its derivatives are kept.
    """

    law = function(SIGNATURE)
    dims = integers(4)
    at = integer()
    component = integer()
    entry = integer()
    read = integer()
    vary = integer()
    kept = integer()


INTEGERS: Final = ("head", "store", "called", "row", "term", "read", "vary", "bent", "temperature", "pivot", "fault")
REALS: Final = (
    "weight", "effort", "flow", "gross", "kept", "x", "v", "e", "f", "work", "matrix", "step", "turned",
    "changed", "moved", "power", "outer",
)  # fmt: skip
"""Parts of a network, in the order in which they lie in its arrays."""


@final
@dataclass(frozen=True, slots=True)
class Net:
    """A network, and memory.

    Attributes
    ----------
    head
        Numbers of rates, temperatures, prescribed efforts, states, unknown efforts and multipliers, and of what is
        stored before its states; the component that is named where efforts do not follow.
    row
        (rows, 4): first term, terms, the place of the entropy that the row's flow makes or −1, and 1 where a store of
        heat takes it up as energy. Rows of N, then those of flows by efforts.
    term, weight
        Places in z, and factors.
    read
        Places in s of what components read; −1 − place of elements of joints.
    vary
        Places in s of what components read; −1 − degree of freedom of joints that they read.
    bent
        Degrees of freedom of the joints that are read.
    temperature
        (temperatures,) entropies whose they are.
    given
        Prescribed efforts, then (z,) prescribed flows.
    effort, flow, gross
        (z,): efforts, flows by them, and sums of sizes.
    kept
        Derivatives of storages and components.
    parameters, scal, x, v, e, f, work
        As components take them; e holds efforts and multipliers, f flows and conditions.
    matrix, pivot, step
        Of what is unknown.
    turned, changed, moved
        (z,), (z,) and (vary,): changes of efforts, of flows, and of what is read.
    power
        (3,): what is given, in W; what is stored, in J; heat that goes to entropies of other states, in W.
    outer
        (states,) energy of the environment by a state in it, as −π₀ of a volume; 0 of others.
    fault
        The component that failed.
    """

    head: Integers
    store: Integers
    called: Integers
    row: Integers
    term: Integers
    weight: Vector
    read: Integers
    vary: Integers
    bent: Integers
    temperature: Integers
    given: Vector
    effort: Vector
    flow: Vector
    gross: Vector
    kept: Vector
    parameters: Vector
    scal: Vector
    x: Vector
    v: Vector
    e: Vector
    f: Vector
    work: Vector
    matrix: Matrix
    pivot: Integers
    step: Vector
    turned: Vector
    changed: Vector
    moved: Vector
    power: Vector
    outer: Vector
    fault: Integers

    @staticmethod
    def of(whole: Integers, reals: Vector, parameters: Vector, scal: Vector, given: Vector) -> "Net":
        """The network that lies in two arrays, with the place and the size of each part at the head of the first."""

        def place(k: int) -> tuple[Integer, Integer]:
            return whole[2 * k], whole[2 * k + 1]

        found: dict[str, Any] = {name: whole.part(*place(k)) for k, name in enumerate(INTEGERS)}
        found |= {name: reals.part(*place(len(INTEGERS) + k)) for k, name in enumerate(REALS)}
        square = found["matrix"]
        unknown = found["head"][4]
        found["matrix"] = Matrix(square.cells, square.start, unknown, unknown)
        return Net(**found, parameters=parameters, scal=scal, given=given)

    def stores(self, on: Evaluator, body: Callable[[Stores], None]) -> None:
        """Call body(storage) for all storages."""
        width, at = Stores.integer_width, self.store
        on.loop(at.size // width, lambda i: body(Stores(at.cells, at.start + i * width, NO_REALS, 0)))

    def each(self, on: Evaluator, body: Callable[[Called], None]) -> None:
        """Call body(component) for all components."""
        width, at = Called.integer_width, self.called
        on.loop(at.size // width, lambda i: body(Called(at.cells, at.start + i * width, NO_REALS, 0)))

    @property
    def known(self) -> Integer:
        """Number of known entries of z; the unknown ones follow."""
        return self.effort.size - self.head[4]

    @property
    def first_state(self) -> Integer:
        """Start of the efforts of storages in z."""
        return self.head[0] + self.head[1] + self.head[2]

    # ---- sums --------------------------------------------------------------------------------------------------

    def _sum(self, on: Evaluator, row: Integer, z: Vector, *, sizes: bool = False) -> Real:
        """A row of N, or of flows by efforts, times z; or the sum of the terms' sizes."""
        total, first = on.variable(0.0), self.row[ROW * row]

        def add(k: Integer) -> None:
            term = self.weight[first + k] * z[self.term[first + k]]
            total.value = total.value + (on.absolute(term) if sizes else term)

        on.loop(self.row[ROW * row + 1], add)
        return total.value

    def _spread(self, on: Evaluator, row: Integer, value: Real, out: Vector) -> None:
        """Add a row of Nᵀ times a value."""
        first = self.row[ROW * row]

        def add(k: Integer) -> None:
            at = self.term[first + k]
            out[at] = out[at] + self.weight[first + k] * value

        on.loop(self.row[ROW * row + 1], add)

    def _across(self, on: Evaluator, z: Vector, out: Vector) -> None:
        """Write the flows by efforts of the constant relations."""
        first = self.row.size // ROW - z.size

        def each_entry(k: Integer) -> None:
            out[k] = self._sum(on, first + k, z)

        on.loop(z.size, each_entry)

    # ---- components --------------------------------------------------------------------------------------------

    def _call(self, on: Evaluator, one: Stores | Called, efforts: Integer, kept: Vector) -> Integer:
        dims = Integers(one.integers, one.integer_start + type(one).dims.offset, 4)
        return on.reach(
            one.law, dims, self.scal, self.parameters.part(one.at, self.parameters.size - one.at), self.x, self.v,
            self.e, self.e.part(efforts, self.e.size - efforts), self.f,
            self.f.part(efforts, self.f.size - efforts), kept, self.work,
        )  # fmt: skip

    def store_efforts(self, on: Evaluator, s: Vector) -> Integer:
        """Write efforts of storages and their energy, and keep their slopes; return a status."""
        status, first = on.counter(0), self.head[5]
        self.power[1] = 0.0

        def surroundings(k: Integer) -> None:
            self.power[1] = self.power[1] + self.outer[k] * s[first + k]

        def each_store(it: Stores) -> None:
            n = it.dims[0]

            def read(j: Integer) -> None:
                self.x[j] = s[first + it.state + j]

            on.loop(n, read)
            found = self._call(on, it, n * n, self.work)
            self.power[1] = self.power[1] + self.f[n * n]

            def each_entry(j: Integer) -> None:
                self.effort[it.effort + j] = self.e[j]

            def keep(j: Integer) -> None:
                self.kept[it.kept + j] = 2.0 * self.f[j]

            on.loop(n, each_entry)
            on.loop(n * n, keep)
            self.failed(on, status, found, it.component)

        on.loop(self.outer.size, surroundings)
        self.stores(on, each_store)
        return status.value

    def energies(self, on: Evaluator, s: Vector, out: Vector) -> Integer:
        """Add energies of storages and the environment in J to out[1], their sizes to out[2]; return a status."""
        status = on.counter(0)

        def each_store(it: Stores) -> None:
            n, first = it.dims[0], self.head[5]

            def read(j: Integer) -> None:
                self.x[j] = s[first + it.state + j]

            on.loop(n, read)
            self.failed(on, status, self._call(on, it, n * n, self.work), it.component)
            count(self.f[n * n])

        def count(energy: Real) -> None:
            out[1], out[2] = out[1] + energy, out[2] + on.absolute(energy)

        self.stores(on, each_store)
        on.loop(self.outer.size, lambda k: count(self.outer[k] * s[self.head[5] + k]))
        return status.value

    def failed(self, on: Evaluator, status: Any, found: Integer, component: Integer) -> None:
        def blame() -> None:
            status.value = found
            self.fault[0] = component

        on.when(on.both(on.same(status.value, 0), on.negate(on.same(found, 0))), blame)

    def flows(self, on: Evaluator, q: Vector, s: Vector, made: Vector) -> Integer:
        """Write flows at the efforts that are there, entropies that components make, and heat; return a status."""
        status, size, around = on.counter(0), self.effort.size, self.scal[1]
        self.power[2] = 0.0
        self._across(on, self.effort, self.flow)

        def inject(k: Integer) -> None:
            flow, row = self.given[self.head[2] + k], self.row.size // ROW - size + k
            self.gross[k] = self._sum(on, row, self.effort, sizes=True) + on.absolute(flow)
            self.flow[k] = self.flow[k] - flow

        def each_component(it: Called) -> None:
            efforts, width = it.dims[0], it.dims[0] + it.dims[1] + it.dims[2]
            rows, kept = it.dims[0] + it.dims[1], self.kept.part(it.kept, self.kept.size - it.kept)

            def gather(j: Integer) -> None:
                self.e[j] = self._sum(on, it.entry + j, self.effort)

            def read(j: Integer) -> None:
                at = self.read[it.read + j]
                on.when(at >= 0, lambda: write_entry(self.x, j, s[at]), lambda: write_entry(self.x, j, q[-1 - at]))

            on.loop(rows, gather)
            on.loop(it.dims[3], read)
            found = self._call(on, it, efforts, kept)

            def scatter(j: Integer) -> None:
                row = it.entry + j
                self._spread(on, row, self.f[j], self.flow)
                on.when(self.head[4] > 0, lambda: self._measure(on, row, self.f[j], kept.part(j * width, rows)))
                place, booked = self.row[ROW * row + 2], self.row[ROW * row + 3]
                on.when(place >= 0, lambda: write_entry(made, place, -self.f[j]))
                passes = on.both(place >= 0, on.same(booked, 0))
                on.when(passes, lambda: write_entry(self.power, 2, self.power[2] - (self.e[j] + around) * self.f[j]))

            on.loop(rows, scatter)
            self.failed(on, status, found, it.component)

        on.loop(size, inject)
        self.each(on, each_component)
        return status.value

    def _measure(self, on: Evaluator, row: Integer, flow: Real, slopes: Vector) -> None:
        """Add the size of a flow to what balances are measured by."""
        total, first = on.variable(on.absolute(flow)), self.row[ROW * row]

        def term(k: Integer) -> None:
            total.value = total.value + on.absolute(slopes[k] * self.e[k])

        on.loop(slopes.size, term)

        def add(k: Integer) -> None:
            at = self.term[first + k]
            self.gross[at] = self.gross[at] + on.absolute(self.weight[first + k]) * total.value

        on.loop(self.row[ROW * row + 1], add)

    def tangent(self, on: Evaluator) -> None:
        """Write the changes of flows by those of efforts and of what is read."""
        self._across(on, self.turned, self.changed)

        def each_component(it: Called) -> None:
            rows, reads = it.dims[0] + it.dims[1], it.dims[2]
            width = rows + reads

            def gather(j: Integer) -> None:
                self.e[j] = self._sum(on, it.entry + j, self.turned)

            def row(j: Integer) -> None:
                total, first = on.variable(0.0), it.kept + j * width

                def by_effort(k: Integer) -> None:
                    total.value = total.value + self.kept[first + k] * self.e[k]

                def by_state(k: Integer) -> None:
                    total.value = total.value + 2.0 * self.kept[first + (rows + k)] * self.moved[it.vary + k]

                on.loop(rows, by_effort)
                on.loop(reads, by_state)
                self._spread(on, it.entry + j, total.value, self.changed)

            on.loop(rows, gather)
            on.loop(rows, row)

        self.each(on, each_component)


def write_entry(vector: Vector, k: Integer, value: Real) -> None:
    """Write a number to a place of a vector: what a lambda cannot."""
    vector[k] = value
