"""Charts of joints: elements and increments of the groups that a mechanism has."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

from ephs.semantics.spaces.staged_groups import STAGED
from ephs.semantics.stage import Evaluator, Integer, Record, Table, Vector, integer

TIE: Final = 100
"""Code of a joint that a gear ties to others."""


@final
@dataclass(frozen=True, slots=True, order=True)
class GroupKind:
    """A group, and how many numbers an element and an increment have; known while staging."""

    code: int
    size: int
    dim: int


class Chart(Record):
    """Places of a joint's element, increment, rates; ``cut`` is its number among the cut joints, −1 on the tree."""

    code = integer()
    dim = integer()
    q_at = integer()
    size = integer()
    v_at = integer()
    r_at = integer()
    cut = integer()


def visit_kind(
    on: Evaluator, kinds: tuple[GroupKind, ...], code: Integer, dim: Integer, body: Callable[[GroupKind], None]
) -> None:
    """Call body(kind) with the kind of a joint, which is then known."""

    def among(first: int) -> None:
        kind = kinds[first]
        if first == len(kinds) - 1:
            body(kind)
        else:
            same = on.both(on.same(code, kind.code), on.same(dim, kind.dim))
            on.when(same, lambda: body(kind), lambda: among(first + 1))

    if kinds:
        among(0)


def of_joints(kinds: tuple[GroupKind, ...]) -> tuple[GroupKind, ...]:
    """The kinds but for those of gears, which have no charts."""
    return tuple(kind for kind in kinds if kind.code != TIE)


def advance(
    on: Evaluator, kinds: tuple[GroupKind, ...], charts: Table[Chart], base: Vector, v: Vector, q: Vector
) -> None:
    """q = base·exp(v), joint by joint."""

    def each_chart(i: Integer) -> None:
        chart = charts[i]

        def with_kind(kind: GroupKind) -> None:
            element = [base[chart.q_at + k] for k in range(kind.size)]
            change = [v[chart.v_at + j] for j in range(kind.dim)]
            for k, x in enumerate(STAGED[kind.code].retract(on, element, change)):
                q[chart.q_at + k] = x

        visit_kind(on, of_joints(kinds), chart.code, chart.dim, with_kind)

    on.loop(charts.size, each_chart)
