"""Gauss methods in joint coordinates: their coefficients, symmetry, orders on loops, and how stages are solved."""

import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import ephs
from ephs.mechanics.methods.explicit import Explicit
from ephs.mechanics.methods.gauss import ORDERS, gauss
from ephs.mechanics.methods.registry import METHODS, Setting
from ephs.mechanics.runs.simulate import problem_of_scene
from ephs.mechanics.tree.equations.equations import Equations
from ephs.solve.control import Control, Tolerance
from ephs.solve.errors import SolveError
from tests.mechanics.methods.test_loops import five_bar
from tests.mechanics.torsion import torsion
from tests.written import scene_of_text

NAMES = tuple(ORDERS)
CONTROL = Control(Tolerance(1e-9, {}), Tolerance(1e-12, {}), 1e-2, 0.0, math.inf, None)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return five_bar(tmp_path_factory.mktemp("five"))


@pytest.fixture(scope="module")
def equations(scene):
    return Equations(problem_of_scene(scene), 0.0)


def stepper(equations, method):
    return METHODS[method].make(Setting(equations.problem, 0.0, CONTROL, {}, equations))[0]


def apart(one, two):
    return max(np.abs(one.q - two.q).max(), np.abs(one.r - two.r).max())


# ---- coefficients ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_the_coefficients_are_those_of_collocation_at_the_zeros_of_legendre_polynomials(name):
    """B(2s) and not B(2s + 1); C(s); the nodes are zeros of the shifted Legendre polynomial."""
    s, found = ORDERS[name] // 2, gauss(name)
    a, b, c = found.arrays["a"][1:-1, 1:], found.arrays["a"][-1, 1:], found.c[1:]
    legendre = [(-1) ** (s + k) * math.comb(s, k) * math.comb(s + k, k) for k in range(s + 1)]
    assert max(abs(sum(x * node**k for k, x in enumerate(legendre))) for node in c) <= 1e-13
    for k in range(1, 2 * s + 1):
        assert abs(b @ c ** (k - 1) - 1.0 / k) <= 1e-14
    assert abs(b @ c ** (2 * s) - 1.0 / (2 * s + 1)) > 1e-7
    for k in range(1, s + 1):
        assert np.abs(a @ c ** (k - 1) - c**k / k).max() <= 1e-14
    assert np.array_equal(found.arrays["a"][:, 0], np.zeros(s + 2))  # the start is no stage


@pytest.mark.parametrize("name", NAMES)
def test_first_guesses_and_estimates_vanish_on_polynomials_as_far_as_they_can(name):
    s, found = ORDERS[name] // 2, gauss(name)
    c, guess = found.c, found.arrays["guess"]
    for i in range(1, s + 1):
        for k in range(i):
            assert abs(guess[i] @ c**k - c[i] ** (k + 1) / (k + 1)) <= 1e-14
    ends = np.append(c, 1.0)
    for weights, degree in zip(found.estimates, (s - 1, s - 2), strict=True):
        for k in range(degree + 1):
            assert abs(weights @ ends**k) <= 1e-15
        assert abs(weights @ ends ** (degree + 1)) > 1e-5


# ---- steps ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*NAMES, "rk87", "radau"])
def test_a_step_back_leads_to_the_start_by_symmetric_methods_only(name):
    eq = Equations(problem_of_scene(scene_of_text(torsion(0.5, 3.0, -1.1, rest=-0.3))), 0.0)
    made, start = stepper(eq, name), eq.start(0.0)
    back = made.step(made.anew(made.step(start, 0.5).end), -0.5).end
    assert (apart(back, start) <= 1e-13) == (name in NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_sweeps_and_newtons_method_solve_the_same_stages(equations, name):
    start = equations.start(0.0)
    swept, solved = stepper(equations, name), stepper(equations, name)
    solved._sweeps = False
    one, two = swept.step(start, 1e-2), solved.step(start, 1e-2)
    assert swept._stages is None and solved.counts["iterations"] > 0
    assert apart(one.end, two.end) <= 1e-11 and apart(one.end, start) > 1e-3
    assert np.abs(one.end.heats - two.end.heats).max() <= 1e-11


@pytest.mark.parametrize("name", NAMES)
def test_stages_evaluated_one_by_one_are_those_of_machine_code(equations, name):
    start = equations.start(0.0)
    made = stepper(equations, name)
    one = made.step(start, 1e-2).end
    equations.steady = False
    try:
        assert apart(one, stepper(equations, name).step(start, 1e-2).end) <= 1e-13
    finally:
        equations.steady = True


@pytest.mark.parametrize("name", NAMES)
def test_orders_on_a_loop_with_friction(name):
    order, scene = ORDERS[name], ephs.load(Path(__file__).parents[3] / "scenes/bricard.toml")
    h = {4: 0.02, 6: 0.04, 8: 0.08}[order]
    exact = ephs.simulate(scene, 0.16, method="rk87", rtol=1e-13, atol=1e-15, save_at=[0.16])
    missed = []
    for step in (h, h / 2):
        sol = ephs.simulate(scene, 0.16, method=name, step=step, save_at=[0.16], audit="off")
        assert not sol.stats["switches"]
        missed.append(
            max(np.abs(sol[path][-1] - exact[path][-1]).max() for path in sol.states if "bodies" in str(path))
        )
    assert 2.0 ** (order - 0.8) <= missed[0] / missed[1]


def test_a_spring_too_stiff_for_sweeps_is_left_to_newtons_method(tmp_path):
    """h ω = 20: Padé (4, 4) of the exponential, of modulus one."""
    file, h = tmp_path / "stiff.toml", 0.1
    file.write_text(torsion(0.5, 2e4, -1.1, rest=-0.3), encoding="utf-8")
    sol = ephs.simulate(ephs.load(file), 3 * h, method="gauss8", step=h, audit="off")
    assert [switch["to"] for switch in sol.stats["switches"]] == ["Newton's method"]
    z = h * np.array([[0.0, 1.0], [-4e4, 0.0]])
    top = [Fraction(math.factorial(8 - j) * math.comb(4, j), math.factorial(8)) for j in range(5)]
    over, under = (sum(float(x) * np.linalg.matrix_power(w, j) for j, x in enumerate(top)) for w in (z, -z))
    y = np.array([0.3, -1.1])
    for i in range(1, 4):
        y = np.linalg.solve(under, over @ y)
        assert np.ravel(sol.joint("axle").coordinate)[i] + 0.3 == pytest.approx(y[0], abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_chosen_steps_are_left_to_radau_where_a_brake_is_stiff(name, tmp_path):
    """A brake that stops within a microsecond: Gauss steps of the motion's length would let its rate ring on."""
    file = tmp_path / "brake.toml"
    file.write_text(torsion(0.5, 3.0, -1.1, rest=-0.3, friction=1e5), encoding="utf-8")
    sol = ephs.simulate(ephs.load(file), 1.0, method=name, rtol=1e-6, atol=1e-6)
    assert [switch["to"] for switch in sol.stats["switches"]] == ["radau"] and sol.stats["steps"] < 500
    assert abs(sol.joint("axle").rate[-1]) <= 1e-5 and sol.energy_error.max() <= 1e-12
    assert not ephs.simulate(ephs.load(file), 1e-6, method=name, rtol=1e-6, atol=1e-6).stats["switches"]


def test_sweeps_that_do_not_contract_end_a_step():
    eq = Equations(problem_of_scene(scene_of_text(torsion(0.5, 2e4, -1.1, rest=-0.3))), 0.0)
    for steady in (True, False):
        eq.steady = steady
        with pytest.raises(SolveError, match="stages"):
            Explicit(eq, CONTROL, gauss("gauss6")).step(eq.start(0.0), 0.1)
