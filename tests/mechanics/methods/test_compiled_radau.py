"""Steps of radau in compiled calls: those taken one by one, lawful, and no more of them than its errors ask for."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.methods import auto
from ephs.mechanics.methods.jacobian import Jacobian
from ephs.mechanics.methods.radau import Implicit
from ephs.mechanics.methods.stages import KeptJacobian, scheme_of
from ephs.mechanics.tree.equations.tangent import Linearised
from tests.mechanics.ball import BALL
from tests.methods import choosing
from tests.numerics import largest
from tests.scenes import equations_of, shipped
from tests.written import scene_of_text

SCENE = """
format = 1
name = "stick"
[thermal.housing]
capacity = 2.0
temperature = 300.0
[bodies.arm]
mass = 1.0
inertia = [0.02, 0.02, 0.01]
position = [0.3, 0.0, 0.6]
[bodies.fist]
mass = 0.5
inertia = [1e-3, 1e-3, 1e-3]
position = [0.6, 0.0, 0.6]
[joints.shoulder]
type = "revolute"
bodies = ["ground", "arm"]
at = [0.0, 0.0, 0.6]
axis = [0.0, 1.0, 0.0]
friction = 0.05
heat = "housing"
[joints.wrist]
type = "revolute"
bodies = ["arm", "fist"]
at = [0.6, 0.0, 0.6]
axis = [0.0, 1.0, 0.0]
stiffness = 500.0
friction = 0.5
heat = "housing"
limits = [-0.02, nan]
limit_stiffness = 1e3
limit_loss = 0.1
[surfaces.fist]
body = "fist"
shape = { sphere = 0.1 }
stiffness = 1e5
loss = 0.3
friction = 0.5
slip = 1e-3
heat = "housing"
[surfaces.floor]
body = "ground"
shape = { plane = {} }
"""
ASKED = {"method": "radau", "audit": "off"}
TIMES = np.linspace(0.0, 0.6, 13)


@pytest.fixture(scope="module")
def scene():
    return scene_of_text(SCENE)


def stepwise(monkeypatch):
    monkeypatch.setattr(Implicit, "many", lambda *_: None)


def motion(sol):
    return np.concatenate([sol.body("fist").position, sol.body("fist").velocity, sol.heat[:, None]], axis=1)


def both_ways(scene, until, monkeypatch, **options):
    """Runs by compiled steps, and by steps one by one."""
    run = {"save_at": np.linspace(0.0, until, 13), **options, **ASKED}
    found = ephs.simulate(scene, until, **run)
    with monkeypatch.context() as patched:
        stepwise(patched)
        return found, ephs.simulate(scene, until, **run)


def test_compiled_constant_steps_are_those_taken_one_by_one(scene, monkeypatch):
    found, oracle = both_ways(scene, 0.25, monkeypatch, step=1e-3)
    assert found.stats["steps"] == oracle.stats["steps"]
    assert motion(found) == pytest.approx(motion(oracle), rel=0.0, abs=1e-10)


def test_compiled_chosen_steps_are_on_average_no_more_than_those_taken_one_by_one(scene, monkeypatch):
    """Where in a step surfaces meet, numbers of steps scatter by a quarter either way: these are of six tolerances."""
    runs = {rtol: both_ways(scene, 0.6, monkeypatch, rtol=rtol) for rtol in (1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6)}
    ratios = [found.stats["steps"] / oracle.stats["steps"] for found, oracle in runs.values()]
    assert np.exp(np.log(ratios).mean()) <= 1.1
    found, oracle = runs[1e-5]
    assert motion(found) == pytest.approx(motion(oracle), rel=0.0, abs=1e-4)


@pytest.mark.parametrize("rtol", [1e-2, 1e-5, 1e-9])  # three, five and seven stages
def test_compiled_steps_of_what_is_smooth_are_those_taken_one_by_one(rtol, monkeypatch):
    options = {"rtol": rtol, "atol": rtol, "save_at": [0.0, 1.0], **ASKED}
    model = shipped("chain")
    found = ephs.simulate(model, 1.0, **options)
    stepwise(monkeypatch)
    oracle = ephs.simulate(model, 1.0, **options)
    assert abs(found.stats["steps"] - oracle.stats["steps"]) <= 0.1 * oracle.stats["steps"] + 1
    tip = [sol.body("rod3").position[-1] for sol in (found, oracle)]
    assert tip[0] == pytest.approx(tip[1], rel=0.0, abs=max(rtol, 1e-12))


def test_surfaces_that_may_touch_have_three_stages_at_tolerances_that_are_not_fine(scene):
    def stages(rtol):
        control = choosing(rtol)
        return scheme_of(equations_of(scene), control).nodes.size

    assert [stages(rtol) for rtol in (1e-3, 1e-6, 1e-8)] == [3, 3, 5]


def test_the_freedoms_alone_are_factorised_as_the_whole_is(scene, monkeypatch):
    renew, seen = KeptJacobian.renew, []

    def whole(self, state):
        renew(self, state)
        seen.append(int(self.newton[0].split))
        self.newton[0].split = 0

    found = ephs.simulate(scene, 0.25, step=1e-3, **ASKED)
    monkeypatch.setattr(KeptJacobian, "renew", whole)
    oracle = ephs.simulate(scene, 0.25, step=1e-3, **ASKED)
    assert all(seen)
    assert motion(found) == pytest.approx(motion(oracle), rel=0.0, abs=1e-10)


def test_the_matrix_of_compiled_rates_is_that_of_the_residual(scene, monkeypatch):
    at, seen = Jacobian.at, []

    def both(self, state):
        found, eq, linear = at(self, state), self.equations, Linearised(self.equations)
        linear.forward(state.q, state.r, eq.heats.entropies(state.heats))
        moving = eq.nv + eq.n
        seen.append((found[eq.nv : moving, :moving].copy(), linear.columns(solve=True)[: eq.n, :moving]))
        return found

    monkeypatch.setattr(Jacobian, "at", both)
    ephs.simulate(scene, 0.3, rtol=1e-3, **ASKED)
    assert any(largest(one) > 1e4 for one, _ in seen)  # it touches
    for one, other in seen:
        assert one == pytest.approx(other, rel=1e-12, abs=1e-12 * largest(other))


@pytest.mark.parametrize("rtol", [0.1, 1e-2, 1e-3, 1e-5])
def test_both_laws_hold_at_any_tolerance(rtol, scene):
    sol = ephs.simulate(scene, 0.6, rtol=rtol, **ASKED)
    assert sol.contact("fist_floor").gap.min() < 0.0
    assert largest(sol.energy_error) <= 1e-12
    assert sol.stats["least_production"] >= 0.0
    assert np.all(np.diff(sol.heat) >= 0.0)


def test_a_matrix_serves_many_steps(scene):
    stats = ephs.simulate(scene, 0.6, rtol=1e-4, **ASKED).stats
    assert 0 < stats["jacobians"] < 0.5 * stats["steps"]
    assert stats["iterations"] < 5 * (stats["steps"] + stats["rejected"])


def test_auto_takes_the_steps_of_radau_only_while_they_pay(scene, monkeypatch):
    """Without semi-implicit steps: mild contact and free flight are explicit again; both laws hold all along."""
    monkeypatch.setattr(auto, "cheap", lambda equations: False)
    monkeypatch.setattr(auto, "BEGINS", {})  # which would be more than such a short run has to gain
    options = {"rtol": 1e-4, "audit": "off", "save_at": TIMES}
    found, radau, explicit = (ephs.simulate(scene, 0.6, method=name, **options) for name in ("auto", "radau", "rk54"))
    assert "radau" in [switch["to"] for switch in found.stats["switches"]]
    assert motion(found) == pytest.approx(motion(radau), abs=1e-2)
    assert np.array_equal(found.t, TIMES)
    assert largest(found.energy_error) <= 1e-12
    assert found.stats["least_production"] >= 0.0
    assert np.all(np.diff(found.heat) >= 0.0)
    assert found.stats["evaluations"] < explicit.stats["evaluations"]
    assert found.stats["jacobians"] < radau.stats["jacobians"]
    assert ephs.simulate(scene, 0.1, rtol=1e-6, audit="off").stats["chosen"] == "rk87"


@pytest.mark.parametrize("slip", [1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("rtol", [1e-2, 1e-3])
def test_radau_is_tried_where_explicit_steps_hide_their_stiffness(slip, rtol):
    """Friction near rest makes explicit steps erratic, not equal: by their estimate alone they went on for 400 000."""
    found = ephs.simulate(scene_of_text(BALL.format(slip=slip)), 1.0, rtol=rtol, audit="off")
    bounces = 4
    assert found.stats["steps"] < 3 * bounces * auto.TRIAL
    assert largest(found.energy_error) <= 1e-12 and np.all(np.diff(found.heat) >= 0.0)
