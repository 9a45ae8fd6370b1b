"""Overlays of an animation: forces and moments of joints as arrows, warmth as glow."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.show.motion import Array, Film, between_instants, nearest, point_of, rotate
from ephs.show.symbols import METAL, Colour

__all__ = ["ARROWS", "Heat", "Loads", "heat_of", "loads_of", "tint"]

ARROWS: dict[str, Colour] = {"force": (214, 51, 108), "moment": (112, 72, 232)}
_WARM = np.array([METAL, (148, 46, 36), (226, 92, 28), (255, 172, 48), (255, 236, 170)], dtype=float)
GROUND = "ground"
NOISE = 1e-9
"""Forces and moments below this share of the other at the joints' arms, and of a millinewton, are rounding."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Loads:
    """Wrenches of joints at the frames of a film.

    Attributes
    ----------
    places : (m, n, 3)
        Origins of the frames C2 of n joints in the world, m.
    force, moment : (m, n, 3)
        On body 2, in world axes, N and N m; zero where they are indeterminate.
    largest : dict of str to float
        Largest size of each, zero where that is rounding.
    loose : tuple of str
        Joints that have indeterminate components; where there are some, no arrow is drawn.
    """

    places: Array
    force: Array
    moment: Array
    largest: dict[str, float]
    loose: tuple[str, ...]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Heat:
    """Temperatures of thermal nodes at the frames of a film: (m,) in K by node, and their whole range."""

    temperatures: dict[str, Array]
    low: float
    high: float

    def share(self, node: str, frame: int) -> float:
        """Temperature of a node in the range, from 0 to 1; 0 without a node."""
        if node not in self.temperatures or not self.high > self.low:
            return 0.0
        return float((self.temperatures[node][frame] - self.low) / (self.high - self.low))


def loads_of(sol: Any, frames: Film, joints: dict[str, Any]) -> Loads:
    """Wrenches at the kept instants nearest to the frames."""
    instants = nearest(np.asarray(sol.t, dtype=float), frames.times)
    shape = (len(frames.times), len(joints), 3)
    places, force, moment = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    loose: list[str] = []
    for i, (name, joint) in enumerate(joints.items()):
        wrench = np.asarray(sol.joint(name).wrench, dtype=float)[instants]
        if np.isnan(wrench).any():
            loose.append(name)
        frame = np.asarray(joint.frame2, dtype=float)
        pose = np.array([[1.0, 0, 0, 0, 0, 0, 0]]) if joint.body2 == GROUND else frames.poses[joint.body2]
        places[:, i] = point_of(np.broadcast_to(pose, (shape[0], 7)), frame[4:])
        for out, part in ((moment, wrench[:, :3]), (force, wrench[:, 3:])):
            known = np.where(np.isnan(part).any(axis=1, keepdims=True), 0.0, part)
            out[:, i] = rotate(pose[:, :4], rotate(np.broadcast_to(frame[:4], (shape[0], 4)), known))
    largest = {"force": _largest(force), "moment": _largest(moment)}
    arm = max([float(np.linalg.norm(np.asarray(j.frame2)[4:])) for j in joints.values()], default=0.0) or 1.0
    for kind, other in (("force", largest["moment"] / arm), ("moment", largest["force"] * arm)):
        if largest[kind] < NOISE * max(1e-3, other):
            largest[kind] = 0.0
    return Loads(places, force, moment, largest, tuple(loose))


def heat_of(sol: Any, frames: Film, nodes: list[str]) -> Heat:
    """Temperatures at the frames."""
    t = np.asarray(sol.t, dtype=float)
    values = {name: np.asarray(sol.thermal(name).temperature, dtype=float) for name in nodes}
    found = {name: between_instants(t, frames.times, value) for name, value in values.items()}
    around = float(sol.scene.world.temperature)
    low = min([around, *(float(v.min()) for v in found.values())])
    high = max([around, *(float(v.max()) for v in found.values())])
    return Heat(found, low, high)


def tint(share: float) -> Colour:
    """From the grey of cold metal through red and orange to pale yellow."""
    at = np.linspace(0.0, 1.0, len(_WARM))
    red, green, blue = (round(float(np.interp(share, at, column))) for column in _WARM.T)
    return red, green, blue


def _largest(vectors: Array) -> float:
    return float(np.linalg.norm(vectors, axis=-1).max(initial=0.0))
