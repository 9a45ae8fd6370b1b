"""Derivatives of runs in PyTorch and JAX, by the frameworks' own checks: `make learning`."""

from pathlib import Path

import jax
import numpy as np
import pytest
import torch
from jax.test_util import check_grads
from torch.autograd.gradcheck import GradcheckError

import ephs
from ephs.exporting.errors import ExportError
from ephs.exporting.response import jax_function, response, torch_function

ROOT = Path(__file__).resolve().parents[1]
jax.config.update("jax_enable_x64", True)


@pytest.fixture(scope="module")
def four_bar():
    scene = ephs.load(ROOT / "scenes/four-bar.toml")
    paths = ["bodies.coupler.mass", "joints.main.friction"]
    return response(scene, paths, ["joints.main.coordinate", "heat"], 0.1, method="rk87", step=0.01)


def test_torch_finds_its_own_differences(four_bar):
    values = torch.tensor(four_bar.start, requires_grad=True)
    assert torch.autograd.gradcheck(torch_function(four_bar), (values,), eps=1e-4, atol=1e-7)


def test_jax_finds_its_own_differences(four_bar):
    function = jax_function(four_bar)
    check_grads(function, (four_bar.start,), order=1, modes=("fwd", "rev"), eps=1e-4, atol=1e-7, rtol=1e-6)


def test_both_give_the_response_and_its_derivatives(four_bar):
    found, slopes = four_bar.linearised(four_bar.start)
    function = jax_function(four_bar)
    assert np.array_equal(jax.jit(function)(four_bar.start), found)
    assert np.allclose(jax.jacrev(function)(four_bar.start), slopes, rtol=1e-14, atol=0.0)
    assert np.allclose(jax.jacfwd(function)(four_bar.start), slopes, rtol=1e-14, atol=0.0)
    several = jax.vmap(function)(np.stack([four_bar.start, 1.1 * four_bar.start]))
    assert np.array_equal(several[1], four_bar(1.1 * four_bar.start))
    values = torch.tensor(four_bar.start, requires_grad=True)
    readings = torch_function(four_bar)(values)
    assert np.array_equal(readings.detach().numpy(), found)
    readings.sum().backward()
    assert np.allclose(values.grad.numpy(), slopes.sum(axis=0), rtol=1e-14, atol=0.0)


def test_a_wrong_derivative_is_found(four_bar):
    """The control: with slopes that are off by a thousandth both checks fail."""
    exact = type(four_bar).linearised

    def off(self, values):
        found, slopes = exact(self, values)
        return found, 1.001 * slopes

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(type(four_bar), "linearised", off)
        values = torch.tensor(four_bar.start, requires_grad=True)
        with pytest.raises(GradcheckError):
            torch.autograd.gradcheck(torch_function(four_bar), (values,), eps=1e-4, atol=1e-7, rtol=1e-6)
        with pytest.raises(AssertionError):
            check_grads(jax_function(four_bar), (four_bar.start,), order=1, eps=1e-4, atol=1e-7, rtol=1e-6)


def test_single_precision_is_refused(four_bar):
    with pytest.raises(ExportError, match=r"float32; expected float64"):
        torch_function(four_bar)(torch.tensor(four_bar.start, dtype=torch.float32))
