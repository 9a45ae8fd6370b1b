"""URDF: a tree of links. Source: the URDF specification (wiki.ros.org/urdf/XML); spherical joints as in PyBullet."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ephs.mechanics.imports.collisions import collide, default_law
from ephs.mechanics.imports.draft import WORLD, Draft, along, pose, turned_tensor
from ephs.mechanics.imports.elements import check_kind, check_link, check_mass, draw, named, tensor
from ephs.mechanics.imports.file_element import FileElement, Plain
from ephs.mechanics.imports.sdf_contacts import soft
from ephs.mechanics.imports.sdf_keys import LINK as SDF_LINK
from ephs.mechanics.imports.xml import bound, numbers, vector
from ephs.mechanics.scene.errors import fault
from ephs.mechanics.scene.geometry import coupling
from ephs.semantics.spaces import SE3

_SIDES = ("lower", "upper")
KINDS = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "fixed": "fixed",
    "floating": "free",
    "planar": "planar",
    "spherical": "spherical",
}
AXIAL = ("revolute", "prismatic", "planar")
ROOT = "root_joint"
_BULLET = {
    "lateral_friction": "friction", "stiffness": "stiffness", "rolling_friction": "rolling",
    "spinning_friction": "spinning",
}  # fmt: skip
"""Nodes of Bullet's ``<contact>`` in a link -> keys of surfaces."""
_PLAIN_ROBOT: Plain = {"version": (), "material": ()}
_PLAIN_LINK: Plain = {
    **dict.fromkeys(("type", "visual/name", "visual/material", "visual/verbose"), ()),
    "contact/restitution": ("0",),
}
_PLAIN_COLLISION: Plain = {"material": ()}
_PLAIN_FIXED: Plain = dict.fromkeys(("dont_collapse", "axis", "limit", "dynamics", "mimic"), ())
_PLAIN_TRANSMISSION: Plain = {"type": ()}
_PLAIN_JOINT: Plain = {"dont_collapse": (), "limit/velocity": ("0",)}
_SPRING = {"springStiffness": "stiffness", "springReference": "rest"}
"""Tags for Gazebo of joints -> keys of joints."""
_PLAIN_TOUCHING: Plain = {
    "kd": ("1",), "mu2": ("1",), "fdir1": ("0 0 0",), "minDepth": ("0",), "maxVel": ("0.01",), "maxContacts": (),
    "laserRetro": (),
}  # fmt: skip
"""Tags for Gazebo of contacts, with their defaults."""
_TOUCHING = ("mu1", "kp", *_PLAIN_TOUCHING)
_PLAIN_GAZEBO: Plain = {
    **{path: plain for path, plain in SDF_LINK.items() if not path.startswith(("collision", "inertial"))},
    **dict.fromkeys(("reference", "material", "preserveFixedJoint", "disableFixedJointLumping"), ()),
    **dict.fromkeys(("provideFeedback", "implicitSpringDamper"), ()),
    **dict.fromkeys(("turnGravityOff", "selfCollide", "dampingFactor", "static"), ("0",)),
}
Settings = Mapping[str, list[FileElement]]
"""Name of a link or joint -> its elements ``<gazebo reference=…>``."""


def read_urdf(root: FileElement, draft: Draft, base: str) -> None:
    """The links and joints of a robot, its root on the ground by a joint ``root_joint``, fixed or free."""
    draft.name = root.get("name") or draft.name
    if any("xacro" in element.tag for element in root.everything()):
        draft.faults.append(fault("xacro", "robot", "xacro tags"))
        return
    links = named(root, "link", draft.faults)
    joints = named(root, "joint", draft.faults)
    ends = {name: _ends(name, joint, links, draft) for name, joint in joints.items()}
    order = _outwards(links, ends, draft)
    if draft.faults or not order:
        return
    for link in links:
        _link(link, links[link], draft)
    law, settings = default_law(draft) | {"group": draft.name}, _gazebo(root, links, joints, draft)
    for name, link in links.items():
        _collisions(name, link, law, settings.get(name, []), draft)
    if draft.contact and any(link.has("collision") for link in links.values()):
        draft.leave("contacts between the links of", draft.name)
    free = base == "free"
    draft.joint(ROOT, "free" if free else "fixed", WORLD, order[0], pose(), pose(), {})
    of_child = {child: name for name, (_, child) in ends.items()}
    for link in order[1:]:
        name = of_child[link]
        _joint(name, joints[name], *ends[name], settings.get(name, []), draft)
    mimics = _mimicry(joints, draft)
    for name in mimics:
        _mimic(name, mimics, joints, draft)
    for number, element in enumerate(root.findall("transmission")):
        _transmission(element, element.get("name") or f"transmission_{number + 1}", joints, draft)
    for name, joint in joints.items():
        moves = KINDS[str(joint.get("type"))] in ("revolute", "prismatic")
        if moves and _effort(name, joint, draft) < math.inf and not draft.driven(name):
            draft.leave("limits of effort of", name)
    for sensor in root.findall("sensor"):
        draft.leave("sensors", sensor.get("name") or "sensor")
        sensor.pass_by()
    root.named("robots", draft.name, _PLAIN_ROBOT)


def _gazebo(
    root: FileElement, links: Mapping[str, FileElement], joints: Mapping[str, FileElement], draft: Draft
) -> Settings:
    """Tags for Gazebo, by the link or joint that they are of."""
    found: dict[str, list[FileElement]] = {}
    for element in root.findall("gazebo"):
        name = element.get("reference") or ""
        kind = "links" if name in links else "joints" if name in joints else "robots"
        found.setdefault(name, []).append(element)
        for tag in ("plugin", "sensor"):
            if element.has(tag):
                draft.leave(f"{tag}s", name or draft.name)
                element.pass_by(tag)
        element.named(kind, name or draft.name, _PLAIN_GAZEBO)
    return found


def _tag(settings: list[FileElement], tag: str) -> str | None:
    """The last value of a tag for Gazebo, written as a text or as an attribute."""
    for element in reversed(settings):
        if (found := element.find(tag)) is not None:
            return found.get("value") or found.text
    return None


def _ends(name: str, joint: FileElement, links: Mapping[str, FileElement], draft: Draft) -> tuple[str, str]:
    """The parent and the child of a joint; its type is checked."""
    check_kind(name, joint, KINDS, draft.faults)
    ends: list[str] = []
    for end in ("parent", "child"):
        element = joint.find(end)
        link = "" if element is None else element.get("link") or ""
        check_link(link, f"joints.{name}.{end}", links, draft.faults)
        ends.append(link)
    return ends[0], ends[1]


def _outwards(links: Mapping[str, FileElement], ends: Mapping[str, tuple[str, str]], draft: Draft) -> list[str]:
    """The links from the root outwards; a fault if they do not form a tree."""
    faults, parents, children = draft.faults, dict[str, str](), dict[str, list[str]]()
    for name, (parent, child) in ends.items():
        if child in parents:
            found = f'"{child}", the child of joint "{parents[child]}" already'
            faults.append(fault("two parents", f"joints.{name}.child", found))
        parents.setdefault(child, name)
        children.setdefault(parent, []).append(child)
    roots = [link for link in links if link not in parents]
    if not links:
        faults.append(fault("no link", "links", "none"))
    elif len(roots) > 1:
        faults.append(fault("roots", "links", f"{len(roots)}: {', '.join(roots)}"))
    if faults:
        return []
    order = list(roots)
    for link in order:
        order += children.get(link, [])
    if len(order) < len(links):
        lost = [link for link in links if link not in order]
        loop = [lost[0]]
        while (above := ends[parents[loop[-1]]][0]) not in loop:
            loop.append(above)
        loop = [*loop[loop.index(above) :], above]
        key = f"joints.{parents[loop[-2]]}"
        faults.append(fault("link cycle", key, f"a cycle of links {' → '.join(reversed(loop))}"))
        return []
    return order


def _link(name: str, link: FileElement, draft: Draft) -> None:
    inertial = link.find("inertial")
    if inertial is None:
        draft.body(name)
    else:
        key = f"links.{name}.inertial"
        place = _origin(inertial, key, draft)
        mass = _attribute(inertial.find("mass"), "value", f"{key}.mass", draft)
        check_mass(mass, key, draft.faults)
        entries = inertial.find("inertia")
        rows = tensor(
            lambda entry: _attribute(entries, entry, f"{key}.inertia", draft, None if entry[1] == entry[2] else 0.0)
        )
        draft.body(name, mass, turned_tensor(place[:4], rows), place[4:])
    link.named("links", name, _PLAIN_LINK)
    for number, visual in enumerate(link.findall("visual")):
        for solid in _solids(visual, f"links.{name}.visual[{number}]", draft):
            draw(draft, name, *solid)


def _solids(element: FileElement, key: str, draft: Draft) -> Iterator[tuple[str, Any, np.ndarray]]:
    """Kind, sizes and pose of the solids of a visual or collision element; a mesh has a file and a scale."""
    geometry, faults = element.find("geometry"), draft.faults
    place = _origin(element, key, draft)
    for solid in () if geometry is None else geometry.findall("*"):
        at = f"{key}.{solid.tag}"
        value: Any = None
        match solid.tag:
            case "box":
                value = vector(solid, "size", at, faults, ())
            case "sphere":
                value = _attribute(solid, "radius", at, draft)
            case "cylinder" | "capsule":
                value = [_attribute(solid, word, at, draft) for word in ("radius", "length")]
            case "mesh":
                value = solid.get("filename") or "", vector(solid, "scale", at, faults, (1.0, 1.0, 1.0))
            case _:
                pass
        yield solid.tag, value, place


def _collisions(name: str, link: FileElement, law: Mapping[str, Any], gazebo: list[FileElement], draft: Draft) -> None:
    """Surfaces of a link, or a note of its contacts."""
    if not draft.contact or not link.has("collision"):
        if link.has("collision"):
            draft.leave("contacts of", name)
        link.pass_by("collision", "contact")
        for element in gazebo:
            element.pass_by(*_TOUCHING)
        return
    own: dict[str, float] = {}
    friction, stiffness = _tag(gazebo, "mu1"), _tag(gazebo, "kp")
    for element in gazebo:
        plain = _PLAIN_TOUCHING if friction is None else {**_PLAIN_TOUCHING, "mu2": (friction,)}
        element.named("links", name, {**_PLAIN_GAZEBO, **plain})
    if friction is not None:
        own["friction"] = numbers(friction, 1, f"gazebo.{name}.mu1", draft.faults)[0]
    if stiffness is not None:
        own |= soft(numbers(stiffness, 1, f"gazebo.{name}.kp", draft.faults)[0], name, draft)
    for word, entry in _BULLET.items():
        for element in link.findall(f"contact/{word}"):
            own[entry] = _attribute(element, "value", f"links.{name}.contact.{word}", draft, 0.0)
    found = link.findall("collision")
    for number, collision in enumerate(found):
        surface = collision.get("name") or (f"{name}_{number + 1}" if len(found) > 1 else name)
        for solid in _solids(collision, f"links.{name}.collision[{number}]", draft):
            collide(draft, name, surface, *solid, {**law, **own})
        collision.named("collisions", name, _PLAIN_COLLISION)


def _joint(name: str, joint: FileElement, parent: str, child: str, gazebo: list[FileElement], draft: Draft) -> None:
    key, kind = f"joints.{name}", KINDS[str(joint.get("type"))]
    origin, turned = _origin(joint, key, draft), pose()
    if kind in AXIAL:
        axis = vector(joint.find("axis"), "xyz", f"{key}.axis", draft.faults, (1.0, 0.0, 0.0))
        frame = along(axis)
        if frame is None:
            draft.faults.append(fault("direction", f"{key}.axis.xyz", str(axis)))
        else:
            turned = frame
    dynamics, d = joint.find("dynamics"), coupling(kind).dim
    entries: dict[str, object] = {}
    if dynamics is not None:
        losses = {word: _attribute(dynamics, word, f"{key}.dynamics", draft, 0.0) for word in ("damping", "friction")}
        for word, value in losses.items():
            if value < 0.0:
                draft.faults.append(fault("range", f"{key}.dynamics.{word}", f"{value:g}", what="a number not below 0"))
        if d:
            entries["friction"] = losses["damping"]
            entries |= draft.dry(name, losses["friction"], d)
    for tag, entry in _SPRING.items():
        if d == 1 and (text := _tag(gazebo, tag)) is not None:
            entries[entry] = numbers(text, 1, f"gazebo.{name}.{tag}", draft.faults)[0]
    draft.joint(name, kind, parent, child, SE3.compose(origin, turned), turned, entries)
    limit = joint.find("limit")
    if limit is not None and kind in ("revolute", "prismatic") and joint.get("type") != "continuous":
        draft.limit(name, *(bound(limit.get(side), f"{key}.limit.{side}", draft.faults, 0.0) for side in _SIDES))
    elif d and limit is not None and limit.has(*_SIDES):
        draft.leave("limits of", name)
        for side in _SIDES:
            limit.get(side)
    joint.named("joints", name, _PLAIN_JOINT if d else _PLAIN_FIXED)


def _mimicry(joints: Mapping[str, FileElement], draft: Draft) -> dict[str, tuple[str, float, float]]:
    """Of each joint that mimics another: this one, multiplier and offset."""
    found: dict[str, tuple[str, float, float]] = {}
    for name, joint in joints.items():
        if (mimic := joint.find("mimic")) is not None:
            words = ("multiplier", 1.0), ("offset", 0.0)
            ratio, offset = (_attribute(mimic, word, f"joints.{name}.mimic", draft, default) for word, default in words)
            found[name] = mimic.get("joint") or "", ratio, offset
    return found


def _mimic(
    name: str, mimics: Mapping[str, tuple[str, float, float]], joints: Mapping[str, FileElement], draft: Draft
) -> None:
    """Couple a joint to its mimicked joint, if both have one degree of freedom; one that mimics none starts at 0."""
    other, ratio, start = mimics[name]
    if other not in joints:
        draft.leave("mimicry of", f"{name} (of {other}, which is not there)")
        return
    moves = {KINDS.get(str(joints[each].get("type"))) for each in (name, other)}
    chain, factor = [name, other], ratio
    while chain[-1] in mimics and chain[-1] not in chain[:-1]:
        further, more, offset = mimics[chain[-1]]
        start, factor = start + factor * offset, factor * more
        chain.append(further)
    if chain[-1] in chain[:-1] or moves - {"revolute", "prismatic"}:
        draft.leave("mimicry of", f"{name} (of {other})")
    else:
        draft.gear(name, name, other, ratio, start)


def _transmission(element: FileElement, name: str, joints: Mapping[str, FileElement], draft: Draft) -> None:
    """An actuator of a transmission between one actuator and one joint; its control is the actuator's effort."""
    tied, motors = element.findall("joint"), element.findall("actuator")
    joint = "" if len(tied) != 1 or len(motors) != 1 else tied[0].get("name") or ""
    kind = KINDS.get(str(joints[joint].get("type"))) if joint in joints else None
    said = [face.text or "" for end in (*tied, *motors) for face in end.findall("hardwareInterface")]
    if any("effort" not in face.lower() for face in said):
        draft.leave("transmissions whose interface is no effort", name)
        element.pass_by()
        return
    given = [each for each in (element, *tied, *motors) if each.has("mechanicalReduction")]
    text = given[0].findtext("mechanicalReduction") if given else None
    ratio = numbers(text, 1, f"transmissions.{name}.mechanicalReduction", draft.faults, (1.0,))[0]
    if kind not in ("revolute", "prismatic") or not draft.knows(joint) or not ratio:
        draft.leave("transmissions", name)
        element.pass_by()
        return
    most = _effort(joint, joints[joint], draft) / abs(ratio)
    draft.actuate(motors[0].get("name") or name, {joint: ratio}, [-most, most])
    element.named("transmissions", name, _PLAIN_TRANSMISSION)


def _effort(name: str, joint: FileElement, draft: Draft) -> float:
    """The largest effort of a joint, which is infinite where none is given."""
    limit = joint.find("limit")
    text = None if limit is None else limit.get("effort")
    return abs(bound(text, f"joints.{name}.limit.effort", draft.faults, math.inf))


def _origin(element: FileElement, key: str, draft: Draft) -> np.ndarray:
    """The pose (7,) of an origin, turned by ``rpy``, or by ``quat_xyzw`` as in URDF 1.1."""
    origin = element.find("origin")
    at, faults = f"{key}.origin", draft.faults
    place = vector(origin, "xyz", at, faults)
    text = None if origin is None else origin.get("quat_xyzw")
    if origin is None or text is None:
        return pose(place, vector(origin, "rpy", at, faults))
    x, y, z, w = numbers(text, 4, f"{at}.quat_xyzw", faults)
    if origin.has("rpy"):
        faults.append(fault("value", f"{at}.quat_xyzw", "rpy beside it", what="one of the two"))
        origin.get("rpy")
    if not np.linalg.norm([w, x, y, z]) > 0.0:
        faults.append(fault("direction", f"{at}.quat_xyzw", "a quaternion of zeros"))
        return pose(place)
    return pose(place, [w, x, y, z])


def _attribute(element: FileElement | None, name: str, key: str, draft: Draft, default: float | None = None) -> float:
    text = None if element is None else element.get(name)
    return numbers(text, 1, f"{key}.{name}", draft.faults, () if default is None else (default,))[0]
