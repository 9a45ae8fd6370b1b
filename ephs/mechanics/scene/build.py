"""Scenes as hierarchical systems.

Boxes are ``SECTION.NAME`` of bodies, joints, thermal nodes and other elements, ``parts.NAME``, ``ground`` and
``environment``; they meet at the junctions ``momenta.BODY``, ``entropies.NODE``, and ``lengthenings.NODE`` of nodes
that expand. A driven joint's momentum is the outer port ``drives.JOINT``. What a part exposes is joined at
``momenta.PART.BODY`` and so on; a part's name is not taken by anything else of its level, so these never clash.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ephs.mechanics.elements import components
from ephs.mechanics.elements.beam import thermoelastic
from ephs.mechanics.elements.motor import armature
from ephs.mechanics.scene.contacts import contact_points
from ephs.mechanics.scene.demands import Demands, demands_on_parts
from ephs.mechanics.scene.made import SystemCache
from ephs.mechanics.scene.model import ENVIRONMENT, GROUND, Joint, Scene
from ephs.mechanics.scene.site import INPUTS, SceneLevel, built, form_of, started
from ephs.mechanics.scene.thermal import ThermalNode
from ephs.operad import Path, Pattern, Quantity, junction, quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Storage
from ephs.semantics.systems.kept import once
from ephs.semantics.systems.system import Filling, System
from ephs.solve.posing.problem import Signal


def component_path(kind: str, name: str) -> Path:
    """Box of a (dotted) body, joint, …: ``left.crank`` is the box ``parts.left.bodies.crank``."""
    *parts, last = name.split(".")
    return Path([*(word for part in parts for word in ("parts", part)), kind, last])


def wrench_port(body: str) -> Path:
    """The outer port at which a wrench acts on a body."""
    return _initial_path("momenta", body)


def tension_port(tendon: str) -> Path:
    """The outer port at which a force acts on a tendon's length."""
    return _initial_path("tensions", tendon)


def drive_ports(of: Joint) -> tuple[tuple[Path, slice], ...]:
    """The outer ports of a driven joint, and which of its degrees of freedom each of them moves."""
    at = _initial_path("drives", of.name)
    if of.middle is None:
        return ((at, slice(0, of.dim)),)
    return ((at / "first", slice(0, 1)), (at / "second", slice(1, 2)))


def scene_system(scene: Scene, *, driven: Iterable[str] = (), wrenches: Iterable[str] = ()) -> System:
    """The scene as a hierarchical system, made once and kept with the scene.

    Parameters
    ----------
    driven
        Joints whose momentum is to be an outer port, beside those that the scene drives itself.
    wrenches
        Bodies whose momentum is to be an outer port.
    """
    asked, pushed = frozenset(driven), frozenset(wrenches)

    form = form_of(scene)

    def made() -> System:
        own = {name for name, j in form.all_joints() if _is_driven(j)}
        return _level(form, Demands(pushed, frozenset(), own | asked), top=True)

    return once(form, ("system", asked, pushed), made)


def started_system(scene: Scene) -> System:
    """The same with the scene's initial state, and ports where its loads and pressures act; made once, too."""

    def made() -> System:
        loaded = {load.body for _, load in scene.all_loads()}
        loaded |= {sheet.node(node) for _, sheet in scene.all_shells() for node in sheet.pushed()}
        return scene_system(scene, wrenches=loaded).with_initial(initial_state(scene))

    return once(scene, "started", made)


def initial_state(scene: Scene) -> dict[Path, Array]:
    """Values of all states of the scene's system at the start; the values are made once and kept with the scene."""
    return dict(once(scene, "initial state", lambda: _initial_state(scene)))


def _initial_state(scene: Scene) -> dict[Path, Array]:
    out: dict[Path, Array] = {}
    for name, body in scene.all_bodies():
        at = component_path("bodies", name)
        out[at / "pe" / "q"] = np.array(body.pose)
        if body.mass > 0.0:
            out[at / "ke" / "p"] = np.concatenate([body.inertia @ body.twist[:3], body.mass * body.twist[3:]])
    for name, j in scene.all_joints():
        at = component_path("joints", name)
        halves = [(at, np.array(j.coordinate))]
        if j.middle is not None:
            halves = [(at / part, j.coordinate[i : i + 1].copy()) for i, part in enumerate(("first", "second"))]
        for place, value in halves:
            out[place / "pe" / "q_r"] = value
            if j.heat == ENVIRONMENT:
                out[place / "env" / "s"] = np.zeros(1)
        if j.armature:
            out[component_path("armatures", name) / "p"] = j.armature * j.rate
    for name, node in scene.all_thermal():
        out |= {component_path("thermal", name) / state: np.zeros(1) for state in ("s", *["e"] * (node.pull > 0.0))}
    for path, level in scene.levels():
        own, at = built(level), Path([word for part in path.split(".")[:-1] for word in ("parts", part)])
        states = once(form_of(level), "states of elements", lambda own=own: _element_states(own))
        out |= {Path([*at, *state]): value for state, value in states.items()}
        for box, (element, start) in own.starts.items():
            for name, value in started(level, element, start).items():
                out[Path([*at, *box, *name.split(".")])] = np.array(value, dtype=float)
    for value in out.values():
        value.flags.writeable = False
    return out


def _element_states(level: SceneLevel) -> Mapping[Path, Array]:
    """States of the boxes of a level's elements, as their fillings have them."""
    if not level.boxes:
        return {}
    return System.of(Pattern(junctions=level.junctions, boxes=level.boxes), level.fillings).state()


def scene_inputs(scene: Scene) -> dict[Path, Signal]:
    """Prescribed drives as flows, motions as efforts at the ports of `drive_ports`, inputs of elements; of tendons no
    force but their own.
    """
    out = {port: signal for ports in element_signals(scene).values() for port, signal in ports.items()}
    for _, j in scene.all_joints():
        if _is_driven(j):
            for port, where in drive_ports(j):
                out[port] = Signal(np.array(j.drive[where])) if j.motion is None else Signal.of_motion(j.motion)
    return out


def element_inputs(scene: Scene) -> Mapping[str, Mapping[Path, Signal]]:
    """Inputs of elements by their names, each with its ports and what these have without it."""
    return {name: ports for name, ports in element_signals(scene).items() if name}


def element_signals(scene: Scene) -> Mapping[str, Mapping[Path, Signal]]:
    """The same with the ports that runs do not name, under the empty name."""

    def made() -> dict[str, dict[Path, Signal]]:
        out: dict[str, dict[Path, Signal]] = {}
        for path, level in scene.levels():
            for port, (name, signal) in built(level).inputs.items():
                section, _, own = name.partition(".")
                out.setdefault(f"{section}.{path}{own}" if name else "", {})[_outside(port, path)] = signal
        return out

    return once(scene, "element inputs", made)


def scene_names(scene: Scene) -> dict[Path, str]:
    """Box in the scene's system -> the name of what it stands for: of bodies, joints, springs, contacts."""
    form = form_of(scene)
    return once(form, "names", lambda: _scene_names(form))


def _scene_names(scene: Scene) -> dict[Path, str]:
    out: dict[Path, str] = {component_path("bodies", name): name for name, _ in scene.all_bodies()}
    out |= {component_path("springs", name): name for name, _ in scene.all_springs()}
    for name, c in scene.all_contacts():
        points = range(len(contact_points(scene, c)))
        out |= {component_path("contacts", name) / f"point{i}": name for i in points}
    for name, j in scene.all_joints():
        at = component_path("joints", name)
        out |= {part: name for part in ([at] if j.middle is None else [at / "first", at / "second"])}
    return out


def _is_driven(j: Joint) -> bool:
    return j.motion is not None or bool(np.any(j.drive))


def _initial_path(group: str, name: str) -> Path:
    return Path([group, *name.split(".")])


@dataclass(slots=True)
class _Builder:
    """Collects the boxes of one level."""

    demands: Demands
    inner: Demands
    junctions: dict[Path, Any] = field(default_factory=dict)
    boxes: dict[Path, dict[Any, str]] = field(default_factory=dict)
    fillings: dict[Path, Filling] = field(default_factory=dict)
    made: SystemCache = field(default_factory=SystemCache)

    def momentum(self, body: str) -> str:
        """The junction of a body's momentum."""
        path = _initial_path("momenta", body)
        self.junctions[path] = junction(quantity.body_momentum, exposed=body in self.demands.bodies)
        return str(path)

    def entropy(self, node: str) -> str:
        """The junction of a thermal node."""
        path = _initial_path("entropies", node)
        self.junctions[path] = junction(quantity.entropy, exposed=node in self.demands.nodes)
        return str(path)

    def lengthening(self, node: str) -> str:
        """The junction of the lengthening of what expands with a thermal node."""
        path = _initial_path("lengthenings", node)
        self.junctions[path] = junction(quantity.displacement)
        return str(path)

    def drive(self, name: str, path: Path, of: Quantity) -> str:
        """The junction of a driven joint, exposed at the request of the level above."""
        self.junctions[path] = junction(of, exposed=name in self.demands.joints)
        return str(path)

    def join(self, own: SceneLevel, path: Path) -> None:
        """A junction of elements."""
        group, name = path[0], ".".join(path[1:])
        if group in ("momenta", "entropies"):
            self.momentum(name) if group == "momenta" else self.entropy(name)
        elif group != "drives":
            self.junctions[path] = own.junctions[path]

    def take(self, own: SceneLevel, section: str) -> None:
        """The boxes of elements of a section, with their junctions: states are in the order of boxes."""
        for path, ports in own.boxes.items():
            if path[0] == section:
                for at in ports.values():
                    self.join(own, Path.of(at))
                self.add(path, own.fillings[path], ports)

    def add(self, path: Path, filling: Filling, ports: Mapping[Any, str]) -> None:
        """A box with its filling."""
        self.boxes[path], self.fillings[path] = dict(ports), filling


def _level(scene: Scene, demands: Demands, *, top: bool) -> System:
    inner = demands_on_parts(scene, demands)
    if not top:
        demands = Demands(demands.bodies | {GROUND}, demands.nodes, demands.joints)
    b = _Builder(demands, inner)
    gravity = scene.world.gravity
    for name, body in scene.bodies.items():
        b.add(Path(["bodies", name]), b.made.body(body, gravity), {"p": b.momentum(name)})
    for name, j in scene.joints.items():
        ports = {"p1": b.momentum(j.body1), "p2": b.momentum(j.body2)}
        if j.heat != ENVIRONMENT:
            ports["s"] = b.entropy(j.heat)
        driven, expands = name in inner.joints, _expands(scene, j)
        if expands:
            ports["e"] = b.lengthening(j.heat)
        system = b.made.joint(j, driven=driven, expands=expands)
        if driven:
            names = ("p_r",) if j.middle is None else ("p_r1", "p_r2")
            for port, (path, _) in zip(names, drive_ports(j), strict=True):
                ports[port] = b.drive(name, path, system.interface[Path.of(port)].quantity)
        b.add(Path(["joints", name]), system, ports)
        if j.armature:
            at = _initial_path("drives", name)
            b.add(Path(["armatures", name]), armature(b.junctions[at].quantity, j.armature), {"p": str(at)})
    own = built(scene)
    for section in ("springs", "contacts", "tendons"):
        b.take(own, section)
    for name, node in scene.thermal.items():
        ports = {"s": b.entropy(name)} | ({"e": b.lengthening(name)} if node.pull else {})
        b.add(Path(["thermal", name]), _storing(node), ports)
    for name, part in scene.parts.items():
        system = _level(part, inner.of_part(name), top=False)
        ports = {port: _joined(b, name, port, system.interface[port].quantity) for port in system.interface}
        b.add(Path(["parts", name]), system, ports)
    for path in own.junctions:
        b.join(own, path)
    b.boxes.update(own.boxes)
    b.fillings.update(own.fillings)
    if top and _initial_path("momenta", GROUND) in b.junctions:
        b.add(Path(["ground"]), components.ground(), {"p": b.momentum(GROUND)})
    return System.of(Pattern(junctions=b.junctions, boxes=b.boxes), b.fillings)


def _expands(scene: Scene, joint: Joint) -> bool:
    """Whether a joint is an element of a beam that expands with its heat."""
    node = scene.thermal.get(joint.heat)
    return joint.strain is not None and node is not None and node.pull > 0.0


def _storing(node: ThermalNode) -> Storage:
    if node.pull:
        return thermoelastic(node.capacity, node.temperature, node.pull, node.reference)
    return components.thermal_node(node.capacity, node.temperature)


def _joined(b: _Builder, part: str, port: Path, of: Quantity) -> str:
    """The junction at this level of a part's outer port."""
    group, *rest = tuple(port)
    if rest == [GROUND]:
        return b.momentum(GROUND)
    name = ".".join([part, *rest])
    if group == "momenta":
        return b.momentum(name)
    if group == "entropies":
        return b.entropy(name)
    path = _outside(port, f"{part}.")
    if group != "drives":
        b.junctions[path] = junction(of, exposed=True)
        return str(path)
    joint_name = name if name in b.inner.joints else name.rpartition(".")[0]
    return b.drive(joint_name, path, of)


def _outside(port: Path, path: str) -> Path:
    """An outer port as seen from outside of the part at a path, which ends in a dot."""
    start = 2 if port[0] == INPUTS else 1
    return Path([*port[:start], *path.split(".")[:-1], *port[start:]])
