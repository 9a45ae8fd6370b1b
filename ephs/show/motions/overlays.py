"""Overlays of an animation: forces and moments as arrows, temperatures and stresses as colour."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ephs.show.motions.motion import Array, Film, between_instants, nearest, point_of, rotate
from ephs.show.motions.sheets import normals, sheets_of
from ephs.show.motions.symbols import METAL, Colour
from ephs.show.shared.errors import ShowError

ARROWS: dict[str, Colour] = {
    "force": (214, 51, 108), "moment": (112, 72, 232), "contact": (9, 146, 104), "slip": (245, 159, 0),
}  # fmt: skip
_WARM = np.array([METAL, (148, 46, 36), (226, 92, 28), (255, 172, 48), (255, 236, 170)], dtype=float)
COLOURS = {
    "temperature": "temperature", "energy": "strain energy", "membrane": "membrane force", "moment": "moment",
    "shear": "transverse force",
}  # fmt: skip
"""Choices of ``colour``, and the name of each quantity in legends."""
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
class Shades:
    """Values shown by colour at the frames of a film, and their range.

    Attributes
    ----------
    said, unit : str
        Name and unit of the quantity.
    values : dict of str to (m,)
        By thermal node, joint or body.
    faces : dict of str to (m, n)
        Of n elements, by shell.
    low, high : float
        The range.
    """

    said: str
    unit: str
    values: dict[str, Array]
    faces: dict[str, Array]
    low: float
    high: float

    @property
    def ends(self) -> tuple[str, str]:
        """Both ends of the range in words."""
        form = ".2f" if self.unit == "K" else ".3g"
        return f"{self.low:{form}} {self.unit}", f"{self.high:{form}} {self.unit}"

    def shares(self, values: Array) -> Array:
        """Values in the range, from 0 to 1."""
        return (values - self.low) / (self.high - self.low) if self.high > self.low else np.zeros_like(values)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Tones:
    """Colours of things at one frame."""

    shades: tuple[Shades, ...]
    frame: int

    def of(self, name: str, own: Colour) -> Colour:
        """Of a thermal node, joint or body; its own colour fades into that of warm metal below a tenth."""
        shade = next((each for each in self.shades if name in each.values), None)
        if shade is None:
            return own
        share = float(shade.shares(shade.values[name][self.frame]))
        fade = min(1.0, 10.0 * share)
        red, green, blue = (round((1.0 - fade) * a + fade * b) for a, b in zip(own, tint(share), strict=True))
        return red, green, blue

    def faces(self, shell: str) -> list[Colour] | None:
        """Of the elements of a shell; None where they have no values."""
        shade = next((each for each in self.shades if shell in each.faces), None)
        return None if shade is None else [tint(share) for share in shade.shares(shade.faces[shell][self.frame])]


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


def shades_of(sol: Any, frames: Film, colour: str | None) -> tuple[Shades, ...]:
    """The values that a choice of colour shows, one of `COLOURS`; none without a choice.

    Raises
    ------
    ShowError
        There is no such choice, or the solution has nothing of it.
    """
    if colour is None:
        return ()
    if colour not in COLOURS:
        raise ShowError("colour", found=colour, expected=", ".join(COLOURS))
    if colour == "temperature":
        return (_temperatures(sol, frames),)
    found = (*(_strains(sol, frames) if colour == "energy" else ()), *_stresses(sol, frames, colour))
    if not found:
        raise ShowError("nothing", path=str(sol.name), found=f"{COLOURS[colour]} to show", expected="beams or shells")
    return found


def _temperatures(sol: Any, frames: Film) -> Shades:
    """Of thermal nodes, of elements of beams with a store of their own, and of shells that of the node they warm."""
    names = [name for name, _ in sol.outline.all_thermal()]
    found = {name: _at_frames(frames, sol, np.asarray(sol.thermal(name).temperature, dtype=float)) for name in names}
    for _, beam in sol.outline.all_beams():
        if all(joint in found for joint in beam.joints):
            found |= _at_nodes(beam, found)
    around = float(sol.outline.world.temperature)
    low = min([around, *(float(v.min()) for v in found.values())])
    high = max([around, *(float(v.max()) for v in found.values())])
    sheets = sheets_of(sol.outline).items()
    faces = {name: np.repeat(found[of.heat][:, None], len(of.cells), axis=1) for name, of in sheets if of.heat in found}
    return Shades(COLOURS["temperature"], "K", found, faces, low, high)


def _strains(sol: Any, frames: Film) -> tuple[Shades, ...]:
    """Strain energy of beams per length: of the elements' joints, and of nodes the mean of those beside them."""
    found: dict[str, Array] = {}
    for name, beam in sol.outline.all_beams():
        motion = sol.beam(name)
        lengths = [each.length for each in (sol.outline.joint(joint).strain for joint in beam.joints) if each]
        along = _at_frames(frames, sol, motion.energy / np.array(beam.lengths or lengths))
        found |= dict(zip(beam.joints, along.T, strict=True))
        found |= _at_nodes(beam, found)
    return (Shades(f"{COLOURS['energy']} of beams", "J/m", found, {}, 0.0, _highest(found)),) if found else ()


def _stresses(sol: Any, frames: Film, colour: str) -> tuple[Shades, ...]:
    """Strain energy of shells per area at the first instant, or the size of a stress resultant."""
    found: dict[str, Array] = {}
    for name in sheets_of(sol.outline):
        motion = sol.shell(name)
        if colour == "energy":
            across = normals(motion.position[0][motion.cells])
            values = motion.energy / (0.5 * np.linalg.norm(across, axis=1))
        else:
            given = getattr(motion, colour)
            twice = np.array([1.0, 1.0, 2.0])[: given.shape[2]]  # 12 and 21 are one number
            values = np.sqrt(np.square(given) @ twice)
        if not np.isnan(values).any():
            found[name] = _at_frames(frames, sol, values)
    unit = {"energy": "J/m²", "moment": "N"}.get(colour, "N/m")
    return (Shades(f"{COLOURS[colour]} of shells", unit, {}, found, 0.0, _highest(found)),) if found else ()


def _at_frames(frames: Film, sol: Any, values: Array) -> Array:
    """Values (n,) or (n, k) of a solution at the frames."""
    t = np.asarray(sol.t, dtype=float)
    columns = [between_instants(t, frames.times, column) for column in values.reshape(len(t), -1).T]
    return np.stack(columns, axis=1).reshape(len(frames.times), *values.shape[1:])


def _highest(found: dict[str, Array]) -> float:
    return max((float(v.max(initial=0.0)) for v in found.values()), default=0.0)


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
