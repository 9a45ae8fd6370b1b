"""Geometry and contacts of SDF. Source: the SDFormat specification, elements ``geometry``, ``collision``, ``surface``.

Two surfaces have the stiffness ``kp`` of both in series and the lesser ``mu``, as in Gazebo and in scenes.
"""

from collections.abc import Iterator, Mapping
from typing import Any
from xml.etree.ElementTree import Element

from ephs.mechanics.imports.collisions import FRICTION, collide, default_law
from ephs.mechanics.imports.draft import WORLD, Draft, along
from ephs.mechanics.imports.keys import note_unknown
from ephs.mechanics.imports.sdf_frames import read_pose
from ephs.mechanics.imports.sdf_keys import COLLISION
from ephs.mechanics.imports.xml import numbers
from ephs.mechanics.scene.errors import fault
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import SE3

RIGID = 1e12
"""Default of ``kp`` in N/m, which stands for a rigid surface."""
_TRUE = ("true", "1")


def solids(element: Element, key: str, draft: Draft) -> Iterator[tuple[str, Any, Array]]:
    """Kind, sizes and pose of the solids of a visual or collision element; a mesh has a file and a scale."""
    geometry, faults = element.find("geometry"), draft.faults
    place = read_pose(element, f"{key}.pose", faults)
    for solid in () if geometry is None else geometry:
        at, value, there = f"{key}.{solid.tag}", None, place

        def sizes(
            words: str, count: int = 1, default: tuple[float, ...] = (), *, of: Element = solid, at: str = at
        ) -> Any:
            found = [numbers(of.findtext(word), count, f"{at}.{word}", faults, default) for word in words.split()]
            return [entry for entries in found for entry in entries]

        match solid.tag:
            case "box":
                value = sizes("size", 3)
            case "sphere":
                value = sizes("radius")[0]
            case "cylinder" | "capsule":
                value = sizes("radius length")
            case "mesh":
                value = (solid.findtext("uri") or "").strip(), sizes("scale", 3, (1.0, 1.0, 1.0))
            case "plane":
                normal = sizes("normal", 3, (0.0, 0.0, 1.0))
                framed = along(normal, place)
                if framed is None:
                    faults.append(fault("direction", f"{at}.normal", str(normal)))
                else:
                    value, there = (), framed
            case _:
                pass
        yield solid.tag, value, there


def link_surfaces(model: Element, links: Mapping[str, Element], draft: Draft) -> None:
    """Surfaces of the links of the model that moves; its links meet each other with ``self_collide`` alone."""
    each, name = (model.findtext("self_collide") or "").strip() in _TRUE, draft.name
    if each and draft.contact and model.find("link/collision/geometry/mesh") is not None:
        draft.leave("contacts (self_collide) between the links of", name)
        each = False
    law = default_law(draft) | ({} if each else {"group": name})
    for link, element in links.items():
        _surfaces(element, link, link, None, law, draft)


def ground_surfaces(model: str, places: Mapping[str, Array], links: Mapping[str, Element], draft: Draft) -> None:
    """Surfaces of a static model, whose links are at ``places`` (7,) in the world."""
    law = {key: value for key, value in default_law(draft).items() if key != "stiffness"}
    for link, element in links.items():
        _surfaces(element, WORLD, f"{model}_{link}", places[link], law, draft)


def _surfaces(
    element: Element, link: str, name: str, place: Array | None, law: Mapping[str, Any], draft: Draft
) -> None:
    found = element.findall("collision")
    if found and not draft.contact:
        draft.leave("contacts of", name)
        return
    for number, collision in enumerate(found):
        if not _meets(collision):
            continue
        own, key = f"{name}_{collision.get('name') or number + 1}", f"links.{name}.collision[{number}]"
        given = _law(collision, own, key, draft)
        for kind, value, at in solids(collision, key, draft):
            collide(draft, link, own, kind, value, at if place is None else SE3.compose(place, at), {**law, **given})


def _meets(collision: Element) -> bool:
    """Whether a collision makes forces: not with a bit mask of 0, and not where it is for sensors alone."""
    bits, sensed = (
        (collision.findtext(f"surface/contact/{word}") or "").strip().lower()
        for word in ("collide_bitmask", "collide_without_contact")
    )
    return not (bits and not bits.removeprefix("0x").strip("0")) and sensed not in _TRUE


def _law(collision: Element, name: str, key: str, draft: Draft) -> dict[str, float]:
    """Stiffness and friction of a collision; a note of other numbers."""
    found: dict[str, float] = {}
    stiffness, friction = "surface/contact/ode/kp", "surface/friction/ode/mu"
    if collision.find(friction) is not None:
        found["friction"] = numbers(collision.findtext(friction), 1, f"{key}.{friction}", draft.faults)[0]
    if collision.find(stiffness) is not None:
        found |= soft(numbers(collision.findtext(stiffness), 1, f"{key}.{stiffness}", draft.faults)[0], name, draft)
    plain = collision.findtext(friction) or f"{FRICTION}"
    note_unknown(collision, {**COLLISION, f"{friction}2": (plain,)}, draft, "collisions", name)
    return found


def soft(stiffness: float, name: str, draft: Draft) -> dict[str, float]:
    """The stiffness ``kp`` of a surface; a note of a rigid one."""
    if 0.0 < stiffness < RIGID:
        return {"stiffness": stiffness}
    draft.leave("rigid contacts (kp) of", name)
    return {}
