"""Semi-implicit steps: their coefficients, their stages, and what contact loses by them."""

import re

import numpy as np
import pytest
from hypothesis import given, settings

import ephs
from ephs.mechanics.methods.semi import ARRAYS, SCHEME, Semi
from ephs.mechanics.tree.engine.drags import Drags, resisting
from ephs.mechanics.tree.engine.programs import of_motion
from ephs.semantics.linear.dense import copy
from ephs.semantics.stage import Program, Real, Vector
from ephs.testing.mechanisms import mechanisms
from tests.mechanics.ball import BALL
from tests.mechanics.plain import uncorrected
from tests.numerics import largest, seeds
from tests.scenes import ROOT, equations_of, shipped
from tests.written import scene_of_text

EXPLICIT, LAST = ARRAYS["a"][1:5, 1:], ARRAYS["a"][5, 1:]
IMPLICIT = SCHEME[1:, 1:]


def test_coefficients_are_of_order_three():
    """All conditions of two coupled methods with the same weights, to order 3."""
    ones = np.ones(4)
    assert LAST.sum() == pytest.approx(1.0, rel=1e-15)
    for a in (EXPLICIT, IMPLICIT):
        assert LAST @ a @ ones == pytest.approx(0.5, rel=1e-14)
        for b in (EXPLICIT, IMPLICIT):
            assert LAST @ ((a @ ones) * (b @ ones)) == pytest.approx(1.0 / 3.0, rel=1e-14)
            assert LAST @ a @ b @ ones == pytest.approx(1.0 / 6.0, rel=1e-14)


def test_no_weight_is_negative_and_stiff_parts_vanish():
    assert np.all(LAST >= 0.0)
    assert 1.0 - LAST @ np.linalg.solve(IMPLICIT, np.ones(4)) == pytest.approx(0.0, abs=1e-14)
    z = 1j * np.logspace(-3, 3, 200)
    grown = [abs(1.0 + x * LAST @ np.linalg.solve(np.eye(4) - x * IMPLICIT, np.ones(4))) for x in z]
    assert max(grown) <= 1.0 + 1e-14


def test_the_estimate_is_by_a_method_of_order_two():
    other = LAST - ARRAYS["error"][1:5]
    for a in (EXPLICIT, IMPLICIT):
        assert (other.sum(), other @ a.sum(axis=1)) == pytest.approx((1.0, 0.5), rel=1e-14)
    assert other @ EXPLICIT.sum(axis=1) ** 2 != pytest.approx(1.0 / 3.0, rel=1e-3)


def probe(
    on, motion, drags: Drags, base: Vector, y: Vector, q: Vector, out: Vector, known: Vector, weight: Real,
):  # fmt: skip
    status, _ = drags.observe(on, motion, base, y, q)
    copy(on, known, drags.reached)
    copy(on, drags.seen, out)
    on.when(on.same(status, 0), lambda: drags.resist(on, motion, y, weight, on.same(status, 1), out))
    return status


PROBES = {looped: Program("probe", probe=of_motion(probe, looped=looped)) for looped in (False, True)}


class Stage:
    """One stage of a scene's equations at its start, with other rates."""

    def __init__(self, scene, seed):
        self.eq = eq = equations_of(scene)
        self.state = eq.start(0.0)
        self.y = eq.vector(self.state)
        self.rates = slice(eq.nv, eq.nv + eq.n)
        self.y[self.rates] += np.random.default_rng(seed).normal(size=eq.n)
        semi = Semi(eq)
        call = PROBES[eq.engine.looped].compiled()["probe"]
        coordinates, size = eq.engine.sizes
        self.out, self.known, self.memory = np.zeros(size), np.zeros(eq.n), semi.memory
        first = call.first(resisting(eq.engine.tables, semi.onsager), eq.engine.work)
        given = self.memory, self.state.q.copy(), self.y.copy(), np.zeros(coordinates), self.out, self.known
        self.run = call.bind(*given, 0.0, first=first)

    def at(self, known, weight):
        self.known[:] = known
        assert self.run(weight) == 0
        return self.out.copy()


SELF = """
format = 1
name = "hug"
[thermal.skin]
capacity = 2.0
temperature = 320.0
[bodies.trunk]
mass = 2.0
inertia = [0.02, 0.03, 0.04]
position = [5.0, 1.0, 0.08]
[bodies.arm]
mass = 1.0
inertia = [0.02, 0.02, 0.01]
position = [5.15, 1.0, 0.08]
[bodies.hand]
mass = 0.5
inertia = [1e-3, 2e-3, 1e-3]
position = [5.15, 1.15, 0.1]
[bodies.finger]
mass = 0.1
inertia = [1e-4, 2e-4, 1e-4]
position = [5.25, 1.15, 0.4]
[joints.knuckle]
type = "revolute"
bodies = ["hand", "finger"]
at = [5.2, 1.15, 0.4]
axis = [0.0, 0.0, 1.0]
armature = 0.02
friction = 0.03
[joints.shoulder]
type = "spherical"
bodies = ["arm", "trunk"]
at = [5.1, 1.0, 0.08]
friction = 0.1
[joints.elbow]
type = "cylindrical"
bodies = ["arm", "hand"]
at = [5.15, 1.05, 0.1]
axis = [0.0, 0.6, 0.8]
friction = [0.05, 2.0]
heat = "skin"
[surfaces.trunk]
body = "trunk"
shape = { sphere = 0.1 }
stiffness = 1e4
loss = 0.4
friction = 0.6
[surfaces.hand]
body = "hand"
shape = { sphere = 0.15 }
stiffness = 2e4
loss = 0.2
friction = 0.5
rolling = 0.01
spinning = 0.02
heat = "skin"
[surfaces.floor]
body = "ground"
shape = { plane = {} }
"""


@pytest.fixture(scope="module")
def hug():
    with pytest.warns(ephs.SceneWarning):  # of overlaps
        return scene_of_text(SELF)


def check(stage, seed):
    eq = stage.eq
    rng = np.random.default_rng(seed)
    status, _, rates = eq.engine.rates(stage.state.q, stage.y)
    assert status == 0
    # Without weight, losses are those of the rates.
    found = stage.at(stage.y[stage.rates], 0.0)
    size = 1.0 + np.abs(rates)
    assert largest(found - rates) <= 1e-9 * size.max()
    # With weight, they are those of the rates that are reached.
    known, weight = rng.normal(size=eq.n), 10.0 ** rng.uniform(-4, 1)
    there = stage.at(known, weight)
    again = stage.at(known + weight * there[stage.rates], 0.0)
    loss = largest(again[stage.rates] - stage.at(np.zeros(eq.n), 0.0)[stage.rates])
    assert largest(there - again) <= 1e-9 * (1.0 + largest(again) + loss)
    made = there[eq.size - len(eq.reduced.made) :]
    assert np.all(made >= 0.0)


@given(scene=mechanisms(), seed=seeds)
@settings(max_examples=25)
def test_losses_act_on_the_rates_that_a_stage_reaches(scene, seed):
    stage = Stage(scene, seed)
    if stage.eq.n and not stage.eq.careful:
        check(stage, seed)


@pytest.fixture(scope="module", params=["four-bar", "slider-crank", "slider-crank, led", "cardan-shaft", "universal"])
def closed(request):
    """A mechanism with loops and friction, of which one has a crank whose motion is prescribed."""
    name, _, led = request.param.partition(", ")
    text = (ROOT / f"scenes/{name}.toml").read_text(encoding="utf-8")
    return scene_of_text(text.replace("drive = 0.06", "motion = { rate = 10.0 }") if led else text)


@given(seed=seeds)
@settings(max_examples=5)
def test_so_they_do_within_loops_and_beside_prescribed_motions(closed, seed):
    stage = Stage(closed, seed)
    check(stage, seed)
    assert stage.memory["counts"][0] > 0


@given(seed=seeds)
@settings(max_examples=10)
def test_so_do_those_of_contacts_within_a_mechanism(hug, seed):
    stage = Stage(hug, seed)
    check(stage, seed)
    assert list(stage.memory["counts"]) == [6, 3]  # three joints and three contacts


def assert_order_three(end, exact, until, counts=(20, 40, 80)):
    """Errors of ends by so many constant steps."""
    errors = [largest(end(until / count) - exact) for count in counts]
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 2.6)


def test_steps_converge_with_order_three():
    """Where friction is smooth beside the steps, and nothing touches or parts."""
    with pytest.warns(ephs.SceneWarning):
        hug = scene_of_text(SELF.replace("loss =", "slip = 1.0\nloss ="))

    def end(step):
        sol = ephs.simulate(hug, 4e-3, rtol=1e-2, atol=1e10, max_step=step, audit="off")
        assert sol.stats["method"] == "semi"
        return np.concatenate([sol.body("hand").velocity[-1], sol.body("trunk").angular_velocity[-1]])

    exact = ephs.simulate(hug, 4e-3, method="rk87", rtol=1e-12, atol=1e-14, audit="off")
    exact = np.concatenate([exact.body("hand").velocity[-1], exact.body("trunk").angular_velocity[-1]])
    assert_order_three(end, exact, 4e-3, (16, 32, 64))


def test_so_they_do_with_loops_and_prescribed_motions(closed):
    def end(step=None, **how):
        sol = ephs.simulate(closed, 0.1, audit="off", step=step, **({"method": "semi"} | how))
        ledgers = [sol.heat[-1], sol.work[-1]]
        return np.concatenate([*(sol.body(body).velocity[-1] for body in closed.bodies), ledgers])

    assert_order_three(end, end(method="rk87", rtol=1e-11, atol=1e-12), 0.1)


def test_so_they_do_under_inputs_that_are_functions_of_time_and_state():
    scene = shipped("four-bar")
    inputs = {"joints.main": lambda t, state: 4.0 * np.sin(20.0 * t) - 0.1 * state.joints["main"].rate[0]}

    def end(step=None, **how):
        with uncorrected():
            sol = ephs.simulate(scene, 0.2, inputs=inputs, audit="off", step=step, **({"method": "semi"} | how))
        return np.concatenate([*(sol.body(body).velocity[-1] for body in scene.bodies), sol.heat[-1:], sol.work[-1:]])

    assert_order_three(end, end(method="rk87", rtol=1e-11, atol=1e-12), 0.2)


def test_a_stiff_brake_does_not_shorten_steps_with_a_loop_or_an_input_that_changes():
    """Losses a thousand times as fast as steps, whose stages are one by one."""
    text = (ROOT / "scenes/four-bar.toml").read_text(encoding="utf-8")
    scene = scene_of_text(re.sub(r"friction = [0-9.]+", "friction = 1e4", text))
    inputs = {"joints.main": lambda t, state: 4.0 + t}
    found = ephs.simulate(scene, 0.5, method="semi", step=0.02, inputs=inputs, audit="off")
    assert largest(found.joint("main").rate) <= 1e-2
    assert found.stats["least_production"] >= 0.0 and largest(found.energy_error) <= 1e-11


@pytest.mark.parametrize("slip", [1e-2, 1e-4, 1e-6])
def test_stiff_friction_does_not_shorten_steps(slip):
    """A ball that slides until it rolls: its speed 5/7, and heat 2/7 of its energy, whatever the slip."""
    text = BALL.format(slip=slip).replace("0.3]", "0.0999]").replace("loss = 0.2", "loss = 1.0")
    scene = scene_of_text(text)
    rtol, speed = 1e-3, 5.0 / 7.0
    sol = ephs.simulate(scene, 0.5, rtol=rtol, audit="off")
    assert sol.stats["method"] == "semi" and sol.stats["steps"] < 1000
    allowed = 2.0 * rtol * speed / 0.1  # a joint's rates are weighed by the largest, which is that of turning
    assert sol.body("ball").velocity[-1, 0] == pytest.approx(speed, abs=allowed)
    assert sol.heat[-1] == pytest.approx(0.5 * 2.0 / 7.0, abs=1.4 * speed * allowed)
    assert largest(sol.energy_error) <= 1e-11
    assert sol.stats["least_production"] >= 0.0


WHEEL = """
format = 1
name = "wheel"
[bodies.wheel]
mass = 1.0
inertia = [4e-3, 4e-3, 4e-3]
position = [0.0, 0.0, 0.11]
angular_velocity = [0.0, 30.0, 0.0]
rotation = { axis = [1.0, 0.0, 0.0], angle = 1.5707963267948966 }
[surfaces.wheel]
body = "wheel"
shape = { cylinder = [0.1, 0.05] }
stiffness = 1e5
loss = 0.3
friction = 0.5
slip = 1e-3
[surfaces.floor]
body = "ground"
shape = { plane = {} }
"""


def test_what_comes_to_rest_stays_where_its_energy_cannot_be_mended():
    """Near rest no small move has the energy that is missing: moves that make more of it missing are taken back."""
    sol = ephs.simulate(scene_of_text(WHEEL), 1.5, rtol=0.1, atol=1e-3, audit="off")
    assert sol.stats["method"] == "semi"
    height = sol.body("wheel").position[:, 2]
    assert height[-1] == pytest.approx(0.1 - 0.5 * 9.81 / 1e5, abs=1e-4)  # on two rims
    assert largest(sol.energy_error) <= 0.1**2


def test_an_ensemble_equals_its_single_runs(tmp_path):
    text, times, members = BALL.format(slip=1e-3), np.linspace(0.0, 0.6, 13), [0.1, 0.3, 0.5]

    def run(friction):
        file = tmp_path / f"{friction}.toml"
        file.write_text(text.replace("friction = 0.5", f"friction = {friction}"), encoding="utf-8")
        sol = ephs.simulate(ephs.load(file), 0.6, rtol=1e-2, save_at=times)
        assert sol.stats["method"] == "semi"
        return sol.heat

    singles = [run(friction) for friction in members]
    table = ephs.sweep(
        ephs.load(tmp_path / "0.5.toml"), {"contacts.ball_floor.friction": members}, 0.6, save_at=times,
        outputs=["heat"], rtol=1e-2,
    )  # fmt: skip
    assert np.array_equal(table["heat"], singles)
