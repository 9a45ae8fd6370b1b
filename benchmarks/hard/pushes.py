"""Inputs that jump: a mass on a spring, pushed by forces whose effect is known in closed form."""

import numpy as np
from numpy.typing import NDArray

import ephs
from benchmarks.hard.case import WEIGHTLESS, Case, read

__all__ = ["CASES", "FORCES", "MASS", "OMEGA", "SPRING", "TIMES", "error", "motion", "push", "sprung"]

Array = NDArray[np.float64]
SPRING = """
[bodies.mass]
mass = 2.0
inertia = [0.1, 0.1, 0.1]
[joints.rail]
type = "prismatic"
bodies = ["ground", "mass"]
at = [0.0, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
stiffness = 18.0
"""
MASS, OMEGA = 2.0, 3.0
TIMES, FORCES = (0.13, 0.31, 0.57, 0.8), (5.0, -3.0, 0.0, 8.0, 2.0)
PULSE, SHORT = ((3.0, 3.005), (0.0, 50.0, 0.0)), ((3.0, 3.0004), (0.0, 500.0, 0.0))


def sprung() -> ephs.Scene:
    """The mass on its spring, without weight."""
    return read(SPRING, WEIGHTLESS)


def push(t: float) -> float:
    """Force in N."""
    return _push(t, TIMES, FORCES)


def _push(t: float, times: tuple[float, ...], forces: tuple[float, ...]) -> float:
    return forces[int(np.searchsorted(times, t, side="right"))]


def motion(t: float, times: tuple[float, ...] = TIMES, forces: tuple[float, ...] = FORCES) -> tuple[float, float]:
    """Place and rate of the mass at a time, from rest: turns about the place that each force holds it at."""
    x, v, now = 0.0, 0.0, 0.0
    for after, force in zip([*times, np.inf], forces, strict=True):
        rest, h = force / MASS / OMEGA**2, min(after, t) - now
        c, s = np.cos(OMEGA * h), np.sin(OMEGA * h)
        x, v, now = rest + (x - rest) * c + v / OMEGA * s, v * c - (x - rest) * OMEGA * s, min(after, t)
        if now == t:
            break
    return float(x), float(v)


def error(sol: ephs.Solution, *course: tuple[float, ...]) -> float:
    """Largest error of place, and of rate over ω, in m."""
    joint = sol.joint("rail")
    x, v = np.array([motion(t, *course) for t in sol.t]).T
    return float(max(np.abs(joint.coordinate[:, 0] - x).max(), np.abs(joint.rate[:, 0] - v).max() / OMEGA))


def _case(
    name: str, words: str, until: float, course: tuple[tuple[float, ...], tuple[float, ...]], *, declared: bool
) -> Case:
    size = max(abs(value) for t in np.linspace(0.0, until, 400) for value in motion(float(t), *course)[:1])
    jumps = {"jumps": course[0]} if declared else {}
    return Case(
        name,
        words,
        sprung,
        until,
        lambda sol: error(sol, *course) / size,
        (1.0 / 60.0,),
        (1e-6,),
        {"inputs": {"joints.rail": lambda t: _push(t, *course)}, **jumps},
    )


CASES = (
    _case("jumps, declared", "a force that jumps at times that are given", 1.0, (TIMES, FORCES), declared=True),
    _case("jumps", "a force that jumps", 1.0, (TIMES, FORCES), declared=False),
    _case("pulse of 5 ms", "a pulse of 5 ms after 3 s of rest", 5.0, PULSE, declared=False),
    _case("pulse of 0.4 ms, declared", "a pulse below the width of the search", 5.0, SHORT, declared=True),
)
