"""Geometry and contacts of SDF. Source: the SDFormat specification, elements ``geometry``, ``collision``, ``surface``.

Two surfaces have the stiffness ``kp`` of both in series and the lesser ``mu``, as in Gazebo and in scenes.
"""

from collections.abc import Iterator, Mapping
from typing import Any
from xml.etree.ElementTree import Element

from ephs.mechanics.imports.collisions import collide, default_law
from ephs.mechanics.imports.draft import WORLD, Draft, along
from ephs.mechanics.imports.sdf_frames import read_pose
from ephs.mechanics.imports.xml import numbers
from ephs.mechanics.scene.errors import fault
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import SE3

RIGID = 1e12
"""Default of ``kp`` in N/m, which stands for a rigid surface."""
_READ = {"surface contact ode kp": "stiffness", "surface friction ode mu": "friction"}
_GEOMETRY = ("pose", "geometry")
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
        for word in ("self_collide", "kinematic"):
            if (element.findtext(word) or "").strip() in _TRUE:
                draft.leave(f"{word} of", link)
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
        own, key = f"{name}_{collision.get('name') or number + 1}", f"links.{name}.collision[{number}]"
        given = _law(collision, own, key, draft)
        for kind, value, at in solids(collision, key, draft):
            collide(draft, link, own, kind, value, at if place is None else SE3.compose(place, at), {**law, **given})


def _law(collision: Element, name: str, key: str, draft: Draft) -> dict[str, float]:
    """Stiffness and friction of a collision; a note of each other number that is not 0."""
    found: dict[str, float] = {}
    for path, text in _leaves(collision):
        if path in _READ:
            value = numbers(text, 1, f"{key}.{path}", draft.faults)[0]
            if path == "surface contact ode kp" and not 0.0 < value < RIGID:
                draft.leave("rigid contacts (kp) of", name)
            else:
                found[_READ[path]] = value
        elif any(word.strip("-+0.") for word in text.split()) or "bitmask" in path:
            draft.leave(f"contact parameter {path.removeprefix('surface ')} of", name)
    return found


def _leaves(element: Element, path: str = "") -> Iterator[tuple[str, str]]:
    """Paths and texts of the elements within a collision that have none themselves."""
    for child in element:
        if not path and child.tag in _GEOMETRY:
            continue
        here = f"{path} {child.tag}".strip()
        if len(child):
            yield from _leaves(child, here)
        else:
            yield here, (child.text or "").strip()
