"""Whether a motion exists, and whether there is one: read off the relation of a system.

Flows of irreversible components stay open, since their matrices M(x, e) are not known before the efforts: what
contradicts without them has no motion whatever they do. The efforts of storages stay open, too, where the *hidden
equations* are asked for: what the relation says of these efforts alone is a condition on states, which every motion
keeps, so that its derivative in time holds of the rates.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeAlias, final

from ephs.operad import Path
from ephs.semantics.descriptor.curvature import curvature
from ephs.semantics.meaning.base import BasePoint
from ephs.semantics.meaning.components import efforts_of, largest, rates_of
from ephs.semantics.meaning.elimination import eliminated
from ephs.semantics.meaning.fields import ROUNDED, Row
from ephs.semantics.meaning.linear import LinearRelation
from ephs.semantics.meaning.variables import ONE, RelationVariable
from ephs.semantics.primitives.primitives import Primitive, Storage
from ephs.semantics.spaces.rank import DIFFERENCE

Labelled: TypeAlias = "tuple[str, Path, Row[Any]]"
"""Origin of an equation (``flow`` or ``effort`` of a junction, or ``component``), its path, and the row."""
WORDS: Mapping[str, str] = {
    "flow": "flow balance of junction",
    "effort": "one effort at junction",
    "component": "component",
}


class Fibre(Protocol):
    """Linear relation over a point of the base."""

    def leaves(self) -> Iterator[tuple[Path, Primitive]]:
        """The primitives with their full paths."""
        ...

    def at(self, path: Path, point: BasePoint) -> LinearRelation:
        """The relation over a point, for the part at this path of the point's system."""
        ...

    def labelled(self, path: Path, point: BasePoint) -> Iterator[Labelled]:
        """The equations that are joined, each with what it is of; nothing is forgotten."""
        ...


@final
@dataclass(frozen=True, slots=True)
class Answer:
    """Yes or no, with what says so."""

    holds: bool
    because: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return self.holds

    def __str__(self) -> str:
        return ("yes" if self.holds else "no") + "".join(f"; {reason}" for reason in self.because)


def possible(fibre: Fibre, point: BasePoint) -> Answer:
    """Whether the relation over a point is empty, with the equations whose weighted sum is 1 = 0."""
    free = replace(point, processes=False)
    if not fibre.at(Path(), free).empty:
        return Answer(False)
    return Answer(True, _certificate(fibre, free))


def _certificate(fibre: Fibre, point: BasePoint) -> tuple[str, ...]:
    """Labels of equations that add up to 1 = 0, each with its weight; each equation has a variable for its label."""
    field, labels = point.field, dict[RelationVariable, str]()
    rows: list[Row[Any]] = []
    for number, (kind, path, row) in enumerate(fibre.labelled(Path(), point)):
        label = RelationVariable("own", "label", path, path, number)
        labels[label] = f"{WORDS[kind]} {path}"
        rows.append(row | {label: field.one})
    left = eliminated(field, rows, lambda variable: variable not in labels and variable != ONE)
    chosen = min((row for row in left if ONE in field.support(row)), key=len, default=None)
    if chosen is None:  # by this order of eliminations it is within rounding
        return ("equations that contradict each other by little more than rounding",)
    weights: dict[str, float] = {}
    for variable, number in chosen.items():
        if variable != ONE:
            share = -field.value(number) / field.value(chosen[ONE])
            weights[labels[variable]] = weights.get(labels[variable], 0.0) + share
    return tuple(f"{words} × {weight:.6g}" for words, weight in sorted(weights.items()))


def hidden(fibre: Fibre, point: BasePoint) -> LinearRelation:
    """What every motion satisfies: equations between the efforts of storages alone."""
    found = fibre.at(Path(), replace(point, storages=False, processes=False))
    return found.onto(v for v in found.variables if v.role == "own" and v.kind == "effort")


def determined(fibre: Fibre, point: BasePoint) -> Answer:
    """Whether outer flows, or outer efforts, determine all rates: two motions of the same ones differ by nothing.

    Differences satisfy the equations without their constants, and H″ of them those of the hidden equations, which last.
    """
    flows = _determined(fibre, point, "flow")
    return flows if flows or not _determined(fibre, point, "effort") else Answer(True)


def _determined(fibre: Fibre, point: BasePoint, given: str) -> Answer:
    """The same where one kind of variables is given at all outer ports."""
    found = fibre.at(Path(), replace(point, storages=False))
    zero = {v for v in found.variables if (v.kind, v.role) in (("effort", "own"), (given, "outer"))}
    rows = [{v: number for v, number in row.items() if v not in zero} for row in found.equations]
    whole = LinearRelation.of(point.field, found.variables - zero, rows).join(_lasting(fibre, point))
    known = whole.determined()
    free = sorted({v.path for v in whole.variables if v.kind == "rate" and v not in known})
    if not free:
        return Answer(True)
    loose = sorted({v.path for v in whole.variables if v.kind == "effort" and v not in known})
    reasons = [f"the rate of {path} is arbitrary" for path in free]
    reasons += [f"the effort of port {path} is arbitrary" for path in loose]
    return Answer(False, tuple(reasons))


def _lasting(fibre: Fibre, point: BasePoint) -> LinearRelation:
    """Hidden equations a·e = 0 last: two rates that both keep them differ by v with a·H″ v = 0."""
    equations = hidden(fibre, point).equations
    asked = {effort for equation in equations for effort in equation}
    slopes: dict[RelationVariable, Row[Any]] = {}
    for path, storage in fibre.leaves() if asked else ():
        if isinstance(storage, Storage) and not asked.isdisjoint(efforts_of(storage, path)):
            slopes |= _slopes(storage, path, point)
    rows: list[Row[Any]] = []
    for equation in equations:
        row: Row[Any] = {}
        for effort, number in equation.items():
            point.field.subtract(row, number, slopes[effort])
        rows.append(row)
    return LinearRelation.among(point.field, rows)


def _slopes(storage: Storage, path: Path, point: BasePoint) -> dict[RelationVariable, Row[Any]]:
    """H″ by rows: of each effort at a storage's ports, minus its change with the rates of the states."""
    rates, efforts = rates_of(storage, path, point.names), efforts_of(storage, path)
    hessian = curvature(storage, point.read(path, storage))
    beside = (DIFFERENCE if storage.kernel is None else ROUNDED) * largest(
        storage.bundle, largest(storage.bundle, hessian).T
    ).T
    return {
        name: {
            rate: point.field.number(-entry, bound)
            for rate, entry, bound in zip(rates, row, bounds, strict=True)
            if bound
        }
        for name, row, bounds in zip(efforts, hessian.tolist(), beside.tolist(), strict=True)
    }
