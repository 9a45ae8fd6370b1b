"""A slider-crank that folds: the work of a prescribed motion through dead centres."""

import numpy as np

import ephs
from benchmarks.hard.case import WEIGHTLESS, Case, read

__all__ = ["CASES", "RATE", "START", "folding", "gained"]

START, RATE, UNTIL = 0.7, 3.0, 5.0
"""Angle in rad and rate in rad/s of the crank, and the end in s."""


def folding(friction: float = 0.0) -> ephs.Scene:
    """A slider-crank whose crank and rod are 1 m long, so that it folds: twice a turn all lies on one point."""
    c, s = np.cos(START), np.sin(START)
    pin, end = np.array([c, s]), np.array([2.0 * c, 0.0])
    fast = RATE * np.array([-s, c]), np.array([-2.0 * RATE * s, 0.0])
    bodies = (
        ("crank", 1.0, 0.5 * pin, START, 0.5 * fast[0], RATE),
        ("rod", 1.0, 0.5 * (pin + end), -START, 0.5 * (fast[0] + fast[1]), -RATE),
        ("slider", 0.5, end, 0.0, fast[1], 0.0),
    )
    joints = (
        ("drive", "revolute", "ground", "crank", (0.0, 0.0), f"motion = {{ rate = {RATE} }}"),
        ("pin", "revolute", "crank", "rod", pin, f"friction = {friction}"),
        ("end", "revolute", "rod", "slider", end, ""),
        ("rail", "prismatic", "ground", "slider", end, ""),
    )
    text = ""
    for name, mass, at, angle, velocity, rate in bodies:
        about = mass / 12.0
        text += (
            f"[bodies.{name}]\nmass = {mass}\ninertia = [{0.01 * about}, {about}, {about}]\n"
            f"position = {[*map(float, at), 0.0]}\n"
            f"rotation = [{float(np.cos(0.5 * angle))!r}, 0.0, 0.0, {float(np.sin(0.5 * angle))!r}]\n"
            f"velocity = {[*map(float, velocity), 0.0]}\nangular_velocity = [0.0, 0.0, {rate}]\n"
        )
    for name, kind, one, other, at, more in joints:
        axis = "[1.0, 0.0, 0.0]" if kind == "prismatic" else "[0.0, 0.0, 1.0]"
        text += (
            f"[joints.{name}]\ntype = '{kind}'\nbodies = ['{one}', '{other}']\nat = {[*map(float, at), 0.0]}\n"
            f"axis = {axis}\n{more}\n"
        )
    return read(text, WEIGHTLESS, "dead-centre")


def gained(until: float) -> float:
    """The kinetic energy in J gained up to a time in s: K = ω² (2 sin² φ + const) of these masses."""
    return RATE**2 * 2.0 * float(np.sin(START + RATE * until) ** 2 - np.sin(START) ** 2)


def _worked(sol: ephs.Solution) -> float:
    """Error of the work, relative to it, and of the slider's place, in m: it may stay where the crank folds."""
    work, place = gained(UNTIL), 2.0 * np.cos(START + RATE * UNTIL)
    return max(abs(float(sol.work[-1]) / work - 1.0), abs(float(sol.body("slider").position[-1, 0]) - float(place)))


CASES = (
    Case(
        "dead centre",
        "work of a prescribed motion through configurations in which the slider could stop",
        folding,
        UNTIL,
        _worked,
        (0.01,),
        (1e-6, 1e-10),
    ),
)
