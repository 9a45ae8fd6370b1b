"""The variational method on joints that do not commute: what its maps are, that steps go back, that momenta stay."""

import math
from dataclasses import replace

import numpy as np
import pytest

from ephs.mechanics.methods.registry import METHODS, Setting
from ephs.solve.running.control import Control, Tolerance
from tests.numerics import jacobian, largest
from tests.scenes import equations_of
from tests.written import scene_of_text

SCENE = """format = 1
name = "pair"

[assembly]
adjust = true

[world]
gravity = [0.1, 0.2, -9.81]

[bodies.base]
mass = 2.0
inertia = [0.6, 0.7, 0.8, 0.05, -0.04, 0.03]
position = [0.3, -0.2, 0.5]
rotation = [0.5, 0.5, -0.5, 0.5]
velocity = [1.0, -2.0, 3.0]
angular_velocity = [0.4, 0.5, -0.6]

[bodies.arm]
mass = 1.0
inertia = [0.3, 0.4, 0.5]
position = [1.3, -0.2, 0.5]
angular_velocity = [-0.7, 0.2, 0.9]

[joints.wrist]
type = "spherical"
bodies = ["base", "arm"]
at = [0.8, -0.2, 0.5]
stiffness = 2.0
"""


def stepper(eq, name):
    control = Control(Tolerance(1e-12, {}), Tolerance(1e-12, {}), 0.1, 0.0, math.inf, None)
    return METHODS[name].make(Setting(eq.problem, 0.0, control, {}, eq))[0]


@pytest.fixture
def heavy():
    return equations_of(scene_of_text(SCENE))


def test_steps_go_back_to_where_they_began(heavy):
    method, start = stepper(heavy, "variational"), heavy.start(0.0)
    end = method.step(start, 0.05).end
    again = method.step(end, -0.05).end
    assert largest(end.q - start.q) > 1e-2
    assert largest(again.q - start.q) <= 1e-12 and largest(again.r - start.r) <= 1e-11


def test_a_step_misses_by_its_third_power(heavy):
    start, missed, method = heavy.start(0.0), [], stepper(heavy, "variational")
    for h in (0.02, 0.01):
        found = stepper(heavy, "variational").step(start, h).end
        exact = stepper(heavy, "rk87").step(start, h).end
        missed.append(max(largest(found.q - exact.q), largest(found.r - exact.r)))
    assert missed[0] / missed[1] == pytest.approx(2.0**method.exponent, rel=0.1)


def test_the_maps_of_momenta_are_inverse_and_begin_with_half_a_bracket(heavy):
    method, rng = stepper(heavy, "variational"), np.random.default_rng(2)
    xi, covector = 0.4 * rng.standard_normal(heavy.n), rng.standard_normal(heavy.n)
    assert largest(method._untwisted(xi, method._turned(xi, covector)) - covector) <= 1e-12
    assert largest(method._turned(xi, method._untwisted(xi, covector)) - covector) <= 1e-12
    bracket = method._turning(covector)
    change = jacobian(lambda v: method._turned(v, covector), heavy.n, 1e-5)
    assert largest(change - 0.5 * bracket) <= 1e-9


def test_work_is_counted(heavy):
    method, state = stepper(heavy, "variational"), heavy.start(0.0)
    method.step(method.step(state, 0.02).end, 0.02)
    assert method.counts["jacobians"] >= 1
    assert 2 <= method.counts["iterations"] <= 20


@pytest.mark.parametrize("rest", [True, False])
def test_the_matrix_of_a_step_is_its_derivative(heavy, rest):
    """At rest exactly, as no increment bends it; else to first order in the increment."""
    method, state = stepper(heavy, "variational"), heavy.start(0.0)
    h = 0.1 if rest else 1e-3
    if rest:
        state = replace(state, r=np.zeros(heavy.n))
    xi = h * state.r

    def first(by):
        return method._start(xi + by, h, method._middle(state, h, xi + by))

    found = method._slope(state, h, xi, method._middle(state, h, xi))
    expected = jacobian(first, heavy.n, 1e-5)
    scale = largest(expected)
    assert largest(found - expected) <= (1e-9 if rest else 1e-5) * scale
    force = method._middle(state, h, xi)[1]
    assert not rest or largest(0.25 * h * method._turning(force)) > 1e-4 * scale


def test_the_last_step_is_a_guess_of_the_next(heavy):
    """Rates that go on changing as they did save iterations."""
    taken = []
    for forgetful in (False, True):
        method, state = stepper(heavy, "variational"), heavy.start(0.0)
        for _ in range(20):
            state = method.step(state, 1e-3).end
            if forgetful:
                method._guess = None
        taken.append(method.counts["iterations"])
    assert taken[0] < taken[1]
