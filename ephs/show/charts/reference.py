"""References for measured motions: states from a file, or a run with tight tolerances."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

import numpy as np

from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.scene.model import Scene, frozen
from ephs.mechanics.scene.state import scale_of
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.show.charts.runs import Array, RunEnding, RunSetting, attempt
from ephs.show.shared.errors import ShowError
from ephs.solve.result.solution import Solution

TIGHT = ((1e-13, 1e-12), (1e-12, 1e-11), (1e-10, 1e-9))
"""Tolerance of the reference and of the run that estimates its error, best first."""
LEAST_ORDER = 5
CHANGE = 1e-6
"""Relative change of data by which the condition of a problem is measured."""
TRUSTED = 1e-4
"""Cross-check of a reference for which no other method is tried."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class PosesInTime:
    """Poses of the b bodies of a scene at n times.

    Parameters
    ----------
    t
        (n,) in s.
    position, rotation
        (n, b, 3) of the centres of mass in m, (n, b, 3, 3) body to world.
    balance
        (n,) kinetic + potential + heat − work less the same at the start, in J.
    totals
        (n, 2) heat and work since the start, in J.
    turnover
        Largest K + |V − V₀| + |heat| + |work|, in J.
    size
        The length of the mechanism in m, by which its gaps are measured too.
    """

    t: Array
    position: Array
    rotation: Array
    balance: Array
    totals: Array
    turnover: float
    size: float = 0.0

    @staticmethod
    def of_solution(solution: Solution) -> "PosesInTime":
        """The motion of a solution, at its times."""
        names = [name for name, _ in solution.scene.all_bodies()]
        bodies = [solution.body(name) for name in names]
        kinetic, potential, heat, work = solution.kinetic, solution.potential, solution.heat, solution.work
        total = kinetic + potential + heat - work
        turnover = kinetic + np.abs(potential - potential[0]) + np.abs(heat) + np.abs(work)
        return PosesInTime(
            solution.t,
            np.stack([body.position for body in bodies], axis=1),
            np.stack([body.rotation for body in bodies], axis=1),
            total - total[0],
            np.column_stack([heat - heat[0], work - work[0]]),
            float(np.max(turnover)),
            _length(solution.scene),
        )

    def off(self, other: "PosesInTime", length: float = 1.0) -> Array:
        """(n,) largest deviation of any component of a position, in units of ``length``, or of a rotation matrix."""
        moved = np.abs(self.position - other.position).max(axis=(1, 2)) / length
        return np.maximum(moved, np.abs(self.rotation - other.rotation).max(axis=(1, 2, 3)))

    def misbooked(self, other: "PosesInTime") -> Array:
        """(n,) largest deviation of heat and work, relative to what the other motion turns over; 0 where that is 0."""
        off = np.abs(self.totals - other.totals).max(axis=1)
        return off / other.turnover if other.turnover > 0.0 else np.zeros_like(off)

    def until(self, count: int) -> "PosesInTime":
        """The motion at its first instants."""
        t, position, rotation, balance, totals = (
            each[:count] for each in (self.t, self.position, self.rotation, self.balance, self.totals)
        )
        return PosesInTime(t, position, rotation, balance, totals, self.turnover, self.size)

    @property
    def length(self) -> float:
        """Size of mechanism and motion in m: the largest distance of bodies from their common centre, over all times,
        at least the length of the mechanism; 1 where both are zero."""
        return max(float(np.linalg.norm(self.position - self.centre, axis=-1).max()), self.size) or 1.0

    @property
    def centre(self) -> Array:
        """(3,) mean position."""
        return self.position.mean(axis=(0, 1))


@final
@dataclass(frozen=True, slots=True, eq=False)
class ReferenceMotion:
    """A reference motion.

    Parameters
    ----------
    cross_check
        How far an independent or a looser computation of it was off at the end.
    source
        Where it is from, in words.
    run
        The method and the setting of the run that it is, None of others.
    """

    motion: PosesInTime
    cross_check: float
    source: str
    run: tuple[str, RunSetting] | None = None


def tight_reference(
    scene: Scene, until: float, *, save_at: Array | None = None, limit: float = 60.0
) -> ReferenceMotion:
    """A run with tight tolerances, by the applicable method of highest order.

    Parameters
    ----------
    limit
        Wall time in s of one run.

    Raises
    ------
    ShowError
        No method reaches the end.
    """
    said, slow, best = "", set[str](), None
    for method, tight, loose in _candidates(until):
        if method in slow and tight.value < TIGHT[-1][0]:
            continue
        runs = [attempt(scene, until, method, tight, limit=limit, save_at=save_at)]
        if runs[0].solution is not None:
            runs.append(attempt(scene, until, method, loose, limit=limit, save_at=save_at))
        if runs[0].ending in (RunEnding.REFUSED, RunEnding.SLOW):  # of looser tolerances only the last is tried
            slow.add(method)
        solutions = [run.solution for run in runs if run.solution is not None]
        if len(solutions) < 2:
            said = said or runs[-1].message
            continue
        motion, check = map(PosesInTime.of_solution, solutions)
        if not (np.isfinite(motion.position).all() and np.isfinite(check.position).all()):
            continue
        found = ReferenceMotion(motion, float(motion.off(check)[-1]), f"{method}, {tight}", (method, tight))
        if found.cross_check <= TRUSTED:
            return found
        best = found if best is None or found.cross_check < best.cross_check else best
    if best is None:
        raise ShowError("reference", path=scene.name, found=said, expected=f"t = {until:g} s")
    return best


def condition(scene: Scene, truth: ReferenceMotion, limit: float = 60.0) -> Array:
    """(n,) amplification of a relative change of rates, a mass and gravity in a motion at its times.

    Ones where that is no run, or its run with other data does not reach the end.
    """
    bodies = [
        (name, replace(body, twist=frozen((1.0 + CHANGE) * np.array(body.twist))))
        for name, body in scene.bodies.items()
    ]
    name, first = bodies[0]
    heavier = replace(first, mass=(1.0 + CHANGE) * first.mass, inertia=frozen((1.0 + CHANGE) * np.array(first.inertia)))
    world = replace(scene.world, gravity=frozen((1.0 + CHANGE) * np.array(scene.world.gravity)))
    changed = replace(scene, bodies={**dict(bodies), name: heavier}, world=world)
    motion = truth.motion
    if truth.run is None:
        return np.ones(len(motion.t))
    run = attempt(changed, float(motion.t[-1]), *truth.run, limit=limit, save_at=motion.t)
    if run.solution is None:
        return np.ones(len(motion.t))
    return np.maximum.accumulate(PosesInTime.of_solution(run.solution).off(motion, motion.length)) / CHANGE


def resting_reference(scene: Scene, save_at: Array) -> ReferenceMotion:
    """Constant motion of an immobile mechanism."""
    n = len(save_at)
    poses = np.array([body.pose for _, body in scene.all_bodies()])
    rotations = np.array([quaternion_to_matrix(pose[:4]) for pose in poses])
    position, rotation = np.tile(poses[:, 4:], (n, 1, 1)), np.tile(rotations, (n, 1, 1, 1))
    motion = PosesInTime(save_at, position, rotation, np.zeros(n), np.zeros((n, 2)), 0.0, _length(scene))
    return ReferenceMotion(motion, 0.0, "it cannot move")


def shipped_reference(file: Path, scene: Scene, until: float | None = None) -> tuple[ReferenceMotion, float]:
    """The states of a file, at a time or at the earliest that it has, and this time.

    The file is JSON: ``{"how": text, "states": {time: {"cross_check": number, "bodies": {name: {"position": [3],
    "quaternion": [4]}}}}}``.

    Raises
    ------
    ShowError
        It is no such file, it has no state at this time, or other bodies than the scene.
    """
    try:
        data: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        states: dict[float, Any] = {float(time): state for time, state in data["states"].items()}
        found = min(states) if until is None else until
        if found not in states:
            times = ", ".join(f"{time:g}" for time in sorted(states))
            raise ShowError("reference-time", path=str(file), found=f"{found:g}", expected=times)
        bodies = [states[found]["bodies"][name] for name, _ in scene.all_bodies()]
        position = np.array([[body["position"] for body in bodies]], dtype=float)
        rotation = np.array([[quaternion_to_matrix(np.array(body["quaternion"], dtype=float)) for body in bodies]])
        check, how = float(states[found].get("cross_check", 0.0)), str(data.get("how", file.name))
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        if isinstance(error, ShowError):
            raise
        raise ShowError("reference-file", path=str(file), found=f"{type(error).__name__}: {error}") from error
    motion = PosesInTime(np.array([found]), position, rotation, np.zeros(1), np.zeros((1, 2)), 0.0, _length(scene))
    return ReferenceMotion(motion, check, how), found


def _length(scene: Scene) -> float:
    return scale_of(scene).length


def _candidates(until: float) -> Iterator[tuple[str, RunSetting, RunSetting]]:
    """Method, tight and loose setting: adaptive ones of high order first, then constant steps, robust methods first."""
    adaptive = [m for m in METHODS.values() if m.scenes and m.adaptive and m.order >= LEAST_ORDER]
    for tight, loose in TIGHT:
        for method in sorted(adaptive, key=lambda m: -m.order):
            yield method.name, RunSetting("tolerance", tight), RunSetting("tolerance", loose)
    for method in sorted((m for m in METHODS.values() if m.scenes and m.fixed), key=lambda m: m.order):
        yield method.name, RunSetting("step", until / 8000), RunSetting("step", until / 4000)
