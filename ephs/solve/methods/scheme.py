"""Gauss collocation: its coefficients, and tables and memory of its stages."""

from dataclasses import dataclass
from functools import cache
from typing import Annotated, Generic, TypeAlias, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.numbering import Index
from ephs.semantics.stage import Integers, Matrix, Record, Vector, integer
from ephs.solve.methods.collocation import moments, values
from ephs.solve.methods.records import Numbers, Rows, Whole, kind_of


@final
@dataclass(frozen=True, slots=True)
class Scheme:
    """Coefficients of a number of stages, as programs are written with them.

    Attributes
    ----------
    nodes, b
        (stages,): times of the stages in parts of a step, and their weights.
    a
        (stages, stages): weights of the rates for the increments to the stages.
    ahead
        (stages, stages): a polynomial through the stages, continued into the next step.
    """

    nodes: tuple[float, ...]
    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    ahead: tuple[tuple[float, ...], ...]

    @property
    def stages(self) -> int:
        """Number of stages."""
        return len(self.b)

    @property
    def single(self) -> bool:
        """Whether there is one stage only: then the relations over the step are all there are."""
        return len(self.b) == 1


@cache
def gauss(stages: int) -> Scheme:
    """Gauss collocation with a number of stages."""
    nodes = 0.5 * (1.0 + np.polynomial.legendre.leggauss(stages)[0])

    def rows(weights: Array) -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(row) for row in weights.tolist())

    return Scheme(
        tuple(nodes.tolist()), rows(np.array([moments(nodes, c) for c in nodes])), tuple(moments(nodes, 1.0).tolist()),
        rows(np.array([values(nodes, 1.0 + c) for c in nodes])),
    )  # fmt: skip


@final
class Velocity(Record):
    """Efforts that are a velocity on a group, of a component whose relation holds on the group over a step."""

    component = integer()
    code = integer()
    effort = integer()
    dim = integer()


@final
class Node(Record):
    """A storage of entropy alone: component, rate, effort among the unknowns; place of ∂θ/∂s in a stage's entries."""

    component = integer()
    rate = integer()
    effort = integer()
    slope = integer()


@final
class StageEntry(Record):
    """An entry of the system of all stages: stages of its row and column, entry of the model's matrix.

    Its source is −1 − row where it holds the place of a row.
    """

    row = integer()
    column = integer()
    source = integer()


@final
@dataclass(frozen=True, slots=True, eq=False)
class GroupsOf(Generic[Whole, Numbers]):
    """Data of the model that several stages use; of one stage all but ``where`` is empty.

    Attributes
    ----------
    velocity, metric
        (groups, 4): `Velocity`; (groups, 36): in which its component measures it, the identity but where its frame is
        another.
    node, entry
        (nodes, 4): `Node`; (nodes, stages²): its places in the system of all stages.
    where
        (entries, 3): `StageEntry`.
    """

    velocity: Whole
    metric: Numbers
    node: Whole
    entry: Whole
    where: Whole


@final
@dataclass(frozen=True, slots=True, eq=False)
class StagesOf(Generic[Numbers, Rows]):
    """Scratch memory of several stages, and of the step as a whole; of one stage all but data and slope is empty.

    Attributes
    ----------
    x, v
        (stages, …): states, and increments from the step's start.
    turn, outer
        (stages, 8): velocities in the coordinates of the increments; increments of one group.
    whole, mean
        (rates,): increment over the step; (unknowns,): that over h, and the efforts' exponents over h.
    gradient
        (rates,): discrete gradients over the step.
    share, factor, end
        (nodes, stages): derivatives of the factors α; the factors; temperatures at the end.
    gap
        (unknowns,): what the relations over the step miss, in the constraints' rows.
    energy
        (components,).
    residual, scale, data, slope
        (stages, …): residuals and their scales; entries of ∂g/∂z, and of ∂g/∂x in the rates' columns.
    matrix, change, dense, pivot
        Entries of the system of all stages, and vectors of a number for each of its rows.
    one
        (8,): the increment of one group over the step.
    """

    x: Rows
    v: Rows
    turn: Rows
    outer: Rows
    whole: Numbers
    mean: Numbers
    gradient: Numbers
    share: Rows
    factor: Numbers
    end: Numbers
    gap: Numbers
    energy: Numbers
    residual: Rows
    scale: Rows
    data: Rows
    slope: Rows
    matrix: Numbers
    change: Numbers
    dense: Numbers
    pivot: Numbers
    one: Numbers


Groups: TypeAlias = GroupsOf[Index, Array]
Stages: TypeAlias = StagesOf[Array, Array]
GroupColumns: TypeAlias = Annotated[GroupsOf[Integers, Vector], kind_of(GroupsOf)]
StageScratch: TypeAlias = Annotated[StagesOf[Vector, Matrix], kind_of(StagesOf)]
