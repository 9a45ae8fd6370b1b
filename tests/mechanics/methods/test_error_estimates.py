"""What methods estimate their errors to be, on a linear equation, against the formulas in the literature."""

import math
from dataclasses import replace

import numpy as np
import pytest

from ephs.mechanics.methods import radau as implicit
from ephs.mechanics.methods import semi, tableaux
from ephs.mechanics.methods.registry import METHODS, Setting
from ephs.solve.methods.collocation import radau
from tests.mechanics.embedded import embedded_radau
from tests.mechanics.plain import uncorrected
from tests.mechanics.torsion import torsion
from tests.methods import choosing
from tests.numerics import largest
from tests.scenes import equations_of
from tests.written import scene_of_text

J, K, RATE = 0.5, 3.0, -1.1
A = np.array([[0.0, 1.0], [-K / J, 0.0]])
RTOL, ATOL = 1e-5, 1e-7
SCENE = torsion(J, K, RATE)
Y = np.array([0.0, RATE])


@pytest.fixture(autouse=True)
def plain():
    """Estimates are of steps without corrections."""
    with uncorrected():
        yield


@pytest.fixture(scope="module")
def equations():
    scene = scene_of_text(SCENE)
    return equations_of(scene)


def stepper(equations, method, **options):
    control = choosing(RTOL, ATOL)
    made, _ = METHODS[method].make(Setting(equations.problem, 0.0, control, options, equations))
    return made


def relative(estimate, end):
    """Relative to what is allowed: of an increment as if it were 1, of a rate by its size before and after."""
    return estimate / (ATOL + RTOL * np.array([1.0, max(abs(RATE), abs(end))]))


def mean_square(relative):
    """With the environment's entropy, which stays as it is."""
    return float(relative @ relative) / 3.0


def stages(a, b, h):
    """The rates at the stages of an explicit method, that at the end, and the end."""
    k = [A @ Y]
    for row in [*a, b]:
        end = Y + h * sum(weight * rate for weight, rate in zip(row, k, strict=True))
        k.append(A @ end)
    return np.array(k), end


@pytest.mark.parametrize("h", [0.02, 0.1])
def test_of_order_five_it_is_the_root_mean_square_of_the_difference(equations, h):
    k, end = stages(tableaux.A5, tableaux.B5, h)
    attempt = stepper(equations, "rk54").step(equations.start(0.0), h)
    expected = relative(h * np.array(tableaux.E5) @ k, end[1])
    assert attempt.error == pytest.approx(math.sqrt(mean_square(expected)), rel=1e-6)
    assert attempt.end.r[0] == pytest.approx(end[1], abs=1e-13)


@pytest.mark.parametrize("h", [0.2, 0.5])
def test_of_order_eight_two_estimates_are_blended(equations, h):
    k, end = stages(tableaux.A8, tableaux.B8, h)
    made = stepper(equations, "rk87")
    assert made.stiffness == 0.0  # nothing is known of it yet
    attempt = made.step(equations.start(0.0), h)
    fine, coarse = (relative(h * np.array(e) @ k, end[1]) for e in (tableaux.E8_5, tableaux.E8_3))
    one, two = mean_square(fine), mean_square(coarse)
    assert attempt.error == pytest.approx(one / math.sqrt(one + 0.01 * two), rel=1e-5)
    # how fast the mode is that the last two stages differ in: at most A's norm in the scale of what is allowed
    assert 0.0 < made.stiffness <= h * float(np.linalg.norm(A, 2))


@pytest.mark.parametrize("stages", [3, 5, 7])
@pytest.mark.parametrize("h", [0.02, 0.1, 0.3, 1.0])  # with three far below what is allowed, half above it, far above
def test_of_radau_it_is_the_filtered_difference_to_the_embedded_method(equations, h, stages, monkeypatch):
    """Again from there where it is too large."""
    monkeypatch.setattr(implicit, "scheme_of", lambda *_: radau(stages))
    found, (_, end) = embedded_radau(stages, A, Y, h)
    if largest(relative(found, end)) > 1.0:
        found, _ = embedded_radau(stages, A, Y, h, Y + found)
    attempt = stepper(equations, "radau").step(equations.start(0.0), h)
    assert attempt.error == pytest.approx(largest(relative(found, end)), rel=1e-3, abs=1e-4)
    assert attempt.end.r[0] == pytest.approx(end, abs=1e-7)


def test_the_estimate_of_radau_is_that_of_the_book_with_three_stages():
    """Hairer and Wanner, IV.8, (8.19): e = γ₀/3 (−13 − 7√6, −13 + 7√6, −1), here over γ₀."""
    root, scheme = math.sqrt(6.0), radau(3)
    found = scheme.defect @ np.linalg.inv(scheme.coefficients) / scheme.gamma
    assert largest(found - np.array([-13.0 - 7.0 * root, -13.0 + 7.0 * root, -1.0]) / 3.0) <= 1e-12


@pytest.mark.parametrize(("rtol", "stages"), [(1e-2, 3), (1e-4, 5), (1e-6, 5), (1e-8, 7)])
def test_radau_has_more_stages_at_finer_tolerances(rtol, stages, equations):
    control = choosing(rtol)
    made, _ = METHODS["radau"].make(Setting(equations.problem, 0.0, control, {}, equations))
    constant, _ = METHODS["radau"].make(Setting(equations.problem, 0.0, replace(control, step=0.1), {}, equations))
    assert (made.scheme.nodes.size, made.exponent) == (stages, stages + 1.0)
    assert constant.scheme.nodes.size == 3


def test_matrices_are_kept_for_steps_of_one_length_and_made_anew_when_asked(equations):
    method, start = stepper(equations, "radau"), equations.start(0.0)
    made, y = method._stages, equations.vector(start)
    made.kept.renew(start)
    for h, factorised in ((0.1, 1), (0.1, 1), (0.2, 2)):
        made.kept.solvers(h)
        assert method.counts["factorisations"] == factorised
    before = method.counts["jacobians"]
    made.kept.stale = True
    made.solve(start, y, 0.2)
    assert method.counts["jacobians"] == before + 1
    assert method.counts["factorisations"] == 3


@pytest.mark.parametrize("method", ["variational", "radau", "rk54", "rk87"])
@pytest.mark.parametrize("h", [0.02, -0.02])
def test_a_step_ends_a_step_later(equations, method, h):
    made = stepper(equations, method)
    assert not any(count for name, count in made.counts.items() if name not in ("keep", "chosen"))
    attempt = made.step(equations.start(0.5), h)
    assert (attempt.start.t, attempt.end.t, attempt.h) == (0.5, 0.5 + h, h)


FALLING = """
format = 1
[bodies.ball]
mass = 2.0
inertia = [0.1, 0.1, 0.1]
position = [0.0, 0.0, {height}]
[joints.slide]
type = "prismatic"
bodies = ["ground", "ball"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
rate = -2.0
[surfaces.ball]
body = "ball"
shape = {{ sphere = 0.1 }}
stiffness = 1e3
loss = 0.5
[surfaces.floor]
body = "ground"
shape = {{ plane = {{}} }}
[contacts.touch]
surfaces = ["ball", "floor"]
"""


@pytest.mark.parametrize("depth", [-0.01, 0.01, 0.03])
def test_semi_implicit_steps_see_a_surface_at_their_end_that_no_stage_meets(depth):
    """The stage ahead knows no acceleration, and is a way of g h²/2 before the end: 5 cm in a step of 0.1 s."""
    h, gravity, stiffness, mass = 0.1, 9.81, 1e3, 2.0
    way = 2.0 * h + 0.5 * gravity * h**2
    equations = equations_of(scene_of_text(FALLING.format(height=0.1 + way - depth)))
    made = stepper(equations, "semi")
    attempt, end = made.step(equations.start(0.0), h), -2.0 - gravity * h
    missed = stiffness / mass * max(depth, 0.0)
    expected = semi.SEVERE * h / 6.0 * missed / (ATOL + RTOL * abs(end))
    assert attempt.end.r[0] == pytest.approx(end, abs=1e-12)
    assert attempt.error == pytest.approx(expected / math.sqrt(made.atol.size), rel=1e-6, abs=1e-6)
