"""Geometry and contacts of SDF. Source: the SDFormat specification, elements ``geometry``, ``collision``, ``surface``.

Two surfaces have the stiffness ``kp`` of both in series and the lesser ``mu``, as in Gazebo and in scenes.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from ephs.mechanics.imports.collisions import FRICTION, collide, default_law
from ephs.mechanics.imports.draft import WORLD, Draft, along
from ephs.mechanics.imports.file_element import FileElement
from ephs.mechanics.imports.sdf_frames import Scope, is_true, read_pose
from ephs.mechanics.imports.sdf_keys import COLLISION
from ephs.mechanics.imports.xml import numbers
from ephs.mechanics.scene.errors import fault
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3

RIGID = 1e12
"""Default of ``kp`` in N/m, which stands for a rigid surface."""
_TRUE = ("true", "1")


def solids(element: FileElement, key: str, draft: Draft) -> Iterator[tuple[str, Any, Array]]:
    """Kind, sizes and pose of the solids of a visual or collision element; a mesh has a file and a scale."""
    geometry, faults = element.find("geometry"), draft.faults
    place = read_pose(element, f"{key}.pose", faults)
    for solid in () if geometry is None else geometry.findall("*"):
        at, value, there = f"{key}.{solid.tag}", None, place

        def sizes(
            words: str, count: int = 1, default: tuple[float, ...] = (), *, of: FileElement = solid, at: str = at
        ) -> Any:
            found = [numbers(of.value(word), count, f"{at}.{word}", faults, default) for word in words.split()]
            return [entry for entries in found for entry in entries]

        match solid.tag:
            case "box":
                value = sizes("size", 3)
            case "sphere":
                value = sizes("radius")[0]
            case "cylinder" | "capsule":
                value = sizes("radius length")
            case "mesh":
                value = (
                    (solid.findtext("uri") or solid.get("filename") or "").strip(),
                    sizes("scale", 3, (1.0, 1.0, 1.0)),
                )
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


def link_surfaces(model: Scope, draft: Draft) -> None:
    """Surfaces of the links of a model that moves, which meet each other with ``self_collide`` alone."""
    scopes = model.everything()
    links = {f"{scope.prefix}{name}": link for scope in scopes for name, link in scope.links.items()}
    if not draft.contact:
        for scope in scopes:
            scope.element.pass_by("self_collide")
    each = draft.contact and is_true(model.element, "self_collide")
    solid = [kind for link in links.values() if each for kind in link.findall("collision/geometry/mesh")]
    if each and solid:
        draft.leave("contacts (self_collide) between the links of", model.name)
        each = False
    law = default_law(draft) | ({} if each else {"group": model.name})
    for link, element in links.items():
        _surfaces(element, link, link, None, law, draft)


def ground_surfaces(model: Scope, draft: Draft) -> None:
    """Surfaces of a static model, whose links are the ground; all else in it has no effect."""
    law = {key: value for key, value in default_law(draft).items() if key != "stiffness"}
    for name, link in model.links.items():
        _surfaces(link, WORLD, f"{model.prefix}{name}", model.link_pose(name), law, draft)
        link.pass_by_all_but("collision")
    model.element.pass_by_all_but("link", "model")


def _surfaces(
    element: FileElement, link: str, name: str, place: Array | None, law: Mapping[str, Any], draft: Draft
) -> None:
    if not draft.contact:
        if element.has("collision"):
            draft.leave("contacts of", name)
            element.pass_by("collision")
        return
    for number, collision in enumerate(element.findall("collision")):
        label = collision.get("name") or number + 1
        if not _meets(collision):
            collision.pass_by()
            continue
        own, key = f"{name}_{label}", f"links.{name}.collision[{number}]"
        given = _law(collision, own, key, draft)
        for kind, value, at in solids(collision, key, draft):
            collide(draft, link, own, kind, value, at if place is None else SE3.compose(place, at), {**law, **given})


def _meets(collision: FileElement) -> bool:
    """Whether a collision makes forces: not with a bit mask of 0, and not where it is for sensors alone."""
    bits = collision.peek("surface/contact/collide_bitmask").strip().lower()
    sensed = (collision.findtext("surface/contact/collide_without_contact") or "").strip().lower()
    return not (bits and not bits.removeprefix("0x").strip("0")) and sensed not in _TRUE


def _law(collision: FileElement, name: str, key: str, draft: Draft) -> dict[str, float]:
    """Stiffness and friction of a collision; a note of other numbers."""
    found: dict[str, float] = {}
    stiffness, friction = "surface/contact/ode/kp", "surface/friction/ode/mu"
    mu, kp = collision.findtext(friction), collision.findtext(stiffness)
    if mu is not None:
        found["friction"] = numbers(mu, 1, f"{key}.{friction}", draft.faults)[0]
    if kp is not None:
        found |= soft(numbers(kp, 1, f"{key}.{stiffness}", draft.faults)[0], name, draft)
    collision.named("collisions", name, {**COLLISION, f"{friction}2": (mu or f"{FRICTION}",)})
    return found


def soft(stiffness: float, name: str, draft: Draft) -> dict[str, float]:
    """The stiffness ``kp`` of a surface; a note of a rigid one."""
    if 0.0 < stiffness < RIGID:
        return {"stiffness": stiffness}
    draft.leave("rigid contacts (kp) of", name)
    return {}
