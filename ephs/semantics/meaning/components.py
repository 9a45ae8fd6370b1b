"""Relations of components: what a primitive says of the variables at its ports, at an instant."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from ephs.operad import ROOT, Path, Quantity
from ephs.semantics.bundles.bundle import Array, Bundle
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.bundles.given import defined
from ephs.semantics.meaning.base import BasePoint
from ephs.semantics.meaning.fields import Field, Row
from ephs.semantics.meaning.linear import LinearRelation
from ephs.semantics.meaning.variables import ONE, RelationVariable, at_port, own
from ephs.semantics.primitives.primitives import Primitive, Reversible, Storage

TURNING = {"se(3)": 3, "so(3)xr3": 3, "free": 3, "cylindrical": 1, "planar": 1}
"""Number of angular coordinates, which come first, by lower-case name of the space; the others are lengths."""


def at_ports(kind: str, bundle: Bundle) -> list[RelationVariable]:
    """The variables of the power ports in the order of the fibre."""
    return [variable for port, _, quantity in bundle.items() for variable in at_port("outer", kind, port, quantity)]


def at_instant(primitive: Primitive, path: Path, point: BasePoint) -> LinearRelation:
    """The relation of the component at this path of the whole system, over a point of the base.

    A storage: rate = f, e = dH(x). Others: f = A e + Cᵀ λ, 0 = C e, with λ inside.

    Raises
    ------
    SemanticsError
        The numbers are to be exact, and the component's are not constant.
    """
    field, bundle = point.field, primitive.bundle
    flows, efforts = at_ports("flow", bundle), at_ports("effort", bundle)
    if isinstance(primitive, Storage):
        return _storage(primitive, path, point)
    if isinstance(primitive, Reversible):
        if primitive.reads and field.decides:
            raise SemanticsError("not-constant", path, found=", ".join(map(str, primitive.reads)))
        dynamic, constraint = primitive.structure(point.read(path, primitive))
        return process(field, bundle, dynamic, constraint)
    if not point.processes:
        return LinearRelation.of(field, [*flows, *efforts])
    if field.decides:
        raise SemanticsError("not-constant", path, found="efforts")
    e = point.efforts.get(path, np.zeros(bundle.size))
    primitive.require_temperature(e, point.reference)
    matrix = primitive.matrix(point.read(path, primitive), e, point.reference) / point.reference.temperature
    return process(field, bundle, matrix, np.zeros((0, bundle.size)))


def _storage(storage: Storage, path: Path, point: BasePoint) -> LinearRelation:
    field, bundle = point.field, storage.bundle
    flows, efforts = at_ports("flow", bundle), at_ports("effort", bundle)
    rates = rates_of(storage, path, point.names)
    rows = [field.exact({rate: 1.0, flow: -1.0}) for rate, flow in zip(rates, flows, strict=True)]
    if not point.storages:
        known = efforts_of(storage, path)
        rows += [field.exact({effort: 1.0, value: -1.0}) for effort, value in zip(efforts, known, strict=True)]
        return LinearRelation.of(field, [*rates, *flows, *efforts, *known], rows)
    x = point.read(path, storage)
    values = defined(str(path), "the effort", storage.effort(x, point.reference), x)
    for effort, value, size in zip(efforts, values.tolist(), largest(bundle, values).tolist(), strict=True):
        rows.append(field.exact({effort: 1.0}) | field.rounded({ONE: -value}, {ONE: size}))
    return LinearRelation.of(field, [*rates, *flows, *efforts, ONE], rows)


def rates_of(storage: Storage, path: Path, names: Mapping[Path, Path]) -> list[RelationVariable]:
    """Rates of the states of the storage at this path, by the names of states: storages of one state share its rate."""
    items = storage.bundle.items()
    return [v for port, _, quantity in items for v in own("rate", names[path / port], quantity.space.dim)]


def efforts_of(primitive: Primitive, path: Path) -> list[RelationVariable]:
    """Efforts of the component at this path, named for good."""
    return [v for port, _, quantity in primitive.bundle.items() for v in own("effort", path / port, quantity.space.dim)]


def process(field: Field[Any], bundle: Bundle, dynamic: Array, constraint: Array) -> LinearRelation:
    """f = A e + Cᵀ λ, 0 = C e; numbers are rounded beside the largest of the same units."""
    flows, efforts = at_ports("flow", bundle), at_ports("effort", bundle)
    multipliers = [RelationVariable("met", "multiplier", ROOT, ROOT, i) for i in range(constraint.shape[0])]
    sizes, beside = largest(bundle, largest(bundle, dynamic).T).T, largest(bundle, constraint.T).T
    rows: list[Row[Any]] = []
    transposed, around = constraint.T.tolist(), beside.T.tolist()
    for i, (entries, size) in enumerate(zip(dynamic.tolist(), sizes.tolist(), strict=True)):
        row = field.exact({flows[i]: -1.0}) | _rounded(field, efforts, entries, size)
        rows.append(row | _rounded(field, multipliers, transposed[i], around[i]))
    for entries, size in zip(constraint.tolist(), beside.tolist(), strict=True):
        rows.append(_rounded(field, efforts, entries, size))
    return LinearRelation.of(field, [*flows, *efforts, *multipliers], rows)


def constant_relation(field: Field[Any], bundle: Bundle, dynamic: Array, constraint: Array) -> LinearRelation:
    """The relation of f = A e + Cᵀ λ, 0 = C e in f and e alone."""
    found = process(field, bundle, dynamic, constraint)
    return found.onto(variable for variable in found.variables if variable.role == "outer")


def _rounded(field: Field[Any], names: list[RelationVariable], entries: list[float], sizes: list[float]) -> Row[Any]:
    return field.rounded(dict(zip(names, entries, strict=True)), dict(zip(names, sizes, strict=True)))


def largest(bundle: Bundle, numbers: Array) -> Array:
    """The largest number of rows of the same units in place of each, (n,) or (n, k)."""
    kinds, count = _units(bundle)
    out = np.zeros((count, *numbers.shape[1:]))
    np.maximum.at(out, kinds, np.abs(numbers))
    return out[kinds]


@lru_cache(maxsize=1024)
def _units(bundle: Bundle) -> tuple[Any, int]:
    """Number of its unit for each coordinate of the fibre, and how many there are."""
    words = [word for _, _, quantity in bundle.items() for word in _words(quantity)]
    known = {word: number for number, word in enumerate(dict.fromkeys(words))}
    return np.array([known[word] for word in words], dtype=int), len(known)


def _words(quantity: Quantity) -> list[tuple[str, bool]]:
    """Unit and kind of each coordinate; angles and lengths of one quantity differ in unit."""
    turning = TURNING.get(quantity.space.name.rstrip("*").lower(), 0)
    return [(quantity.unit, i < turning) for i in range(quantity.space.dim)]
