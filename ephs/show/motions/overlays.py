"""Overlays of an animation: forces and moments of joints and forces of contacts as arrows, warmth as glow."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ephs.show.motions.motion import Array, Film, between_instants, nearest, point_of, rotate
from ephs.show.motions.symbols import METAL, Colour

ARROWS: dict[str, Colour] = {
    "force": (214, 51, 108), "moment": (112, 72, 232), "contact": (9, 146, 104), "slip": (245, 159, 0),
}  # fmt: skip
_WARM = np.array([METAL, (148, 46, 36), (226, 92, 28), (255, 172, 48), (255, 236, 170)], dtype=float)
GROUND = "ground"
NOISE = 1e-9
"""Forces and moments below this share of the other at the joints' arms, and of a millinewton, are rounding."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Arrows:
    """Arrows of one kind at the frames of a film.

    Attributes
    ----------
    kind : str
        A key of `ARROWS`.
    places : (m, n, 3)
        Where n arrows begin in the world, m.
    vectors : (m, n, 3)
        In world axes, N or N m; zero where there is none.
    largest : float
        Size of the vector whose arrow is the longest.
    label : str
        Of the legend.
    """

    kind: str
    places: Array
    vectors: Array
    largest: float
    label: str

    @property
    def colour(self) -> Colour:
        """Red, green and blue."""
        return ARROWS[self.kind]

    def tips(self, longest: float) -> Array:
        """(m, n, 3) their ends, the longest arrow with a length in m."""
        return self.places + longest / self.largest * self.vectors


@final
@dataclass(frozen=True, slots=True, eq=False)
class Loads:
    """Wrenches of joints on their body 2, and forces of contacts on their second body.

    Attributes
    ----------
    arrows : tuple of Arrows
        Those that are there, beyond rounding.
    loose : tuple of str
        Joints that have indeterminate components; where there are some, no arrow is drawn.
    """

    arrows: tuple[Arrows, ...]
    loose: tuple[str, ...]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Heat:
    """Values shown by colour at the frames of a film: (m,) by thermal node or body, and their range.

    Temperatures in K; or strain energy per length, in J/m, of beams.
    """

    temperatures: dict[str, Array]
    low: float
    high: float
    unit: str = "K"

    @property
    def ends(self) -> tuple[str, str]:
        """Both ends of the range in words."""
        form = ".2f" if self.unit == "K" else ".3g"
        return f"{self.low:{form}} {self.unit}", f"{self.high:{form}} {self.unit}"

    def share(self, node: str, frame: int) -> float:
        """Temperature of a node in the range, from 0 to 1; 0 without a node."""
        if node not in self.temperatures or not self.high > self.low:
            return 0.0
        return float((self.temperatures[node][frame] - self.low) / (self.high - self.low))


def loads_of(sol: Any, frames: Film, joints: dict[str, Any]) -> Loads:
    """Wrenches of joints, and forces of contacts, at the kept instants nearest to the frames."""
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
    beyond = {"force": NOISE * max(1e-3, largest["moment"] / arm), "moment": NOISE * max(1e-3, largest["force"] * arm)}
    found = [
        Arrows(kind, places, vectors, largest[kind], f"{kind} on body 2, the longest {largest[kind]:.3g} {unit}")
        for kind, vectors, unit in (("force", force, "N"), ("moment", moment, "N m"))
        if largest[kind] >= beyond[kind]
    ]
    return Loads((*found, *_contacts(sol, instants)), tuple(loose))


def _contacts(sol: Any, instants: NDArray[np.int64]) -> list[Arrows]:
    """Forces of contacts, slipping and sticking ones separately, on one scale."""
    laws = dict(sol.outline.all_contacts())
    if not laws:
        return []
    motions = [sol.contact(name) for name in laws]
    places, force = (np.stack([getattr(m, key)[instants] for m in motions], axis=1) for key in ("place", "force"))
    slips = np.stack([m.slip[instants] > of.law.slip for m, of in zip(motions, laws.values(), strict=True)], axis=1)
    most, says = _largest(force), {"contact": "contact force", "slip": "contact force where it slips"}
    parts = {kind: np.where((slips == (kind == "slip"))[:, :, None], force, 0.0) for kind in says}
    return [
        Arrows(kind, places, part, most, f"{says[kind]}, the longest {_largest(part):.3g} N")
        for kind, part in parts.items()
        if part.any()
    ]


def heat_of(sol: Any, frames: Film, nodes: list[str]) -> Heat:
    """Temperatures at the frames."""
    t = np.asarray(sol.t, dtype=float)
    values = {name: np.asarray(sol.thermal(name).temperature, dtype=float) for name in nodes}
    found = {name: between_instants(t, frames.times, value) for name, value in values.items()}
    for _, beam in sol.outline.all_beams():
        if all(joint in found for joint in beam.joints):
            found |= _at_nodes(beam, found)
    around = float(sol.outline.world.temperature)
    low = min([around, *(float(v.min()) for v in found.values())])
    high = max([around, *(float(v.max()) for v in found.values())])
    return Heat(found, low, high)


def strain_of(sol: Any, frames: Film) -> Heat:
    """Strain energy per length at the frames: of the elements' joints, and of nodes the mean of those beside them."""
    t, found = np.asarray(sol.t, dtype=float), dict[str, Array]()
    for name, beam in sol.outline.all_beams():
        motion = sol.beam(name)
        lengths = [each.length for each in (sol.outline.joint(joint).strain for joint in beam.joints) if each]
        along = motion.energy / np.array(beam.lengths or lengths)
        found |= {
            joint: between_instants(t, frames.times, row) for joint, row in zip(beam.joints, along.T, strict=True)
        }
        found |= _at_nodes(beam, found)
    return Heat(found, 0.0, max((float(v.max(initial=0.0)) for v in found.values()), default=0.0), "J/m")


def _at_nodes(beam: Any, of_elements: dict[str, Array]) -> dict[str, Array]:
    """Values at a beam's nodes: the means of the elements beside them."""
    beside = [None, *beam.joints, None]
    pairs = zip(beam.nodes, beside[:-1], beside[1:], strict=True)
    return {node: np.mean([of_elements[each] for each in two if each], axis=0) for node, *two in pairs}


def tint(share: float) -> Colour:
    """From the grey of cold metal through red and orange to pale yellow."""
    at = np.linspace(0.0, 1.0, len(_WARM))
    red, green, blue = (round(float(np.interp(share, at, column))) for column in _WARM.T)
    return red, green, blue


def _largest(vectors: Array) -> float:
    return float(np.linalg.norm(vectors, axis=-1).max(initial=0.0))
