"""Elements of registered sections: checks of their tables, of what they name, and of their rules."""

from collections.abc import Collection, Iterator, Mapping, Set
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any, final

import numpy as np

from ephs.mechanics.scene.actuators import Actuator
from ephs.mechanics.scene.checked import Checked
from ephs.mechanics.scene.contacts import meeting
from ephs.mechanics.scene.custom import Element, number_of, read_in
from ephs.mechanics.scene.element import AXIS, ENVIRONMENT, GROUND, JOINTS, OUTSIDE, SINGLE
from ephs.mechanics.scene.entries import Document, validate
from ephs.mechanics.scene.errors import Fault, did_you_mean, fault, legible, listing, shown, unknown
from ephs.mechanics.scene.model import KINDS, Scene, elements_of, with_sections
from ephs.mechanics.scene.registry import REGISTERED
from ephs.mechanics.scene.schema_numbers import LARGEST
from ephs.mechanics.scene.site import SceneLevel, Site, built
from ephs.operad import PatternError
from ephs.semantics.bundles.errors import SemanticsError

_ERRORS = (SemanticsError, PatternError, ValueError, ArithmeticError)


@final
@dataclass(frozen=True, slots=True)
class ReferableNames:
    """The names that references may use; ``unknown_parts`` are parts that could not be read, of which
    nothing is known."""

    bodies: Set[str]
    thermal: Set[str]
    unknown_parts: Set[str]

    def check(self, table: Checked[Any], name: str, at: str, what: str) -> None:
        """Append a fault where a reference at a key is unknown; ``what`` is body or thermal."""
        fixed, known = (GROUND, self.bodies) if what == "body" else (ENVIRONMENT, self.thermal)
        if name == fixed or name in known or name.split(".")[0] in self.unknown_parts:
            return
        hint = did_you_mean(name, [*known, fixed], f"there are: {listing(known)}")
        table.fault(f"unknown {what}", at, f'"{name}"', hint=hint)


def resolve_elements(
    document: Document, parts: Mapping[str, Scene], names: ReferableNames, folder: Path, faults: list[Fault]
) -> dict[str, dict[str, Element]]:
    """The elements by section, checked but for what depends on where bodies are."""
    known = {
        kind: {*document.sections[section], *_inside(parts, section)}
        for kind, section in (("joint", "joints"), ("tendon", "tendons"), ("surface", "surfaces"))
    } | {"carrier": set(document.sections["shells"]), "side": set(document.sections["beams"])}
    found: dict[str, dict[str, Element]] = {}
    for section in (*KINDS, *REGISTERED):
        found[section] = {}
        for name, table in document.sections[section].items():
            entry = read_in(table.entry, name, folder)
            check_table(replace(table, entry=entry), names, known)
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
    sheets = {name: each.settled(Site(scene, each, SceneLevel())) for name, each in scene.shells.items()}
    scene = with_sections(scene, {"shells": sheets})
    for each in (*sheets.values(), *scene.surfaces.values()):  # what carries contacts
        faults += broken(Checked(each, f"{each.section}.{each.name}"), Site(scene, each, SceneLevel()))
    if faults:
        return scene
    found = given or {each.name: each for each in meeting(scene)}
    for name, each in found.items():
        key = f"contacts.{name}" if given else " and ".join(f"surfaces.{surface}" for surface in each.surfaces)
        faults += islice(broken(Checked(each, key), Site(scene, each, SceneLevel())), 1)
    return replace(scene, contacts=found)


def settled(scene: Scene) -> Scene:
    """The scene with the values of elements of its level, parts apart, that depend on where bodies are."""
    own: dict[str, dict[str, Element]] = {}
    for each in elements_of(scene):
        own.setdefault(each.section, {})[each.name] = each.settled(Site(scene, each, SceneLevel()))
    return with_sections(scene, own)


def _inside(parts: Mapping[str, Scene], section: str) -> Iterator[str]:
    for part, scene in parts.items():
        yield from (f"{part}.{name}" for name, _ in scene.every(section))


def check_table(table: Checked[Element], names: ReferableNames, known: Mapping[str, Collection[str]]) -> None:
    """Append the faults of an element's table: sizes of numbers, what it names, and its rules; ``known`` has names by
    kind, those of carriers and sides beside bodies."""
    entry, spoiled = table.entry, set(table.spoiled)
    for name in type(entry).numbers:
        if name not in spoiled and np.any(np.abs(number_of(entry, name)) > LARGEST):
            spoiled.add(name)
            table.fault("large", name, most=LARGEST)
    for place, kind, name in entry.references():
        of = "joint" if kind in JOINTS else kind
        if place.partition("[")[0] in spoiled or name in OUTSIDE[kind]:
            continue
        if of == "carrier" and name in known.get(of, ()) and name in names.bodies:
            table.fault("collision", place, f'"{name}", a body and a shell', other="a body")
        elif of in ("body", "end", "side", "carrier", "node"):
            more = known.get(of, ()) if of in ("side", "carrier") else ()
            there = replace(names, bodies=names.bodies | {*more}) if more else names
            there.check(table, name, place, "thermal" if of == "node" else "body")
        elif of in known and name not in known[of] and name.split(".")[0] not in names.unknown_parts:
            table.faults.append(unknown(of, f"{table.key}.{place}", name, known[of]))
    table.faults.extend(broken(replace(table, spoiled=frozenset(spoiled))))


def broken(table: Checked[Element], *site: Site, adjusted: bool = False) -> Iterator[Fault]:
    """The faults of rules that do not hold: of those that are asked at a site, or of the others."""
    for each in type(table.entry).rules:
        if (each.placed, each.adjusted) == (bool(site), adjusted) and table.sound(*each.keys):
            for at, found, *texts in each.texts(table.entry, *site):
                found = found or shown(getattr(table.entry, at) if at else {})
                yield Fault(*map(legible, (f"{table.key}.{at}".rstrip("."), found, *texts)))


def placed_faults(scene: Scene, *, adjusted: bool = False) -> list[Fault]:
    """Faults of the elements of a level, parts apart, that depend on where bodies and joints are."""
    own = list(elements_of(scene))
    if adjusted:
        sites = [(Checked(x, f"{x.section}.{x.name}"), Site(scene, x, SceneLevel())) for x in own]
        return [each for table, site in sites for each in broken(table, site, adjusted=True)]
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
    yield from table.faults or broken(table, Site(scene, element, SceneLevel()))


def _unbuilt(scene: Scene, element: Element) -> Iterator[Fault]:
    try:
        element.build(Site(scene, element, SceneLevel()))
    except _ERRORS as error:
        yield fault("not built", f"{element.section}.{element.name}", str(error))


def number_faults(element: Element, key: str) -> list[Fault]:
    """Faults of an element with other numbers: those that its table would have."""
    values: dict[str, Any] = {name: getattr(element, name) for name in type(element).model_fields}
    faults: list[Fault] = []
    check_table(validate(type(element), values, key, faults), ReferableNames(_Everything(), _Everything(), set()), {})
    return faults


class _Everything(set[str]):
    """All names: those of an element that was loaded are known."""

    def __contains__(self, _: object) -> bool:
        return True
