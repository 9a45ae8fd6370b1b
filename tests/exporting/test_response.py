"""Readings of a motion as a function of a model's numbers: what PyTorch and JAX differentiate through."""

import sys

import numpy as np
import pytest

import ephs
from ephs.exporting.errors import ExportError
from ephs.exporting.response import jax_function, response, torch_function
from ephs.mechanics.scene.parameters import varied
from tests.numerics import largest
from tests.scenes import shipped

PATHS = ["bodies.coupler.mass", "joints.main.friction"]
NAMES = ["joints.main.coordinate", "bodies.coupler.position", "heat"]
TIMES = [0.05, 0.1]


@pytest.fixture(scope="module")
def four_bar():
    scene = shipped("four-bar")
    return response(scene, PATHS, NAMES, 0.1, method="rk87", step=0.01, save_at=TIMES)


def test_values_are_those_of_a_run(four_bar):
    numbers = four_bar.start * [1.1, 0.9]
    scene = varied(four_bar.model, dict(zip(PATHS, numbers, strict=True)))
    sol = ephs.simulate(scene, 0.1, method="rk87", step=0.01, save_at=TIMES)
    parts = sol.joint("main").coordinate, sol.body("coupler").position, sol.heat
    expected = np.concatenate([np.ravel(part) for part in parts])
    found = four_bar(numbers)
    assert found.shape == (four_bar.size,) == expected.shape
    assert largest(found - expected) <= 1e-12 * largest(expected)


def test_derivatives_are_those_that_differences_tend_to(four_bar):
    """Central differences err by the square of their distance: by a quarter of it where that is half."""
    _, slopes = four_bar.linearised(four_bar.start)
    for j, number in enumerate(four_bar.start):
        errors = []
        for e in (1e-2 * number, 5e-3 * number):
            ahead, behind = (four_bar(four_bar.start + s * e * np.eye(2)[j]) for s in (1.0, -1.0))
            errors.append(largest((ahead - behind) / (2.0 * e) - slopes[:, j]))
        assert errors[1] <= 0.26 * errors[0] + 1e-11 * largest(slopes) / 1e-2


def test_bad_input_is_named(four_bar):
    with pytest.raises(ExportError, match=r"numbers of shape \(3,\): expected \(2,\)"):
        four_bar([1.0, 2.0, 3.0])
    with pytest.raises(ephs.OptionError, match="nothing"):
        response(four_bar.model, PATHS, ["nothing"], 0.1, method="rk87", step=0.01)


@pytest.mark.parametrize(("function", "name"), [(torch_function, "torch"), (jax_function, "jax")])
def test_a_framework_that_is_missing_is_named(four_bar, function, name, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ExportError, match=f"not installed: pip install {name}"):
        function(four_bar)
