"""What is kept of every member, by name, and how it is read from a solution."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.scene.errors import did_you_mean, listing
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.solve.errors import OptionError
from ephs.semantics.bundle import Array

if TYPE_CHECKING:
    from ephs.mechanics.solve.solution import Solution
    from ephs.semantics.system import System

__all__ = ["BOOKS", "JOINT", "Output", "outputs_of"]

BOOKS = {
    "heat": "J", "work": "J", "kinetic": "J", "potential": "J", "energy": "J", "exergy": "J", "entropy": "J/K",
    "entropy_production": "J/K", "energy_error": "J", "constraint_error": "",
}  # fmt: skip
"""Ledgers of the whole model, and their units."""
JOINT = ("coordinate", "rate", "wrench")
_BODY = {"position": "m", "quaternion": "", "velocity": "m/s", "angular_velocity": "rad/s"}
_MARKER = {"position": "m", "velocity": "m/s"}
_LABELS = {
    "position": ("xyz", ("x", "y", "z")), "velocity": ("xyz", ("x", "y", "z")),
    "angular_velocity": ("xyz", ("x", "y", "z")), "quaternion": ("quaternion", ("w", "x", "y", "z")),
    "wrench": ("wrench", ("mx", "my", "mz", "fx", "fy", "fz")),
}  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class Output:
    """One of the things that are kept.

    Parameters
    ----------
    name
        ``joints.pin.rate``, ``bodies.crank.position``, ``thermal.housing.temperature``, ``markers.tip.position``, a
        ledger such as ``energy``, or the path of a state.
    units
        "" where it has none, or several.
    """

    name: str
    units: str

    def read(self, solution: "Solution") -> Array:
        """(n,) or (n, d) of a solution with n instants."""
        kind, _, rest = self.name.partition(".")
        thing, _, what = rest.rpartition(".")
        motion: Any = solution
        if self.name in BOOKS:
            return np.asarray(getattr(motion, self.name))
        if solution.motion is not None and kind in _OF and what in _OF[kind] and thing:
            return np.asarray(getattr(getattr(motion, kind_of(kind))(thing), what))
        return solution[self.name]

    def labels(self, size: int) -> tuple[str, tuple[str, ...] | None]:
        """The dimension of an output of so many columns, and what its places are called."""
        dim, labels = _LABELS.get(self.name.rpartition(".")[2], (f"{self.name}.place", None))
        return (dim, labels) if labels is None or len(labels) == size else (f"{self.name}.place", None)


_OF = {"joints": JOINT, "bodies": tuple(_BODY), "thermal": ("temperature",), "markers": tuple(_MARKER)}


def kind_of(kind: str) -> str:
    """How a solution calls what a scene file has under a heading."""
    return {"joints": "joint", "bodies": "body", "thermal": "thermal", "markers": "marker"}[kind]


def outputs_of(model: "Scene | System", names: Sequence[str] | None) -> tuple[Output, ...]:
    """The outputs of these names; by default joints' coordinates and rates, heat and work, or a system's states.

    Raises
    ------
    OptionError
        There is no such output; the nearest name is told.
    """
    known = dict(_known(model))
    if names is None:
        if isinstance(model, Scene):
            names = [name for name in known if name.startswith("joints.") and name.endswith((".coordinate", ".rate"))]
            names += ["heat", "work"]
        else:
            names = [name for name in known if name not in BOOKS]
    for name in names:
        if name not in known:
            hint = did_you_mean(name, list(known), f"one of {listing(list(known))}")
            raise OptionError("outputs", name, f"the name of an output; {hint}")
    return tuple(Output(name, known[name]) for name in dict.fromkeys(names))


def _known(model: "Scene | System") -> "list[tuple[str, str]]":
    out: list[tuple[str, str]] = []
    if isinstance(model, Scene):
        from ephs.mechanics.build import scene_system

        for name, joint in model.all_joints():
            if joint.dim:
                out += [(f"joints.{name}.{what}", "") for what in JOINT]
        out += [(f"joints.{name}.{what}", "") for name, _ in model.implicit_joints() for what in JOINT]
        for name, _ in model.all_bodies():
            out += [(f"bodies.{name}.{what}", units) for what, units in _BODY.items()]
        out += [(f"thermal.{name}.temperature", "K") for name, _ in model.all_thermal()]
        for name, _ in model.all_markers():
            out += [(f"markers.{name}.{what}", units) for what, units in _MARKER.items()]
        system = scene_system(model)
    else:
        system = model
    out += list(BOOKS.items())
    return out + [(str(slot.path), "") for slot in system.descriptor().states if slot.quantity.space.dim]
