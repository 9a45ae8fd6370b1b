"""SDF: a graph of links with their poses, loops included. Source: the SDFormat specification (sdformat.org/spec)."""

import math
from collections.abc import Mapping
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from ephs.mechanics.imports.draft import UNLIMITED, WORLD, Draft, along, pose, turned_tensor
from ephs.mechanics.imports.elements import check_kind, check_link, check_mass, draw, named, tensor
from ephs.mechanics.imports.keys import note_unknown
from ephs.mechanics.imports.sdf_contacts import ground_surfaces, link_surfaces, solids
from ephs.mechanics.imports.sdf_frames import MODEL, Frames, read_pose
from ephs.mechanics.imports.sdf_keys import LINK, ROOT, joint_keys
from ephs.mechanics.imports.sdf_keys import MODEL as MODEL_KEYS
from ephs.mechanics.imports.sdf_keys import WORLD as WORLD_KEYS
from ephs.mechanics.imports.xml import numbers
from ephs.mechanics.scene.errors import fault
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rank import DIRECTION
from ephs.semantics.spaces.rotations import quaternion_to_matrix

# SDF's kind: (kind, how many axes)
KINDS = {
    "revolute": ("revolute", 1),
    "continuous": ("revolute", 1),
    "prismatic": ("prismatic", 1),
    "screw": ("screw", 1),
    "ball": ("spherical", 0),
    "fixed": ("fixed", 0),
    "universal": ("universal", 2),
    "revolute2": ("universal", 2),
}
AXES_OF_MODEL = (1, 4)
"""Up to this version axes are in the model's directions, from then on in the joint's."""
_PASSED_BY = {
    "plugin": "plugins",
    "gripper": "grippers",
    "sensor": "sensors",
    "projector": "projectors",
}


def read_sdf(root: Element, draft: Draft) -> None:
    """Links and joints of the only model of a file; unattached links move freely by a joint ``root_joint``."""
    models = _models(root, draft)
    if not models:
        return
    model, *grounds = models
    draft.name = model.get("name") or draft.name
    for inner in model.findall("model") + model.findall("include"):
        found = inner.get("name") or inner.findtext("uri") or inner.tag
        hint = "write its links and joints into the model: nothing else is read"
        draft.faults.append(fault("not supported", inner.tag, f'"{found}"', what="models within it", hint=hint))
    links, every, placed = (named(model, tag, draft.faults) for tag in ("link", "joint", "frame"))
    joints = dict(every)
    for name in [name for name, joint in joints.items() if joint.get("type") == "gearbox"]:
        draft.leave("gearboxes", name)  # a ratio of two rates is no lower pair
        del joints[name]
    ends = {name: _ends(name, joint, links, placed, draft) for name, joint in joints.items()}
    if not links:
        draft.faults.append(fault("no link", "links", "none"))
    if draft.faults:
        return
    frames = Frames({**placed, **every, **links}, draft.faults)
    place = _place(model, frames, draft)
    for name, link in links.items():
        _link(name, link, SE3.compose(place, frames.at(name, f"links.{name}.pose")), draft)
    if not draft.faults:
        _hold(links, ends, _is(model, "static"), place, frames, draft)
        link_surfaces(model, links, draft)
        for other in grounds:
            _ground(other, draft)
    version = tuple(int(word) for word in (root.get("version") or "1.6").split(".")[:2] if word.isdigit())
    for name, joint in joints.items():
        _joint(name, joint, ends[name], place, frames, version, draft)
    note_unknown(root, ROOT, draft, "files", draft.name)
    note_unknown(model, MODEL_KEYS, draft, "models", draft.name)
    for world in root.findall("world"):
        note_unknown(world, WORLD_KEYS, draft, "worlds", world.get("name") or "world")
    for element in [*model.iter(), *root.findall("world/plugin")]:
        if element.tag in _PASSED_BY:
            draft.leave(_PASSED_BY[element.tag], element.get("name") or element.tag)


def _models(root: Element, draft: Draft) -> list[Element]:
    """The only model, or the only one that moves and then the static ones; none where there is a fault."""
    worlds = root.findall("world")
    models = root.findall("model") + [model for world in worlds for model in world.findall("model")]
    models.sort(key=lambda model: _is(model, "static"))
    if not models or (len(models) > 1 and not (_is(models[1], "static") and not _is(models[0], "static"))):
        names = ", ".join(model.get("name") or "?" for model in models)
        draft.faults.append(fault("one model", "model", f"{len(models)}: {names}" if models else "none"))
        return []
    for world in worlds:
        if gravity := world.findtext("gravity"):
            draft.gravity = numbers(gravity, 3, "world.gravity", draft.faults)
        for include in world.findall("include"):
            draft.leave("other models of the world", include.findtext("uri") or "?")
    return models


def _is(element: Element, word: str) -> bool:
    return (element.findtext(word) or "").strip() in ("true", "1")


def _place(model: Element, frames: Frames, draft: Draft) -> np.ndarray:
    """The pose (7,) of a model in the world."""
    place = read_pose(model, "model.pose", draft.faults)
    if frame := model.get("placement_frame"):
        place = SE3.compose(place, SE3.inverse(frames.at(frame, "model.placement_frame")))
    if (base := _relative(model)) not in ("", "world"):
        hint = "place it relative to the world"
        draft.faults.append(
            fault("not supported", "model.pose", f'"{base}"', what="other frames than its own", hint=hint)
        )
    return place


def _ground(model: Element, draft: Draft) -> None:
    """Surfaces of a static model, on the ground."""
    name = model.get("name") or "static"
    links, joints, placed = (named(model, tag, draft.faults) for tag in ("link", "joint", "frame"))
    frames = Frames({**placed, **joints, **links}, draft.faults)
    place = _place(model, frames, draft)
    if model.find("link/visual") is not None:
        draft.leave("pictures of static models", name)
    if model.find("model") is not None or model.find("include") is not None:
        draft.leave("models within static models", name)
    ground_surfaces(name, {link: SE3.compose(place, frames.at(link, f"{name}.{link}")) for link in links}, links, draft)


def _relative(element: Element) -> str:
    given = element.find("pose")
    return "" if given is None else given.get("relative_to", "")


def _ends(
    name: str, joint: Element, links: Mapping[str, Element], frames: Mapping[str, Element], draft: Draft
) -> tuple[str, str]:
    """The parent and the child of a joint; its type is checked."""
    check_kind(name, joint, KINDS, draft.faults)
    ends: list[str] = []
    for end in ("parent", "child"):
        link = (joint.findtext(end) or "").strip()
        for _ in frames:  # a frame stands for the link that it is attached to
            if link not in frames or link in links:
                break
            link = frames[link].get("attached_to", link)
        if link == "world" and link not in links:
            ends.append(WORLD)
            continue
        check_link(link, f"joints.{name}.{end}", links, draft.faults)
        ends.append(link)
    if ends[0] == ends[1]:
        draft.faults.append(fault("same body", f"joints.{name}", f'"{ends[0] or "world"}" twice'))
    return ends[0], ends[1]


def _hold(
    links: Mapping[str, Element],
    ends: Mapping[str, tuple[str, str]],
    static: bool,
    place: np.ndarray,
    frames: Frames,
    draft: Draft,
) -> None:
    """Join each unattached group of links to the ground: freely, or rigidly if the model is static."""
    near: dict[str, set[str]] = {}
    for first, second in ends.values():
        near.setdefault(first, set()).add(second)
        near.setdefault(second, set()).add(first)
    children = {child for _, child in ends.values()}
    reached: set[str] = set()
    for start in (WORLD, *sorted(links, key=lambda link: link in children)):
        if start in reached:
            continue
        if start != WORLD:
            at = SE3.compose(place, frames.at(start, f"links.{start}.pose"))
            draft.joint("root_joint", "fixed" if static else "free", WORLD, start, at, pose(), {})
        waiting = [start]
        while waiting:
            here = waiting.pop()
            reached.add(here)
            waiting += near.get(here, set()) - reached


def _link(name: str, link: Element, place: np.ndarray, draft: Draft) -> None:
    inertial, key, faults = link.find("inertial"), f"links.{name}.inertial", draft.faults
    if inertial is None:
        draft.leave("absence of an inertia, which is 1 kg and 1 kg m² by the specification, of", name)
        draft.body(name, 1.0, np.eye(3), place=place)
    else:
        if inertial.get("auto", "").strip() in ("true", "1"):
            hint = "give it mass and inertia in numbers"
            faults.append(fault("not supported", key, "inertia from shapes", what="automatic inertia", hint=hint))
        own = read_pose(inertial, f"{key}.pose", faults)
        mass = numbers(inertial.findtext("mass"), 1, f"{key}.mass", faults, (1.0,))[0]
        check_mass(mass, key, faults)
        given = inertial.find("inertia")

        def entry(word: str) -> float:
            text = None if given is None else given.findtext(word)
            return numbers(text, 1, f"{key}.inertia.{word}", faults, (1.0 * (word[1] == word[2]),))[0]

        rows = tensor(entry)
        draft.body(name, mass, turned_tensor(own[:4], rows), own[4:], place)
    note_unknown(link, LINK, draft, "links", name)
    for number, visual in enumerate(link.findall("visual")):
        for solid in solids(visual, f"links.{name}.visual[{number}]", draft):
            draw(draft, name, *solid)


def _joint(
    name: str,
    joint: Element,
    ends: tuple[str, str],
    place: np.ndarray,
    frames: Frames,
    version: tuple[int, ...],
    draft: Draft,
) -> None:
    key, (kind, count), faults = f"joints.{name}", KINDS[str(joint.get("type"))], draft.faults
    origin = frames.at(name, f"{key}.pose")
    axes: list[np.ndarray] = []
    for tag in ("axis", "axis2")[:count]:
        element = joint.find(tag)
        direction = _direction(element, f"{key}.{tag}", origin, frames, version, draft)
        if not np.linalg.norm(direction) > DIRECTION:
            faults.append(fault("direction", f"{key}.{tag}.xyz", str(direction.tolist())))
            return
        axes.append(direction)
    framed = along(axes[0], origin) if axes else origin
    assert framed is not None  # the axis is a direction
    entries = _dynamics(name, joint, kind, count, draft)
    if kind == "universal":
        entries["axis2"] = (quaternion_to_matrix(framed[:4]).T @ quaternion_to_matrix(origin[:4]) @ axes[1]).tolist()
    elif kind == "screw":
        entries["pitch"] = _pitch(joint, key, draft)
    at1, at2 = (_inside(end, framed, place, frames) for end in ends)
    draft.joint(name, kind, *ends, at1, at2, entries)
    _limits(name, joint, kind, count, draft)
    note_unknown(joint, joint_keys(count, fixed=kind == "fixed"), draft, "joints", name)


def _inside(link: str, at: np.ndarray, place: np.ndarray, frames: Frames) -> np.ndarray:
    """A frame of the model, in a link or in the world."""
    if link == WORLD:
        return SE3.compose(place, at)
    return SE3.compose(SE3.inverse(frames.at(link, f"links.{link}.pose")), at)


def _direction(
    axis: Element | None, key: str, origin: np.ndarray, frames: Frames, version: tuple[int, ...], draft: Draft
) -> np.ndarray:
    """The direction of an axis in the joint's frame."""
    xyz = None if axis is None else axis.find("xyz")
    given = np.array(numbers(None if xyz is None else xyz.text, 3, f"{key}.xyz", draft.faults, (0.0, 0.0, 1.0)))
    base = "" if xyz is None else xyz.get("expressed_in", "")
    of_model = axis is not None and (axis.findtext("use_parent_model_frame") or "").strip() in ("true", "1")
    if of_model or version <= AXES_OF_MODEL:
        base = base or MODEL
    if not base:
        return given
    there = quaternion_to_matrix(frames.at(base, f"{key}.xyz")[:4])
    return quaternion_to_matrix(origin[:4]).T @ there @ given


def _dynamics(name: str, joint: Element, kind: str, count: int, draft: Draft) -> dict[str, Any]:
    """Friction, stiffness and rest, a number an axis; damping of a ball joint is about all axes."""
    words = {"friction": "damping", "dry": "friction", "stiffness": "spring_stiffness", "rest": "spring_reference"}
    rows: dict[str, list[float]] = {entry: [] for entry in words}
    for tag in ("axis", "axis2")[: max(count, 1)]:
        axis, key = joint.find(tag), f"joints.{name}.{tag}"
        dynamics = None if axis is None else axis.find("dynamics")
        for entry, word in words.items():
            text = None if dynamics is None else dynamics.findtext(word)
            value = numbers(text, 1, f"{key}.dynamics.{word}", draft.faults, (0.0,))[0]
            if value < 0.0 and entry != "rest":
                what = "a number not below 0"
                draft.faults.append(fault("range", f"{key}.dynamics.{word}", f"{value:g}", what=what))
            rows[entry].append(value)
    if kind == "fixed":
        return {}
    dry = draft.dry(name, max(rows.pop("dry")), 3 if kind == "spherical" else count)
    if kind == "spherical":
        return {"friction": rows["friction"][0]}
    return dict(rows) if count > 1 else {entry: values[0] for entry, values in rows.items()} | dry


def _limits(name: str, joint: Element, kind: str, count: int, draft: Draft) -> None:
    """Stops of a joint of one degree of freedom, as far as its limits are finite, or a note of them."""
    for tag in ("axis", "axis2"):
        limit = joint.find(f"{tag}/limit")
        if limit is None or kind == "fixed":
            continue
        given = {word: limit.findtext(word) for word in ("lower", "upper")}
        sides = [_bound(given[word], f"joints.{name}.{tag}.limit.{word}", draft) for word in given]
        if count == 1 and joint.get("type") != "continuous":
            draft.limit(name, -sides[0] if given["lower"] is None else sides[0], sides[1])
        elif any(abs(side) < UNLIMITED for side in sides):
            draft.leave("limits of", name)


def _bound(text: str | None, key: str, draft: Draft) -> float:
    """A limit, infinite where there is none."""
    if text is None or text.strip().lstrip("+-").lower() in ("inf", "infinity"):
        return -math.inf if (text or "").strip().startswith("-") else math.inf
    return numbers(text, 1, key, draft.faults)[0]


def _pitch(joint: Element, key: str, draft: Draft) -> float:
    """Metres a radian. The older entry counts radians a metre, of a left-handed thread."""
    newer, older = joint.findtext("screw_thread_pitch"), joint.findtext("thread_pitch")
    if newer is not None or older is None:
        return numbers(newer, 1, f"{key}.screw_thread_pitch", draft.faults, (1.0,))[0] / (2.0 * math.pi)
    turns = numbers(older, 1, f"{key}.thread_pitch", draft.faults)[0]
    if turns == 0.0:
        draft.faults.append(fault("range", f"{key}.thread_pitch", "0", what="a number that is not 0"))
        return 0.0
    return -1.0 / turns
