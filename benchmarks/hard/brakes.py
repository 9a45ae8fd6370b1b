"""Brakes: friction that stops a disc within a part of a step, and one that an explicit step does not survive."""

import math
from functools import lru_cache

import numpy as np
from scipy.integrate import solve_ivp

import ephs
from benchmarks.hard.case import WEIGHTLESS, Case, read
from examples.failing import pendulum

__all__ = ["CASES", "ENERGY", "RATE", "brake"]

RATE, ENERGY, WARM = 100.0, 5000.0, 300.0
"""Rate of the disc in rad/s, its energy in J, the temperature of its pad in K."""
DAMPING, SPEED, UNTIL = 20.0, 6.0, 2.0
"""Of the rod: friction in N m s, its rate at the start in rad/s, the end in s."""


def brake(friction: float, capacity: float | None = None, temperature: float = WARM) -> ephs.Scene:
    """A disc of 1 kg m² on a pin, 100 rad/s: 5000 J. Its heat goes into a pad of so many J/K, if there is one."""
    heat = 'heat = "pad"' if capacity else ""
    pad = f"[thermal.pad]\ncapacity = {capacity}\ntemperature = {temperature}" if capacity else ""
    return read(
        f"""
        [bodies.disc]
        mass = 1.0
        inertia = [0.5, 0.5, 1.0]
        angular_velocity = [0.0, 0.0, {RATE}]
        [joints.pin]
        type = "revolute"
        bodies = ["ground", "disc"]
        at = [0.0, 0.0, 0.0]
        axis = [0.0, 0.0, 1.0]
        friction = {friction}
        {heat}
        {pad}
        """,
        WEIGHTLESS,
    )


def _stopped(sol: ephs.Solution, friction: float, capacity: float | None) -> float:
    """Error of heat, rate and entropy at the end, relative to energy, rate and entropy made; of the angle in rad."""
    t, ledgers = sol.t[-1], sol.ledgers
    heat = ENERGY * -math.expm1(-2.0 * friction * t)
    off = [
        abs(ledgers.heat[-1] - heat) / ENERGY,
        abs(sol.joint("pin").rate[-1, 0] - RATE * math.exp(-friction * t)) / RATE,
        abs(sol.joint("pin").coordinate[-1, 0] + RATE / friction * math.expm1(-friction * t)),
    ]
    made = capacity * math.log1p(heat / (capacity * WARM)) if capacity else heat / ledgers.temperature
    off.append(abs(ledgers.made[-1] - ledgers.made[0] - made) / made)
    return max(off)


def _brake(friction: float, step: float, capacity: float | None = None) -> Case:
    warm = f", a pad of {capacity:g} J/K" if capacity else ""
    return Case(
        f"brake {friction:g}" + (", pad" if capacity else ""),
        f"a disc stopped by friction of {friction:g} N m s{warm}",
        lambda: brake(friction, capacity),
        1.0,
        lambda sol: _stopped(sol, friction, capacity),
        (step,),
        (1e-6,),
    )


@lru_cache
def _rod() -> tuple[float, float]:
    """Angle of the damped rod at the end, and its heat: the equation of one freedom."""
    inertia, torque = 0.35, 9.81 * 0.5
    found = solve_ivp(
        lambda _, y: (y[1], (torque * math.cos(y[0]) - DAMPING * y[1]) / inertia, DAMPING * y[1] ** 2),
        (0.0, UNTIL), (0.0, SPEED, 0.0), "DOP853", rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    return float(found.y[0, -1]), float(found.y[2, -1])


def _damped(sol: ephs.Solution) -> float:
    angle, heat = _rod()
    off = abs(float(sol.joint("pin").coordinate[-1, 0]) - angle), abs(float(sol.heat[-1]) - heat) / heat
    return float(np.nan_to_num(max(off), nan=np.inf))


def _entropy(sol: ephs.Solution) -> float:
    """The deepest fall of the total entropy between two instants, relative to what was made."""
    ledgers = sol.ledgers
    return max(0.0, -float(np.diff(ledgers.entropy).min())) / float(ledgers.made[-1] - ledgers.made[0])


def _supplied(sol: ephs.Solution) -> float:
    """Energy and exergy that the ledger of a closed system says it was supplied, relative to what was turned over."""
    whole = sol.ledger()
    return float(max(np.abs(whole.energy_supplied).max(), np.abs(whole.exergy_supplied).max())) / sol.ledgers.scale


CASES = (
    _brake(1e6, 0.002),
    _brake(20.0, 0.05),
    _brake(100.0, 0.05),
    _brake(1e6, 0.002, 0.01),
    Case(
        "beyond stability",
        "steps of twice what an explicit method survives",
        lambda: pendulum(SPEED, f"friction = {DAMPING}"),
        UNTIL,
        _damped,
        (0.1,),
        (1e-6,),
    ),
    Case(
        "total entropy",
        "the entropy of all parts rises in every step",
        lambda: pendulum(SPEED, f"friction = {DAMPING}"),
        UNTIL,
        _entropy,
        (0.01,),
        (1e-4, 1e-8),
        instants=400,
        exact=1e-11,
    ),
    Case(
        "nothing supplied",
        "the defect of steps is no supply",
        lambda: pendulum(SPEED, "friction = 2.0"),
        1.0,
        _supplied,
        (0.01,),
        (1e-4,),
        exact=1e-11,
    ),
)
