"""Rods that expand with heat: against equations written by hand, closed forms, and both laws."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ephs
from ephs.mechanics.elements.strain import displacement, stretching
from ephs.semantics.spaces import SE3
from tests.numerics import jacobian, largest
from tests.written import scene_of_text

ELEMENTS, LENGTH, MASS, EA, CAPACITY, CONDUCTION, EXPANSION = 4, 1.0, 0.1, 1000.0, 20.0, 0.5, 1e-3
WARM, REFERENCE = 320.0, 300.0
PULL = EA * EXPANSION
CELL = LENGTH / ELEMENTS
SHORT = 1e-5
"""Step of central differences, whose rounding is about 1e-11 and whose curvature 1e-10."""
ROD = """
format = 1
[world]
gravity = [0.0, 0.0, {gravity}]
temperature = 300.0
[beams.rod]
from = [0.0, 0.0, 0.0]
to = [1.0, 0.0, 0.0]
up = [0.0, 0.0, 1.0]
elements = 4
order = {order}
section = {{ EA = 1000.0, GA = [400.0, 400.0], GJ = {GJ}, EI = [{EI}, {EI}], rhoA = 0.1, rhoI = [1e-3, 1e-3, 1e-3] }}
ends = {ends}
damping = {damping}
rod = "{rod}"
thermal = {{ capacity = 20.0, conduction = 0.5, temperature = {warm}, expansion = 1e-3, reference = 300.0 }}
"""


def rod(**changed):
    given = {
        "gravity": 0.0, "order": 2, "GJ": 5.0, "EI": 6.0, "ends": '["ground"]', "damping": 0.0, "rod": "reissner",
        "warm": WARM,
    }  # fmt: skip
    return scene_of_text(ROD.format(**(given | changed)))


def axial(t, y):
    """Displacements and speeds of the nodes, temperatures of the elements of a rod that is held at its start."""
    u, v, theta = np.split(y, 3)
    mass = MASS * CELL * np.array([1.0] * (ELEMENTS - 1) + [0.5])
    strain = np.diff(u, prepend=0.0) / CELL
    force = EA * strain - PULL * (theta - REFERENCE)
    heat = -CONDUCTION / CELL * np.diff(theta)  # to the next
    warming = -PULL * theta * np.diff(v, prepend=0.0) + np.append(0.0, heat) - np.append(heat, 0.0)
    return np.concatenate([v, (np.append(force[1:], 0.0) - force) / mass, warming / (CAPACITY * CELL)])


@pytest.fixture(scope="module")
def by_hand():
    start = np.concatenate([np.zeros(2 * ELEMENTS), np.full(ELEMENTS, WARM)])
    return solve_ivp(axial, (0.0, 0.1), start, method="DOP853", rtol=1e-12, atol=1e-13, t_eval=[0.05, 0.1])


def swung(method, **options):
    """(8, 2) displacements in m and temperatures in K of a warm rod at two instants."""
    sol = ephs.simulate(rod(), 0.1, method=method, save_at=[0.0, 0.05, 0.1], **options)
    at = [sol.body(f"rod.{i + 1}").position[1:, 0] - CELL * (i + 1) for i in range(ELEMENTS)]
    return np.array([*at, *(sol.thermal(f"rod-{i + 1}").temperature[1:] for i in range(ELEMENTS))])


def gap(found, wanted):
    """Largest difference from what is wanted, relative to the swing and to the cooling."""
    u, _, theta = np.split(wanted, 3)
    off = np.abs(found - np.concatenate([u, theta]))
    return max(off[:ELEMENTS].max() / largest(u), off[ELEMENTS:].max() / largest(theta - WARM))


@pytest.mark.parametrize(("method", "near"), [("rk54", 1e-8), ("rk87", 1e-8), ("radau", 1e-7)])
def test_a_warm_rod_swings_as_the_equations_by_hand(method, near, by_hand):
    assert gap(swung(method, rtol=1e-10), by_hand.y) < near


@pytest.mark.parametrize(
    ("method", "step", "order"),
    [("natural", 2e-4, 2), ("variational", 5e-4, 2), ("natural4", 1e-3, 4)],
)
def test_constant_steps_have_their_order(method, step, order, by_hand):
    coarse, fine = (gap(swung(method, step=h), by_hand.y) for h in (step, 0.5 * step))
    assert fine < coarse < 0.5 and coarse / fine > 0.7 * 2.0**order


def test_modes_are_those_of_the_linear_equations():
    """Of waves that cool what they stretch, and of heat that conducts."""
    about = np.concatenate([np.zeros(2 * ELEMENTS), np.full(ELEMENTS, REFERENCE)])
    wanted = np.linalg.eigvals(jacobian(lambda v: axial(0.0, about + v), 12, 1e-4))
    found = np.linalg.eigvals(ephs.linearize(rod(warm=REFERENCE)).A)
    for value in wanted:
        assert np.abs(found - value).min() < 1e-6 * largest(wanted)
    swift = EA / CELL + PULL**2 * REFERENCE / (CAPACITY * CELL)  # no time to conduct
    fastest = 2.0 * np.sqrt(swift / (MASS * CELL)) * np.sin((2 * ELEMENTS - 1) * np.pi / (4 * ELEMENTS))
    assert largest(wanted.imag) == pytest.approx(fastest, rel=1e-3)


STEEL = """
format = 1
[beams.rod]
from = [0.0, 0.0, 0.0]
to = [1.0, 0.0, 0.0]
elements = 8
order = 4
section = { circle = 0.004, E = 2e11, nu = 0.3, rho = 7800.0 }
thermal = { capacity = 188.0, conduction = 2.3e-3, temperature = 313.15, expansion = 1.2e-5, reference = 293.15 }
ends = ["ground", "ground"]
"""


@pytest.mark.parametrize("method", ["rk54", "rk87", "radau"])
def test_what_is_equally_warm_all_along_loses_no_entropy(method):
    """Differences of its temperatures are near rounding, and so is the heat that they conduct."""
    sol = ephs.simulate(scene_of_text(STEEL), 5e-4, method=method)
    assert sol.stats["least_production"] >= -1e-30


@pytest.mark.parametrize(("method", "damping"), [("natural", "damping = 1e-4\n"), ("natural4", "")])
def test_a_warm_rod_between_walls_is_at_rest(method, damping):
    """The forces that hold it are large and its energies are not: what moves is rounding of the forces."""
    scene = scene_of_text(STEEL + damping + "[world]\ngravity = [0.0, 0.0, 0.0]\n")
    assert ephs.simulate(scene, 1e-2, method=method, step=1e-3).audit.passed
    swinging = ephs.simulate(rod(), 0.1, method=method, step=2e-2, audit="off")
    assert "accuracy" in [finding.law for finding in swinging.audit.findings], "the control: one end is free"


@pytest.mark.parametrize("order", [2, 4])
def test_a_rod_held_at_both_ends_presses_when_it_is_warm(order):
    scene = rod(ends='["ground", "ground"]', order=order)
    beam = ephs.simulate(scene, 0.01).beam("rod")
    np.testing.assert_allclose(beam.force[-1, :, 0], -PULL * (WARM - REFERENCE), rtol=1e-12)
    np.testing.assert_allclose(beam.energy, 0.0, atol=1e-20)


def test_a_free_rod_comes_to_rest_longer():
    rest = ephs.equilibrium(rod())
    tip = dict(rest.model.all_bodies())["rod.4"].pose
    assert tip[4] == pytest.approx(LENGTH * (1.0 + EXPANSION * (WARM - REFERENCE)), rel=1e-12)


def test_it_buckles_by_heat_at_four_pi_squared():
    """Clamped at both ends, at EA α Δθ = 4 π² EI/L², which the elements of order 4 have to a few per cent."""
    bend = 0.3
    critical = 4.0 * np.pi**2 * bend / LENGTH**2 / PULL

    def fastest(part):
        scene = rod(ends='["ground", "ground"]', order=4, EI=bend, warm=REFERENCE + part * critical)
        return np.linalg.eigvals(ephs.linearize(scene).A).real.max()

    assert fastest(0.9) < 1e-3 < fastest(1.1)


@pytest.mark.parametrize(
    ("method", "options"), [("rk87", {"rtol": 1e-8}), ("natural4", {"step": 2e-3}), ("radau", {"rtol": 1e-6})]
)
def test_both_laws_hold_where_it_bends_far(method, options):
    scene = rod(gravity=-9.81, damping=2e-3, EI=0.02, GJ=0.02)
    sol = ephs.simulate(scene, 0.3, method=method, **options)
    tip = sol.body("rod.4").position[-1]
    assert tip[2] < -0.2
    assert sol.energy_error.max() < 1e-11
    assert sol.stats["least_production"] >= -1e-18


def test_the_rate_of_lengthening_is_the_slope_of_the_strain():
    """At drawn poses, of elements that are curved and twisted without stress, along drawn twists."""
    source = np.random.default_rng(7)
    for _ in range(20):
        length, rest, pose, u = source.uniform(0.1, 2.0), *(0.5 * source.standard_normal((3, 6)))
        pose = SE3.exp(pose)

        def lengthened(t, pose=pose, u=u, length=length, rest=rest):
            return displacement(SE3.compose(pose, SE3.exp(t * u)), length, rest)[3]

        slope = (lengthened(SHORT) - lengthened(-SHORT)) / (2.0 * SHORT)
        assert np.dot(stretching(pose, length, rest), u) == pytest.approx(slope, abs=SHORT**1.5)


def test_explicit_and_implicit_steps_meet():
    """Where it bends far: the lengthening of an element depends on all of its pose."""
    scene = rod(gravity=-9.81, EI=0.02)
    ends = [
        ephs.simulate(scene, 0.15, method=method, rtol=1e-9).body("rod.4").position[-1] for method in ("rk87", "radau")
    ]
    np.testing.assert_allclose(*ends, atol=1e-7)
