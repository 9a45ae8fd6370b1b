"""Outputs of every member by name, and their readers."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.motion.readout import freedoms_of
from ephs.mechanics.scene.errors import did_you_mean, listing
from ephs.mechanics.scene.model import Scene
from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import OptionError
from ephs.solve.result.labels import POSE, WRENCH, Labels, labels_of
from ephs.solve.result.temperatures import heat_storages

if TYPE_CHECKING:
    from ephs.semantics.systems.system import System
    from ephs.solve.result.solution import Solution

TOTALS = {
    "heat": "J", "work": "J", "kinetic": "J", "potential": "J", "energy": "J", "exergy": "J", "entropy": "J/K",
    "entropy_production": "J/K", "energy_error": "1", "constraint_error": "m, rad",
}  # fmt: skip
"""Ledgers of the whole model, and their units."""
JOINT = ("coordinate", "rate", "wrench")
_AXES, _FOUR = ("x", "y", "z"), POSE.names[:4]
_BODY = {
    "position": Labels("axis", _AXES, ("m",) * 3),
    "quaternion": Labels("quaternion", _FOUR, ("1",) * 4),
    "velocity": Labels("axis", _AXES, ("m/s",) * 3),
    "angular_velocity": Labels("axis", _AXES, ("rad/s",) * 3),
}
_MARKER = {key: _BODY[key] for key in ("position", "velocity")}
_TEMPERATURE = Labels("", (), ("K",))


@final
@dataclass(frozen=True, slots=True)
class Output:
    """One recorded output.

    Parameters
    ----------
    name
        ``joints.pin.rate``, ``bodies.crank.position``, ``thermal.housing.temperature``, ``markers.tip.position``, a
        ledger such as ``energy``, or the path of a state.
    labels
        What its columns are called, and their units.
    """

    name: str
    labels: Labels

    def read(self, solution: "Solution") -> Array:
        """(n,) or (n, d) of a solution with n instants."""
        kind, _, rest = self.name.partition(".")
        thing, _, what = rest.rpartition(".")
        motion: Any = solution
        if self.name in TOTALS:
            return np.asarray(getattr(motion, self.name))
        if kind in _OF and what in _OF[kind] and thing:
            if kind == "thermal" and solution.motion is None:
                return solution.temperature(thing)
            return np.asarray(getattr(getattr(motion, kind_of(kind))(thing), what))
        return solution[self.name]


_OF = {"joints": JOINT, "bodies": tuple(_BODY), "thermal": ("temperature",), "markers": tuple(_MARKER)}


def kind_of(kind: str) -> str:
    """Names in a solution by headings of a scene file."""
    return {"joints": "joint", "bodies": "body", "thermal": "thermal", "markers": "marker"}[kind]


def outputs_of(model: "Scene | System", names: Sequence[str] | None) -> tuple[Output, ...]:
    """The outputs of these names; by default joints' coordinates and rates, heat and work, or a system's states.

    Raises
    ------
    OptionError
        There is no such output; the nearest name is told.
    """
    known = known_outputs(model)
    if names is None:
        if isinstance(model, Scene):
            names = [name for name in known if name.startswith("joints.") and name.endswith((".coordinate", ".rate"))]
            names += ["heat", "work"]
        else:
            names = [name for name in known if name not in TOTALS]
    if isinstance(names, str) or not isinstance(names, Sequence):
        raise OptionError("outputs", names, "names of outputs, as a list")
    for name in names:
        if name not in known:
            raise unknown_output("outputs", name, known)
    return tuple(Output(name, known[name]) for name in dict.fromkeys(names))


def known_outputs(model: "Scene | System") -> dict[str, Labels]:
    """Labels of every output of a model, by its name."""
    return dict(_known(model))


def made_by_hand(solution: Any) -> dict[str, Labels]:
    """Labels of what is read of joints, bodies and storages of heat of a system, by the paths of their boxes."""
    if solution.scene is not None:
        return {}
    moving = {name: labels for name, labels in solution.freedoms.items() if labels.units}
    bodies = [] if solution.outline is None else [name for name, _ in solution.outline.all_bodies()]
    warm = [] if solution.problem is None else heat_storages(solution.problem.descriptor, environments=False)
    return dict(_of_mechanism(moving, bodies)) | {f"thermal.{path}.temperature": _TEMPERATURE for path in warm}


def _of_mechanism(joints: Mapping[str, Labels], bodies: Iterable[str]) -> "Iterator[tuple[str, Labels]]":
    for name, labels in joints.items():
        yield f"joints.{name}.coordinate", labels
        yield f"joints.{name}.rate", replace(labels, units=tuple(f"{unit}/s" for unit in labels.units))
        yield f"joints.{name}.wrench", WRENCH
    yield from ((f"bodies.{name}.{key}", labels) for name in bodies for key, labels in _BODY.items())


def unknown_output(option: str, name: str, known: Iterable[str]) -> OptionError:
    """Error of a name that no output has; suggestions are of the same kind: a joint's for a joint's."""
    kind = str(name).partition(".")[0]
    alike = [other for other in known if other.partition(".")[0] == kind] or list(known)
    hint = did_you_mean(str(name), alike, f"one of {listing(alike)}")
    return OptionError(option, name, f"the name of an output; {hint}")


def _known(model: "Scene | System") -> "Iterator[tuple[str, Labels]]":
    system: Any = model
    if isinstance(model, Scene):
        from ephs.mechanics.scene.build import scene_system

        system = scene_system(model)
        joints = [(name, joint) for name, joint in model.all_joints() if joint.dim]
        moving = {name: freedoms_of(joint) for name, joint in [*joints, *model.implicit_joints()]}
        yield from _of_mechanism(moving, (name for name, _ in model.all_bodies()))
        yield from ((f"thermal.{name}.temperature", _TEMPERATURE) for name, _ in model.all_thermal())
        yield from (
            (f"markers.{name}.{key}", labels) for name, _ in model.all_markers() for key, labels in _MARKER.items()
        )
    yield from ((name, Labels("", (), (unit,))) for name, unit in TOTALS.items())
    for slot in system.descriptor().states:
        if slot.quantity.space.dim:
            yield str(slot.path), labels_of(slot.quantity)
