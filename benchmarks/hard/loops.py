"""Loops that pass alignment, cannot move, or hang on screws of hardly any pitch; a bushing of no length."""

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import ephs
from benchmarks import families
from benchmarks.hard.case import WEIGHTLESS, Case, read

__all__ = ["BUSHING", "CASES", "angles", "fall", "stretched"]

Array = NDArray[np.float64]
GRAVITY, SPEED = 9.81, -1.0
LONG = 10.0
"""s: cranks pass through alignment with the ground many times."""
BLOCK, STIFFNESS, DAMPING = 2.0, 50.0, 3.0
"""Of the block on its bushing: mass in kg, N/m, N s/m."""


@lru_cache
def angles(windows: int, times: tuple[float, ...]) -> Array:
    """The common angle in rad of the cranks of a row of windows: bars are alike, couplers move along circles."""
    inertia = (windows + 1) / 3.0 + windows
    torque = GRAVITY * ((windows + 1) / 2.0 + windows)
    found = solve_ivp(
        lambda _, y: (y[1], -torque * np.cos(y[0]) / inertia), (0.0, times[-1]), (0.5 * np.pi, SPEED), "DOP853", times,
        rtol=3e-14, atol=1e-15,
    )  # fmt: skip
    return found.y[0]


def _aligned(windows: int) -> Callable[[ephs.Solution], float]:
    def off(sol: ephs.Solution) -> float:
        angle = angles(windows, tuple(sol.t.tolist()))
        exact = np.column_stack([0.5 * np.cos(angle), 0.5 * np.sin(angle)])
        return float(np.abs(sol.body("crank0").position[:, :2] - exact).max())

    return off


STRETCHED = """
[bodies.left]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.5, {half}, 0.0]
rotation = {up}
[bodies.right]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [1.5, {half}, 0.0]
rotation = {down}
"""


def stretched(height: float) -> str:
    """Two bars of 1 m, all but in line between two pins of the ground."""
    half = 0.5 * float(np.arcsin(height))
    up, down = ([float(np.cos(half)), 0.0, 0.0, sign * float(np.sin(half))] for sign in (1.0, -1.0))
    text = STRETCHED.format(half=0.5 * height, up=up, down=down)
    far = 2.0 * float(np.sqrt(1.0 - height**2))
    pins = {
        "a": ("ground", "left", 0.0, 0.0),
        "b": ("left", "right", 0.5 * far, height),
        "c": ("ground", "right", far, 0.0),
    }
    for name, (one, two, x, y) in pins.items():
        text += f'[joints.{name}]\ntype = "revolute"\nbodies = ["{one}", "{two}"]\nat = [{x!r}, {y!r}, 0.0]\n'
        text += "axis = [0.0, 0.0, 1.0]\n"
    return text


def _locked(height: float) -> Case:
    def off(sol: ephs.Solution) -> float:
        return float(np.abs(sol.body("left").position[-1] - sol.body("left").position[0]).max())

    return Case(
        f"stretched truss {height:g}",
        f"two bars between two pins, {height:g} m off their line: they cannot move",
        lambda: read(stretched(height), "[world]\ngravity = [0.0, -9.81, 0.0]\n"),
        0.2,
        off,
        (0.005,),
        (1e-6,),
    )


PITCH, TORQUE = 1e-6, 0.05
SCREW = f"""
[bodies.spindle]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
[joints.nut]
type = "screw"
bodies = ["ground", "spindle"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
pitch = {PITCH!r}
drive = {TORQUE!r}
"""


def _screwed(sol: ephs.Solution) -> float:
    """Error of the angle, relative to it, and of the balance in parts of the work."""
    angle = 0.5 * TORQUE * sol.t[-1] ** 2 / (0.1 + PITCH**2)
    found, work = float(sol.joint("nut").coordinate[-1, 0]), TORQUE * angle
    return max(abs(found / angle - 1.0), abs(float(sol.work[-1]) / work - 1.0), float(sol.energy_error.max()))


BUSHING = f"""
[world]
gravity = [0.0, -{GRAVITY}, 0.0]
[bodies.block]
mass = {BLOCK}
inertia = [0.2, 0.3, 0.4]
position = [0.1, 0.2, 0.3]
[springs.bushing]
bodies = ["ground", "block"]
at1 = [0.1, 0.2, 0.3]
at2 = [0.0, 0.0, 0.0]
stiffness = {STIFFNESS}
length = {{length}}
damping = {DAMPING}
"""


def fall(t: float | Array) -> Array:
    """Height in m above the support of a damped oscillator that is let go there."""
    decay = DAMPING / (2.0 * BLOCK)
    turns = np.sqrt(STIFFNESS / BLOCK - decay**2)
    sag = BLOCK * GRAVITY / STIFFNESS
    return -sag * (1.0 - np.exp(-decay * t) * (np.cos(turns * t) + decay / turns * np.sin(turns * t)))


def bricard() -> ephs.Scene:
    """The shipped linkage."""
    return ephs.load(Path(__file__).parents[2] / "scenes" / "bricard.toml")


@lru_cache
def _bricard() -> Array:
    """(3,) place of one of its bars at the end, by the Runge-Kutta method of order 8 at 1e-12."""
    sol = ephs.simulate(bricard(), 1.0, method="rk87", rtol=1e-12, atol=1e-12, save_at=[1.0])
    return sol.body("c").position[-1]


def _hinged(sol: ephs.Solution) -> float:
    return float(np.abs(sol.body("c").position[-1] - _bricard()).max())


def _fallen(sol: ephs.Solution) -> float:
    sag = BLOCK * GRAVITY / STIFFNESS
    return float(np.abs(sol.body("block").position[:, 1] - 0.2 - fall(sol.t)).max()) / sag


CASES = (
    *(
        Case(
            f"windows {windows}",
            f"a row of {windows} four-bars through configurations in which the constraints lose rank",
            lambda windows=windows: families.scene("four-bar-windows", windows),
            LONG,
            _aligned(windows),
            (0.01,),
            (1e-6, 1e-9),
        )
        for windows in (1, 2)
    ),
    *map(_locked, (1e-9, 1e-6)),
    Case("bricard", "an overconstrained ring of six bars", bricard, 1.0, _hinged, (0.05, 0.0125), (1e-6,)),
    Case("screw", "a screw of a pitch of 10⁻⁶ m", lambda: read(SCREW, WEIGHTLESS), 1.0, _screwed, (0.01,), (1e-6,)),
    Case("bushing", "a spring of no length, both ends in one place", lambda: read(BUSHING.format(length=0.0)), 1.0,
         _fallen, (2.0**-8,), (1e-6,)),
)  # fmt: skip
