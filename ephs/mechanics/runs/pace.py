"""Step limits for prescribed motions and thin surfaces."""

from typing import TYPE_CHECKING

import numpy as np

from ephs.mechanics.scene.build import contact_points
from ephs.mechanics.scene.geometry import coupling
from ephs.solve.auditing.audit import LEAP

if TYPE_CHECKING:
    from ephs.mechanics.scene.model import Scene
    from ephs.semantics.bundle import Array

TURN = 0.1
"""Step limit for prescribed motions: largest displacement in rad, or as a fraction of the scene's extent."""
TIMES = 100.0
"""Largest error of a step of a method of order p, which is the p-th power of that angle, in tolerances."""


def longest_step(scene: "Scene", order: int, rtol: float, span: tuple[float, float]) -> float:
    """The longest step in s that is chosen for a scene; infinite without prescribed motion and thin surfaces.

    ``span`` is the run's, in s; see `_driven_step`.
    """
    return min(_driven_step(scene, order, rtol, span), _contact_step(scene))


def _contact_step(scene: "Scene") -> float:
    """Time in which no body passes more than `LEAP` of a surface, at the speeds of the start and of a fall.

    A step that begins before a thin surface and ends behind it sees no contact; behind a plane it does.
    """
    surfaces, bodies = dict(scene.all_surfaces()), dict(scene.all_bodies())
    thick = np.inf
    for _, contact in scene.all_contacts():
        _, points = contact_points(scene, contact)
        thick = min(thick, *(gap.thickness for _, _, gap in points))
    if thick == np.inf:
        return np.inf
    reach = max((float(np.linalg.norm(s.frame[4:])) for s in surfaces.values()), default=0.0)
    twists = [body.twist for body in bodies.values()]
    start = sum(sorted((_speed(twist, reach) for twist in twists), reverse=True)[:2])
    fall = np.sqrt(2.0 * float(np.linalg.norm(scene.world.gravity)) * _extent(scene))
    return float(LEAP * thick / (start + fall)) if start + fall > 0.0 else np.inf


def _speed(twist: "Array", reach: float) -> float:
    return float(np.linalg.norm(twist[3:]) + reach * np.linalg.norm(twist[:3]))


def _extent(scene: "Scene") -> float:
    places = np.array([np.zeros(3), *(body.pose[4:] for _, body in scene.all_bodies())])
    return float(np.linalg.norm(np.ptp(places, axis=0)))


def _driven_step(scene: "Scene", order: int, rtol: float, span: tuple[float, float]) -> float:
    """The longest step in s where motions are prescribed.

    What is prescribed makes no error, and what follows from it alone makes none that is seen: without a limit, steps
    would leap over positions that the mechanism cannot reach, and heat and work would be sums over a few instants.

    Parameters
    ----------
    order, rtol
        Of the method; the least of the tolerances that steer it.
    """
    moved = [(joint, joint.motion) for _, joint in scene.all_joints() if joint.motion is not None]
    if not moved:
        return np.inf
    extent = _extent(scene)
    turn = min(TURN, (TIMES * rtol) ** (1.0 / order)) if rtol else TURN
    limits: list[float] = []
    for joint, motion in moved:
        turning = bool(np.any(coupling(joint.kind, joint.pitch).pair.basis[:3]))
        allowed = turn if turning or not extent else turn * extent
        fastest = motion.fastest(*span)
        limits.append(allowed / fastest if fastest else np.inf)
    return min(limits)
