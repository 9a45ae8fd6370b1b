"""Elements of registered sections: checks of their tables, of what they name, and of their rules."""

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any, final

import numpy as np

from ephs.mechanics.scene.actuators import Actuator
from ephs.mechanics.scene.checked import Checked
from ephs.mechanics.scene.contacts import meeting
from ephs.mechanics.scene.custom import Element, number_of, read_in
from ephs.mechanics.scene.element import AXIS, FREE_END, HOLDERS, OUTSIDE, SINGLE
from ephs.mechanics.scene.entries import Document, validate
from ephs.mechanics.scene.errors import Fault, did_you_mean, fault, legible, listing, shown
from ephs.mechanics.scene.model import KINDS, Scene, elements_of, with_sections
from ephs.mechanics.scene.registry import REGISTERED
from ephs.mechanics.scene.schema_numbers import LARGEST
from ephs.mechanics.scene.site import Site, built, nodes_of_shells, shells_of
from ephs.operad import PatternError
from ephs.semantics.bundles.errors import SemanticsError

_NOUNS = {"bodies": "body"}
_ERRORS = (SemanticsError, PatternError, ValueError, ArithmeticError)


@final
@dataclass(frozen=True, slots=True)
class ReferableNames:
    """Names that references may use, by section; of ``unknown_parts``, which could not be read, nothing is known."""

    known: Mapping[str, Set[str]]
    unknown_parts: Set[str]

    @staticmethod
    def of(document: Document, parts: Mapping[str, Scene], warm: Set[str], unknown_parts: Set[str]) -> "ReferableNames":
        """Those of a file and its parts; ``warm`` are thermal nodes of beams."""
        inside = {
            section: {f"{part}.{name}" for part, scene in parts.items() for name, _ in scene.every(section)}
            for section in {section for sections in HOLDERS.values() for section in sections}
        }
        inside["thermal"] |= warm
        known = {section: names.union(document.sections[section]) for section, names in inside.items()}
        own = {"shells": set(document.sections["shells"]), "beams": set(document.sections["beams"])}
        return ReferableNames(known | own | {"meshes": known["shells"]}, unknown_parts)

    def check(self, table: Checked[Any], name: str, at: str, kind: str) -> None:
        """Append a fault where a reference of a kind at a key is unknown."""
        own = [*HOLDERS[kind], *(["beams"] if kind == "side" else [])]
        if kind == "carrier" and all(name in self.known[section] for section in own):
            table.fault("collision", at, f'"{name}", a body and a shell', other="a body")
        sheet, _, number = name.rpartition(".")
        node = kind == "body" and number.isdecimal() and sheet in self.known["meshes"]  # rules say whether it is there
        there = node or any(name in self.known[section] for section in own)
        if there or name in OUTSIDE[kind] or name.split(".")[0] in self.unknown_parts:
            return
        known = set[str]().union(*(self.known[section] for section in own))
        hint = did_you_mean(name, [*known, *OUTSIDE[kind] - {FREE_END}], f"there are: {listing(known)}")
        table.fault(f"unknown {_NOUNS.get(own[0], own[0].removesuffix('s'))}", at, f'"{name}"', hint=hint)


def resolve_elements(
    document: Document, names: ReferableNames, folder: Path, faults: list[Fault]
) -> dict[str, dict[str, Element]]:
    """The elements by section, checked but for what depends on where bodies are."""
    found: dict[str, dict[str, Element]] = {}
    for section in (*KINDS, *REGISTERED):
        found[section] = {}
        for name, table in document.sections[section].items():
            entry = read_in(table.entry, name, folder)
            check_table(replace(table, entry=entry), names)
            if not table.spoiled:
                found[section][name] = read_in(entry.normalised(), name)
    found["actuators"] |= _pulls(document, found, faults)
    return found


def _pulls(document: Document, found: Mapping[str, Mapping[str, Element]], faults: list[Fault]) -> dict[str, Element]:
    """For each tendon an actuator of its name whose control is the tension."""
    given = document.sections["actuators"]
    for name, of in found["actuators"].items():
        if name in found["tendons"] and of.named("tendon") != (name,):
            faults.append(fault("collision", f"actuators.{name}", shown(name), other=f"the tendon {name}"))
    return {name: Actuator(tendon=name, ratio=[-1.0]).called(name) for name in found["tendons"] if name not in given}


def with_contacts(scene: Scene, faults: list[Fault]) -> Scene:
    """The scene with contacts of all surfaces of its level that can meet, where its file names none."""
    given = scene.contacts
    sheets = {name: each.settled(Site(scene, each)) for name, each in scene.shells.items()}
    scene = with_sections(scene, {"shells": sheets})
    for each in (*sheets.values(), *scene.surfaces.values()):  # what carries contacts
        faults += _broken_at(scene, each)
    for each in () if faults else elements_of(scene):
        _check_nodes(scene, each, faults)
    if faults:
        return scene
    found = given or {each.name: each for each in meeting(scene)}
    for each in found.values():
        key = "" if given else " and ".join(f"surfaces.{surface}" for surface in each.surfaces)
        faults += islice(_broken_at(scene, each, key), 1)
    return replace(scene, contacts=found)


def settled(scene: Scene) -> Scene:
    """The scene with the values of elements of its level, parts apart, that depend on where bodies are."""
    own: dict[str, dict[str, Element]] = {}
    for each in elements_of(scene):
        own.setdefault(each.section, {})[each.name] = each.settled(Site(scene, each))
    return with_sections(scene, own)


def check_table(table: Checked[Element], names: ReferableNames | None) -> None:
    """Append the faults of an element's table: sizes of numbers, what it names unless this is known, and its rules."""
    entry, spoiled = table.entry, set(table.spoiled)
    for name in type(entry).numbers:
        if name not in spoiled and np.any(np.abs(number_of(entry, name)) > LARGEST):
            spoiled.add(name)
            table.fault("large", name, most=LARGEST)
    for place, kind, name in entry.references():
        if names is not None and place.partition("[")[0] not in spoiled:
            names.check(table, name, place, kind)
    table.faults.extend(broken(replace(table, spoiled=frozenset(spoiled))))


def broken(table: Checked[Element], *site: Site, adjusted: bool = False) -> Iterator[Fault]:
    """The faults of rules that do not hold: of those that are asked at a site, or of the others."""
    for each in type(table.entry).rules:
        if (each.placed, each.adjusted) == (bool(site), adjusted) and table.sound(*each.keys):
            for at, found, *texts in each.texts(table.entry, *site):
                found = found or shown(getattr(table.entry, at) if at else {})
                yield Fault(*map(legible, (f"{table.key}.{at}".rstrip("."), found, *texts)))


def _broken_at(scene: Scene, element: Element, key: str = "", *, adjusted: bool = False) -> Iterator[Fault]:
    """The faults of rules that do not hold where an element is; ``key`` is another name of its table."""
    table = Checked(element, key or f"{element.section}.{element.name}")
    return broken(table, Site(scene, element), adjusted=adjusted)


def placed_faults(scene: Scene, *, adjusted: bool = False) -> list[Fault]:
    """Faults of the elements of a level, parts apart, that depend on where bodies and joints are."""
    own = list(elements_of(scene))
    if adjusted:
        return [each for element in own for each in _broken_at(scene, element, adjusted=True)]
    faults = [each for element in own for each in _placed(scene, element)]
    if not faults and any(scene.elements.values()):  # those that users wrote may not be built
        try:
            built(scene)
        except _ERRORS:
            faults = [each for element in own for each in _unbuilt(scene, element)]
    return faults


def _placed(scene: Scene, element: Element) -> Iterator[Fault]:
    table = Checked(element, f"{element.section}.{element.name}")
    for place, kind, name in element.references():
        if kind in (AXIS, SINGLE):
            joint, what = scene.joint(name), "motor joint" if kind == AXIS else "gear freedoms"
            if joint.dim != 1 or (kind == AXIS and joint.motion is not None):
                table.fault(what, place, f"{name}, {joint.kind}")
    yield from table.faults or _broken_at(scene, element)


def _check_nodes(scene: Scene, element: Element, faults: list[Fault]) -> None:
    """Append a fault where it names a node that a shell does not have, or one that is welded to a body."""
    table = Checked(element, f"{element.section}.{element.name}", faults)
    for place, kind, name in element.references():
        at, _, number = name.rpartition(".")
        if kind != "body" or (sheet := shells_of(scene).get(at)) is None or name in nodes_of_shells(scene):
            continue
        count = len(sheet.mesh().points)
        body = next((body for body, nodes in sheet.welds().items() if number in map(str, nodes)), None)
        if body is None:
            table.fault("unknown node", place, f'"{name}"', first=sheet.node(0), last=sheet.node(count - 1))
        else:
            table.fault("welded node", place, f'"{name}", welded to {body}', body=body)


def _unbuilt(scene: Scene, element: Element) -> Iterator[Fault]:
    try:
        element.build(Site(scene, element))
    except _ERRORS as error:
        yield fault("not built", f"{element.section}.{element.name}", str(error))


def number_faults(element: Element, key: str) -> list[Fault]:
    """Faults of an element with other numbers: those that its table would have."""
    values: dict[str, Any] = {name: getattr(element, name) for name in type(element).model_fields}
    faults: list[Fault] = []
    check_table(validate(type(element), values, key, faults), None)
    return faults
