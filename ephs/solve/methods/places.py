"""Places of a component in the tables, and operations on vectors by place."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from ephs.semantics.stage import Evaluator, Integer, Integers, Real, Vector
from ephs.solve.methods.records import Columns, Dims, OuterPort, Row, row_of


def raise_to(on: Evaluator, out: Vector, i: Integer, value: Real) -> None:
    """The larger of an entry and a number."""
    out[i] = on.maximum(out[i], value)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A component in the tables: numbers of its efforts, multipliers and increments, and their first indices."""

    t: Columns
    i: Integer
    n: Integer
    k: Integer
    m: Integer
    e_at: Integer
    w_at: Integer
    j_at: Integer
    first: Integer

    @staticmethod
    def of(t: Columns, i: Integer) -> "Part":
        """The component of a number."""
        dims = row_of(Dims, t.dims, i)
        first = t.counts[0] + t.counts[1] + t.multiplier_at[i]
        return Part(
            t, i, dims.efforts, dims.multipliers, dims.increments, t.e_at[i], t.read_w_at[i], t.jacobian_at[i], first
        )

    def effort(self, j: Integer) -> Integer:
        """The effort of a port."""
        return self.t.e_index[self.e_at + j]

    def balance(self, j: Integer) -> Integer:
        """The unknown that is this effort, and the equation that is the balance there."""
        return self.t.counts[0] + self.effort(j)

    def rate(self, j: Integer) -> Integer:
        """The rate of a state."""
        return self.t.read_w[self.w_at + j]


def each_component(on: Evaluator, t: Columns, kind: int, body: Callable[[Part], None]) -> None:
    """Do something for each component of a kind."""

    def component(i: Integer) -> None:
        on.when(on.same(t.kind[i], kind), lambda: body(Part.of(t, i)))

    on.loop(t.kind.size, component)


def each_row(on: Evaluator, record: type[Row], integers: Integers, body: Callable[[Row, Integer], None]) -> None:
    """Do something for each row of a table of integers, and its number."""
    on.loop(integers.size // record.integer_width, lambda k: body(row_of(record, integers, k), k))


def each_input(on: Evaluator, t: Columns, body: Callable[[OuterPort, Integer, Integer], None]) -> None:
    """Do something for each freedom of the outer ports: its port, its number there, and that of its input."""

    def port(i: Integer) -> None:
        outer, first = row_of(OuterPort, t.outer, i), t.input_at[i]
        on.loop(outer.dim, lambda j: body(outer, j, first + j))

    on.loop(t.input_at.size, port)
