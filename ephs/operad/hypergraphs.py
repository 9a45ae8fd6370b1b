"""Patterns to and from DisCoPy: the free hypergraph category, boxes on spiders.

`discopy` is imported when it is needed, and is no dependency.
"""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from ephs.operad.pattern import Pattern
from ephs.operad.quantities import Quantity
from ephs.operad.text import quantity_text
from ephs.operad.translation import Translation, Wiring, box_name, lost_of, numbered


def to_discopy(pattern: Pattern) -> Translation[Any]:
    """The pattern as a `discopy.frobenius.Hypergraph`: junctions are spiders, all ports outputs.

    Types are quantities, in the words of `Pattern.to_text`; the names of a box' ports are its `data`. The codomain are
    the outer ports, sorted by name, the domain is empty.
    """
    frobenius: Any = import_module("discopy.frobenius")
    spiders = {path: number for number, path in enumerate(pattern.junctions)}
    types = {path: frobenius.Ty(quantity_text(junction.quantity)) for path, junction in pattern.junctions.items()}
    none = frobenius.Ty()
    boxes: list[Any] = []
    wires: list[tuple[tuple[int, ...], tuple[int, ...]]] = []
    for box, content in pattern.boxes.items():
        on = [port.junction for port in content.ports.values()]
        data = tuple(map(str, content.ports))
        boxes.append(frobenius.Box(box_name(box), none, none.tensor(*(types[path] for path in on)), data=data))
        wires.append(((), tuple(spiders[path] for path in on)))
    outer = sorted(pattern.interface)
    codomain = none.tensor(*(types[path] for path in outer))
    wiring = (), tuple(wires), tuple(spiders[path] for path in outer)
    found = frobenius.Hypergraph(none, codomain, tuple(boxes), wiring, spider_types=list(types.values()))
    inner = [path for path, junction in pattern.junctions.items() if not junction.exposed]
    lost = [f"junctions are numbered: {', '.join(map(str, inner))}"] if inner else []
    lost += [f"outer ports are numbered: {', '.join(map(str, outer))}"] if outer else []
    return Translation(found, (*lost_of(pattern), *lost))


def from_discopy(hypergraph: Any, quantities: Mapping[str, Quantity] | Quantity | None = None) -> Translation[Pattern]:
    """Read a `discopy` hypergraph: inputs and outputs are alike ports.

    Ports of a box are named by its `data`, where that is a name for each; else ``in1``, ``out1``, … The domain's outer
    ports are named ``in1``, …, the codomain's ``out1``, …

    Parameters
    ----------
    quantities
        Name of an object -> quantity, for names that are not the words of `Pattern.to_text`; or the quantity of all.

    Raises
    ------
    PatternError
        A type without quantity, a spider with two outer ports, or one with an outer port but no inner one, which no
        pattern has.
    """
    lost: list[str] = []
    boxes: list[tuple[str | None, list[tuple[str, int]]]] = []
    for name, box, (dom, cod) in zip(
        numbered(str(box.name) for box in hypergraph.boxes), hypergraph.boxes, hypergraph.box_wires, strict=True
    ):
        spiders = (*dom, *cod)
        data: Any = box.data
        ports: list[str] = list(map(str, data if isinstance(data, list | tuple) else ()))  # pyright: ignore[reportUnknownArgumentType]
        if len(ports) != len(spiders) or len(set(ports)) < len(ports):
            ports = [*_numbers("in", len(dom)), *_numbers("out", len(cod))]
            lost += [f"box {name} has {len(dom)} inputs"] * (len(dom) > 0)
            lost += [f"the data of box {name}"] * (data is not None)
        lost += [f"box {name} is called so in place of {box.name}, which is taken"] * (name != str(box.name))
        lost += [f"box {name} is a dagger"] * bool(box.is_dagger)
        boxes.append((name, list(zip(ports, spiders, strict=True))))
    dom, cod = hypergraph.dom_wires, hypergraph.cod_wires
    outer = [*zip(_numbers("in", len(dom)), dom, strict=True), *zip(_numbers("out", len(cod)), cod, strict=True)]
    types: list[tuple[str | None, str | None]] = [(str(kind.inside[0].name), None) for kind in hypergraph.spider_types]
    found = Wiring("hypergraph", types, boxes, list(outer)).pattern(quantities)
    return Translation(found.result, (*lost, *found.lost))


def _numbers(word: str, count: int) -> list[str]:
    return [f"{word}{k}" for k in range(1, count + 1)]
