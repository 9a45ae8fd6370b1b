"""Users' inputs as forces on a scene's joints, bodies and markers."""

from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import replace
from typing import Any, final

import numpy as np

from ephs.mechanics.elements.shell.pressure import node_areas
from ephs.mechanics.motion.batch import rotations
from ephs.mechanics.runs.signals import View, signal
from ephs.mechanics.scene.actuators import Actuator
from ephs.mechanics.scene.build import body_box, component_path, element_inputs, node_boxes, tension_port
from ephs.mechanics.scene.element import GROUND
from ephs.mechanics.scene.loads import Load
from ephs.mechanics.scene.markers import Marker
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.shells import ShellSheet
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import AssemblyError, listed
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.solve.posing.problem import Signal, State

# Pressure on a scene's shells as forces on their nodes, which follow the surface.


def pressed(scene: Scene, name: str, sheet: ShellSheet, pressure: Signal) -> tuple[list[str], Signal]:
    """Nodes of a shell, and the wrenches there (6 · nodes,), in nodes' axes, of a pressure in Pa."""
    cells, start, at = sheet.mesh().cells, sheet.start()[0], component_path("shells", name)
    welded = {node: body for body, nodes in sheet.welds().items() for node in nodes}
    pushed = sheet.moving()

    def reading(node: int) -> Callable[[State], Array]:
        rest = start[node]
        if node not in welded:
            free = at / f"node{node}" / "pe" / "q"
            return lambda state: state[free]
        if welded[node] == GROUND:
            return lambda _: rest
        pose = component_path("bodies", welded[node]) / "pe" / "q"
        offset = SE3.compose(SE3.inverse(scene.body(welded[node]).pose), rest)
        return lambda state: SE3.compose(state[pose], offset)

    poses = [reading(node) for node in range(len(start))]

    def wrenches(t: float, state: State) -> Array:
        found = np.array([pose(state) for pose in poses])
        forces = (pressure.at(t, state) * node_areas(found[:, 4:], cells))[pushed]
        out = np.zeros((len(pushed), 6))
        out[:, 3:] = np.einsum("nij,ni->nj", rotations(found[pushed, :4]), forces)
        return out.ravel()

    softly = pressure.constant or pressure.timed
    return [sheet.node(node) for node in pushed], Signal(wrenches, soft=softly)


def part_of(whole: Signal, where: slice) -> Signal:
    """Some of a signal's numbers."""
    if whole.constant:
        return Signal(whole.at(0.0, {})[where])
    return Signal(lambda t, state: whole.at(t, state)[where], held=whole.held, timed=whole.timed, soft=whole.soft)


def sum_of(one: Signal, other: Signal) -> Signal:
    """The sum of two signals."""
    if one.constant and other.constant:
        return Signal(one.at(0.0, {}) + other.at(0.0, {}))
    held = all(signal.constant or signal.held for signal in (one, other))
    timed = all(signal.constant or signal.timed for signal in (one, other))
    return Signal(lambda t, state: one.at(t, state) + other.at(t, state), held=held, timed=timed)


def add_to(signals: dict[Any, Signal], key: Hashable, more: Signal) -> None:
    """Add a signal to that of the same key, if there is one."""
    signals[key] = sum_of(signals[key], more) if key in signals else more


def scene_signals(
    scene: Scene, inputs: Mapping[Any, Any], view: View
) -> tuple[dict[str, Signal], dict[str, Signal], dict[Path, Signal]]:
    """Forces on joints, wrenches on bodies, by name, and signals at other outer ports: loads and user inputs.

    A key may be a tuple of names, whose input gives the numbers of all of them in a row.

    Raises
    ------
    AssemblyError
        There is no such joint, body, marker or attachment.
    """
    forces: dict[str, Signal] = {}
    wrenches: dict[str, Signal] = {}
    others: dict[Path, Signal] = {}
    joints, markers = dict(scene.all_joints()), dict(scene.all_markers())
    bodies = {*dict(scene.all_bodies()), *node_boxes(scene)}
    sizes = {f"joints.{name}": j.dim for name, j in joints.items() if j.strain is None}  # beams have no ports within
    sizes |= {f"bodies.{name}": 6 for name in bodies}
    actuators = {f"actuators.{name}": each for name, each in scene.every("actuators")}
    sizes |= dict.fromkeys(actuators, 1)
    own = element_inputs(scene)
    sizes |= {key: sum(signal.at(0.0, {}).size for signal in ports.values()) for key, ports in own.items()}
    blown = {name: sheet for name, sheet in scene.all_shells() if sheet.pressure is not None}
    pressures = {name: Signal(np.array([sheet.pressure])) for name, sheet in blown.items()}
    sizes |= {f"shells.{name}": 1 for name in blown}
    sizes |= {f"markers.{name}": 3 for name, marker in markers.items() if marker.body in bodies}
    for _, load in scene.all_loads():
        add_to(wrenches, load.body, _of_load(scene, load))
    for key, given in _single(inputs, sizes, view):
        kind, _, name = key.partition(".")
        if key in own:
            first = 0
            for port, signal in own[key].items():
                last = first + signal.at(0.0, {}).size
                others[port] = replace(part_of(given, slice(first, last)), effort=signal.effort)
                first = last
            continue
        if kind in ("joints", "actuators"):
            of = actuators.get(key)
            if of is not None and of.tendon is not None:
                add_to(others, tension_port(of.tendon), *_shares(of, given))
                continue
            shares = {name: given} if of is None else dict(zip(of.joints, _shares(of, given), strict=True))
            for joint, share in shares.items():
                add_to(forces, joint, share)
            continue
        if kind == "shells":
            pressures[name] = given
            continue
        if kind == "markers":
            name, given = markers[name].body, _at_marker(scene, markers[name], given)
        add_to(wrenches, name, given)
    for name, sheet in blown.items():
        nodes, whole = pressed(scene, name, sheet, pressures[name])
        shared = Signal(_Latest(whole).at, soft=whole.soft)
        for i, node in enumerate(nodes):
            add_to(wrenches, node, part_of(shared, slice(6 * i, 6 * i + 6)))
    return forces, wrenches, others


def _single(inputs: Mapping[Any, Any], sizes: Mapping[str, int], view: View) -> Iterator[tuple[str, Signal]]:
    """The signal of each joint, body or marker, of ``sizes`` numbers by key."""
    for key, value in inputs.items():
        keys = key if isinstance(key, tuple) else (key,)
        for one in keys:
            if one not in sizes:
                raise AssemblyError("unknown-input", one, expected=listed(one, sizes))
        ends = np.cumsum([0, *(sizes[one] for one in keys)])
        whole = signal(value, effort=False, name=", ".join(keys), size=int(ends[-1]), view=view)
        if len(keys) == 1:
            yield keys[0], whole
            continue
        shared = whole if whole.constant else Signal(_Latest(whole).at, held=whole.held, timed=whole.timed)
        for one, first, last in zip(keys, ends[:-1], ends[1:], strict=True):
            yield one, part_of(shared, slice(int(first), int(last)))


def _shares(of: Actuator, control: Signal) -> list[Signal]:
    """Force on each joint of an actuator, or on the length of its tendon, of its control within its limits."""
    low, high = (-np.inf, np.inf) if of.limits is None else of.limits

    def share(ratio: float) -> Signal:
        if control.constant:
            return Signal(ratio * np.clip(control.at(0.0, {}), low, high))
        return replace(control, value=lambda t, state: ratio * np.clip(control.at(t, state), low, high))

    return [share(ratio) for ratio in np.atleast_1d(of.ratio)]


@final
class _Latest:
    """A signal that several ports share: evaluated once for each time and state."""

    def __init__(self, signal: Signal) -> None:
        self._signal, self._found = signal, np.zeros(0)
        self._t = float("nan")
        self._state: State = {}

    def at(self, t: float, state: State) -> Array:
        if t != self._t or state is not self._state:
            self._found = self._signal.at(t, state)
            self._t, self._state = t, state
        return self._found


def _at_marker(scene: Scene, marker: Marker, force: Signal) -> Signal:
    """A force in world axes at a marker as a wrench in the body's frame."""
    pose = body_box(scene, marker.body) / "pe" / "q"

    def wrench(t: float, state: Mapping[Path, Array]) -> Array:
        own = quaternion_to_matrix(state[pose][:4]).T @ force.at(t, state)
        return np.concatenate([np.cross(marker.at, own), own])

    return Signal(wrench)


def _of_load(scene: Scene, load: Load) -> Signal:
    """A load as a wrench in the body's frame."""
    still, pose = np.eye(3), body_box(scene, load.body) / "pe" / "q"

    def wrench(t: float, state: Mapping[Path, Array]) -> Array:
        share = 1.0 if t >= load.ramp else max(t, 0.0) / load.ramp
        return share * load.wrench(still if load.follower else quaternion_to_matrix(state[pose][:4]))

    steady = load.follower and not load.ramp
    return Signal(load.wrench(still)) if steady else Signal(wrench, timed=load.follower)
