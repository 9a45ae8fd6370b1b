"""Step limit for prescribed motions."""

from typing import TYPE_CHECKING

import numpy as np

from ephs.mechanics.scene.geometry import coupling

if TYPE_CHECKING:
    from ephs.mechanics.scene.model import Scene

__all__ = ["longest_step"]

TURN = 0.1
"""By how much a prescribed joint may move in a step at most: rad, or this part of the scene's extent."""
TIMES = 100.0
"""Largest error of a step of a method of order p, which is the p-th power of that angle, in tolerances."""


def longest_step(scene: "Scene", order: int, rtol: float) -> float:
    """The longest step in s that is chosen for a scene; infinite where no motion is prescribed.

    What is prescribed makes no error, and what follows from it alone makes none that is seen: without a limit, steps
    would leap over positions that the mechanism cannot reach, and heat and work would be sums over a few instants.

    Parameters
    ----------
    order, rtol
        Of the method; the least of the tolerances that steer it.
    """
    moved = [joint for _, joint in scene.all_joints() if joint.motion]
    if not moved:
        return np.inf
    places = np.array([np.zeros(3), *(body.pose[4:] for _, body in scene.all_bodies())])
    extent = float(np.linalg.norm(np.ptp(places, axis=0)))
    turn = min(TURN, (TIMES * rtol) ** (1.0 / order)) if rtol else TURN
    limits: list[float] = []
    for joint in moved:
        turning = bool(np.any(coupling(joint.kind, joint.pitch).pair.basis[:3]))
        allowed = turn if turning or not extent else turn * extent
        limits.append(allowed / abs(float(joint.motion or 1.0)))
    return min(limits)
