"""The numbers of a scene's elements: reading, writing and range of each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from ephs.mechanics.scene.custom import Element
from ephs.mechanics.scene.errors import Fault, fault
from ephs.mechanics.scene.geometry import body_twist, coupling_of
from ephs.mechanics.scene.inertia import impossible, moments_text
from ephs.mechanics.scene.joints import DryEntry
from ephs.mechanics.scene.layers import LAYER_NUMBERS, layer_number
from ephs.mechanics.scene.model import (
    ATTACHED,
    ELEMENTS,
    GROUND,
    IDENTITY_POSE,
    KINDS,
    Body,
    Joint,
    Scene,
    World,
    frozen,
    mapped,
    with_sections,
)
from ephs.mechanics.scene.motions import changed
from ephs.mechanics.scene.registry import REGISTERED
from ephs.mechanics.scene.shells import ShellSheet
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces import rotations as so3
from ephs.semantics.spaces.decompositions import symmetric_eigenvalues
from ephs.semantics.spaces.rank import INERTIA


@final
@dataclass(frozen=True, slots=True, eq=False)
class NumberField:
    """A number, or an array of numbers, of a body, joint, …

    Parameters
    ----------
    get, put
        The array from (scene, dotted name); the scene from (scene, dotted name, array).
    least
        Bound of every number, and whether it is excluded.
    spread
        Whether one number may stand for all freedoms.
    moves
        ``"frame"`` where bodies have to follow, ``"state"`` where it is a joint's coordinate or rate.
    faults
        What is wrong with the new value: from (scene, name, the scene before).
    table
        Whether it has an entry for each table of a list: ``LIST.KEY`` is ``LIST[0].KEY`` of the first.
    """

    get: Callable[[Scene, str], Array]
    put: Callable[[Scene, str, Array], Scene]
    least: tuple[float, bool] | None = None
    spread: bool = False
    moves: str = ""
    faults: Callable[[Scene, str, Scene], list[Fault]] = lambda *_: []
    table: bool = False


def placed(scene: Scene, before: Scene, coordinates: Mapping[str, Array], rates: Mapping[str, Array]) -> Scene:
    """The scene with its bodies where its joints want them: joints keep the coordinates and rates that are not given,
    as the scene before had them, unless they close a loop."""
    joints = dict(before.all_joints())
    for name, joint in joints.items():
        kept = {"coordinate": joint.coordinate, "rate": joint.rate}
        scene = _edited(scene, "joints", name, lambda j, kept=kept: j.changed(**kept))
    return scene.with_state(coordinates, rates, adjust=True)


def _edited(scene: Scene, kind: str, name: str, change: Callable[[Any], Any]) -> Scene:
    """The scene with one of its elements changed, in any part; its world in all."""
    if kind == "world":
        return mapped(scene, {}, change(scene.world))
    own = scene.section(kind)
    if name in own:
        return with_sections(scene, {kind: {**own, name: change(own[name])}})
    part, _, rest = name.partition(".")
    return replace(scene, parts={**scene.parts, part: _edited(scene.parts[part], kind, rest, change)})


def _element(scene: Scene, kind: str, name: str) -> Any:
    """An element of any part, its names as seen from there; the world."""
    if kind == "world":
        return scene.world
    own = scene.section(kind)
    if name in own:
        return own[name]
    part, _, rest = name.partition(".")
    return _element(scene.parts[part], kind, rest)


def _within(
    kind: str, read: Callable[[Any], ArrayLike], write: Callable[[Any, Array], Any], **more: Any
) -> NumberField:
    """Numbers of an element that depend on it alone: read from it, and written to it."""
    return NumberField(
        lambda scene, name: np.array(read(_element(scene, kind, name)), dtype=float),
        lambda scene, name, values: _edited(scene, kind, name, lambda of: write(of, values)),
        **more,
    )


def _attribute(kind: str, key: str, **more: Any) -> NumberField:
    """A number or an array that is an attribute."""

    def read(of: Any) -> Any:
        value = getattr(of, key)
        return () if value is None else value

    def write(of: Any, values: Array) -> Any:
        return of.changed(**{key: frozen(values) if isinstance(getattr(of, key), np.ndarray) else values.tolist()})

    numbers = ({"world": World} | dict(ELEMENTS) | REGISTERED)[kind].numbers
    return _within(kind, read, write, least=numbers[key].least, **more)


# ---- bodies ------------------------------------------------------------------------------------------------------

_SIX = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def _inertia(body: Body, values: Array) -> Body:
    xx, yy, zz, xy, xz, yz = values.tolist()
    return body.changed(inertia=frozen([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def _body_faults(scene: Scene, name: str, before: Scene) -> list[Fault]:
    """An inertia that no mass distribution has."""
    body, key = scene.body(name), f"bodies.{name}.inertia"
    wrong = "massless" if body.mass == 0.0 and body.inertia.any() else impossible(body.inertia)
    if not wrong or (wrong == "inertia triangle" and impossible(before.body(name).inertia)):
        return []
    return [fault(wrong, key, moments_text(body.inertia))]


def _put_position(scene: Scene, name: str, values: Array) -> Scene:
    """Another centre of mass: the body's motion and joints are unchanged; a free body starts there."""
    body = scene.body(name)
    pose = np.concatenate([body.pose[:4], values])
    joints = [j for _, j in scene.all_joints() if name in (j.body1, j.body2)]
    shift = so3.quaternion_to_matrix(body.pose[:4]).T @ (values - body.pose[4:])
    twist = np.array(body.twist)
    if joints:
        twist[3:] += np.cross(twist[:3], shift)
    scene = _edited(scene, "bodies", name, lambda b: b.changed(pose=frozen(pose), twist=frozen(twist)))
    back = np.concatenate([IDENTITY_POSE[:4], -shift])
    for joint in joints:
        frames = {
            key: frozen(SE3.compose(back, getattr(joint, key)))
            for key, at in (("frame1", joint.body1), ("frame2", joint.body2))
            if at == name
        }
        scene = _edited(scene, "joints", joint.name, lambda j, frames=frames: j.changed(**frames))
    return scene


def _free_only(key: str) -> Callable[[Scene, str, Scene], list[Fault]]:
    def faults(scene: Scene, name: str, _before: Scene) -> list[Fault]:
        joint = next((j.name for _, j in scene.all_joints() if name in (j.body1, j.body2)), None)
        if joint is None:
            return []
        return [fault("held velocity", f"bodies.{name}.{key}", f"a body held by joint {joint}", joint=joint)]

    return faults


# ---- joints ------------------------------------------------------------------------------------------------------


def _pose(scene: Scene, body: str) -> Array:
    return IDENTITY_POSE if body == GROUND else scene.body(body).pose


def _joint_origin(scene: Scene, name: str) -> Array:
    joint = scene.joint(name)
    return SE3.compose(_pose(scene, joint.body1), joint.frame1)[4:]


def _put_at(scene: Scene, name: str, values: Array) -> Scene:
    """Another position of the joint in the world: both frames are displaced equally."""
    joint, by = scene.joint(name), values - _joint_origin(scene, name)
    frames: dict[str, Array] = {}
    for key, body in (("frame1", joint.body1), ("frame2", joint.body2)):
        frame = np.array(getattr(joint, key))
        frame[4:] += so3.quaternion_to_matrix(_pose(scene, body)[:4]).T @ by
        frames[key] = frozen(frame)
    return _edited(scene, "joints", name, lambda j: j.changed(**frames))


def _frame(key: str) -> NumberField:
    def write(joint: Joint, values: Array) -> Joint:
        return joint.changed(**{key: frozen([*getattr(joint, key)[:4], *values])})

    return _within("joints", lambda joint: getattr(joint, key)[4:], write, moves="frame")


def _law(law: str, key: str, change: Callable[[Joint, str, float], Joint], moves: str = "") -> NumberField:
    """A number of a joint's prescribed motion or dry friction, if there is one."""

    def read(joint: Joint) -> ArrayLike:
        of: Any = getattr(joint, law)
        return [number for name, number in of.numbers if name == key] if of is not None else ()

    return _within("joints", read, lambda joint, values: change(joint, key, float(values[0])), moves=moves)


def _led(joint: Joint, key: str, value: float) -> Joint:
    law = changed(joint.motion, key, value)
    return joint.changed(motion=law, rate=frozen([law.rate(0.0)]))


def _rubbed(joint: Joint, key: str, value: float) -> Joint:
    assert joint.dry is not None
    return joint.changed(dry=replace(joint.dry, **{key: value}))


def _stiffness_faults(scene: Scene, name: str, _before: Scene) -> list[Fault]:
    """A rotation vector rests at 0."""
    joint: Joint = scene.joint(name)
    turning = list(coupling_of(joint).turning)
    about, rest = joint.stiffness[turning], joint.rest[turning]
    return [fault("rest rotation", f"joints.{name}.rest", rest.tolist())] if np.any(about) and np.any(rest) else []


def _friction_faults(scene: Scene, name: str, _before: Scene) -> list[Fault]:
    moments = symmetric_eigenvalues(scene.joint(name).friction)
    if moments.size and moments[0] < -INERTIA * float(np.abs(moments).max()):
        return [fault("friction sign", f"joints.{name}.friction", f"the eigenvalue {moments[0]:.6g}")]
    return []


def _table_faults(section: str) -> Callable[[Scene, str, Scene], list[Fault]]:
    """The checks of an element's table."""

    def faults(scene: Scene, name: str, _before: Scene) -> list[Fault]:
        from ephs.mechanics.scene.resolve_elements import number_faults

        return number_faults(_element(scene, section, name), f"{section}.{name}")

    return faults


def _registered(kind: type[Element]) -> dict[str, NumberField]:
    """The numbers of elements that build themselves, with the checks of their tables."""
    return {key: _attribute(kind.section, key, faults=_table_faults(kind.section)) for key in kind.numbers}


def _of_layers(key: str) -> NumberField:
    """A number of each layer of a shell."""

    def read(sheet: ShellSheet) -> list[float]:
        return [layer_number(layer, key) for layer in sheet.layers or ()]

    def write(sheet: ShellSheet, values: Array) -> ShellSheet:
        pairs = zip(sheet.layers or (), values.tolist(), strict=True)
        # what is not given keeps its default, which may be another number of the layer
        layers = [layer if layer_number(layer, key) == value else {**layer, key: value} for layer, value in pairs]
        return sheet.changed(layers=layers)

    return _within("shells", read, write, faults=_table_faults("shells"), table=True)


def _of_pairs(key: str, **more: Any) -> NumberField:
    """Numbers of joints that elements of beams have not, whose own law is that of their strain."""
    plain = _attribute("joints", key, **more)

    def get(scene: Scene, name: str) -> Array:
        return plain.get(scene, name) if scene.joint(name).strain is None else np.zeros(0)

    return replace(plain, get=get)


def fields_of(kind: str) -> Mapping[str, NumberField]:
    """Key of the scene file -> its numbers, of a kind of element; none where there is no such kind."""
    return _registered(REGISTERED[kind]) if kind in REGISTERED else FIELDS.get(kind, {})


FIELDS: Mapping[str, Mapping[str, NumberField]] = {
    "world": {key: _attribute("world", key) for key in World.numbers},
    "bodies": {
        "mass": _attribute("bodies", "mass", faults=_body_faults),
        "inertia": _within("bodies", lambda body: [body.inertia[at] for at in _SIX], _inertia, faults=_body_faults),
        "position": NumberField(lambda scene, name: np.array(scene.body(name).pose[4:]), _put_position),
        "angular_velocity": _within(
            "bodies",
            lambda body: body.twist[:3],
            lambda body, values: body.changed(twist=frozen([*values, *body.twist[3:]])),
            faults=_free_only("angular_velocity"),
        ),
        "velocity": _within(
            "bodies",
            lambda body: so3.quaternion_to_matrix(body.pose[:4]) @ body.twist[3:],
            lambda body, values: body.changed(twist=frozen(body_twist(body.pose, values, body.twist[:3]))),
            faults=_free_only("velocity"),
        ),
    },
    "joints": {
        "pitch": _attribute("joints", "pitch", moves="frame"),
        "friction": _of_pairs("friction", spread=True, faults=_friction_faults),
        **{f"dry.{key}": _law("dry", key, _rubbed) for key in DryEntry.model_fields},
        "stiffness": _of_pairs("stiffness", spread=True, faults=_stiffness_faults),
        "rest": _of_pairs("rest", faults=_stiffness_faults),
        "drive": _of_pairs("drive"),
        "coordinate": _within(
            "joints",
            lambda joint: coupling_of(joint).coordinates(joint.coordinate),
            lambda joint, values: joint.changed(coordinate=frozen(coupling_of(joint).element(values))),
            moves="state",
        ),
        **{f"motion.{key}": _law("motion", key, _led, "state") for key in ("rate", "amplitude", "frequency", "phase")},
        "rate": _attribute("joints", "rate", moves="state"),
        "at": NumberField(_joint_origin, _put_at, moves="frame"),
        "frame1.position": _frame("frame1"),
        "frame2.position": _frame("frame2"),
    },
    **{section: _registered(KINDS[section]) for section in ("springs", "tendons", *ATTACHED)},
    "shells": _registered(KINDS["shells"]) | {f"layers.{key}": _of_layers(key) for key in LAYER_NUMBERS},
    "thermal": {key: _attribute("thermal", key) for key in ("capacity", "temperature")},
    **{section: _registered(KINDS[section]) for section in ("conduction", "markers", "contacts")},
}
"""Kind of element -> key of the scene file -> its numbers."""
