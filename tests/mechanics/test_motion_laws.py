"""Motions that are prescribed as functions of time: laws, closed forms by every method, loops, what is refused."""

import json
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import ephs
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from ephs.mechanics.scene.parameters import varied
from ephs.mechanics.tree.finding.parts import determined_by
from tests.numerics import largest
from tests.scenes import ROOT
from tests.written import scene_of_text

GRAVITY, DAMPING = 9.81, 0.05
CART = """
format = 1
[assembly]
adjust = true
[bodies.cart]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
[bodies.bob]
mass = 1.0
inertia = [1e-9, 1e-9, 1e-9]
position = [0.0, 0.0, -1.0]
[joints.rail]
type = "prismatic"
bodies = ["ground", "cart"]
at = [0.0, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
motion = {motion}
[joints.pivot]
type = "revolute"
bodies = ["cart", "bob"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
friction = 0.05
"""
HARMONIC = ephs.HarmonicMotion(0.1, 0.8, 0.3)
FORMS = {
    "{ rate = 0.3 }": ephs.PolynomialMotion((0.3,)),
    "{ polynomial = [0.2, -0.3, 0.5] }": ephs.PolynomialMotion((0.2, -0.3, 0.5)),
    "{ amplitude = 0.1, frequency = 0.8, phase = 0.3 }": HARMONIC,
    "{ times = [0.0, 0.4, 1.0], displacements = [0.0, 0.3, 0.1] }": ephs.TabulatedMotion(
        (0.0, 0.4, 1.0), (0.0, 0.3, 0.1)
    ),
}


number = st.floats(-3.0, 3.0)
times = st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=5, unique=True).map(sorted)


@pytest.mark.parametrize("form", FORMS)
def test_a_rate_beside_a_motion_is_the_motion_s_to_the_digits_of_files(form):
    rate = FORMS[form].rate(0.0)

    def text(given):
        return CART.replace("motion = {motion}", f"motion = {form}\nrate = {given}")

    for written in (rate, float(np.nextafter(rate, 9.0)) if rate else 0.0, float(f"{rate:.9g}")):
        assert scene_of_text(text(written)).joint("rail").rate[0] == pytest.approx(rate, rel=1e-8, abs=0.0)
    with pytest.raises(ephs.SceneError, match="the prescribed initial rate"):
        scene_of_text(text(rate + 1e-6))


@st.composite
def laws(draw):
    """Motion laws of each form."""
    kind = draw(st.sampled_from(["polynomial", "harmonic", "table"]))
    if kind == "polynomial":
        return ephs.PolynomialMotion(tuple(draw(st.lists(number, min_size=1, max_size=5))))
    if kind == "harmonic":
        return ephs.HarmonicMotion(draw(number), draw(st.floats(0.0, 2.0)), draw(number))
    at = tuple(draw(times))
    assume(min(np.diff(at)) > 0.05)
    return ephs.TabulatedMotion(at, tuple(draw(st.lists(number, min_size=len(at), max_size=len(at)))))


def integral(function, law, start, end):
    """Gauss's quadrature, exact in each piece of a spline."""
    knots = np.clip([start, *getattr(law, "times", ()), end], start, end)
    nodes, weights = np.polynomial.legendre.leggauss(40)  # for four turns of a harmonic
    pieces = pairwise(knots)
    return sum(0.5 * (b - a) * w * function(0.5 * (a + b) + 0.5 * (b - a) * x) for a, b in pieces
               for x, w in zip(nodes, weights, strict=True))  # fmt: skip


def size(function, start, end):
    return 1.0 + max(abs(function(t)) for t in np.linspace(start, end, 60))


class Slow:
    """A law whose rate is none of its displacement."""

    displacement = staticmethod(lambda t: t + 2.0 * t**2)
    rate = staticmethod(lambda t: 0.9 + 3.6 * t)
    acceleration = staticmethod(lambda t: 3.6)


def off(law, start, end):
    """How far displacement, rate and acceleration are from being integrals of each other, relative to their size."""
    found = []
    for whole, part in ((law.displacement, law.rate), (law.rate, law.acceleration)):
        wanted = whole(end) - whole(start)
        found.append(abs(integral(part, law, start, end) - wanted) / (size(whole, start, end) + size(part, start, end)))
    return max(found)


@given(laws(), st.floats(-2.0, 0.0), st.floats(0.1, 2.0))
def test_rates_and_accelerations_integrate(law, start, length):
    assert off(law, start, start + length) < 1e-11


@given(laws(), st.floats(0.1, 10.0), st.floats(0.1, 10.0), st.floats(-2.0, 2.0))
def test_other_units_are_the_same_law(law, length, time, t):
    other = law.rescaled(length, time)
    for k, name in enumerate(("displacement", "rate", "acceleration")):
        wanted = getattr(law, name)(t) * length / time**k
        scale = size(getattr(law, name), -2.0, 2.0) * length / time**k
        assert getattr(other, name)(t * time) == pytest.approx(wanted, abs=1e-9 * scale)


@cache
def cart(law, end):
    """Angle and rate of a pendulum whose pivot moves along a law, by SciPy."""
    start = [0.0, law.rate(0.0)]  # the bob is at rest

    def slopes(t, y):
        return [y[1], law.acceleration(t) * np.cos(y[0]) - GRAVITY * np.sin(y[0]) - DAMPING * y[1]]

    jumps = [t for t in getattr(law, "times", ()) if 0.0 < t < end]
    state = start
    for a, b in zip([0.0, *jumps], [*jumps, end], strict=True):
        state = solve_ivp(slopes, (a, b), state, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    return state


@pytest.mark.parametrize(
    ("method", "form"),
    [(name, form) for name in METHODS for form in FORMS if name in ("rk87", "natural") or "times" in form],
)
def test_pendulum_on_a_led_cart_by_every_method(method, form):
    scene, law, end = scene_of_text(CART.replace("{motion}", form)), FORMS[form], 1.2
    own = METHODS[method]
    fixed = {"natural": 2e-3, "natural4": 1e-2, "variational": 2e-3}
    tolerance = 1e-6 if own.order < 4 else 1e-8
    options = {"step": fixed[method]} if method in fixed else {"rtol": tolerance, "atol": 0.01 * tolerance}
    sol = ephs.simulate(scene, end, method=method, **options)
    angle, rate = cart(law, end)
    allowed = 2e-5 if own.order < 4 else 1e-6
    assert sol.joint("pivot").coordinate[-1, 0] == pytest.approx(angle, abs=allowed)
    assert sol.joint("pivot").rate[-1, 0] == pytest.approx(rate, abs=10.0 * allowed)
    rail, moved = sol.joint("rail"), [law.displacement(t) - law.displacement(0.0) for t in sol.t]
    exact = allowed if method in ("natural", "natural4") else 1e-14  # theirs takes rates at nodes
    np.testing.assert_allclose(rail.coordinate[:, 0], moved, atol=exact)
    np.testing.assert_allclose(rail.rate[:, 0], [law.rate(t) for t in sol.t], atol=1e-10)


def test_force_of_a_led_body_is_its_mass_times_acceleration():
    scene = scene_of_text(CART.replace("{motion}", "{ amplitude = 0.1, frequency = 0.8, phase = 0.3 }"))
    alone = ephs.simulate(scene, 1.0, method="rk87", rtol=1e-9)
    joint, pendulum = alone.joint("rail"), alone.joint("pivot")
    angle, spin = pendulum.coordinate[:, 0], pendulum.rate[:, 0]
    pushed = np.array([HARMONIC.acceleration(t) for t in alone.t])
    turned = pushed * np.cos(angle) - GRAVITY * np.sin(angle) - DAMPING * spin
    bob = pushed - turned * np.cos(angle) + spin**2 * np.sin(angle)
    force = joint.wrench[:, 5]
    np.testing.assert_allclose(force, pushed + bob, atol=1e-7)


@pytest.fixture(scope="module")
def crank():
    """A slider-crank that is turned from rest to rest."""
    text = (ROOT / "scenes/slider-crank.toml").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("drive")]
    text = "\n".join("velocity = [0.0, 0.0, 0.0]" if line.startswith("velocity") else line for line in lines)
    text = "\n".join(
        "angular_velocity = [0.0, 0.0, 0.0]" if line.startswith("angular_velocity") else line
        for line in text.splitlines()
    )
    motion = "motion = { times = [0.0, 0.2, 0.5], displacements = [0.0, 1.0, 4.0] }"
    return scene_of_text(text.replace("[joints.bearing]", "[joints.bearing]\n" + motion))


TOWED = """
format = 1
[world]
gravity = [0.0, 0.0, 0.0]
[bodies.cart]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
[bodies.trailer]
mass = 2.0
inertia = [0.1, 0.1, 0.1]
[joints.rail]
type = "prismatic"
bodies = ["ground", "cart"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
motion = {motion}
[joints.tow]
type = "prismatic"
bodies = ["cart", "trailer"]
frame1 = { position = [0.0, 0.0, 0.0] }
frame2 = { position = [0.0, 0.0, 0.0] }
stiffness = 5.0
"""
TABLE = ephs.TabulatedMotion((0.2, 0.5, 0.8, 1.1), (0.1, 0.3, 0.2, 0.5))
FROM_REST = {
    "{ times = [0.2, 0.5, 0.8, 1.1], displacements = [0.1, 0.3, 0.2, 0.5] }": TABLE,
    f"{{ amplitude = 0.3, frequency = 0.7, phase = {0.5 * np.pi!r} }}": ephs.HarmonicMotion(0.3, 0.7, 0.5 * np.pi),
    "{ polynomial = [0.0, 0.0, 0.0, 1.0] }": ephs.PolynomialMotion((0.0, 0.0, 0.0, 1.0)),
}


@cache
def towed(law):
    """Displacement, its rate and the work on the cart after 1.5 s, by SciPy."""
    state = [0.0, 0.0, 0.0]

    def rates(t, y):
        return [y[1], -2.5 * y[0] - law.acceleration(t), law.rate(t) * (law.acceleration(t) - 5.0 * y[0])]

    for one, other in pairwise([0.0, *TABLE.times, 1.5]):
        state = solve_ivp(rates, (one, other), state, rtol=1e-12, atol=1e-14).y[:, -1]
    return state


@pytest.mark.parametrize(("method", "tolerance"), [("rk87", 1e-9), ("rk54", 1e-6), ("radau", 1e-9), ("natural4", 1e-6)])
@pytest.mark.parametrize("form", FROM_REST)
def test_what_is_towed_from_rest_moves_as_its_equation_says(form, method, tolerance):
    """At first it has next to no energy, beside that of the led cart; at any tolerance its energy stays its own."""
    state = towed(FROM_REST[form])
    run = ephs.simulate(
        scene_of_text(TOWED.replace("{motion}", form)), 1.5, method=method, rtol=tolerance, atol=1e-2 * tolerance
    )
    # errors of steps add up, by a factor of some ten steps of the largest error
    most = largest(run.joint("tow").coordinate)
    assert abs(run.joint("tow").coordinate[-1, 0] - state[0]) < 30.0 * tolerance * max(1.0, most)
    assert abs(run.work[-1] - state[2]) < 30.0 * tolerance * max(1.0, largest(run.work))


def test_loop_from_rest_to_rest(crank):
    """Work is what the energies gain, and heat; it is so by methods that share no code."""
    first = ephs.simulate(crank, 0.6, method="rk87", rtol=1e-10)
    other = ephs.simulate(crank, 0.6, method="natural", step=2.5e-4)
    assert first.joint("bearing").coordinate[-1, 0] == 4.0
    assert first.joint("bearing").rate[-1, 0] == 0.0
    np.testing.assert_allclose(first.body("slider").position[-1], other.body("slider").position[-1], atol=1e-6)
    assert first.work[-1] == pytest.approx(other.work[-1], rel=1e-5)
    assert first.energy_error.max() < 1e-12


def test_system_by_hand_takes_a_law():
    """An effort at a joint's port; a function without derivative is left to the natural methods."""
    scene = scene_of_text(CART.replace("{motion}", "{ amplitude = 0.1, frequency = 0.8, phase = 0.3 }"))
    whole = ephs.simulate(scene, 0.5, method="rk87", rtol=1e-9)
    problem = whole.problem
    (port,) = (path for path, signal in problem.signals.items() if signal.effort)
    own = {str(path): value for path, value in problem.initial.items()}
    given_law = ephs.simulate(
        problem.system, 0.5, method="rk87", rtol=1e-9, initial=own, inputs={str(port): {"effort": HARMONIC}}
    )
    last = {str(path): values[-1] for path, values in whole.states.items()}
    for path, values in given_law.states.items():
        np.testing.assert_allclose(values[-1], last[str(path)], atol=1e-9)
    with pytest.raises(ephs.OptionError, match="without derivative"):
        ephs.simulate(problem.system, 0.5, method="rk87", initial=own, inputs={str(port): {"effort": HARMONIC.rate}})


def test_a_system_is_read_anew_for_each_motion_and_once_for_all_forces():
    problem = problem_of_scene(scene_of_text(CART.replace("{motion}", "{ rate = 0.3 }")))
    ((path, signal),) = problem.signals.items()

    def key(value, effort):
        return determined_by(replace(problem, signals={path: replace(signal, value=value, effort=effort)}))

    values = [*FORMS.values(), np.array([0.2]), np.array([0.3])]
    assert len({key(value, True) for value in values}) == len(values)
    assert key(np.array([0.2]), False) == key(np.array([0.3]), False)


@pytest.mark.parametrize("form", FORMS)
def test_text_keeps_the_law(form):
    scene = scene_of_text(CART.replace("{motion}", form))
    again = scene_from_text(scene_to_text(scene))
    assert again.joint("rail").motion == scene.joint("rail").motion == FORMS[form]


def test_a_number_in_an_older_text_is_a_constant_rate():
    data = json.loads(scene_to_text(scene_of_text(CART.replace("{motion}", "{ rate = 0.3 }"))))
    for rate in (0.3, -2, 0.0):
        data["joints"]["rail"]["motion"] = rate
        assert scene_from_text(json.dumps(data)).joint("rail").motion == ephs.PolynomialMotion((float(rate),))


@pytest.mark.parametrize("law", [{"coefficients": [0.3], "phase": 0.0}, {"slope": 1.0}, {"times": [0.0]}])
def test_a_law_that_no_class_has_is_refused(law):
    data = json.loads(scene_to_text(scene_of_text(CART.replace("{motion}", "{ rate = 0.3 }"))))
    assert scene_from_text(json.dumps(data)).joint("rail").motion == ephs.PolynomialMotion((0.3,))
    data["joints"]["rail"]["motion"] = law
    with pytest.raises((KeyError, TypeError)):
        scene_from_text(json.dumps(data))


@pytest.mark.parametrize("form", FORMS)
def test_a_path_changes_one_number_of_a_law(form):
    scene = scene_of_text(CART.replace("{motion}", form))
    numbers = dict(FORMS[form].numbers)
    for key in ("rate", "amplitude", "frequency", "phase"):
        values = {f"joints.rail.motion.{key}": 0.7}
        if key in numbers:
            joint = varied(scene, values).joint("rail")
            assert type(joint.motion) is type(FORMS[form]) and dict(joint.motion.numbers) == numbers | {key: 0.7}
            assert joint.rate == joint.motion.rate(0.0)
        else:
            with pytest.raises(ephs.SceneError, match="no such number"):
                varied(scene, values)


def test_numbers_of_a_law_are_varied():
    form = "{ amplitude = 0.1, frequency = 0.8, phase = 1.5707963267948966 }"  # it begins at rest
    scene, other = (scene_of_text(CART.replace("{motion}", form.replace("0.1", of))) for of in ("0.1", "0.2"))
    table = ephs.sweep(scene, {"joints.rail.motion.amplitude": [0.1, 0.2]}, 0.3, outputs=["joints.pivot.coordinate"])
    wanted = ephs.simulate(other, 0.3).joint("pivot").coordinate[-1, 0]
    assert table["joints.pivot.coordinate"].values.ravel()[-1] == pytest.approx(wanted, abs=1e-8)


@pytest.mark.parametrize(
    "use",
    [
        ephs.dynamics,
        ephs.linearize,
        ephs.equilibrium,
        lambda scene: ephs.sensitivity(scene, ["bodies.bob.mass"], 0.1),
    ],
)
def test_functions_of_a_state_refuse_it(use):
    scene = scene_of_text(CART.replace("{motion}", "{ amplitude = 0.1, frequency = 0.8 }"))
    with pytest.raises((ephs.OptionError, ephs.SimulationError), match=r"motion|prescribed"):
        use(scene)


def test_law_with_another_rate_is_seen():
    assert off(Slow(), 0.0, 1.0) > 1e-2


SWINGER = """
    format = 1
    name = "swinger"
    [assembly]
    adjust = true
    [bodies.b]
    mass = 1.0
    inertia = [0.01, 0.01, 0.01]
    position = [0.3, 0.0, 0.0]
    [joints.pin]
    type = "revolute"
    bodies = ["ground", "b"]
    at = [0.0, 0.0, 0.0]
    axis = [0.0, 1.0, 0.0]
    motion = { amplitude = 0.3, frequency = 2.0 }
    """


@pytest.mark.parametrize("method", ["rk87", "radau", "semi", "natural", "natural4", "variational"])
def test_a_run_starts_where_its_joints_move_as_their_laws_say(method):
    """The state of a file is that at 0, and after a period; at other times a run goes on from one that came there."""
    scene, law = scene_of_text(SWINGER), lambda t: 0.3 * np.sin(4.0 * np.pi * t)
    with pytest.raises(ephs.OptionError, match=r"joints\.pin has the rate 3\.76991 .* scene\.at\(solution, 0\.3\)"):
        ephs.simulate(scene, 0.5, t0=0.3, method=method, step=1e-2)
    run = ephs.simulate(scene, 0.3, method="rk87", rtol=1e-10)
    arrived = {str(path): values[-1] for path, values in run.states.items()}
    for start, t0, initial in ((scene, 0.5, None), (run.scene.at(run, 0.3), 0.3, None), (scene, 0.3, arrived)):
        sol = ephs.simulate(start, t0 + 0.1, t0=t0, method=method, step=1e-2, initial=initial)
        off = largest(sol.joint("pin").coordinate[:, 0] - law(sol.t))
        # natural sums rates in the middle of steps: h²/24 of what accelerations change by
        assert off < (1e-2**2 / 24.0 * 2.0 * 0.3 * (4.0 * np.pi) ** 2 if method == "natural" else 1e-9)
    with pytest.raises(ephs.AssemblyError, match="contradicts the joints"):
        ephs.simulate(scene, 0.1, method=method, step=1e-2, initial=arrived)
    with pytest.raises(ephs.SceneError, match=r"joints\.pin\.motion: found a rate of 1, expected 3\.76991"):
        ephs.simulate(scene.with_state(rates={"pin": 1.0}), 0.1, method=method, step=1e-2)
