"""Step limits for prescribed motions and thin surfaces."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from ephs.semantics.primitives.primitives import Storage
from ephs.semantics.spaces.pairs import PAIRS, pair
from ephs.semantics.systems.kept import once
from ephs.solve.auditing.audit import LEAP
from ephs.solve.posing.errors import SolveError
from ephs.solve.posing.problem import NO_STATE

if TYPE_CHECKING:
    from ephs.operad import Quantity
    from ephs.semantics.bundles.bundle import Array
    from ephs.semantics.descriptor.descriptor import Descriptor
    from ephs.solve.posing.problem import Problem, Signal

TURN = 0.1
"""Step limit for prescribed motions: largest displacement in rad, or as a fraction of the scene's extent."""
SAMPLES = 256
"""Number of instants for the largest rate that is prescribed by a function."""
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
TIMES = 100.0
"""Largest error of a step of a method of order p, which is the p-th power of that angle, in tolerances."""


def longest_step(problem: "Problem", order: int, rtol: float, span: tuple[float, float]) -> float:
    """The longest step that is chosen for a problem; infinite without prescribed motion and thin surfaces.

    ``span`` is the run's; all times are in the problem's unit. See `_driven_step`.
    """
    return min(_driven_step(problem, order, rtol, span), _contact_step(problem))


def _contact_step(problem: "Problem") -> float:
    """Time in which no body passes more than `LEAP` of a surface, at the speeds of the start and of a fall.

    A step that begins before a thin surface and ends behind it sees no contact; behind a plane it does.
    """
    d = problem.descriptor
    thick, reach = once(d, "surfaces", lambda: _surfaces(d))
    if thick == np.inf:
        return np.inf
    from ephs.mechanics.tree.finding.frames import frames_of  # most systems have no surfaces

    found = frames_of(d)
    components = found.wiring.components
    speeds, pull, places = [0.0], 0.0, [np.zeros(3)]
    for link in found.links:
        if link.momentum is not None and not link.light:
            twist = np.linalg.solve(link.inertia, problem.initial[link.momentum.path])
            speeds.append(float(np.linalg.norm(twist[3:]) + reach * np.linalg.norm(twist[:3])))
        if link.pose is not None:
            places.append(problem.initial[link.pose.path][4:])
        if link.potential >= 0 and not link.light:
            weight = dict(components[link.potential].primitive.parameters).get("weight", 0.0)
            pull = max(pull, float(np.linalg.norm(np.asarray(weight, dtype=float))) / float(link.inertia[5, 5]))
    fast = sum(sorted(speeds)[-2:]) + np.sqrt(2.0 * pull * _spread(places))
    return float(LEAP * thick / fast) if fast > 0.0 else np.inf


def _surfaces(descriptor: "Descriptor") -> tuple[float, float]:
    """The least thickness of what touches, infinite where nothing thin does, and how far frames are from bodies."""
    gaps = [one.gap for one in descriptor.numbering.primitives if isinstance(one, Storage) and one.gap]
    if not gaps:
        return np.inf, 0.0
    from ephs.mechanics.shapes.gap import Gap  # most systems have no surfaces
    from ephs.mechanics.tree.finding.frames import frames_of

    thick = min(gap.thickness for gap in gaps if isinstance(gap, Gap))
    if thick == np.inf:
        return np.inf, 0.0
    found = frames_of(descriptor)
    reach = 0.0
    for joint in found.joints:
        stored = found.wiring.components[joint.potential].primitive
        if isinstance(stored, Storage) and stored.gap:
            ends = (end.offset[4:] for end in (joint.first, joint.second) if end.link >= 0)
            reach = max(reach, *(float(np.linalg.norm(at)) for at in ends))
    return thick, reach


def _spread(places: "Sequence[Array]") -> float:
    """Diagonal of the box around some places."""
    return float(np.linalg.norm(np.ptp(np.array(places), axis=0))) if len(places) else 0.0


def _driven_step(problem: "Problem", order: int, rtol: float, span: tuple[float, float]) -> float:
    """The longest step where motions of joints or bodies are prescribed.

    What is prescribed makes no error, and what follows from it alone makes none that is seen: without a limit, steps
    would leap over positions that the mechanism cannot reach, and heat and work would be sums over a few instants.

    Parameters
    ----------
    order, rtol
        Of the method; the least of the tolerances that steer it.
    """
    moved = [
        (signal, twists)
        for slot in problem.descriptor.outer
        if (signal := problem.signals.get(slot.path)) is not None
        and signal.effort
        and (twists := twists_of(slot.quantity)) is not None
    ]
    if not moved:
        return np.inf
    places = [problem.initial[slot.path][4:] for slot in problem.descriptor.states if slot.quantity.kind == "pose"]
    extent = _spread([np.zeros(3), *places])
    turn = min(TURN, (TIMES * rtol) ** (1.0 / order)) if rtol else TURN
    fastest = 0.0
    for signal, twists in moved:
        turning = bool(np.any(twists[:3]))
        for rate in _rates(signal, span):
            size = float(np.linalg.norm((twists[:3] if turning else twists[3:]) @ rate))
            fastest = max(fastest, size if turning or not extent else size / extent)
    return turn / fastest if fastest else np.inf


def _rates(signal: "Signal", span: tuple[float, float]) -> "Iterator[Array]":
    """Prescribed rates at many instants of a run; none where they depend on the state, or fail."""
    if not (signal.constant or signal.timed):
        return
    start, end = span
    within = np.arange(1, SAMPLES) * GOLDEN % 1.0  # no lattice, which a periodic motion may be in step with
    for share in (0.0,) if signal.constant else (0.0, 1.0, *within.tolist()):
        with suppress(SolveError):  # of which the run tells
            yield signal.at(start + share * (end - start), NO_STATE)


def twists_of(momentum: "Quantity") -> "Array | None":
    """(6, d) twists (angular, linear) that the efforts of a momentum are coordinates of; None of what is no motion."""
    if momentum.kind != "momentum" or not momentum.space.name.endswith("*"):
        return None
    name = momentum.space.name.removesuffix("*")
    return pair(name, **dict(momentum.space.parameters)).basis if name in PAIRS else np.eye(6)
