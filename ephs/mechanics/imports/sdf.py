"""SDF: a graph of links with their poses, loops included. Source: the SDFormat specification (sdformat.org/spec)."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ephs.mechanics.imports.draft import WORLD, Draft, along, pose, turned_tensor
from ephs.mechanics.imports.elements import check_kind, check_mass, draw, tensor
from ephs.mechanics.imports.file_element import FileElement
from ephs.mechanics.imports.sdf_contacts import ground_surfaces, link_surfaces, solids
from ephs.mechanics.imports.sdf_frames import MODEL, End, Scope, global_name, is_true, joint_ends, read_pose, world_of
from ephs.mechanics.imports.sdf_keys import LINK, ROOT, joint_keys
from ephs.mechanics.imports.sdf_keys import MODEL as MODEL_KEYS
from ephs.mechanics.imports.sdf_keys import WORLD as WORLD_KEYS
from ephs.mechanics.imports.xml import bound, numbers
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
AXES = ("axis", "axis2")
GRAVITY = (0.0, 0.0, -9.8)
"""Of a world, by default, in m/s²."""
AXES_OF_MODEL = (1, 4)
"""Up to this version axes are in the model's directions, from then on in the joint's."""
_PASSED_BY = {
    "plugin": "plugins",
    "gripper": "grippers",
    "sensor": "sensors",
    "projector": "projectors",
}


def read_sdf(root: FileElement, draft: Draft) -> None:
    """Links and joints of the models of a file; static models beside others are the ground, and unattached links move
    freely by a joint ``root_joint``."""
    world = world_of(root, draft.faults)
    moving = [model for model in world.models.values() if not model.grounded]
    scopes = [scope for model in moving for scope in model.everything()]
    _name(root, world, draft)
    _gravity(root, draft)
    _pass_by(world, draft)
    if world.models and not any(scope.links for scope in scopes):
        draft.faults.append(fault("no link", "links", "none"))
    joints: dict[tuple[Scope, str], tuple[FileElement, tuple[End, End]]] = {}
    for scope in (world, *scopes):
        for name, joint in scope.joints.items():
            if joint.get("type") == "gearbox":  # a ratio of two rates is no lower pair
                draft.leave("gearboxes", f"{scope.prefix}{name}")
                joint.pass_by()
                continue
            check_kind(f"{scope.prefix}{name}", joint, KINDS, draft.faults)
            before = len(draft.faults)
            first, second = ends = joint_ends(scope, name)
            if first == second and len(draft.faults) == before:
                found = f'"{global_name(first) or "world"}" twice'
                draft.faults.append(fault("same body", scope.key("joints", name), found))
            joints[scope, name] = joint, ends
    if draft.faults:
        return
    for scope in (world, *scopes):
        for name in scope.frames:  # those that nothing uses have faults, too
            scope.at(name, f"{scope.key('frames', name)}.pose")
        for name, link in scope.links.items():
            _link(f"{scope.prefix}{name}", link, scope.link_pose(name), draft)
    if not draft.faults:
        _hold(scopes, [ends for _, ends in joints.values()], draft)
        for model in moving:
            link_surfaces(model, draft)
        for model in world.models.values():
            if model.grounded:
                _ground(model, draft)
    version = tuple(int(word) for word in (root.get("version") or "1.6").split(".")[:2] if word.isdigit())
    for (scope, name), (joint, ends) in joints.items():
        _joint(name, joint, ends, scope, version, draft)


def _name(root: FileElement, world: Scope, draft: Draft) -> None:
    """Names of the scene, and of elements in notes."""
    moving = [model.name for model in world.models.values() if not model.grounded]
    draft.name = (moving[0] if len(moving) == 1 else world.name) or draft.name
    root.named("files", draft.name, ROOT)
    if world.element is not root:
        world.element.named("worlds", world.name or "world", WORLD_KEYS)
    for model in world.models.values():
        for scope in model.everything():
            scope.element.named("models", scope.prefix.removesuffix("::") or scope.name, MODEL_KEYS)


def _gravity(root: FileElement, draft: Draft) -> None:
    """Gravity of the world, by default that of the specification; before SDF 1.6 ``physics`` has it."""
    for world in root.findall("world"):
        given = [each for path in ("gravity", "physics/gravity") for each in world.findall(path)]
        texts = [text for each in given if (text := (each.text or "").strip() or each.get("xyz"))]
        draft.gravity = numbers(texts[0], 3, "world.gravity", draft.faults) if texts else list(GRAVITY)


def _pass_by(world: Scope, draft: Draft) -> None:
    """Notes of models in other files, and of elements without a counterpart."""
    models = [scope for model in world.models.values() for scope in model.everything()]
    for include in world.element.findall("include"):
        draft.leave("other models of the world", include.findtext("uri") or "?")
        include.pass_by()
    for scope in models:
        for include in scope.element.findall("include"):
            found, hint = include.findtext("uri") or "include", "write its links and joints into the model"
            draft.faults.append(
                fault("not supported", "include", f'"{found}"', what="models of other files", hint=hint)
            )
    above = [] if world.element in [scope.element for scope in models] else world.element.findall("plugin")
    for element in [*above, *(each for model in world.models.values() for each in model.element.everything())]:
        if element.tag in _PASSED_BY:
            draft.leave(_PASSED_BY[element.tag], element.get("name") or element.tag)
            element.pass_by()


def _ground(model: Scope, draft: Draft) -> None:
    """Surfaces of a static model, on the ground."""
    for scope in model.everything():
        if any(link.has("visual") for link in scope.links.values()):
            draft.leave("pictures of static models", scope.name)
        ground_surfaces(scope, draft)


def _hold(scopes: Sequence[Scope], ends: Sequence[tuple[End, End]], draft: Draft) -> None:
    """Join each unattached group of links to the ground: freely, or rigidly if the model is static."""
    near: dict[str, set[str]] = {}
    for first, second in [(global_name(one), global_name(other)) for one, other in ends]:
        near.setdefault(first, set()).add(second)
        near.setdefault(second, set()).add(first)
    children = {global_name(child) for _, child in ends}
    links = {f"{scope.prefix}{name}": (scope, name) for scope in scopes for name in scope.links}
    reached: set[str] = set()
    for start in (WORLD, *sorted(links, key=lambda link: link in children)):
        if start in reached:
            continue
        if start != WORLD:
            scope, name = links[start]
            kind = "fixed" if scope.holds else "free"
            draft.joint("root_joint", kind, WORLD, start, scope.link_pose(name), pose(), {})
        waiting = [start]
        while waiting:
            here = waiting.pop()
            reached.add(here)
            waiting += near.get(here, set()) - reached


def _link(name: str, link: FileElement, place: np.ndarray, draft: Draft) -> None:
    inertial, key, faults = link.find("inertial"), f"links.{name}.inertial", draft.faults
    if inertial is None:
        draft.leave("absence of an inertia, which is 1 kg and 1 kg m² by the specification, of", name)
        draft.body(name, 1.0, np.eye(3), place=place)
    else:
        if (inertial.get("auto") or "").strip().lower() in ("true", "1"):
            hint = "give it mass and inertia in numbers"
            faults.append(fault("not supported", key, "inertia from shapes", what="automatic inertia", hint=hint))
        own = read_pose(inertial, f"{key}.pose", faults)
        mass = numbers(inertial.value("mass"), 1, f"{key}.mass", faults, (1.0,))[0]
        check_mass(mass, key, faults)
        given = inertial.find("inertia")

        def entry(word: str) -> float:
            text = None if given is None else given.value(word)
            return numbers(text, 1, f"{key}.inertia.{word}", faults, (1.0 * (word[1] == word[2]),))[0]

        rows = tensor(entry)
        draft.body(name, mass, turned_tensor(own[:4], rows), own[4:], place)
    link.named("links", name, LINK)
    for number, visual in enumerate(link.findall("visual")):
        for solid in solids(visual, f"links.{name}.visual[{number}]", draft):
            draw(draft, name, *solid)


def _joint(
    name: str, joint: FileElement, ends: tuple[End, End], scope: Scope, version: tuple[int, ...], draft: Draft
) -> None:
    key, (kind, count), faults = scope.key("joints", name), KINDS[str(joint.get("type"))], draft.faults
    whole, origin = f"{scope.prefix}{name}", scope.at(name, f"{key}.pose")
    joint.named("joints", whole, joint_keys(count, fixed=kind == "fixed"))
    axes: list[np.ndarray] = []
    for tag in AXES[:count]:
        direction = _direction(joint.find(tag), f"{key}.{tag}", origin, scope, version, draft)
        if not np.linalg.norm(direction) > DIRECTION:
            faults.append(fault("direction", f"{key}.{tag}.xyz", str(direction.tolist())))
            return
        axes.append(direction)
    framed = along(axes[0], origin) if axes else origin
    assert framed is not None  # the axis is a direction
    entries = _dynamics(whole, joint, kind, count, draft)
    if kind == "universal":
        entries["axis2"] = (quaternion_to_matrix(framed[:4]).T @ quaternion_to_matrix(origin[:4]) @ axes[1]).tolist()
    elif kind == "screw":
        entries["pitch"] = _pitch(joint, key, draft)
    at1, at2 = (_inside(end, framed, scope) for end in ends)
    draft.joint(whole, kind, global_name(ends[0]), global_name(ends[1]), at1, at2, entries)
    if kind != "fixed":
        _limits(whole, joint, count, draft)


def _inside(end: End, at: np.ndarray, scope: Scope) -> np.ndarray:
    """A frame of a model, in a link or in the world."""
    if end is not None and end[0] is scope:  # without the rounding of the model's place
        return SE3.compose(SE3.inverse(scope.at(end[1], scope.key("links", end[1]))), at)
    whole = SE3.compose(scope.place(), at)
    return whole if end is None else SE3.compose(SE3.inverse(end[0].link_pose(end[1])), whole)


def _direction(
    axis: FileElement | None, key: str, origin: np.ndarray, scope: Scope, version: tuple[int, ...], draft: Draft
) -> np.ndarray:
    """The direction of an axis in the joint's frame."""
    xyz = None if axis is None else axis.find("xyz")
    text = None if axis is None else axis.get("xyz") if xyz is None else xyz.text
    given = np.array(numbers(text, 3, f"{key}.xyz", draft.faults, (0.0, 0.0, 1.0)))
    base = "" if xyz is None else xyz.get("expressed_in") or ""
    of_model = axis is not None and is_true(axis, "use_parent_model_frame")
    if of_model or version <= AXES_OF_MODEL:
        base = base or MODEL
    if not base or (base == MODEL and scope.parent is None):
        return given
    there = quaternion_to_matrix(scope.at(base, f"{key}.xyz")[:4])
    return quaternion_to_matrix(origin[:4]).T @ there @ given


def _dynamics(name: str, joint: FileElement, kind: str, count: int, draft: Draft) -> dict[str, Any]:
    """Friction, stiffness and rest, a number an axis; damping of a ball joint is about all axes."""
    words = {"friction": "damping", "dry": "friction"}
    words |= {"stiffness": "spring_stiffness", "rest": "spring_reference"} if count else {}
    rows: dict[str, list[float]] = {entry: [] for entry in words}
    for tag in () if kind == "fixed" else AXES[: max(count, 1)]:
        axis, key = joint.find(tag), f"joints.{name}.{tag}"
        dynamics = None if axis is None else axis.find("dynamics")
        for entry, word in words.items():
            text = None if dynamics is None else dynamics.value(word)
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


def _limits(name: str, joint: FileElement, count: int, draft: Draft) -> None:
    """Stops of a joint of one degree of freedom, as far as its limits are finite, or a note of them."""
    for tag in AXES[: max(count, 1)]:
        limit, key = joint.find(f"{tag}/limit"), f"joints.{name}.{tag}.limit"
        if limit is None:
            continue
        lower = bound(limit.value("lower"), f"{key}.lower", draft.faults, -math.inf)
        upper = bound(limit.value("upper"), f"{key}.upper", draft.faults, math.inf)
        if count == 1 and joint.get("type") != "continuous":
            draft.limit(name, lower, upper)
        elif math.isfinite(lower) or math.isfinite(upper):
            draft.leave("limits of", name)


def _pitch(joint: FileElement, key: str, draft: Draft) -> float:
    """Metres a radian. The older entry counts radians a metre, of a left-handed thread."""
    newer, older = joint.findtext("screw_thread_pitch"), joint.findtext("thread_pitch")
    if newer is not None or older is None:
        return numbers(newer, 1, f"{key}.screw_thread_pitch", draft.faults, (1.0,))[0] / (2.0 * math.pi)
    turns = numbers(older, 1, f"{key}.thread_pitch", draft.faults)[0]
    if turns == 0.0:
        draft.faults.append(fault("range", f"{key}.thread_pitch", "0", what="a number that is not 0"))
        return 0.0
    return -1.0 / turns
