"""Contents of an animation: bodies, joints, springs and tendons with their motion, sizes and overlays."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.show.motions.lines import BodyLine, lines_of
from ephs.show.motions.motion import Array, Film, film, point_of
from ephs.show.motions.overlays import GROUND, Loads, Shades, loads_of, shades_of
from ephs.show.motions.sheets import DrawnShell, sheets_of
from ephs.show.motions.solids import Solid, solids_of
from ephs.show.shared.errors import ShowError


@final
@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """A mechanism and its motion, prepared for drawing; nodes of shells are bodies without a surface.

    Attributes
    ----------
    joints, bodies : dict
        Of the scene, by name.
    springs : dict of str to Line
        Springs, and segments of tendons.
    solids : dict of str to Solid
        Surfaces of the bodies.
    sheets : dict of str to DrawnShell
        Faces of the shells.
    frames : Film
        Poses at even times.
    loads, shades
        Arrows and colours; None, or empty, where they are not drawn.
    """

    joints: dict[str, Any]
    springs: dict[str, BodyLine]
    bodies: dict[str, Any]
    solids: dict[str, Solid]
    sheets: dict[str, DrawnShell]
    frames: Film
    loads: Loads | None
    shades: tuple[Shades, ...]

    def pose_of(self, name: str) -> Array:
        """(n, 7) of a body or the ground."""
        still = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        return np.broadcast_to(still, (len(self.frames.times), 7)) if name == GROUND else self.frames.poses[name]

    def places(self) -> tuple[Array, Array]:
        """Points (n, m, 3) at n frames that the camera must see, and the radius (m,) in m about each."""
        found = [(self.frames.poses[name][:, 4:], solid.reach) for name, solid in self.solids.items()]
        ends = [(j.body1, np.asarray(j.frame1, dtype=float)[4:]) for j in self.joints.values()]
        ends += [(s.body1, np.asarray(s.at1, dtype=float)) for s in self.springs.values()]
        ends += [(s.body2, np.asarray(s.at2, dtype=float)) for s in self.springs.values()]
        ends += [end for sheet in self.sheets.values() for end in sheet.ends]
        found += [(point_of(self.pose_of(body), at), 0.0) for body, at in ends]
        if not found:
            return np.zeros((len(self.frames.times), 1, 3)), np.zeros(1)
        return np.stack([points for points, _ in found], axis=1), np.array([reach for _, reach in found])

    def size(self) -> float:
        """Largest extent of the mechanism at any one instant, in m: trajectories do not count."""
        points, reaches = self.places()
        around = reaches[None, :, None]
        across = np.linalg.norm((points + around).max(axis=1) - (points - around).min(axis=1), axis=1)
        return float(across.max(initial=0.0)) or 1.0

    def symbol_size(self, joint: Any, size: float) -> float:
        """Radius in m of a joint's symbol, by the bodies that it joins."""
        near = [self.solids[name].reach for name in (joint.body1, joint.body2) if name in self.solids]
        small = min([reach for reach in near if reach > 0.0], default=0.25 * size)
        return float(np.clip(0.16 * small, 0.014 * size, 0.05 * size))


def stage_of(
    sol: Any, *, fps: float, duration: float | None, wrenches: bool = False, colour: str | None = None
) -> Stage:
    """The stage of a solution; `colour` as of `shades_of`.

    Raises
    ------
    ShowError
        If the solution has no bodies, no instants or nothing of the colour, or `fps` or `duration` is not positive.
    """
    scene = sol.outline
    if scene is None:
        raise ShowError("scene", path=str(sol.name))
    if not len(sol.t):
        raise ShowError("nothing", path=str(sol.name), found="instants", expected="some to show")
    for name, value in (("fps", fps), ("duration", duration)):
        if value is not None and not value > 0:
            raise ShowError("span", path=name, found=str(value), expected="something above 0")
    bodies, joints = dict(scene.all_bodies()), dict(scene.all_joints())
    frames = film(sol, list(bodies), fps, duration)
    return Stage(
        joints,
        lines_of(scene),
        bodies,
        solids_of(scene),
        sheets_of(scene),
        frames,
        loads_of(sol, frames, joints) if wrenches else None,
        shades_of(sol, frames, colour),
    )
