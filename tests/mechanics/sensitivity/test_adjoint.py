"""Gradients by steps taken back are those of tangents carried forward, and of a complex step."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.methods.explicit import tableau
from ephs.mechanics.sensitivity import explicit
from ephs.mechanics.sensitivity.family import ParameterFamily
from ephs.mechanics.tree.engine.tangents import StepTangent
from ephs.solve.posing.errors import OptionError
from tests.mechanics.sensitivity.test_sensitivity import WOUND
from tests.mechanics.tree.machines import gas_spring_on_slider_crank, motor_on_four_bar
from tests.numerics import largest
from tests.scenes import shipped
from tests.solve.test_own_methods import Kutta
from tests.written import scene_of_text

NEAR = 1e-12
"""Part of the largest derivative: both ways round the same derivatives of some thousand operations a step."""
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


def forwards(model, paths, times, weights, method, step, **given):
    """The same by tangents carried forward: what elements and rates are by the parameters."""
    family = ParameterFamily(model, paths, given.get("initial"), given.get("inputs"), None, joints=True)
    along = explicit.ExplicitTangent(family, 0.0, tableau(method, chosen=False))
    point, layout, found = along.start(), along.equations.layout, np.zeros(len(paths))
    for k in range(round(times[-1] / step)):
        point = along.step(point, step)
        for place in np.flatnonzero(np.isclose(times, (k + 1) * step)):
            for name, weight in weights.items():
                path, _, key = name.rpartition(".")
                joint = path if path in layout.freedoms else path.removeprefix("joints.")
                read = point.q[:, layout.elements[joint]] if key == "coordinate" else point.y[:, layout.freedoms[joint]]
                found += weight[place] * read[:, 0]
    return found


def of_system(machine, paths, joint):
    """A machine with what is attached: circuits, gases and heat are taken back, too."""
    system, initial, inputs = machine()[:3]
    weights = {f"{joint}.coordinate": [1.0], f"{joint}.rate": [-0.4]}
    return (system, paths, [0.02], weights, "rk87", 0.005), {"initial": initial, "inputs": inputs}


def striking():
    """A ball on a slide strikes a floor that moves past it: the force is a power of a depth that was none."""
    paths = ["bodies.ball.mass", "bodies.carriage.mass", "world.gravity[2]", "joints.fall.coordinate",
             "joints.slide.rate"]  # fmt: skip
    weights = {"joints.fall.rate": [0.4, 1.0], "joints.slide.rate": [0.0, -2.0]}
    return (scene_of_text(STRIKING), paths, [0.05, 0.15], weights, "rk54", 0.005), {}


def wound():
    """A motor whose current follows from a balance."""
    paths = ["motors.m.resistance", "motors.m.constant", "motors.m.voltage", "bodies.arm.mass"]
    return (scene_of_text(WOUND), paths, [0.1], {"joints.pin.coordinate": [1.0]}, "rk87", 0.02), {}


def four_bar(method):
    """Loops and friction."""
    return (shipped("four-bar"), PATHS, TIMES, WEIGHTS, method, STEPS[method]), {}


MOTOR = ["coil.l", "copper.r", "rotor.j", "fan.h"], "linkage.joints.main"
GAS = ["gas.c", "damper.d", "piston.a"], "engine.joints.bearing"
TAKEN_BACK = {
    **{f"four-bar by {method}": lambda method=method: four_bar(method) for method in STEPS},
    "motor": lambda: of_system(motor_on_four_bar, *MOTOR),
    "gas": lambda: of_system(gas_spring_on_slider_crank, *GAS), "strikes": striking, "wound": wound,
}  # fmt: skip


SHORT = ("motor", "gas", "wound")


@pytest.mark.parametrize(
    "case", [pytest.param(name, marks=[pytest.mark.long] * (name not in SHORT)) for name in TAKEN_BACK]
)
def test_steps_taken_back_are_tangents_carried_forward(case, monkeypatch):
    """With the balance kept: steps without its correction have other derivatives."""
    (model, paths, times, weights, method, step), given = TAKEN_BACK[case]()
    expected = forwards(model, paths, times, weights, method, step, **given)
    assert np.all(np.abs(expected) > 0.0), "all of them act"

    def off():
        found = ephs.gradient(model, paths, times, weights, method=method, step=step, **given)
        return largest(np.array([found.derivatives[path] for path in paths]) - expected) / largest(expected)

    assert off() <= NEAR
    monkeypatch.setattr(explicit, "StepTangent", lambda *given, corrected: StepTangent(*given, corrected=False))
    assert not case.startswith("four-bar") or off() > 10.0 * NEAR


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"method": "natural"}, "rk54, rk87 or an ephs.Method"),
        ({"times": [0.2, 0.1]}, "ascending"),
        ({"t0": "x"}, "number"),
        ({"parameters": []}, "one path or several"),
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
