"""Gradients by steps taken back are those of tangents carried forward, and of a complex step."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.methods.explicit import tableau
from ephs.mechanics.sensitivity import explicit
from ephs.mechanics.sensitivity.family import ParameterFamily
from ephs.mechanics.tree.engine.tangents import StepTangent
from ephs.solve.posing.errors import OptionError
from tests.mechanics.tree.machines import gas_spring_on_slider_crank, motor_on_four_bar
from tests.numerics import largest
from tests.scenes import shipped
from tests.solve.test_own_methods import Kutta
from tests.written import scene_of_text

NEAR = 1e-12
"""Part of the largest derivative: both ways round the same derivatives of some thousand operations a step."""
READ = 1e-9
"""The same of readings that are differenced along tangents."""
PATHS = ["bodies.coupler.mass", "bodies.rocker.inertia[2]", "joints.main.friction", "joints.main.drive",
         "joints.knee.frame1.position[0]", "joints.main.coordinate", "joints.main.rate"]  # fmt: skip
TIMES = [0.08, 0.16]
STEPS = {"rk54": 0.02, "rk87": 0.08, Kutta(): 0.02}
WEIGHTS = {"joints.main.coordinate": [0.0, 1.0], "joints.main.rate": [-0.3, 0.7]}
STRIKING = """
format = 1
name = "striking"
[world]
gravity = [0.0, 0.0, -9.81]
[bodies.carriage]
mass = 1.0
inertia = [0.01, 0.01, 0.01]
position = [0.0, 0.0, 0.12]
[bodies.ball]
mass = 2.0
inertia = [8e-3, 8e-3, 8e-3]
position = [0.0, 0.0, 0.12]
[joints.slide]
type = "prismatic"
bodies = ["ground", "carriage"]
at = [0.0, 0.0, 0.12]
axis = [1.0, 0.0, 0.0]
coordinate = 0.0
rate = 0.3
[joints.fall]
type = "prismatic"
bodies = ["carriage", "ball"]
at = [0.0, 0.0, 0.12]
axis = [0.0, 0.0, 1.0]
coordinate = 0.0
rate = -0.2
[surfaces.ball]
body = "ball"
shape = { sphere = 0.1 }
stiffness = 1e4
exponent = 1.5
loss = 0.2
friction = 0.3
slip = 1e-2
[surfaces.floor]
body = "ground"
shape = { plane = {} }
"""


def backwards(method, paths=PATHS):
    scene = shipped("four-bar")
    return ephs.gradient(scene, paths, TIMES, WEIGHTS, method=method, step=STEPS[method])


def forwards(scene, paths, times, weights, method, step):
    """The same by tangents carried forward: what elements and rates are by the parameters."""
    family = ParameterFamily(scene, paths, None, None, None, joints=True)
    along = explicit.ExplicitTangent(family, 0.0, tableau(method, chosen=False))
    point, layout, found = along.start(), along.equations.layout, np.zeros(len(paths))
    for k in range(round(times[-1] / step)):
        point = along.step(point, step)
        for place in np.flatnonzero(np.isclose(times, (k + 1) * step)):
            for name, given in weights.items():
                joint, key = name.split(".")[1:]
                read = point.q[:, layout.elements[joint]] if key == "coordinate" else point.y[:, layout.freedoms[joint]]
                found += given[place] * read[:, 0]
    return found


@pytest.mark.parametrize("method", STEPS, ids=str)
def test_steps_with_loops_friction_and_the_balance_kept_as_tangents_say(method, monkeypatch):
    scene = shipped("four-bar")
    found, expected = backwards(method), forwards(scene, PATHS, TIMES, WEIGHTS, method, STEPS[method])
    scale = largest(expected)
    assert largest(np.array([found.derivatives[path] for path in PATHS]) - expected) <= NEAR * scale
    monkeypatch.setattr(explicit, "StepTangent", lambda *given, corrected: StepTangent(*given, corrected=False))
    plain = backwards(method)
    apart = largest(np.array([plain.derivatives[path] for path in PATHS]) - expected)
    assert apart > 10.0 * NEAR * scale, "steps without the correction have other derivatives"


@pytest.mark.parametrize(
    ("machine", "paths", "joint"),
    [
        (motor_on_four_bar, ["coil.l", "copper.r", "rotor.j", "fan.h"], "linkage.joints.main"),
        (gas_spring_on_slider_crank, ["gas.c", "damper.d", "piston.a"], "engine.joints.bearing"),
    ],
)
def test_systems_with_what_is_attached_as_tangents_say(machine, paths, joint):
    """Circuits, gases and heat are taken back, too."""
    system, initial, inputs = machine()[:3]
    run = {"initial": initial, "inputs": inputs, "method": "rk87", "step": 0.005}
    along = ephs.sensitivity(system, paths, 0.02, **run)
    expected = along.of(lambda sol: sol.joint(joint).coordinate[-1, 0] - 0.4 * sol.joint(joint).rate[-1, 0])
    found = ephs.gradient(system, paths, [0.02], {f"{joint}.coordinate": [1.0], f"{joint}.rate": [-0.4]}, **run)
    mine = np.array([found.derivatives[path] for path in paths])
    assert largest(mine - expected) <= READ * largest(expected)


def test_through_a_contact_that_slips_as_tangents_say():
    """A ball on a slide strikes a floor that moves past it: the force is a power of a depth that was none."""
    scene = scene_of_text(STRIKING)
    paths = ["bodies.ball.mass", "bodies.carriage.mass", "world.gravity[2]", "joints.fall.coordinate",
             "joints.slide.rate"]  # fmt: skip
    weights = {"joints.fall.rate": [0.4, 1.0], "joints.slide.rate": [0.0, -2.0]}
    times, step = [0.05, 0.15], 0.005
    found = ephs.gradient(scene, paths, times, weights, method="rk54", step=step)
    expected = forwards(scene, paths, times, weights, "rk54", step)
    assert np.all(np.abs(expected) > 0.0), "it strikes, and slips"
    mine = np.array([found.derivatives[path] for path in paths])
    assert largest(mine - expected) <= NEAR * largest(expected)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"method": "natural"}, "rk54, rk87 or an ephs.Method"),
        ({"times": [0.2, 0.1]}, "ascending"),
        ({"parameters": []}, "at least one"),
        ({"weights": {"bodies.coupler.position": [1.0]}}, "joint of the tree"),
        ({"weights": {"joints.main.coordinate": [1.0, 2.0, 3.0]}}, "(2, 1)"),
        ({"weights": {"joints.main.coordinate": [1.0, np.nan]}}, "finite numbers"),
        ({"inputs": {"joints.main": lambda t: [t]}}, "functions of time"),
    ],
)
def test_gradients_refuse(change, says):
    scene = shipped("four-bar")
    given = {"model": scene, "parameters": PATHS[:1], "times": TIMES, "weights": WEIGHTS} | change
    with pytest.raises(OptionError) as raised:
        ephs.gradient(**given)
    assert says in str(raised.value)
