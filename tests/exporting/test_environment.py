"""Environments: gymnasium's own checks, the motion of the package, many on threads like one alone."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import ephs
from ephs.exporting.environment import Environment, Environments, EnvironmentTask
from tests.scenes import shipped
from tests.written import scene_of_text


@pytest.fixture(scope="module")
def task() -> EnvironmentTask:
    return EnvironmentTask(
        shipped("slider-crank"),
        inputs=["joints.bearing"],
        outputs=["joints.bearing", "joints.cylinder"],
        reward=lambda seen, action: -float(action @ action) - (seen[1] - 20.0) ** 2,
        limits=0.5,
        horizon=10,
        parameters={"bodies.rod.mass": (0.1, 0.2), "joints.bearing.friction": (1e-3, 3e-3)},
    )


def test_gymnasium_finds_nothing_wrong(task, recwarn):
    check_env(Environment(task), skip_render_check=True)
    assert all("infinity" in str(each.message) for each in recwarn)  # observations have no bounds


def test_an_episode_is_a_run_of_the_package():
    scene = shipped("slider-crank")
    made = EnvironmentTask(scene, inputs=["joints.bearing"], reward=lambda *_: 0.0, rtol=1e-9, horizon=10)
    env = Environment(made)
    env.reset(seed=1)
    for _ in range(10):
        seen, _, ended, cut, info = env.step(np.array([0.3]))
    assert (ended, cut, info) == (False, True, {"status": 0})
    run = ephs.simulate(scene, 0.2, method="rk54", rtol=1e-9, inputs={"joints.bearing": 0.3 - 0.06})
    found = dict(zip(made.names, seen, strict=True))
    assert found["joints.bearing.coordinate"] == pytest.approx(run.joint("bearing").coordinate[-1].item(), rel=1e-7)
    assert found["joints.bearing.rate"] == pytest.approx(run.joint("bearing").rate[-1].item(), rel=1e-6)


@pytest.mark.parametrize("threads", [1, 3])
def test_many_are_like_one_alone(task, threads):
    many, rng = Environments(task, 20, threads=threads), np.random.default_rng(3)
    actions = rng.uniform(-0.5, 0.5, (23, 20, 1))
    found, _ = many.reset(seed=5)
    again = [found.copy()]
    over = []
    for action in actions:
        seen, rewards, ended, cut, _ = many.step(action)
        again.append(seen.copy())
        over.append(ended | cut)
        assert many.observation_space.contains(seen) and rewards.shape == (20,)
    assert [bool(each.all()) for each in over] == [k in (9, 20) for k in range(23)]
    np.testing.assert_array_equal(over[10], np.zeros(20, dtype=bool))
    many.reset(seed=5)
    for k, action in enumerate(actions):
        np.testing.assert_array_equal(many.step(action)[0], again[k + 1])
    many.close()


def test_parameters_are_drawn_anew_for_each_episode(task):
    env = Environment(task)
    ends = []
    for seed in (1, 1, 2):
        env.reset(seed=seed)
        for _ in range(5):
            seen, *_ = env.step(np.array([0.2]))
        ends.append(seen[0])
    assert ends[0] == ends[1] != ends[2]


@pytest.mark.parametrize("seed", [4, [7, None, 3]])
def test_each_of_many_draws_as_one_alone_with_its_seed(task, seed):
    """And goes on to draw without a seed; None leaves a generator as it is."""
    many, ends = Environments(task, 3), []
    many.reset(seed=11)
    for given in (seed, None):
        many.reset(seed=given)
        for _ in range(5):
            seen, *_ = many.step(np.full((3, 1), 0.2))
        ends.append(seen)
    for k in range(3):
        env = Environment(task)
        env.reset(seed=11 + k)
        for given, end in zip((4 + k if seed == 4 else seed[k], None), ends, strict=True):
            env.reset(seed=given)
            for _ in range(5):
                alone, *_ = env.step(np.array([0.2]))
            assert alone.tolist() == end[k].tolist()
    assert ends[0].tolist() != ends[1].tolist()
    with pytest.raises(ephs.OptionError, match="seed is"):
        many.reset(seed=[1])


@pytest.mark.parametrize(
    "option",
    [{"limits": -1.0}, {"limits": np.nan}, {"limits": "wide"}, {"limits": [1.0, 2.0]}, {"period": 0.0},
     {"period": "short"}, {"period": np.nan}, {"horizon": 0}, {"horizon": 1.5}, {"reward": 3.0}, {"done": 3.0},
     {"parameters": ["bodies.rod.mass"]}, {"inputs": "joints.bearing"}, {"inputs": ["joints.bearing"] * 2},
     *({"parameters": {"bodies.rod.mass": pair}} for pair in ((2.0, 1.0), (1.0, 2.0, 3.0, 4.0), 1.0, (1.0, np.nan)))],
)  # fmt: skip
def test_options_that_have_no_meaning_are_refused_by_name(option):
    given = {"inputs": ["joints.bearing"], "reward": lambda *_: 0.0} | option
    with pytest.raises(ephs.OptionError, match=next(iter(option))):
        EnvironmentTask(shipped("slider-crank"), **given)


def test_ranges_have_ends_that_a_scene_may_have():
    given = {"inputs": ["joints.bearing"], "reward": lambda *_: 0.0, "parameters": {"bodies.rod.mass": (-1.0, 1.0)}}
    with pytest.raises(ephs.SceneError, match=r"bodies\.rod\.mass"):
        EnvironmentTask(shipped("slider-crank"), **given)


def test_what_is_not_there_is_refused_by_name():
    scene = shipped("slider-crank")
    with pytest.raises(ephs.ExportError, match=r"joints\.no"):
        EnvironmentTask(scene, inputs=["joints.bearing"], outputs=["joints.no"], reward=lambda *_: 0.0)


def test_it_is_an_environment_of_gymnasium(task):
    assert isinstance(Environment(task), gymnasium.Env)
    assert isinstance(Environments(task, 2), gymnasium.vector.VectorEnv)


def test_actions_of_actuators_have_their_ranges():
    names = ["actuators.push", "actuators.free", "joints.h"]
    found = EnvironmentTask(
        scene_of_text(
            'format = 1\n[bodies.arm]\nmass = 1.0\ninertia = [0.1, 0.1, 0.1]\n[joints.h]\ntype = "revolute"\n'
            'bodies = ["ground", "arm"]\nat = [0.5, 0.0, 0.0]\naxis = [0.0, 1.0, 0.0]\n'
            '[actuators.push]\njoints = ["h"]\nratio = 3.0\nlimits = [-0.5, 2.0]\n[actuators.free]\njoints = ["h"]\n'
        ),
        inputs=names,
        reward=lambda *_: 0.0,
    ).action_space
    assert (found.low.tolist(), found.high.tolist()) == ([-0.5, -1.0, -1.0], [2.0, 1.0, 1.0])
