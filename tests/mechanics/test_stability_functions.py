"""One step of each method on a linear equation is its stability function of h A, in closed form.

The equation is that of a disc on a torsion spring with friction, y' = A y with y = (angle from rest, rate).
"""

import math

import numpy as np
import pytest

import ephs
from ephs import Pattern, library
from ephs.mechanics.methods import radau as implicit
from ephs.mechanics.methods import tableaux
from ephs.mechanics.methods.registry import METHODS, Setting
from ephs.mechanics.methods.semi import ARRAYS, SCHEME
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.solve.methods.collocation import radau as coefficients
from tests.mechanics.embedded import embedded_radau
from tests.mechanics.plain import uncorrected
from tests.mechanics.torsion import torsion
from tests.methods import choosing
from tests.numerics import largest
from tests.oscillator import rubbed_oscillator
from tests.scenes import model_of
from tests.written import scene_of_text

J, K, D = 0.5, 3.0, 0.4
ANGLE, RATE = 0.3, -1.1
A = np.array([[0.0, 1.0], [-K / J, -D / J]])
Y = np.array([ANGLE, RATE])
SCENE = torsion(J, K, RATE, rest=-ANGLE, friction=D)


def rational(top, bottom, z):
    """A rational function of a matrix, by the coefficients of its numerator and denominator."""
    over, under = (sum(c * np.linalg.matrix_power(z, k) for k, c in enumerate(cs)) for cs in (top, bottom))
    return np.linalg.solve(under, over)


def pade(top, bottom):
    """The rational function of these degrees next to the exponential one."""

    def coefficients(own, other, sign):
        whole = math.factorial(own + other)
        return [sign**j * math.factorial(own + other - j) * math.comb(own, j) / whole for j in range(own + 1)]

    return lambda z: rational(coefficients(top, bottom, 1), coefficients(bottom, top, -1), z)


def diagonal(stages):
    """Padé (s, s): s Gauss stages, of which one is the midpoint rule."""
    return pade(stages, stages)


def explicit(a, b):
    """1 + Σ z^(k+1) bᵀ Aᵏ 1."""
    n = len(b)
    matrix = np.array([[0.0] * n, *([*row, *[0.0] * (n - len(row))] for row in a)])
    weights = [float(np.array(b) @ np.linalg.matrix_power(matrix, k) @ np.ones(n)) for k in range(n)]
    return lambda z: rational([1.0, *weights], [1.0], z)


def semi(z):
    """Stages of SSP3(4,3,3) as one linear system: rates of the implicit stages move and lose, explicit angles pull."""
    pulled = np.array([[0.0, 0.0], [z[1, 0], 0.0]])
    explicit, implicit = ARRAYS["a"][1:5, 1:], SCHEME[1:, 1:]
    stages = np.eye(8) - np.kron(explicit, pulled) - np.kron(implicit, z - pulled)
    return np.eye(2) + np.kron(ARRAYS["a"][5, 1:], np.eye(2)) @ np.linalg.solve(stages, np.kron(np.ones((4, 1)), z))


FUNCTIONS = {
    "natural": diagonal(1),
    "natural4": diagonal(3),
    "radau": pade(2, 3),
    "rk54": explicit(tableaux.A5, tableaux.B5),
    "rk87": explicit(tableaux.A8, tableaux.B8),
    "semi": semi,
}


@pytest.fixture(scope="module")
def scene():
    return scene_of_text(SCENE)


def states(scene, method, h, steps, **more):
    with uncorrected():
        sol = ephs.simulate(scene, steps * h, method=method, step=h, audit="off", **more)  # any step
    axle = sol.joint("axle")
    return np.column_stack([np.ravel(axle.coordinate) + ANGLE, np.ravel(axle.rate)])


@pytest.mark.parametrize("h", [0.05, 0.3])
@pytest.mark.parametrize("method", FUNCTIONS)
def test_a_step_is_the_stability_function(scene, method, h):
    found = states(scene, method, h, 2)
    step = FUNCTIONS[method](h * A)
    for i, expected in enumerate((Y, step @ Y, step @ step @ Y)):
        assert largest(found[i] - expected) <= 1e-11


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("stages", [3, 5, 7])
def test_steps_of_radau_are_the_stability_function_of_their_number_of_stages(scene, stages, compiled, monkeypatch):
    """Padé (s − 1, s), in compiled steps and in those taken one by one; −s/z is left of what is fast."""
    monkeypatch.setattr(implicit, "scheme_of", lambda *_: coefficients(stages))
    if not compiled:
        monkeypatch.setattr(implicit.Implicit, "many", lambda *_: None)
    for h in (0.3, 2.0):
        found, step = states(scene, "radau", h, 2), pade(stages - 1, stages)(h * A)
        assert largest(found - [Y, step @ Y, step @ step @ Y]) <= 1e-11
    assert largest(found[1] - pade(stages - 2, stages - 1)(h * A) @ Y) >= 1e-6  # one stage less shows
    fast = states(scene, "radau", 1e4, 1)[1]
    assert largest(fast + stages * np.linalg.solve(1e4 * A, Y)) <= 0.01 * largest(fast)


def test_the_variational_method_is_the_midpoint_rule_with_friction_in_the_middle(scene):
    assert largest(states(scene, "variational", 0.1, 1)[1] - diagonal(1)(0.1 * A) @ Y) <= 1e-12


def test_every_method_of_scenes_with_constant_steps_has_its_test():
    of_scenes = {name for name, m in METHODS.items() if m.scenes and m.fixed}
    assert of_scenes == {*FUNCTIONS, "variational"}


# ---- systems without bodies -------------------------------------------------------------------------------------

MASS, SPRING, DRAG = 2.0, 3.0, 0.4
SYSTEM = rubbed_oscillator(SPRING, MASS, DRAG)
LINKED = Pattern.from_text(
    "q: displacement; p: momentum; p2: momentum; pe(q); ke(p); ke2(p=p2); pkc(q, p); link(p, p2)"
)(
    pe=library.spring(k=SPRING), ke=library.point_mass(m=MASS), ke2=library.point_mass(m=MASS),
    pkc=library.pkc(), link=library.rigid_link(),
)  # fmt: skip
START = {"pe.q": 0.3, "ke.p": -1.1}


@pytest.mark.parametrize("method", [name for name, m in METHODS.items() if m.systems])
@pytest.mark.parametrize(
    ("system", "more", "matrix"),
    [
        (SYSTEM, {}, [[0.0, 1.0 / MASS], [-SPRING, -DRAG / MASS]]),
        (LINKED, {"ke2.p": -1.1}, [[0.0, 1.0 / MASS], [-0.5 * SPRING, 0.0]]),
    ],
    ids=["friction", "constraint"],
)
def test_systems_take_the_same_steps(method, system, more, matrix):
    h, steps = 0.1, 3
    sol = ephs.simulate(system, steps * h, initial=START | more, method=method, step=h)
    one = FUNCTIONS[method](h * np.array(matrix))
    expected = [np.linalg.matrix_power(one, i) @ list(START.values()) for i in range(steps + 1)]
    found = np.column_stack([np.ravel(sol[path]) for path in START])
    assert largest(found - expected) <= (1e-9 if method == "radau" else 1e-12)
    for path, value in more.items():
        assert value == START["ke.p"]
        assert largest(np.ravel(sol[path]) - found[:, 1]) <= 1e-12
    # Newton's method has the exact matrix of what is linear; the heat is not
    assert sol.stats["iterations"] <= (3 if method == "radau" else 2) * steps + 2
    if method != "radau":  # no step was cut, and the order of elimination was decided at the start
        assert sol.stats["cut_steps"] == 0 and sol.stats["orders"] >= 1
    energy = 0.5 * SPRING * found[:, 0] ** 2 + 0.5 * (1 + len(more)) * found[:, 1] ** 2 / MASS
    assert largest(sol.energy - sol.energy[0]) <= (1e-7 if method == "radau" else 1e-11) * energy[0]
    made = (energy[0] - energy) / 293.15 if not more else 0.0 * energy
    tolerance = 1e-12 if method == "natural" else 1e-7
    assert largest(sol.entropy - sol.entropy[0] - made) <= tolerance


def test_methods_have_the_orders_that_are_said_of_them():
    problem = problem_of_system(SYSTEM, START)
    model = model_of(problem)
    for name in ("natural", "natural4"):
        assert METHODS[name].undamped(model).order == METHODS[name].order


def test_the_estimate_of_radau_falls_with_the_power_that_it_says():
    for rtol, h, power in ((1e-2, 0.05, 4.0), (1e-9, 0.4, 8.0), (1e-6, 0.1, 6.0)):
        control = choosing(rtol)
        method, _ = METHODS["radau"].make(Setting(problem_of_system(SYSTEM, START), 0.0, control, {}))
        start = method.start(0.0, h)
        one, two = (method.step(start, part * h) for part in (1.0, 0.5))
        assert round(np.log2(one.error / two.error)) == method.exponent == power
    # dense output is the polynomial through the stages, and the step itself at its ends; no store of heat: y are states
    for attempt in (one, two):
        assert largest(method.inside(attempt, attempt.h).y - attempt.end.y) <= 1e-14
        assert largest(method.inside(attempt, 0.0).y - start.y) <= 1e-14
    inside = method.inside(one, 0.05)
    assert inside.t == 0.05 and largest(inside.y - two.end.y) <= 1e-6
    assert largest(inside.z - two.end.z) <= 1e-4
    row = method.row(one.end)  # what is made by friction, and the energies of storages, each at its place
    names = [str(slot.path) for slot in method.model.descriptor.components]
    energies = dict(zip(names, row.energies, strict=True))
    end = method.problem.descriptor.unpack(one.end.y)
    at = {str(path): float(value[0]) for path, value in end.items()}
    assert energies["pe"] == pytest.approx(0.5 * SPRING * at["pe.q"] ** 2, rel=1e-12)
    assert energies["ke"] == pytest.approx(0.5 * at["ke.p"] ** 2 / MASS, rel=1e-12)
    assert energies["mf"] == pytest.approx(row.sums[3], rel=1e-12) and energies["mf"] > 0.0


@pytest.mark.parametrize(("rtol", "count"), [(1e-2, 3), (1e-6, 5), (1e-9, 7)])
@pytest.mark.parametrize("h", [0.2, 0.5])
def test_the_estimate_of_radau_is_the_filtered_defect_of_the_embedded_method(h, rtol, count):
    control = choosing(rtol)
    problem = problem_of_system(LINKED, START | {"ke2.p": -1.1})
    method, _ = METHODS["radau"].make(Setting(problem, 0.0, control, {}))
    assert not any(method.counts.values())
    attempt = method.step(method.start(0.0, h), h)
    matrix, y = np.array([[0.0, 1.0 / MASS], [-0.5 * SPRING, 0.0]]), np.array(list(START.values()))
    found, end = embedded_radau(count, matrix, y, h)
    expected = np.abs(found) / (rtol + rtol * np.maximum(np.abs(y), np.abs(end)))
    assert attempt.error == pytest.approx(expected.max(), rel=1e-4, abs=1e-7)
