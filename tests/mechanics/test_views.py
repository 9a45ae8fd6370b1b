"""Functions of inputs and events read states by the names of `Solution`, and read the same numbers."""

import numpy as np
import pytest
from hypothesis import given, settings

import ephs
from ephs.mechanics.motion.views import Names
from ephs.semantics.bundles.errors import AssemblyError
from tests.mechanics.dynamics.drawn import moving
from tests.numerics import largest
from tests.scenes import SCENES
from tests.written import scene_of_text

ROUNDING = 1e-11
"""10 κ ε: twists are read back from momenta, and rates of cut joints from twists."""
FOLLOWERS = """
format = 1
[bodies.rod]
mass = 2.0
inertia = [0.2, 0.2, 0.01]
[bodies.link]
mass = 0.0
inertia = [0.0, 0.0, 0.0]
position = [0.0, 0.5, 0.0]
[bodies.disk]
mass = 1.0
inertia = [0.1, 0.1, 0.2]
position = [0.0, 1.0, 0.0]
[bodies.comet]
mass = 1.0
inertia = [0.1, 0.1, 0.2]
position = [5.0, 0.0, 0.0]
velocity = [0.0, 1.0, 2.0]
angular_velocity = [0.1, 0.2, 0.3]
[joints.pin]
type = "revolute"
bodies = ["ground", "rod"]
axis = [1.0, 0.0, 0.0]
at = [0.0, 0.0, 0.5]
rate = 0.7
[joints.elbow]
type = "revolute"
bodies = ["rod", "link"]
axis = [0.0, 1.0, 0.0]
at = [0.0, 0.3, 0.0]
rate = -0.4
[joints.wrist]
type = "revolute"
bodies = ["link", "disk"]
axis = [0.0, 0.0, 1.0]
at = [0.0, 0.8, 0.0]
rate = 1.3
[markers.tip]
body = "disk"
at = [0.1, 0.0, -0.5]
[markers.wall]
body = "ground"
at = [1.0, 2.0, 3.0]
[thermal.bearing]
capacity = 50.0
temperature = 320.0
"""


@pytest.fixture
def followers():
    return scene_of_text(FOLLOWERS)


def same(found, expected):
    return largest(np.asarray(found) - expected, initial=0.0) <= ROUNDING * (1.0 + largest(expected, initial=0.0))


def agrees(model, state, of=None):
    """Whether views, over joint coordinates and over states by path, read in a state what the dynamics say of it."""
    of = state if of is None else of
    for view in (model.view(of), Names(model.scene).view(model.states(of))):
        for name in model.scene.joints:
            joint = view.joints[name]
            if not (same(joint.coordinate, state.coordinates[name]) and same(joint.rate, state.rates[name])):
                return False
        for name, body in model.bodies(state).items():
            read = view.bodies[name]
            if not (same(read.position, body.position) and same(read.twist, body.twist)):
                return False
    return True


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_names_read_what_the_dynamics_say(path):
    model = ephs.dynamics(ephs.load(path))
    assert agrees(model, model.state0)
    assert not agrees(model, model.state0, of=model.step(model.state0, 0.01))


@settings(max_examples=12)
@given(moving())
def test_names_read_what_the_dynamics_say_in_any_motion(found):
    _, model, state, _ = found
    assert agrees(model, state)


def test_names_read_what_solutions_say(followers):
    """Bodies without mass, free bodies, markers and thermal nodes included; by an input, by an event."""
    seen = {}

    def look(t, state):
        seen[t] = {
            "pin": np.concatenate([state.joints.pin.coordinate, state.joints.pin.rate]),
            "wrist": np.concatenate([state.joints["wrist"].coordinate, state.joints["wrist"].rate]),
            "comet": np.concatenate([state.joints.comet.coordinate, state.joints.comet.rate]),
            "link": np.concatenate([state.bodies.link.position, state.bodies.link.velocity]),
            "turn": state.bodies.link.angular_velocity,
            "tip": np.concatenate([state.markers.tip.position, state.markers.tip.velocity]),
            "wall": state.markers.wall.position,
            "bearing": np.array([state.thermal.bearing.temperature, state.thermal.bearing.entropy]),
        }
        return 1.0

    push = {"joints.pin": lambda t, state: 0.1 * look(t, state)}
    sol = ephs.simulate(followers, 0.3, method="rk87", events=[look], inputs=push)
    for i, t in enumerate(sol.t):
        read = seen[float(t)]
        for name in ("pin", "wrist", "comet"):
            of = sol.joint(name)
            assert same(read[name], np.concatenate([of.coordinate[i], of.rate[i]])), name
        link, tip, node = sol.body("link"), sol.marker("tip"), sol.thermal("bearing")
        assert same(read["link"], np.concatenate([link.position[i], link.velocity[i]]))
        assert same(read["turn"], link.angular_velocity[i])
        assert same(read["tip"], np.concatenate([tip.position[i], tip.velocity[i]]))
        assert same(read["wall"], sol.marker("wall").position[i])
        assert same(read["bearing"], np.array([node.temperature[i], node.entropy[i]]))


def test_what_is_not_there_is_named_with_what_is_near(followers):
    view = Names(followers).view({})
    assert list(view.joints) == ["pin", "elbow", "wrist", "comet"]
    assert list(view.bodies) == list(followers.bodies)
    with pytest.raises(AttributeError, match=r"no joints\.writs; there are: .*; did you mean 'wrist'"):
        view.joints.writs  # noqa: B018
    with pytest.raises(KeyError, match=r"no bodies\.arm"):
        view.bodies["arm"]


def test_one_input_for_many_joints_is_one_input_for_each(followers):
    names = ("joints.pin", "joints.wrist", "markers.tip")
    calls, single = [], []

    def all_of_them(t, state):
        calls.append(t)
        rates = [state.joints.pin.rate, state.joints.wrist.rate]
        return -np.concatenate([*rates, 0.2 * state.markers.tip.velocity])

    def of_the_pin(t, state):
        single.append(t)
        return -state.joints.pin.rate

    own = {
        "joints.pin": of_the_pin,
        "joints.wrist": lambda t, state: -state.joints.wrist.rate,
        "markers.tip": lambda t, state: -0.2 * state.markers.tip.velocity,
    }
    one, other = (
        ephs.simulate(followers, 0.2, method="rk87", step=0.02, audit="off", inputs=given).states
        for given in ({names: all_of_them}, own)
    )
    for path, values in one.items():
        assert np.array_equal(values, other[path]), path
    assert len(calls) <= len(single)  # evaluated once for all three
    with pytest.raises(AssemblyError, match="writs"):
        ephs.simulate(followers, 0.1, inputs={("joints.pin", "joints.writs"): [0.0, 0.0]})
    with pytest.raises(ephs.SimulationError, match="2 are wanted"):
        ephs.simulate(followers, 0.1, inputs={("joints.pin", "joints.wrist"): lambda t: [0.0]})
