"""Strategies for elements of the algebras that the package ships, by interface."""

from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any, TypeAlias

from hypothesis import strategies as st

from ephs.operad import Algebra, Interface, Path, Quantity, Space, quantity
from ephs.semantics.algebra import (
    Conductors,
    Corelation,
    Cost,
    ExactRelation,
    Sharer,
    Units,
    corelations,
    cost,
    exact_relations,
    intervals,
    relations,
    resource_sharers,
    systems,
    units,
)
from ephs.semantics.systems.system import Filling
from ephs.testing.primitives import irreversibles, reversibles, storages

Elements: TypeAlias = Callable[[Interface], st.SearchStrategy[Any]]
"""Interface -> elements of it."""
LEVEL = Quantity("level", Space("real", 1, 1), 1)
FEW: st.SearchStrategy[Quantity] = st.sampled_from(
    [LEVEL, LEVEL, LEVEL.in_frame("B"), quantity.joint_momentum("cylindrical")]
)
"""So few quantities that many junctions can be linked: of dimensions 1 and 2, with and without frame."""
SMALL = st.integers(-2, 2)


@st.composite
def _corelations(draw: st.DrawFn, interface: Interface) -> Corelation:
    return Corelation.of(interface, _alike(draw, interface))


def _alike(draw: st.DrawFn, interface: Interface) -> list[list[Path]]:
    """Groups of ports of one quantity, in one frame."""
    kinds: dict[Quantity, list[Path]] = {}
    for port, of in interface.items():
        kinds.setdefault(of.quantity, []).append(port)
    return [
        draw(st.lists(st.sampled_from(ports), min_size=2, unique=True))
        for ports in kinds.values()
        if len(ports) > 1 and draw(st.booleans())
    ]


@st.composite
def _units(draw: st.DrawFn, interface: Interface) -> Units:
    if not interface:
        return Units.of(interface)
    powers = st.dictionaries(st.sampled_from(sorted(interface)), SMALL, max_size=3)
    unit = st.dictionaries(st.sampled_from(["kg", "m"]), SMALL, max_size=1)
    return Units.of(interface, draw(st.lists(st.tuples(powers, unit), max_size=2)))


@st.composite
def _costs(draw: st.DrawFn, interface: Interface) -> Cost:
    power = sorted(port for port, of in interface.items() if of.power)
    carried = draw(st.sets(st.sampled_from(power))) if power else set[Path]()
    count = st.integers(0, 5)
    return Cost(interface, frozenset(carried), draw(count), draw(count), draw(count))


@st.composite
def _conductors(draw: st.DrawFn, interface: Interface) -> Conductors:
    nodes = [port for port, of in sorted(interface.items()) if of.power and of.quantity.space.dim == 1]
    edges: list[tuple[Path, Path, Fraction, Fraction]] = []
    for k, one in enumerate(nodes[:4]):
        # few conductors, as exact fractions grow with each node that is eliminated
        other = draw(st.sampled_from([*nodes[k + 1 :], Path()]))
        low, width = draw(st.integers(0, 2)), draw(st.integers(0, 1))
        edges.append((one, other, Fraction(low), Fraction(low + width)))
    return Conductors.of(interface, edges)


@st.composite
def _exact(draw: st.DrawFn, interface: Interface) -> ExactRelation:
    state = Path(("x",))
    inner = {state: 1} if draw(st.booleans()) else {}
    known: list[Any] = [(kind, path, i) for path in inner for kind in ("state", "rate") for i in range(1)]
    for port, of in interface.items():
        if of.power:
            known += [(kind, port, i) for kind in ("flow", "effort") for i in range(of.quantity.space.dim)]
    known.append(("one", Path(), 0))
    row = st.dictionaries(st.sampled_from(known), SMALL, max_size=4)
    # an equation that is constant makes the relation empty: few are
    rows = [r for r in draw(st.lists(row, max_size=len(known))) if any(r[key] for key in r if key[0] != "one")]
    return ExactRelation.of(interface, rows, inner)


@st.composite
def _sharers(draw: st.DrawFn, interface: Interface) -> Sharer:
    names = {str(port): str(port) for port in interface}
    for group in _alike(draw, interface):
        names |= {str(port): str(group[0]) for port in group}
    hidden = {"hidden": 1} if draw(st.booleans()) else {}
    dims = hidden | {names[str(port)]: of.quantity.space.dim for port, of in interface.items()}
    places = [(name, i) for name, dim in dims.items() for i in range(dim)]
    terms: dict[tuple[str, int], list[tuple[int, list[tuple[str, int]]]]] = {}
    for place in places:
        factors = st.lists(st.sampled_from(places), max_size=2)
        terms[place] = draw(st.lists(st.tuples(SMALL, factors), min_size=1, max_size=2))

    def rates(values: Mapping[str, tuple[Any, ...]]) -> Mapping[str, tuple[Any, ...]]:
        def value(name: str, i: int) -> Any:
            total: Any = 0
            for scale, factors in terms[name, i]:
                term: Any = scale
                for other, k in factors:
                    term = term * values[other][k]
                total = total + term
            return total

        return {name: tuple(value(name, i) for i in range(dim)) for name, dim in dims.items()}

    return Sharer.of(interface, names, rates, hidden)


def _primitives(interface: Interface) -> st.SearchStrategy[Filling]:
    choices: list[st.SearchStrategy[Filling]] = [reversibles(interface), irreversibles(interface)]
    if interface and all(of.power for of in interface.values()):
        choices.append(storages(interface))
    return st.one_of(choices)


ELEMENTS: Mapping[Algebra[Any], Elements] = {
    systems: _primitives,
    relations: _primitives,
    exact_relations: _exact,
    corelations: _corelations,
    units: _units,
    cost: _costs,
    intervals: _conductors,
    resource_sharers: _sharers,
}
"""Every algebra that the package ships, with elements to try its laws on."""
