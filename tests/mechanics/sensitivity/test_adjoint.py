"""Gradients by steps taken back are those of tangents carried forward, and of a complex step."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.sensitivity import explicit
from ephs.mechanics.tree.engine.tangents import StepTangent
from ephs.solve.errors import OptionError
from tests.mechanics.sensitivity.test_exact import PENDULUM, pendulum

NEAR = 1e-11
"""Part of the largest derivative: both ways round the same derivatives of some thousand operations a step."""
PATHS = ["bodies.coupler.mass", "bodies.rocker.inertia[2]", "joints.main.friction", "joints.main.drive",
         "joints.knee.frame1.position[0]", "joints.main.coordinate", "joints.main.rate"]  # fmt: skip
TIMES = [0.08, 0.16]
STEPS = {"rk54": 0.02, "rk87": 0.08}
WEIGHTS = {"joints.main.coordinate": [0.0, 1.0], "joints.main.rate": [-0.3, 0.7]}


def backwards(method, paths=PATHS):
    scene = ephs.load("scenes/four-bar.toml")
    return ephs.gradient(scene, paths, TIMES, WEIGHTS, method=method, step=STEPS[method])


def forwards(method):
    found = ephs.sensitivity(ephs.load("scenes/four-bar.toml"), PATHS, TIMES[-1], method=method, step=STEPS[method])
    places = [int(np.argmin(np.abs(found.t - t))) for t in TIMES]
    return sum(np.asarray(w) @ found[name][places, 0] for name, w in WEIGHTS.items())


@pytest.mark.parametrize("method", ["rk54", "rk87"])
def test_steps_with_loops_friction_and_the_balance_kept_as_tangents_say(method, monkeypatch):
    found, expected = backwards(method), forwards(method)
    scale = np.abs(expected).max()
    assert np.abs(np.array([found.derivatives[path] for path in PATHS]) - expected).max() <= NEAR * scale
    monkeypatch.setattr(explicit, "StepTangent", lambda *given, corrected: StepTangent(*given, corrected=False))
    plain = backwards(method)
    apart = np.abs(np.array([plain.derivatives[path] for path in PATHS]) - expected).max()
    assert apart > 10.0 * NEAR * scale, "steps without the correction have other derivatives"


def test_a_pendulum_as_a_complex_step_says(tmp_path, monkeypatch):
    """Of the method's plain steps: f(x + i ε)/ε has no difference in which digits cancel."""
    monkeypatch.setattr(explicit, "StepTangent", lambda *given, corrected: StepTangent(*given, corrected=False))
    file = tmp_path / "pendulum.toml"
    file.write_text(PENDULUM)
    scene = ephs.load(file).with_state({"pin": 0.6}, {"pin": 1.1})
    values = np.array([2.0, 0.3, 0.7, 0.2, 1.5, 9.81, 0.6, 1.1])
    paths = ["bodies.rod.mass", "bodies.rod.inertia[2]", "joints.pin.frame2.position[1]", "joints.pin.friction",
             "joints.pin.stiffness", "world.gravity[1]", "joints.pin.coordinate", "joints.pin.rate"]  # fmt: skip
    weights = {"joints.pin.coordinate": [2.0], "joints.pin.rate": [-0.5]}
    found = ephs.gradient(scene, paths, [0.4], weights, method="rk54", step=0.05)
    steps = [pendulum(values + 1e-40j * unit, "rk54", 0.05, 8) for unit in np.eye(len(values))]
    expected = np.array([2.0 * y[0] - 0.5 * y[1] for y in steps])
    assert found.value == pytest.approx(expected[0].real, rel=1e-12)
    slopes = expected.imag / 1e-40
    slopes[5] = -slopes[5]  # gravity points downwards
    mine = np.array([found.derivatives[path] for path in paths])
    assert np.abs(mine - slopes).max() <= 1e-12 * np.abs(slopes).max()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"method": "natural"}, "rk54 or rk87"),
        ({"times": [0.2, 0.1]}, "ascending"),
        ({"parameters": []}, "at least one"),
        ({"weights": {"bodies.coupler.position": [1.0]}}, "joint of the tree"),
        ({"weights": {"joints.main.coordinate": [1.0, 2.0, 3.0]}}, "(2, 1)"),
        ({"inputs": {"joints.main": lambda t: [t]}}, "functions of time"),
    ],
)
def test_gradients_refuse(change, says):
    given = {"parameters": PATHS[:1], "times": TIMES, "weights": WEIGHTS} | change
    with pytest.raises(OptionError) as raised:
        ephs.gradient(ephs.load("scenes/four-bar.toml"), **given)
    assert says in str(raised.value)
