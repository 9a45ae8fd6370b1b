"""Mechanisms far from metres, kilograms and seconds are solved in units of their own, and shown in these.

All thresholds of assembly, of loops, of iterations and of errors then count in the mechanism's own length, mass and
time. The units are powers of two, so that nothing is rounded on the way there and back; near metres, kilograms and
seconds they are these.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from ephs.mechanics.scene.build import drive_ports, element_signals, scene_system, wrench_port
from ephs.mechanics.scene.element import POSE, NumberForm
from ephs.mechanics.scene.geometry import coupling_of
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.rescaled import element_units, freedom_units, rescaled
from ephs.mechanics.scene.state import scale_of
from ephs.operad import Path, Quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.semantics.spaces import Pair, pair
from ephs.semantics.systems.kept import once
from ephs.solve.equations.mobility import Mobility, mobility
from ephs.solve.posing.motion_law import MotionLaw
from ephs.solve.posing.problem import Problem, Signal, State
from ephs.solve.result.record import RunRecord

NEAR = 16, 20, 20
"""Powers of two that one unit of length, mass and time is from the next: within the first ones from m, kg and s, runs
are in these. At half of it, all methods agree with runs in units of one to rounding, or to their tolerance."""


@final
@dataclass(frozen=True, slots=True)
class OwnUnits:
    """A length in m, a mass in kg, a time in s."""

    length: float
    mass: float
    time: float

    @staticmethod
    def of(scene: Scene) -> "OwnUnits":
        """Those of a scene: of its length and rate, and its mass as a whole.

        Of one with elements of unknown quantities, those are m, kg and s: only their maker knows other units.
        """
        if any(True for _ in scene.all_elements()):
            system = scene_system(scene)
            ports = (port.quantity for port in system.interface.values())
            if not all(_is_known(of) for of in (*system.states.values(), *ports)):
                return SI
        scale = scale_of(scene)
        mass = sum(body.mass for _, body in scene.all_bodies()) or 1.0
        sizes = scale.length, mass, 1.0 / scale.rate
        return OwnUnits(*(2.0 ** (near * round(np.log2(x) / near)) for x, near in zip(sizes, NEAR, strict=True)))

    @property
    def energy(self) -> float:
        """In J; that of an entropy in J/K, too."""
        return self.mass * self.length**2 / self.time**2


SI = OwnUnits(1.0, 1.0, 1.0)


def in_own_units(problem: Problem) -> Problem:
    """The problem of a scene in its own units; solutions refer to the original problem.

    That problem itself where its units are near, or where there is no scene.
    """
    scene: Scene | None = problem.scene
    if scene is None or (units := once(scene, "units", lambda: OwnUnits.of(scene))) == SI:
        return problem
    small = once(scene, "own", lambda: rescaled(scene, 1.0 / units.length, 1.0 / units.mass, 1.0 / units.time))
    ports = {port: where for _, j in scene.all_joints() for port, where in _ports(j, units)}
    pushable = [*dict(scene.all_bodies()), *(sheet.node(i) for _, sheet in scene.all_shells() for i in sheet.moving())]
    bodies = {wrench_port(name): np.array([units.length] * 3 + [1.0] * 3) for name in pushable}
    force = units.mass * units.length / units.time**2
    flows = {
        port: _unit(scene_system(scene).interface[port].quantity, units) / units.time / force
        for ports in element_signals(scene).values()
        for port in ports
    }
    forces = bodies | ports | flows
    driven = frozenset(n for n, j in scene.all_joints() if any(port in problem.signals for port, _ in drive_ports(j)))
    pushed = frozenset(name for name in pushable if wrench_port(name) in problem.signals)
    system = scene_system(small, driven=driven, wrenches=pushed)
    descriptor = system.descriptor()
    factors = units_of_states(descriptor, units)

    def given(state: State) -> dict[Path, Array]:
        return {path: value * factors[path] for path, value in state.items()}

    def scaled(port: Path, signal: Signal) -> Signal:
        force = units.mass * units.length / units.time**2 * forces[port]
        unit = units.energy / units.time / force if signal.effort else force
        if not callable(signal.value):
            return replace(signal, value=np.asarray(signal.value) / unit)
        if isinstance(signal.value, MotionLaw):
            return replace(signal, value=signal.value.rescaled(1.0 / float(unit[0] * units.time), 1.0 / units.time))
        return replace(signal, value=lambda t, state: signal.at(t * units.time, given(state)) / unit)

    whole = np.concatenate([factors[slot.path] for slot in descriptor.states])

    def shown(record: RunRecord, stats: Mapping[str, Any]) -> tuple[Problem, RunRecord, dict[str, Any]]:
        of = RunRecord(
            record.t * units.time, record.x * whole, record.energies * units.energy, record.ledgers * units.energy
        )
        return problem, of, _stats(stats, units, factors)

    return replace(
        problem,
        system=system,
        descriptor=descriptor,
        initial={path: np.asarray(value) / factors[path] for path, value in problem.initial.items()},
        signals={port: scaled(port, signal) for port, signal in problem.signals.items()},
        reference=replace(problem.reference, pressure=small.world.pressure),
        scene=small,
        shown=shown,
        given=given,
        seconds=units.time,
        length=problem.length / units.length,
    )


def mobility_of(problem: Problem) -> Mobility:
    """Mobility and redundant constraints of a problem in its initial state."""
    own = in_own_units(problem)
    d, x = own.descriptor, own.descriptor.pack(own.initial)
    return once(d, ("mobility", x.tobytes(), own.prescribed), lambda: mobility(d, x, own.prescribed))


def _ports(j: Any, units: OwnUnits) -> list[tuple[Path, Array]]:
    """The outer ports of a driven joint, and its forces there in units of one force."""
    of = units.length / freedom_units(coupling_of(j), j.coordinate, units.length)
    return [(port, of[where]) for port, where in drive_ports(j)]


def units_of_states(descriptor: Descriptor, units: OwnUnits, *, read: bool = False) -> dict[Path, Array]:
    """By path, the unit of each number of a state: (size,) as it is stored, or as users read it."""
    return {slot.path: _unit(slot.quantity, units, read=read) for slot in descriptor.states}


def _is_known(of: Quantity) -> bool:
    plain = of.space.dim == 1 or not of.space.name.endswith("*")
    return of.kind in ("relative_pose", "pose") or of.space.dim == 6 or (of.kind in _SCALARS and plain)


def _unit(quantity: Quantity, units: OwnUnits, *, read: bool = False) -> Array:
    """(size,) units of a state.

    Raises
    ------
    KeyError
        Only its maker knows its unit.
    """
    space, kind = quantity.space, quantity.kind
    momentum = units.mass * units.length / units.time
    if kind == "relative_pose":
        of = Pair.from_space(space)
        unit = np.where(np.any(of.basis[:3], axis=0), 1.0, units.length)
        return unit if read else element_units(space.size, unit, units.length)
    if kind == "pose":
        return POSE.unit(units.length, units.mass, units.time, ())
    if kind == "momentum" and space.name.endswith("*") and space.dim == 1:  # of a joint's rate itself
        turning = np.any(pair(space.name[:-1], **dict(space.parameters)).basis[:3])
        return np.array([momentum * (units.length if turning else 1.0)])
    if space.dim == 6:
        return momentum * np.array([units.length] * 3 + [1.0] * 3)
    return np.full(space.size, _SCALARS[kind].unit(units.length, units.mass, units.time, ()))


_SCALARS: Mapping[str, NumberForm] = {
    "entropy": NumberForm(energy=1),
    "flux_linkage": NumberForm(energy=1, time=1),
    "charge": NumberForm(),
    "displacement": NumberForm(length=1),
    "angle": NumberForm(),
    "momentum": NumberForm(energy=1, time=1, length=-1),
    "angular_momentum": NumberForm(energy=1, time=1),
    "volume": NumberForm(length=3),
    "liquid": NumberForm(length=3),
}
"""Kind of a quantity -> dimension of its state: temperatures and charges are the same in all units."""


def _stats(stats: Mapping[str, Any], units: OwnUnits, factors: Mapping[Path, Array]) -> dict[str, Any]:
    out = dict(stats)
    times = dict.fromkeys(("step", "shortest_step", "longest_step", "work_apart_at"), units.time)
    for key, unit in (times | dict.fromkeys(("least_production", "work_apart"), units.energy)).items():
        if out.get(key) is not None:
            out[key] *= unit
    if "plain_defect" in out:
        defect = out["plain_defect"].items()
        out["plain_defect"] = {key: value * (units.time if key == "at" else units.energy) for key, value in defect}
    if "jumps" in out:
        found = [{**one, "t": one["t"] * units.time} for one in out["jumps"]["found"]]
        out["jumps"] = {**out["jumps"], "found": found}
    if "events" in out:
        out["events"] = [
            {
                **event,
                "t": event["t"] * units.time,
                "state": {path: (np.array(x) * factors[Path.of(path)]).tolist() for path, x in event["state"].items()},
            }
            for event in out["events"]
        ]
    return out
