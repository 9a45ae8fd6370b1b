"""Beams: the laws of the element, and rods by every method against closed forms."""

import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.elements.beam import beam_damper, beam_element, beam_spring
from ephs.mechanics.elements.strain import displacement, logarithm, mean_stress, strain_resistance
from ephs.operad import Path
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.spaces import SE3
from ephs.testing import check_primitive
from tests.mechanics.momenta import momenta
from tests.methods import OF_SCENES
from tests.numerics import EPS, generators, largest, seeds, slope
from tests.written import scene_of_text

STIFFNESS = np.array([500.0, 400.0, 600.0, 1e4, 8e3, 9e3])
REST = np.array([0.1, 0.0, 0.2, 1.0, 0.0, 0.1])
Q_R = Path.of("q_r")

# what is sent: the flying rod of Simo and Vu-Quoc in three dimensions
SECTION = "{ EA = 1e4, GA = [1e4, 1e4], GJ = 500.0, EI = [500.0, 500.0], rhoA = 1.0, rhoI = [20.0, 10.0, 10.0] }"
ROD = """format = 1
name = "rod"
[world]
gravity = [0.0, 0.0, 0.0]
[beams.rod]
from = [0.0, 0.0, 0.0]
to = [6.0, 8.0, 0.0]
elements = 4
section = {section}
{more}
"""


def rod(more=""):
    return scene_of_text(ROD.format(section=SECTION, more=more))


def pose(rng, size):
    return SE3.exp(size * rng.standard_normal(6))


# ---- the element ----------------------------------------------------------------------------------------------------


@given(generators, st.floats(1e-9, 1.2))
def test_the_recorded_logarithm_is_that_of_the_group(rng, size):
    q = pose(rng, size)
    found = np.array(logarithm(q))
    assert largest(found - SE3.log(q)) <= 64 * EPS * max(1.0, largest(found))
    other = np.concatenate([-q[:4], q[4:]])
    assert np.array_equal(np.array(logarithm(other)), found)


@pytest.mark.parametrize("rest", [REST, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])])
@settings(max_examples=12)
@example(4059489547, 0.9059938836513397)  # turned by 3.04
@example(3580702043, 0.9513732140954049)  # by 3.11 and, with the curved rest, 3.12
@given(seeds, st.floats(1e-12, 1.0))
def test_the_strain_is_a_difference_of_logarithms_without_their_rounding(rest, seed, size):
    """Against 40 digits: near rest it is right relative to itself where the reference curve is straight."""
    q, length = pose(np.random.default_rng(seed), size), 1.3
    found = np.array(displacement(q, length, rest))
    with mpmath.workdps(40):
        expected = np.array([float(x) for x in exact_displacement(q, length * rest)])
    size = largest(found) if not rest[:3].any() else 1.0
    assert largest(found - expected) <= 256 * EPS * size


def exact_displacement(q, base):
    """log(exp(a) q) − a by power series of 4 × 4 matrices, and by the angle of the turn, which may be near π."""

    def screw(a):
        w, v = a[:3], a[3:]
        rows = [[0, -w[2], w[1], v[0]], [w[2], 0, -w[0], v[1]], [-w[1], w[0], 0, v[2]], [0, 0, 0, 0]]
        return mpmath.matrix(rows)

    w, x, y, z = (mpmath.mpf(float(entry)) for entry in q[:4])
    norm = mpmath.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    turn = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    place = mpmath.matrix([[*turn[i], mpmath.mpf(float(q[4 + i]))] for i in range(3)] + [[0, 0, 0, 1]])
    start = [mpmath.mpf(float(entry)) for entry in base]
    whole = mpmath.expm(screw(start)) * place
    sine = [(whole[i, j] - whole[j, i]) / 2 for i, j in ((2, 1), (0, 2), (1, 0))]
    size = mpmath.sqrt(sum(entry * entry for entry in sine))
    angle = mpmath.atan2(size, (whole[0, 0] + whole[1, 1] + whole[2, 2] - 1) / 2)
    turned = [angle / size * entry for entry in sine]
    units = ([1, 0, 0], [0, 1, 0], [0, 0, 1])
    moves = [mpmath.expm(screw([*turned, *unit]))[:3, 3] for unit in units]  # exp is linear in translations
    moved = mpmath.lu_solve(mpmath.matrix([[move[i] for move in moves] for i in range(3)]), whole[:3, 3])
    return [a - b for a, b in zip([*turned, *moved], start, strict=True)]


@pytest.mark.parametrize("order", [2, 4])
@given(generators, st.floats(1e-6, 0.5))
def test_a_step_changes_the_energy_by_what_its_effort_does(order, rng, size):
    spring, q, v = beam_spring(1.3, STIFFNESS, REST, order), pose(rng, 0.4), size * rng.standard_normal(6) / 3.0
    before, after = (spring.energy({Q_R: x}) for x in (q, SE3.retract(q, v)))
    work = spring.discrete_gradient({Q_R: q}, v) @ v
    assert abs(work - (after - before)) <= 256 * EPS * (before + after + STIFFNESS.max())


def test_energy_and_damping_are_what_their_ports_ask_for():
    """The search strains elements ten thousand times their length, where the compliance of order 4 has no digits."""
    check_primitive(beam_spring(1.3, STIFFNESS, REST), max_examples=20)
    check_primitive(beam_damper(1.3, STIFFNESS, REST, 0.02), max_examples=20)


@given(generators, st.floats(1e-6, 1.0))
def test_damping_of_order_4_is_definite_at_strains_that_elements_have(rng, size):
    found = np.array(strain_resistance(pose(rng, size), 1.3, STIFFNESS, REST, 0.02, 4))
    assert largest(found - found.T) <= 8 * EPS * largest(found)
    values = np.linalg.eigvalsh(found)
    assert values[0] >= -64 * EPS * values[-1]


def compliance(d):
    """K⁻¹ + ad_d K⁻¹ ad_dᵀ/12 with the brackets of 4 × 4 matrices."""

    def screw(a):
        x, y, z = a[:3]
        return np.array([[0.0, -z, y, a[3]], [z, 0.0, -x, a[4]], [-y, x, 0.0, a[5]], [0.0, 0.0, 0.0, 0.0]])

    brackets = [screw(d) @ screw(unit) - screw(unit) @ screw(d) for unit in np.eye(6)]
    ad = np.array([[b[2, 1], b[0, 2], b[1, 0], b[0, 3], b[1, 3], b[2, 3]] for b in brackets]).T
    return np.diag(1.0 / STIFFNESS) + ad @ np.diag(1.0 / STIFFNESS) @ ad.T / 12.0


@given(generators)
def test_stress_and_energy_at_order_4_have_the_compliance_of_a_stress_in_balance(rng):
    length, q = 1.3, pose(rng, 0.4)
    d = SE3.log(SE3.compose(SE3.exp(length * REST), q))
    change = d - length * REST
    stress = np.linalg.solve(compliance(d), change / length)
    scale = 64 * EPS * np.linalg.cond(compliance(d))
    assert largest(np.array(mean_stress(q, length, STIFFNESS, REST, 4)) - stress) <= scale * largest(stress)
    energy = beam_spring(length, STIFFNESS, REST, 4).energy({Q_R: q})
    assert energy == pytest.approx(0.5 * change @ stress, rel=scale)
    assert energy <= beam_spring(length, STIFFNESS, REST, 2).energy({Q_R: q}) * (1.0 + scale)


@pytest.mark.parametrize("order", [2, 4])
def test_only_order_4_has_the_stiffness_of_a_timoshenko_beam(order):
    """Ends kept parallel and sheared by δ: the force is δ/(L/GA + L³/12 EI)."""
    length, shift, straight = 1.3, 1e-6, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    _, about2, about3, _, along2, along3 = STIFFNESS
    for axis, bending, shear in ((5, about3, along2), (6, about2, along3)):
        q = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        q[axis] = shift
        exact = shift / (length / shear + length**3 / (12.0 * bending))
        found = mean_stress(q, length, STIFFNESS, straight, order)[axis - 1]
        assert (abs(found / exact - 1.0) <= 1e-9) == (order == 4)


@pytest.mark.parametrize("order", [2, 4])
@given(generators)
def test_damping_resists_the_rate_of_the_strain(order, rng):
    """⟨u|μ u⟩ = L ξ̇ᵀ τ K ξ̇, the rate of the strain by differences of a logarithm of another code; C⁻¹ at order 4."""
    tau, length, h = 0.02, 1.3, 1e-5
    damper, q, u = beam_damper(length, STIFFNESS, REST, tau, order), pose(rng, 0.4), rng.standard_normal(6)
    d = SE3.compose(SE3.exp(length * REST), q)
    rate = slope(lambda t: SE3.log(SE3.retract(d, t * u)), h) / length
    reference = ephs.Reference()
    flow = damper.flow({Q_R: q}, np.append(u, 0.0), reference)
    stiffness = np.diag(STIFFNESS) if order == 2 else np.linalg.inv(compliance(SE3.log(d)))
    expected = length * tau * float(rate @ stiffness @ rate)
    assert u @ flow[:6] == pytest.approx(expected, rel=1e-8)
    assert -flow[6] * reference.temperature == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({"length": 0.0}, "length"),
        ({"stiffness": -STIFFNESS}, "stiffness"),
        ({"damping": -1.0}, "damping"),
        ({"order": 3}, "order"),
    ],
)
def test_elements_of_impossible_numbers_are_refused(changed, key):
    with pytest.raises(StructureError, match=key):
        beam_element(**({"length": 1.0, "stiffness": STIFFNESS, "damping": 0.1} | changed))


def test_an_element_joins_two_bodies_by_hand():
    """Two equal bodies oscillate along the element with ω² = 2 EA/(L m)."""
    pattern = ephs.Pattern.from_text("p1: body_momentum; p2: body_momentum; one(p=p1); two(p=p2); rod(p1, p2)")
    body = ephs.mechanics.rigid_body(2.0, [0.1, 0.1, 0.1], (0.0, 0.0, 0.0))
    system = pattern(one=body, two=body, rod=beam_element(length=0.5, stiffness=STIFFNESS))
    turn, stretch = np.sqrt(2.0 * STIFFNESS[3] / (0.5 * 2.0)), 1e-3
    start = {"two.pe.q": [1.0, 0.0, 0.0, 0.0, 0.5 + stretch, 0.0, 0.0]}
    sol = ephs.simulate(system, np.pi / turn, initial=start, method="natural", step=np.pi / turn / 64)
    assert sol["two.pe.q"][-1, 4] - sol["one.pe.q"][-1, 4] == pytest.approx(0.5 - stretch, abs=stretch * 2e-3)
    assert sol.summary()["max_energy_error"] <= 1e-11


# ---- scenes ----------------------------------------------------------------------------------------------------------


def test_a_beam_through_points_of_a_circle_is_the_circle():
    radius, at = 3.0, np.linspace(0.0, 0.5 * np.pi, 3)
    points = [[radius * float(np.sin(a)), radius * float(1.0 - np.cos(a)), 0.0] for a in at]
    text = ROD.format(section=SECTION, more="").replace("from = [0.0, 0.0, 0.0]\nto = [6.0, 8.0, 0.0]", f"{points = }")
    scene = scene_of_text(text)
    assert "beam rod: 4 elements" in str(scene)
    for i, angle in enumerate(np.linspace(0.0, 0.5 * np.pi, 5)):
        expected = [radius * np.sin(angle), radius * (1.0 - np.cos(angle)), 0.0]
        assert largest(scene.body(f"rod.{i}").pose[4:] - expected) <= 64 * EPS * radius
    for i in range(1, 5):
        strain = scene.joint(f"rod-{i}").strain
        assert strain.length == pytest.approx(0.125 * np.pi * radius, rel=64 * EPS)
        assert largest(np.abs(strain.rest) - [0.0, 1.0 / radius, 0.0, 1.0, 0.0, 0.0]) <= 64 * EPS
    assert sum(body.mass for _, body in scene.all_bodies()) == pytest.approx(0.5 * np.pi * radius, rel=64 * EPS)


@pytest.mark.parametrize("elements", [1, 2, 3, 4, 7])
@pytest.mark.parametrize("order", [2, 4])
def test_nodes_at_order_4_have_the_inertia_of_the_rod(order, elements):
    """Mass, centre of mass and moment of inertia about it; at order 2 the last is wrong by the square of a length."""
    more = f"order = {order}"
    text = ROD.format(section=SECTION, more=more).replace("elements = 4", f"elements = {elements}")
    nodes = [body for _, body in scene_of_text(text).all_bodies()]
    mass, x = np.array([b.mass for b in nodes]), np.array([np.linalg.norm(b.pose[4:]) for b in nodes])
    moments = [mass.sum() / 10.0, mass @ x / 50.0, (mass @ (x - 5.0) ** 2 * 12.0) / 1000.0]
    right = np.abs(np.array(moments) - 1.0) <= 16 * EPS
    assert mass.min() > 0.0 and right.tolist() == [True, True, order == 4 and elements > 1]


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        # of Timoshenko and Goodier's table: J = 0.1406 a⁴ of a square, 0.229 a b³ where a = 2 b
        ("rectangle = [2.0, 2.0]", [0.1406 * 16.0, 16.0 / 12.0, 16.0 / 12.0, 4.0]),
        ("rectangle = [1.0, 2.0]", [0.229 * 2.0, 2.0 / 12.0, 8.0 / 12.0, 2.0]),
        ("circle = 2.0", [8.0 * np.pi, 4.0 * np.pi, 4.0 * np.pi, 4.0 * np.pi]),
        ("tube = [2.0, 1.0]", [7.5 * np.pi, 3.75 * np.pi, 3.75 * np.pi, 3.0 * np.pi]),
    ],
)
def test_sections_of_shapes_have_their_moments(shape, expected):
    section = f"{{ {shape}, E = 1.0, nu = 0.0, rho = 1.0 }}"
    found = scene_of_text(ROD.format(section=section, more="")).joint("rod-1").strain.stiffness
    assert found[:4] * [2.0, 1.0, 1.0, 1.0] == pytest.approx(expected, rel=2e-3)


# ---- motion ----------------------------------------------------------------------------------------------------------


STRUCK = "angular_velocity = [0.0, 2.0, 3.0]\nstrain = [0.1, 0.05, 0.0, 0.02, 0.0, 0.01]\nvelocity = [1.0, 2.0, 3.0]\n"


CONSTANT = ("natural", "natural4", "variational")


def flight_is_lawful(scene, until, name, step, columns=slice(None)):
    """The solution of a free flight; it keeps to rounding what the method keeps, else by its accuracy."""
    steps = {"step": step} if name in CONSTANT else {"rtol": 1e-7, "atol": 1e-9}
    sol = ephs.simulate(scene, until, method=name, audit="off", **steps)
    kept = momenta(scene, sol)[:, columns]
    drift = largest(kept - kept[0]) / largest(kept)
    lost = float(np.ptp(sol.energy) / largest(sol.energy))
    assert drift <= (1e-12 if name == "variational" else 1e-2 if name in CONSTANT else 1e-5)
    assert lost <= (1e-11 if name.startswith("natural") else 1e-2 if name in CONSTANT else 1e-5)
    return sol


@pytest.mark.parametrize("name", OF_SCENES)
def test_a_flying_rod_keeps_what_its_method_keeps(name):
    flight_is_lawful(rod(STRUCK), 0.5, name, 2.0**-6)


@pytest.mark.parametrize("order", [2, 4])
def test_damping_turns_into_heat_what_the_motion_loses(order):
    heat = 'damping = 0.02\nheat = "core"\n[thermal.core]\ncapacity = 10.0\ntemperature = 300.0\n'
    sol = ephs.simulate(rod(STRUCK + f"order = {order}\n" + heat), 0.5, method="natural", step=2.0**-6)
    summary = sol.summary()
    assert summary["heat"] > 1.0
    assert summary["max_energy_error"] <= 1e-12 and summary["min_entropy_production"] >= 0.0
    assert summary["thermal"]["core"]["temperature"] == pytest.approx(300.0 + summary["heat"] / 10.0, rel=1e-12)


def test_a_beam_tells_its_strain_and_its_support_what_it_holds():
    """A cantilever at rest under a load on its end: in every section the load, and its moment about it."""
    load = 'ends = ["ground"]\n[loads.tip]\nbody = "rod.4"\nforce = [0.0, 0.0, 2.0]\n'
    text = ROD.format(section=SECTION, more=load).replace("[6.0, 8.0, 0.0]", "[10.0, 0.0, 0.0]")
    rest = ephs.equilibrium(scene_of_text(text)).model
    sol = ephs.simulate(rest, 2.0**-6, method="natural", step=2.0**-7)
    rod, wrench = sol.beam("rod"), sol.joint("rod-start").wrench[-1]
    tip = rod.position[-1, -1]
    assert rod.position.shape == (3, 5, 3) and rod.strain.shape == (3, 4, 6)
    assert np.linalg.norm(rod.force[-1], axis=1) == pytest.approx(2.0, rel=0.02)
    # axes of the root: x, z, −y; the middle of an element holds the mean of its ends' moments
    assert largest(wrench - [0.0, 0.0, -2.0 * tip[0], 0.0, -2.0, 0.0]) <= 1e-6
    middle = 2.0 * (tip[0] - 0.5 * (rod.position[-1, 1:, 0] + rod.position[-1, :-1, 0]))
    assert np.abs(rod.moment[-1][:, 2]) == pytest.approx(middle, rel=1e-3)
    with pytest.raises(KeyError, match="the beams are rod"):
        sol.beam("rode")
