"""A model's tables, order of elimination and scratch memory, as arrays and as records of programs."""

from dataclasses import dataclass, fields
from typing import Annotated, Any, Final, Generic, TypeAlias, TypeVar, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.numbering import Index, spans
from ephs.semantics.stage import Integer, Integers, Record, Vector, integer, matrix, vector
from ephs.semantics.stage.kinds import Kind, group
from ephs.semantics.stage.memory import HeldCells

DONE, DIVERGED, PIVOT, INCONSISTENT, COMPONENT = 0, 1, 2, 3, 10
"""Outcome of a step: COMPONENT + what a component's kernel returned, see `ephs.semantics.descriptor.kernel_table`."""

STORING, REVERSIBLE, IRREVERSIBLE, WORKING = 0, 1, 2, 3
"""Kinds of components; a working one is reversible at an instant and does work over a step."""

Whole = TypeVar("Whole")
Numbers = TypeVar("Numbers")
Rows = TypeVar("Rows")


@final
class Dims(Record):
    """Numbers of efforts and multipliers of a component, and of increments and state coordinates that it reads."""

    efforts = integer()
    multipliers = integer()
    increments = integer()
    numbers = integer()


@final
class StateRecord(Record):
    """A state: its group, its place and how many numbers it has, the place and number of its rates."""

    code = integer()
    at = integer()
    size = integer()
    rate = integer()
    dim = integer()


@final
class OuterPort(Record):
    """An outer port: place and number of its efforts, 1 where they are prescribed, then the place of its flows."""

    at = integer()
    dim = integer()
    prescribed = integer()
    unknown = integer()


@final
@dataclass(frozen=True, slots=True, eq=False)
class TablesOf(Generic[Whole, Numbers]):
    """The model as arrays. Unknowns: rates, efforts, multipliers, outer flows; rows in the same order.

    Attributes
    ----------
    counts
        Rates, efforts, multipliers, unknowns.
    kind, address
        Of each component, and where its kernel is.
    dims
        (components, 4): `Dims`.
    parameters, parameter_at
        Numbers of all components, and where each one's begin.
    e_index, e_at
        Effort of each local effort, in the same order as flows.
    multiplier_at
        First multiplier of each component.
    read_x, read_x_at, read_w, read_w_at
        Number of the states of each local x⁰; rate of each local v.
    jacobian, jacobian_at
        Place in the matrix' entries of each entry of a component's Jacobian, −1 where it is structurally zero.
    states
        (states, 5): `StateRecord`.
    intensive, entropy
        (efforts,): what turns an exergetic effort into the energy effort; 1 on entropy.
    row, column, template
        Of each entry of the matrix; what of it is constant. The last entries, one a row, hold what the loop adds.
    constraining, balancing
        Entries at efforts in the equations after the balances, and in the balances.
    block, group
        (rows,): residuals are measured block by block; (blocks,): blocks of one kind, whose scales do not differ
        beyond reason.
    outer, input_at
        (outer ports, 4): `OuterPort`; where inputs begin.
    """

    counts: Whole
    kind: Whole
    address: Whole
    dims: Whole
    parameters: Numbers
    parameter_at: Whole
    e_index: Whole
    e_at: Whole
    multiplier_at: Whole
    read_x: Whole
    read_x_at: Whole
    read_w: Whole
    read_w_at: Whole
    jacobian: Whole
    jacobian_at: Whole
    states: Whole
    intensive: Numbers
    entropy: Numbers
    row: Whole
    column: Whole
    template: Numbers
    constraining: Whole
    balancing: Whole
    block: Whole
    group: Whole
    outer: Whole
    input_at: Whole


@final
@dataclass(frozen=True, slots=True, eq=False)
class OrderOf(Generic[Whole, Numbers]):
    """`ephs.solve.equations.sparse.Elimination` as arrays, and which constraint rows are left out.

    Attributes
    ----------
    dropped
        (rows,): 1 where the equation is replaced by "this multiplier is zero".
    floor
        (rows,): the least |pivot|/|largest of its row| that this order accepts.
    tolerance
        (1,): the relative residual that dropped equations may keep.
    """

    rows: Whole
    columns: Whole
    start: Whole
    entry: Whole
    diagonal: Whole
    place: Whole
    dropped: Whole
    floor: Numbers
    tolerance: Numbers


@final
@dataclass(frozen=True, slots=True, eq=False)
class MemoryOf(Generic[Numbers]):
    """All scratch memory of the loop, allocated once.

    Attributes
    ----------
    e, lam, v, x, f, c, jac, work
        Arguments of components.
    data, factors, residual, scale, step, dense, pivot
        Entries of the matrix and of its factors, and vectors of a number for each row.
    block, group
        Scales.
    flows, energy
        Of all ports, and of each component.
    defect
        (2,): largest relative residual of a dropped equation, and the least of the largest scales of a step.
    """

    e: Numbers
    lam: Numbers
    v: Numbers
    x: Numbers
    f: Numbers
    c: Numbers
    jac: Numbers
    work: Numbers
    data: Numbers
    factors: Numbers
    residual: Numbers
    scale: Numbers
    block: Numbers
    group: Numbers
    step: Numbers
    dense: Numbers
    flows: Numbers
    energy: Numbers
    defect: Numbers
    pivot: Numbers


Tables: TypeAlias = TablesOf[Index, Array]
Order: TypeAlias = OrderOf[Index, Array]
Memory: TypeAlias = MemoryOf[Array]


def efforts_of(t: Tables, components: Index | slice) -> Index:
    """Efforts at the ports of some components, one after the other."""
    return t.e_index[spans(t.e_at[components], t.dims[components, 0])]


def rates_of(t: Tables, components: Index | slice) -> Index:
    """Rates of the states that some components read, one after the other."""
    return t.read_w[spans(t.read_w_at[components], t.dims[components, 2])]


def flat() -> Kind:
    """An argument that is an array of integers of any shape, seen as one row."""

    def split(value: Any, _trail: object) -> tuple[Any, ...] | None:
        fits = isinstance(value, np.ndarray) and value.dtype == np.int64 and value.flags.c_contiguous
        return (value, value.size) if fits else None

    return Kind(
        "a contiguous array of int64", ("integers", "integer"), split, lambda parts: Integers(parts[0], 0, parts[1])
    )


def kind_of(cls: Any) -> Kind:
    """The kind of argument that is all the arrays of a class, by the variables of their types."""
    kinds: dict[Any, Any] = {Whole: flat, Numbers: vector, Rows: matrix}
    return group(cls, **{field.name: kinds[field.type]() for field in fields(cls)})


Columns: TypeAlias = Annotated[TablesOf[Integers, Vector], kind_of(TablesOf)]
Elimination: TypeAlias = Annotated[OrderOf[Integers, Vector], kind_of(OrderOf)]
Scratch: TypeAlias = Annotated[MemoryOf[Vector], kind_of(MemoryOf)]

Row = TypeVar("Row", bound=Record)
_NO_REALS: Final[HeldCells[Any]] = HeldCells([])


def row_of(record: type[Row], integers: Integers, i: Integer) -> Row:
    """Row i of a table of integers as a record."""
    return record(integers.cells, integers.start + i * record.integer_width, _NO_REALS, 0)
