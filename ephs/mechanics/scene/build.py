"""Scenes as hierarchical systems.

Boxes are ``SECTION.NAME`` of bodies, joints, thermal nodes and other elements, ``parts.NAME``, ``ground`` and
``environment``; they meet at the junctions ``momenta.BODY``, ``entropies.NODE``, and ``lengthenings.NODE`` of nodes
that expand. A driven joint's momentum is the outer port ``drives.JOINT``. What a part exposes is joined at
``momenta.PART.BODY`` and so on; a part's name is not taken by anything else of its level, so these never clash.
"""

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, final

import numpy as np

from ephs.mechanics.elements import components
from ephs.mechanics.elements.beam import beam_stretch, elastic, hinge_damper, thermoelastic
from ephs.mechanics.elements.bodies import rigid_body
from ephs.mechanics.elements.joints import between_frames, joint, universal_joint
from ephs.mechanics.elements.motor import armature
from ephs.mechanics.scene.contacts import contact_points
from ephs.mechanics.scene.flexible import Strain
from ephs.mechanics.scene.model import ENVIRONMENT, GROUND, Body, Joint, Scene
from ephs.mechanics.scene.site import INPUTS, SceneLevel, built, form_of, started
from ephs.mechanics.scene.thermal import ThermalNode
from ephs.operad import Junction, Path, Pattern, Quantity, junction, quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Storage
from ephs.semantics.spaces import pair
from ephs.semantics.systems.kept import once
from ephs.semantics.systems.system import System
from ephs.solve.posing.problem import Signal

_RATES = ("p_r",), ("p_r1", "p_r2")
"""Ports of a driven joint, and of a universal one."""


def component_path(kind: str, name: str) -> Path:
    """Box of a (dotted) body, joint, …: ``left.crank`` is the box ``parts.left.bodies.crank``."""
    *parts, last = name.split(".")
    return Path([*(word for part in parts for word in ("parts", part)), kind, last])


def node_boxes(scene: Scene) -> Mapping[str, Path]:
    """Boxes of the nodes of its shells that are welded to nothing, by their names; made once, kept with the scene."""

    def made() -> dict[str, Path]:
        return {
            sheet.node(i): component_path("shells", name) / f"node{i}"
            for name, sheet in scene.all_shells()
            for i in sheet.free()
        }

    return once(scene, "boxes of nodes", made)


def body_box(scene: Scene, name: str) -> Path:
    """Box of a (dotted) body, or of a node of a shell."""
    return node_boxes(scene).get(name) or component_path("bodies", name)


def wrench_port(body: str) -> Path:
    """The outer port at which a wrench acts on a body."""
    return _initial_path("momenta", body)


def tension_port(tendon: str) -> Path:
    """The outer port at which a force acts on a tendon's length."""
    return _initial_path("tensions", tendon)


def drive_ports(of: Joint) -> tuple[tuple[Path, slice], ...]:
    """The outer ports of a driven joint, and which of its degrees of freedom each of them moves."""
    return tuple(_halves(_initial_path("drives", of.name), of))


def _halves(path: Path, of: Joint) -> list[tuple[Path, slice]]:
    """Paths of the pairs of which a joint at a path is made, and the degrees of freedom of each."""
    if of.middle is None:
        return [(path, slice(0, of.dim))]
    return [(path / "first", slice(0, 1)), (path / "second", slice(1, 2))]


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
        own = frozenset(name for name, j in form.all_joints() if _is_driven(j))
        return _level(form, Demands(pushed, frozenset(), own | asked), top=True)

    return once(form, ("system", asked, pushed), made)


def started_system(scene: Scene, *, driven: Iterable[str] = ()) -> System:
    """The same with the scene's initial state, and ports where its loads and pressures act; made once, too.

    Raises
    ------
    SceneError
        The scene has no such joint.
    """
    joints = frozenset(scene.joint(name).name for name in driven)

    def made() -> System:
        loaded = {load.body for _, load in scene.all_loads()}
        blown = [sheet for _, sheet in scene.all_shells() if sheet.pressure is not None]
        loaded |= {sheet.node(node) for sheet in blown for node in sheet.moving()}
        return scene_system(scene, driven=joints, wrenches=loaded).with_initial(initial_state(scene))

    return once(scene, ("started", joints), made)


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
        for place, where in _halves(at, j):
            out[place / "pe" / "q_r"] = np.array(j.coordinate if j.middle is None else j.coordinate[where])
            if j.heat == ENVIRONMENT:
                out[place / "env" / "s"] = np.zeros(1)
        if j.armature:
            out[component_path("armatures", name) / "p"] = j.armature * j.rate
    for name, node in scene.all_thermal():
        out |= {component_path("thermal", name) / state: np.zeros(1) for state in ("s", *["e"] * (node.pull > 0.0))}
    for path, level in scene.levels():
        own, at = built(level), Path([word for part in path.split(".")[:-1] for word in ("parts", part)])
        states = once(form_of(level), "states of elements", lambda own=own: _element_states(own))
        out |= {at / state: value for state, value in states.items()}
        for box, (element, start) in own.starts.items():
            for name, value in started(level, element, start).items():
                out[at / box / name] = np.array(value, dtype=float)
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
    out |= {box: name for name, box in node_boxes(scene).items()}
    out |= {component_path("springs", name): name for name, _ in scene.all_springs()}
    for name, c in scene.all_contacts():
        points = range(len(contact_points(scene, c)))
        out |= {component_path("contacts", name) / f"point{i}": name for i in points}
    for name, j in scene.all_joints():
        out |= {part: name for part, _ in _halves(component_path("joints", name), j)}
    return out


def _is_driven(j: Joint) -> bool:
    return j.motion is not None or bool(np.any(j.drive))


def _initial_path(group: str, name: str) -> Path:
    return Path([group, *name.split(".")])


@final
@dataclass(frozen=True, slots=True)
class Demands:
    """Bodies, thermal nodes and driven joints that the level above connects to, by names of this level."""

    bodies: frozenset[str]
    nodes: frozenset[str]
    joints: frozenset[str]

    def with_own(self, scene: Scene) -> "Demands":
        """The same with those to which this level's joints and other elements connect."""
        joints = scene.joints.values()
        bodies = {name for j in joints for name in (j.body1, j.body2)}
        nodes = {x.heat for x in joints}
        turned = {name for name, j in scene.joints.items() if j.armature}
        for path in built(scene).junctions:
            of = {"momenta": bodies, "entropies": nodes, "drives": turned}.get(path[0])
            if of is not None:
                of.add(".".join(path[1:]))
        return Demands(self.bodies | bodies, self.nodes | nodes, self.joints | turned)

    def of_part(self, part: str) -> "Demands":
        """The same, as seen from a part."""
        start = part + "."

        def inside(names: frozenset[str]) -> frozenset[str]:
            return frozenset(name[len(start) :] for name in names if name.startswith(start))

        return Demands(inside(self.bodies), inside(self.nodes), inside(self.joints))

    def exposed(self, path: Path, of: Junction) -> Junction:
        """A junction, exposed where it is demanded."""
        group, name = path[0], ".".join(path[1:])
        match group:
            case "momenta":
                asked = name in self.bodies
            case "entropies":
                asked = name in self.nodes
            case "drives":  # of a half of a universal joint, too
                asked = name in self.joints or name.rpartition(".")[0] in self.joints
            case _:
                return of
        return junction(of.quantity, exposed=asked)


def _level(scene: Scene, demands: Demands, *, top: bool) -> System:
    inner, made = demands.with_own(scene), _SystemCache()
    b, own = SceneLevel(), built(scene)

    def take(path: Path) -> None:
        for at in own.boxes[path].values():
            b.junctions.setdefault(Path.of(at), own.junctions[Path.of(at)])
        b.add(path, own.fillings[path], own.boxes[path])

    for name, body in scene.bodies.items():
        b.add(Path(["bodies", name]), made.body(body, scene.world.gravity), {"p": b.momentum(name)})
    hinges = {name for beam in scene.beams.values() if beam.lengths for name in beam.joints}
    for name, j in scene.joints.items():
        ports = {"p1": b.momentum(j.body1), "p2": b.momentum(j.body2)}
        if j.heat != ENVIRONMENT:
            ports["s"] = b.entropy(j.heat)
        driven, expands = name in inner.joints, _expands(scene, j)
        hinged = name in hinges and bool(np.any(j.friction))
        if expands:
            ports["e"] = b.join("lengthenings", j.heat, quantity.displacement)
        system = made.joint(j, driven=driven, expands=expands, hinged=hinged)
        for port, (path, _) in zip(_RATES[j.middle is not None], drive_ports(j), strict=True) if driven else ():
            ports[port] = b.join("drives", str(Path(path[1:])), system.interface[Path.of(port)].quantity)
        b.add(Path(["joints", name]), system, ports)
        if j.armature:
            of = b.junctions[_initial_path("drives", name)].quantity
            b.add(Path(["armatures", name]), armature(of, j.armature), {"p": ports["p_r"]})
    for section in ("springs", "contacts", "tendons"):  # states are in the order of boxes
        for path in own.boxes:
            if path[0] == section:
                take(path)
    for name, node in scene.thermal.items():
        ports = {"s": b.entropy(name)}
        if node.pull:
            ports["e"] = b.join("lengthenings", name, quantity.displacement)
        b.add(Path(["thermal", name]), _storing(node), ports)
    for name, part in scene.parts.items():
        system = _level(part, inner.of_part(name), top=False)
        ports = {port: _joined(b, name, port, system.interface[port].quantity) for port in system.interface}
        b.add(Path(["parts", name]), system, ports)
    for path, of in own.junctions.items():
        b.junctions.setdefault(path, of)
    for path in own.boxes:
        take(path)
    if top and _initial_path("momenta", GROUND) in b.junctions:
        b.add(Path(["ground"]), components.ground(), {"p": b.momentum(GROUND)})
    if not top:
        demands = replace(demands, bodies=demands.bodies | {GROUND})
    junctions = {path: demands.exposed(path, of) for path, of in b.junctions.items()}
    return System.of(Pattern(junctions=junctions, boxes=b.boxes), b.fillings)


_NOT_OF_SYSTEM = frozenset(
    {"name", "body1", "body2", "heat", "drive", "motion", "coordinate", "rate", "armature"}
)  # fmt: skip
"""Attributes of a joint that its system does not depend on, but for whether there is a place for heat."""


@final
@dataclass(frozen=True, slots=True)
class _SystemCache:
    """Cache of systems, by the data that they depend on: of a thousand in a rod most differ by their names only."""

    systems: dict[Hashable, System] = field(default_factory=dict)

    def body(self, of: Body, gravity: Array) -> System:
        """A body's system."""
        key = of.mass, of.inertia.tobytes(), gravity.tobytes()
        if key not in self.systems:
            # the scene's reader has checked the inertia
            self.systems[key] = rigid_body(of.mass, of.inertia, gravity, strict=False)
        return self.systems[key]

    def joint(self, of: Joint, *, driven: bool, expands: bool = False, hinged: bool = False) -> System:
        """A joint's system; ``driven`` exposes its momentum, ``expands`` the lengthening of a beam's element.

        ``hinged``: it joins pieces of a rod, of which its friction is the damping.
        """
        names = (each.name for each in fields(of) if each.name not in _NOT_OF_SYSTEM)
        key = driven, expands, hinged, of.heat != ENVIRONMENT, *(_hashable(getattr(of, name)) for name in names)
        if key not in self.systems:
            self.systems[key] = _joint(of, driven=driven, expands=expands, hinged=hinged)
        return self.systems[key]


def _hashable(value: Any) -> Hashable:
    if isinstance(value, np.ndarray):
        return value.tobytes()
    return tuple(_hashable(getattr(value, each.name)) for each in fields(value)) if isinstance(value, Strain) else value


def _joint(j: Joint, *, driven: bool, expands: bool, hinged: bool) -> System:
    heat = j.heat != ENVIRONMENT
    if j.middle is not None:
        return universal_joint(j.frame1, j.middle, j.frame2, j.friction, j.stiffness, j.rest, heat=heat, driven=driven)
    if j.strain is not None:
        of = j.strain
        parts = elastic(of.length, of.stiffness, of.rest, of.damping, of.order)
        stretch = beam_stretch(float(of.length), tuple(of.rest.tolist())) if expands else None
        return between_frames(j.frame1, j.frame2, *parts, heat=heat, stretch=stretch)
    if hinged:
        parts = components.pair_spring(pair(j.kind), j.stiffness, j.rest), hinge_damper(j.friction)
        return between_frames(j.frame1, j.frame2, *parts, heat=heat, kind=j.kind, driven=driven)
    return joint(
        j.kind, j.frame1, j.frame2, j.friction, j.stiffness, j.rest, pitch=j.pitch, heat=heat, driven=driven,
        limits=j.limits, stop=j.stop, dry=j.dry,
    )  # fmt: skip


def _expands(scene: Scene, joint: Joint) -> bool:
    """Whether a joint is an element of a beam that expands with its heat."""
    node = scene.thermal.get(joint.heat)
    return joint.strain is not None and node is not None and node.pull > 0.0


def _storing(node: ThermalNode) -> Storage:
    if node.pull:
        return thermoelastic(node.capacity, node.temperature, node.pull, node.reference)
    return components.thermal_node(node.capacity, node.temperature)


def _joined(b: SceneLevel, part: str, port: Path, of: Quantity) -> str:
    """The junction at this level of a part's outer port."""
    path = port if port[1:] == (GROUND,) else _outside(port, f"{part}.")
    b.junctions.setdefault(path, junction(of, exposed=True))
    return str(path)


def _outside(port: Path, path: str) -> Path:
    """An outer port as seen from outside of the part at a path, which ends in a dot."""
    start = 2 if port[0] == INPUTS else 1
    return Path([*port[:start], *path.split(".")[:-1], *port[start:]])
