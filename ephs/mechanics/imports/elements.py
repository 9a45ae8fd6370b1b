"""Common elements of URDF and SDF: named elements, joints with a kind, links that joints name, inertia by entries,
pictures."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from ephs.mechanics.imports.draft import Draft
from ephs.mechanics.imports.file_element import FileElement
from ephs.mechanics.scene.errors import Fault, did_you_mean, fault, listing
from ephs.semantics.bundles.bundle import Array


def named(root: FileElement, tag: str, faults: list[Fault]) -> dict[str, FileElement]:
    """The elements of a kind by their names; a fault for each without a name of its own."""
    found: dict[str, FileElement] = {}
    for number, element in enumerate(root.findall(tag)):
        name = element.get("name")
        if not name:
            faults.append(fault("missing", f"{tag}s[{number}].name", "nothing", what="a name"))
        elif name in found:
            faults.append(fault("twice", f"{tag}s.{name}", f'a second {tag} "{name}"'))
        else:
            found[name] = element
    return found


def check_kind(name: str, joint: FileElement, kinds: Iterable[str], faults: list[Fault]) -> None:
    """A fault where a joint's type is unknown."""
    kind, known = joint.get("type"), list(kinds)
    if kind not in known:
        hint = did_you_mean(kind or "", known, "take one of these kinds")
        found = "nothing" if kind is None else f'"{kind}"'
        faults.append(fault("unknown type", f"joints.{name}.type", found, known=", ".join(known), hint=hint))


def check_link(link: str, key: str, links: Mapping[str, FileElement], faults: list[Fault]) -> None:
    """A fault where a joint names a missing link."""
    if link not in links:
        hint = did_you_mean(link, links, f"there are: {listing(links)}")
        faults.append(fault("unknown link", key, f'"{link}"' if link else "nothing", hint=hint))


def check_mass(mass: float, key: str, faults: list[Fault]) -> None:
    """A fault where a mass is negative."""
    if mass < 0.0:
        faults.append(fault("range", f"{key}.mass", f"{mass:g} kg", what="a number not below 0"))


def tensor(entry: Callable[[str], float]) -> list[list[float]]:
    """Rows of an inertia tensor from its entries ``ixx``, ``ixy``, …"""
    rows = (("ixx", "ixy", "ixz"), ("ixy", "iyy", "iyz"), ("ixz", "iyz", "izz"))
    found = {name: entry(name) for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")}
    return [[found[name] for name in row] for row in rows]


def draw(draft: Draft, link: str, kind: str, value: Any, place: Array) -> None:
    """A shape for pictures, or a note of it; a mesh has a file and a scale."""
    if kind == "mesh":
        draft.mesh(link, value[0], place, value[1])
    elif kind in ("box", "sphere", "cylinder"):
        draft.shape(link, kind, value, place)
    else:
        draft.leave("shapes", f"{kind} of {link}")
