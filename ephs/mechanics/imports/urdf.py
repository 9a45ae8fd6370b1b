"""URDF: a tree of links. Source: the URDF specification (wiki.ros.org/urdf/XML); spherical joints as in PyBullet."""

from collections.abc import Iterator, Mapping
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from ephs.mechanics.imports.collisions import collide, default_law
from ephs.mechanics.imports.draft import WORLD, Draft, along, pose, turned_tensor
from ephs.mechanics.imports.elements import check_kind, check_link, check_mass, draw, named, tensor
from ephs.mechanics.imports.keys import Known, note_unknown
from ephs.mechanics.imports.sdf_contacts import soft
from ephs.mechanics.imports.sdf_keys import LINK as SDF_LINK
from ephs.mechanics.imports.xml import numbers, vector
from ephs.mechanics.scene.errors import fault
from ephs.mechanics.scene.geometry import coupling
from ephs.semantics.spaces import SE3

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
"""Elements of Bullet's ``<contact>`` in a link -> keys of surfaces."""
_ROBOT: Known = dict.fromkeys(("name", "version", "link", "joint", "transmission", "material", "gazebo", "sensor"), ())
_LINK: Known = {
    **dict.fromkeys(("name", "type", "inertial/origin", "inertial/mass", "inertial/inertia"), ()),
    **dict.fromkeys(("visual", "collision", *(f"contact/{word}" for word in _BULLET)), ()),
    "contact/restitution": ("0",),
}
_COLLISION: Known = dict.fromkeys(("name", "origin", "geometry", "material"), ())
_FIXED: Known = dict.fromkeys(
    ("name", "type", "parent", "child", "origin", "dont_collapse", "axis", "limit", "dynamics", "mimic"), ()
)
_JOINT: Known = {
    **dict.fromkeys(("name", "type", "parent", "child", "origin", "dont_collapse", "axis", "mimic"), ()),
    **dict.fromkeys(("dynamics/damping", "dynamics/friction", "limit/lower", "limit/upper", "limit/effort"), ()),
    "limit/velocity": ("0",),
}
_SPRING = {"springStiffness": "stiffness", "springReference": "rest"}
"""Tags for Gazebo of joints -> keys of joints."""
_TOUCHING: Known = {
    **dict.fromkeys(("mu1", "kp"), ()), "kd": ("1",), "mu2": ("1",), "fdir1": ("0 0 0",), "minDepth": ("0",),
    "maxVel": ("0.01",), "maxContacts": (), "laserRetro": (),
}  # fmt: skip
"""Tags for Gazebo of contacts, with their defaults."""
_GAZEBO: Known = {
    **{path: plain for path, plain in SDF_LINK.items() if not path.startswith(("collision", "inertial"))},
    **dict.fromkeys(("reference", "material", "preserveFixedJoint", "disableFixedJointLumping"), ()),
    **dict.fromkeys(("provideFeedback", "implicitSpringDamper", *_SPRING), ()),
    **dict.fromkeys(("turnGravityOff", "selfCollide", "dampingFactor", "static"), ("0",)),
}
Settings = Mapping[str, Mapping[str, Element]]
"""Name of a link or joint -> tag -> element, of ``<gazebo reference=…>``."""


def read_urdf(root: Element, draft: Draft, base: str) -> None:
    """The links and joints of a robot, its root on the ground by a joint ``root_joint``, fixed or free."""
    draft.name = root.get("name") or draft.name
    if any("xacro" in str(element.tag) for element in root.iter()):
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
        _collisions(name, link, law, settings.get(name, {}), draft)
    if draft.contact and root.find("link/collision") is not None:
        draft.leave("contacts between the links of", draft.name)
    free = base == "free"
    draft.joint(ROOT, "free" if free else "fixed", WORLD, order[0], pose(), pose(), {})
    of_child = {child: name for name, (_, child) in ends.items()}
    for link in order[1:]:
        name = of_child[link]
        _joint(name, joints[name], *ends[name], settings.get(name, {}), draft)
    for name, joint in joints.items():
        _mimic(name, joint, joints, draft)
    for number, element in enumerate(root.findall("transmission")):
        _transmission(element, element.get("name") or f"transmission_{number + 1}", joints, draft)
    for name, joint in joints.items():
        effort = _attribute(joint.find("limit"), "effort", f"joints.{name}.limit", draft, 0.0)
        if effort and KINDS[str(joint.get("type"))] in ("revolute", "prismatic") and not draft.driven(name):
            draft.leave("limits of effort of", name)
    for sensor in root.findall("sensor"):
        draft.leave("sensors", sensor.get("name") or "sensor")
    note_unknown(root, _ROBOT, draft, "robots", draft.name)


def _gazebo(root: Element, links: Mapping[str, Element], joints: Mapping[str, Element], draft: Draft) -> Settings:
    """Tags for Gazebo; a note of those that are not imported."""
    found: dict[str, dict[str, Element]] = {}
    for element in root.findall("gazebo"):
        name = element.get("reference", "")
        kind = "links" if name in links else "joints" if name in joints else "robots"
        own = found.setdefault(name, {})
        own.update((child.tag, child) for child in element)
        touching: Known = _TOUCHING if draft.contact else dict.fromkeys(_TOUCHING, ())
        if draft.contact and "mu1" in own:
            touching = {**touching, "mu2": (_text(own["mu1"]) or "",)}
        for tag in ("plugin", "sensor"):
            if element.find(tag) is not None:
                draft.leave(f"{tag}s", name or draft.name)
        note_unknown(element, {**_GAZEBO, **touching}, draft, kind, name or draft.name)
    return found


def _text(element: Element | None) -> str | None:
    """The value of a tag for Gazebo, written as a text or as an attribute."""
    return None if element is None else element.get("value") or element.text


def _ends(name: str, joint: Element, links: Mapping[str, Element], draft: Draft) -> tuple[str, str]:
    """The parent and the child of a joint; its type is checked."""
    check_kind(name, joint, KINDS, draft.faults)
    ends: list[str] = []
    for end in ("parent", "child"):
        element = joint.find(end)
        link = "" if element is None else element.get("link", "")
        check_link(link, f"joints.{name}.{end}", links, draft.faults)
        ends.append(link)
    return ends[0], ends[1]


def _outwards(links: Mapping[str, Element], ends: Mapping[str, tuple[str, str]], draft: Draft) -> list[str]:
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


def _link(name: str, link: Element, draft: Draft) -> None:
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
    note_unknown(link, _LINK if draft.contact else {**_LINK, "contact": ()}, draft, "links", name)
    for number, visual in enumerate(link.findall("visual")):
        for solid in _solids(visual, f"links.{name}.visual[{number}]", draft):
            draw(draft, name, *solid)


def _solids(element: Element, key: str, draft: Draft) -> Iterator[tuple[str, Any, np.ndarray]]:
    """Kind, sizes and pose of the solids of a visual or collision element; a mesh has a file and a scale."""
    geometry, faults = element.find("geometry"), draft.faults
    place = _origin(element, key, draft)
    for solid in () if geometry is None else geometry:
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
                value = solid.get("filename", ""), vector(solid, "scale", at, faults, (1.0, 1.0, 1.0))
            case _:
                pass
        yield solid.tag, value, place


def _collisions(name: str, link: Element, law: Mapping[str, Any], gazebo: Mapping[str, Element], draft: Draft) -> None:
    """Surfaces of a link, or a note of its contacts."""
    found = link.findall("collision")
    if not found or not draft.contact:
        if found:
            draft.leave("contacts of", name)
        return
    own: dict[str, float] = {}
    if "mu1" in gazebo:
        own["friction"] = numbers(_text(gazebo["mu1"]), 1, f"gazebo.{name}.mu1", draft.faults)[0]
    if "kp" in gazebo:
        own |= soft(numbers(_text(gazebo["kp"]), 1, f"gazebo.{name}.kp", draft.faults)[0], name, draft)
    for element in link.findall("contact/*"):
        if element.tag in _BULLET:
            key = f"links.{name}.contact.{element.tag}"
            own[_BULLET[element.tag]] = _attribute(element, "value", key, draft, 0.0)
    for number, collision in enumerate(found):
        surface = collision.get("name") or (f"{name}_{number + 1}" if len(found) > 1 else name)
        for solid in _solids(collision, f"links.{name}.collision[{number}]", draft):
            collide(draft, name, surface, *solid, {**law, **own})
        note_unknown(collision, _COLLISION, draft, "collisions", name)


def _joint(name: str, joint: Element, parent: str, child: str, gazebo: Mapping[str, Element], draft: Draft) -> None:
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
        if tag in gazebo and d == 1:
            entries[entry] = numbers(_text(gazebo[tag]), 1, f"gazebo.{name}.{tag}", draft.faults)[0]
        elif tag in gazebo:
            draft.leave(f"{tag} of joints", name)
    draft.joint(name, kind, parent, child, SE3.compose(origin, turned), turned, entries)
    limit = joint.find("limit")
    if limit is not None and kind in ("revolute", "prismatic") and joint.get("type") != "continuous":
        lower, upper = (_attribute(limit, side, f"{key}.limit", draft, 0.0) for side in ("lower", "upper"))
        draft.limit(name, lower, upper)
    elif d and limit is not None and {"lower", "upper"} & set(limit.attrib):
        draft.leave("limits of", name)
    note_unknown(joint, _JOINT if d else _FIXED, draft, "joints", name)


def _mimic(name: str, joint: Element, joints: Mapping[str, Element], draft: Draft) -> None:
    """Couple a joint to its mimicked joint, if both have one degree of freedom and the latter starts at 0."""
    mimic = joint.find("mimic")
    if mimic is None:
        return
    key, other = f"joints.{name}.mimic", mimic.get("joint") or ""
    ratio, offset = (
        _attribute(mimic, word, key, draft, default) for word, default in (("multiplier", 1.0), ("offset", 0.0))
    )
    followed = joints.get(other)
    moves = [KINDS.get(str(each.get("type"))) for each in (joint, followed) if each is not None]
    if followed is None:
        draft.leave("mimicry of", f"{name} (of {other}, which is not there)")
    elif other == name or set(moves) - {"revolute", "prismatic"} or (followed.find("mimic") is not None and offset):
        draft.leave("mimicry of", f"{name} (of {other})")
    else:
        draft.gear(name, name, other, ratio, offset)


def _transmission(element: Element, name: str, joints: Mapping[str, Element], draft: Draft) -> None:
    """An actuator of a transmission between one actuator and one joint; its control is the actuator's effort."""
    tied, motors = element.findall("joint"), element.findall("actuator")
    joint = "" if len(tied) != 1 or len(motors) != 1 else tied[0].get("name", "")
    kind = KINDS.get(str(joints[joint].get("type"))) if joint in joints else None
    text = next((each.text for each in element.iter("mechanicalReduction")), None)
    ratio = numbers(text, 1, f"transmissions.{name}.mechanicalReduction", draft.faults, (1.0,))[0]
    if kind not in ("revolute", "prismatic") or not draft.knows(joint) or not ratio:
        draft.leave("transmissions", name)
        return
    limit = joints[joint].find("limit")
    effort = 0.0 if limit is None else _attribute(limit, "effort", f"joints.{joint}.limit", draft, 0.0)
    draft.actuate(motors[0].get("name") or name, {joint: ratio}, [-effort / abs(ratio), effort / abs(ratio)])


def _origin(element: Element, key: str, draft: Draft) -> np.ndarray:
    origin = element.find("origin")
    at, faults = f"{key}.origin", draft.faults
    return pose(vector(origin, "xyz", at, faults), vector(origin, "rpy", at, faults))


def _attribute(element: Element | None, name: str, key: str, draft: Draft, default: float | None = None) -> float:
    text = None if element is None else element.get(name)
    return numbers(text, 1, f"{key}.{name}", draft.faults, () if default is None else (default,))[0]
