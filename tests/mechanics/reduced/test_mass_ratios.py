"""Loops of links whose masses differ by orders of magnitude: rank is one of kinematics, not of masses."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ephs

POINTS = np.array([(0.0, 0.0), (0.3, 0.8), (1.5, 1.1), (1.2, 0.0)])


def four_bar(masses, folder):
    """A planar four-bar from rest under gravity along −y; three slender links with these masses in kg."""
    lines = ["format = 1", 'name = "four-bar"', "[world]", "gravity = [0.0, -9.81, 0.0]"]
    for i, mass in enumerate(masses):
        a, b = POINTS[i : i + 2]
        angle, inertia = 0.5 * np.arctan2(*(b - a)[::-1]), mass * float(np.sum((b - a) ** 2)) / 12.0
        lines += [
            f"[bodies.b{i}]",
            f"mass = {mass!r}",
            f"inertia = [{inertia / 50.0!r}, {inertia!r}, {inertia!r}]",
            f"position = {[*(0.5 * (a + b)).tolist(), 0.0]}",
            f"rotation = {[float(np.cos(angle)), 0.0, 0.0, float(np.sin(angle))]}",
        ]
    ends = (("ground", "b0"), ("b0", "b1"), ("b1", "b2"), ("b2", "ground"))
    for i, ((one, two), point) in enumerate(zip(ends, POINTS, strict=True)):
        lines += [f"[joints.j{i}]", 'type = "revolute"', f'bodies = ["{one}", "{two}"]']
        lines += [f"at = {[*point.tolist(), 0.0]}", "axis = [0.0, 0.0, 1.0]"]
    file = folder / "four-bar.toml"
    file.write_text("\n".join(lines), encoding="utf-8")
    return ephs.load(file)


def crank_angle(masses, until):
    """The angle of the first crank in rad: one freedom, its energy's equation differenced in closed kinematics."""
    lengths = np.linalg.norm(np.diff(POINTS, axis=0), axis=1)

    def angles(first):
        tip = lengths[0] * np.array([np.cos(first), np.sin(first)])
        away = POINTS[3] - tip
        far = float(np.linalg.norm(away))
        inner = np.arccos((lengths[1] ** 2 + far**2 - lengths[2] ** 2) / (2.0 * lengths[1] * far))
        second = np.arctan2(away[1], away[0]) + inner
        end = tip + lengths[1] * np.array([np.cos(second), np.sin(second)])
        return tip, end, second, np.arctan2(*(POINTS[3] - end)[::-1])

    def rates(first):
        """d(second, third) by d(first), from the derivative of the closed chain."""
        _, _, second, third = angles(first)
        columns = lengths * np.array(
            [[-np.sin(a) for a in (first, second, third)], [np.cos(a) for a in (first, second, third)]]
        )
        return np.array([1.0, *np.linalg.solve(columns[:, 1:], -columns[:, 0])])

    def inertia(first):
        _, _, second, _ = angles(first)
        by = rates(first)
        spin = masses * lengths**2 / 12.0
        centre = 0.5 * lengths[1] * np.array([-np.sin(second), np.cos(second)]) * by[1]
        middle = lengths[0] * np.array([-np.sin(first), np.cos(first)]) + centre
        ends = masses[0] * lengths[0] ** 2 / 4.0 + masses[2] * (lengths[2] * by[2]) ** 2 / 4.0
        return float(spin @ by**2 + ends + masses[1] * middle @ middle)

    def potential(first):
        tip, end, _, _ = angles(first)
        return 9.81 * float(0.5 * masses[0] * tip[1] + 0.5 * masses[1] * (tip[1] + end[1]) + 0.5 * masses[2] * end[1])

    def slope(function, x, h=1e-4):
        return (8.0 * (function(x + h) - function(x - h)) - function(x + 2.0 * h) + function(x - 2.0 * h)) / (12.0 * h)

    def right(_, y):
        return y[1], -(slope(potential, y[0]) + 0.5 * slope(inertia, y[0]) * y[1] ** 2) / inertia(y[0])

    start = float(np.arctan2(*POINTS[1][::-1]))
    return float(solve_ivp(right, (0.0, until), (start, 0.0), rtol=1e-10, atol=1e-12).y[0, -1])


@pytest.mark.parametrize("heavy", range(3))
@pytest.mark.parametrize("method", ["auto", "rk87", "radau", "ida"])
def test_a_heavy_link_leaves_the_rank_of_the_loop_alone(method, heavy, tmp_path):
    """Against the equation of the one freedom, whose differences are good for 1e-9; methods for 100 tolerances."""
    masses = np.ones(3)
    masses[heavy] = 1e10
    sol = ephs.simulate(four_bar(masses.tolist(), tmp_path), 0.4, method=method)
    angle = crank_angle(masses, 0.4)
    exact = 0.5 * np.linalg.norm(POINTS[1]) * np.array([np.cos(angle), np.sin(angle)])
    assert np.abs(sol.body("b0").position[-1, :2] - exact).max() <= 1e-4


@pytest.mark.parametrize("heavy", range(3))
@pytest.mark.parametrize(("method", "allowed"), [("natural", 1e-4), ("natural4", 1e-9)])
def test_component_by_component_too(method, allowed, heavy, tmp_path):
    """At constant steps of 0.01 s, to their errors at equal masses; balances to rounding."""
    masses = np.ones(3)
    masses[heavy] = 1e10
    sol = ephs.simulate(four_bar(masses.tolist(), tmp_path), 0.4, method=method, step=0.01)
    angle = crank_angle(masses, 0.4)
    exact = 0.5 * np.linalg.norm(POINTS[1]) * np.array([np.cos(angle), np.sin(angle)])
    assert np.abs(sol.body("b0").position[-1, :2] - exact).max() <= allowed
    assert sol.energy_error.max() <= 10.0 * np.sqrt(40) * 10.0 * np.finfo(float).eps
