"""What acts on a mechanism to first order about a point: components and attachments, evaluated there once.

Forces of the point, and by how much they change with places, rates and temperatures. About the point that is exact to
first order, which is all that equations over dual numbers need there.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Final, final

import numpy as np

from ephs.mechanics.tree.sweeps.acting import Work
from ephs.mechanics.tree.sweeps.balances import slopes_of
from ephs.mechanics.tree.sweeps.network import Net, write_entry
from ephs.semantics.descriptor.numbering import starts
from ephs.semantics.linear.dense import copy
from ephs.semantics.stage import (
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Real,
    Vector,
    members,
)
from ephs.solve.equations.sparse import Index

MOST: Final = 24
"""Increments of one component's state at most: those of four relative poses."""


@final
@dataclass(frozen=True, slots=True)
class Expansion:
    """A component at a point.

    Attributes
    ----------
    state, effort
        The point: x, and the efforts of what is no storage.
    value
        Flows there; of a storage efforts.
    slope
        Their derivatives, row by row: by efforts, then by the state, left-trivialised; of a storage by the latter.
    energy
        (1,) of a storage, in J.
    """

    state: Vector
    effort: Vector
    value: Vector
    slope: Vector
    energy: Vector

    @staticmethod
    def size(dims: Index) -> Index:
        """(components,) numbers of the expansions of components with dimensions (components, 4)."""
        n, _, rates, states = dims.T
        return states + 2 * n + n * (n + rates) + 1


@final
@dataclass(frozen=True, slots=True)
class About:
    """A point at which what acts has been evaluated, and changes of it.

    Attributes
    ----------
    expansion, begin
        Of all components, and where that of each one begins.
    met, flow, slope
        Of what is attached: (known + read,) rates, temperatures, prescribed efforts, states, and zeros for degrees of
        freedom of joints that it reads; (known,) flows by the first; their derivatives.
    increment
        Increments of all joints from the point.
    local, off, changed
        Memory: increments of a component's state, of ``met``; flows.
    """

    expansion: Vector
    begin: Integers
    met: Vector
    flow: Vector
    slope: Matrix
    increment: Vector
    local: Annotated[Vector, MOST]
    off: Vector
    changed: Vector

    # ---- components --------------------------------------------------------------------------------------------

    def expanded(self, number: Integer, dims: Integers) -> Expansion:
        """The expansion of a component with these dimensions."""
        n, rates, states = dims[0], dims[2], dims[3]
        sizes: list[Integer] = [states, n, n, n * (n + rates), 1]
        at: Integer = self.begin[number]
        parts: list[Vector] = []
        for size in sizes:
            parts.append(Vector(self.expansion.cells, self.expansion.start + at, size))
            at = at + size
        return Expansion(*parts)

    def keep(self, on: Evaluator, number: Integer, dims: Integers, work: Work, stored: bool) -> None:
        """Keep a component that was evaluated in the memory."""
        n, rates, one = dims[0], dims[2], self.expanded(number, dims)
        value, slope = one.value, one.slope
        copy(on, work.x.part(0, dims[3]), one.state)
        if stored:
            copy(on, work.e.part(0, n), value)
            on.loop(n * n, lambda k: write_entry(slope, k, 2.0 * work.f[k]))
            one.energy[0] = work.c[0]
            return
        width = n + rates
        copy(on, work.e.part(0, n), one.effort)
        copy(on, work.f.part(0, n), value)

        def row(j: Integer) -> None:
            at = width * j
            on.loop(n, lambda k: write_entry(slope, at + k, work.jac[at + k]))
            on.loop(rates, lambda k: write_entry(slope, at + (n + k), 2.0 * work.jac[at + (n + k)]))

        on.loop(n, row)

    def store(self, on: Evaluator, number: Integer, dims: Integers, work: Work) -> None:
        """Write the efforts of a storage to the memory, and its energy at the point."""
        n, one = dims[0], self.expanded(number, dims)
        value, slope = one.value, one.slope

        def effort(j: Integer) -> None:
            work.e[j] = value[j] + _along(on, slope.part(n * j, n), self.local)

        on.loop(n, effort)
        work.c[0] = one.energy[0]

    def relate(self, on: Evaluator, number: Integer, dims: Integers, work: Work, moving: Integer) -> None:
        """Write the flows of a component to the memory, whose state's first increments move so many."""
        n, one = dims[0], self.expanded(number, dims)
        width, value, slope, off = n + dims[2], one.value, one.slope, on.scratch(1 + MOST)
        on.loop(n, lambda k: write_entry(off, k, work.e[k] - one.effort[k]))

        def flow(j: Integer) -> None:
            by_effort = _along(on, slope.part(width * j, n), off)
            work.f[j] = value[j] + (by_effort + _along(on, slope.part(width * j + n, moving), self.local))

        on.loop(n, flow)

    # ---- what is attached --------------------------------------------------------------------------------------

    def attach(self, on: Evaluator, net: Net, rate: Callable[[Integer], Real], work: Work) -> Integer:
        """Keep a network that was evaluated, whose first efforts are rates, and its derivatives; return a status."""
        self._depend(on, net, rate, work, lambda k, value: write_entry(self.met, k, value))
        copy(on, net.flow.part(0, net.known), self.flow)
        return slopes_of(on, net, self.slope)

    def flows(self, on: Evaluator, net: Net, rate: Callable[[Integer], Real], work: Work) -> Vector:
        """Flows of the network."""
        self._depend(on, net, rate, work, lambda k, value: write_entry(self.off, k, value - self.met[k]))

        def each_entry(k: Integer) -> None:
            self.changed[k] = self.flow[k] + _along(on, self.slope.row(k), self.off)

        on.loop(self.flow.size, each_entry)
        return self.changed

    def _depend(
        self, on: Evaluator, net: Net, rate: Callable[[Integer], Real], work: Work, put: Callable[[Integer, Real], None]
    ) -> None:
        """Call put(k, value) with all that flows depend on."""
        head = net.head
        on.loop(head[0], lambda k: put(k, rate(k)))
        on.loop(head[1], lambda k: put(head[0] + k, work.temperature[net.temperature[k]]))
        on.loop(head[2], lambda k: put(head[0] + (head[1] + k), net.given[k]))
        on.loop(head[3], lambda k: put(net.first_state + k, work.entropy[head[5] + k]))
        on.loop(net.bent.size, lambda k: put(net.known + k, self.increment[net.bent[k]]))


def memory_about(dims: Index, known: int, bent: int) -> dict[str, Any]:
    """Memory of a point by the names of `About`, but for increments.

    Parameters
    ----------
    dims
        (components, 4) dimensions of those that are evaluated, zeros of others.
    known, bent
        Numbers of known efforts of the attached network, and of degrees of freedom that it reads.
    """
    size = Expansion.size(dims)
    shapes = {
        "expansion": (int(size.sum()),), "met": (known + bent,), "flow": (known,), "slope": (known, known + bent),
        "local": (MOST,), "off": (known + bent,), "changed": (known,),
    }  # fmt: skip
    return {"begin": starts(size), **{name: np.zeros(shape) for name, shape in shapes.items()}}


def _along(on: Evaluator, row: Vector, by: Vector) -> Real:
    total = on.variable(0.0)

    def add(k: Integer) -> None:
        total.value = total.value + row[k] * by[k]

    on.loop(row.size, add)
    return total.value


ABOUT: Final = members(About)
