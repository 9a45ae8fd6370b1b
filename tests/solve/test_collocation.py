"""Polynomials through stages: values and integrals of all powers that they can have, for any nodes."""

import numpy as np
import pytest

from ephs.solve.methods.collocation import moments, values
from ephs.solve.methods.radau import COEFFICIENTS, DEFECT, GAMMA, NODES, T_INVERSE, VALUES, T

SETS = {
    "radau": NODES,
    "gauss": 0.5 + np.array([-1.0, 0.0, 1.0]) * np.sqrt(0.15),
    "four": np.array([0.1, 0.4, 0.7, 1.2]),
}


@pytest.mark.parametrize("theta", [0.0, 0.3, 1.0, 1.7])
@pytest.mark.parametrize("name", SETS)
def test_powers_are_met(name, theta):
    nodes = SETS[name]
    for k in range(nodes.size):
        assert values(nodes, theta) @ nodes**k == pytest.approx(theta**k, abs=1e-12)
        assert moments(nodes, theta) @ nodes**k == pytest.approx(theta ** (k + 1) / (k + 1), abs=1e-12)


def test_the_coefficients_of_radau_are_those_of_the_book_and_their_eigenvalues_too():
    """Hairer and Wanner, IV.5 and IV.8."""
    root = 6.0**0.5
    assert np.allclose(COEFFICIENTS[-1], [(16 - root) / 36, (16 + root) / 36, 1 / 9], atol=1e-14)
    assert np.allclose(COEFFICIENTS[0], [(88 - 7 * root) / 360, (296 - 169 * root) / 1800, (-2 + 3 * root) / 225])
    assert pytest.approx((6.0 + 81.0 ** (1 / 3) - 9.0 ** (1 / 3)) / 30.0) == GAMMA
    assert np.allclose(T @ np.diag(VALUES) @ T_INVERSE, COEFFICIENTS, atol=1e-13)
    assert VALUES[0].imag == 0.0 and VALUES[1].imag > 0.0 and VALUES[2] == VALUES[1].conj()
    # the embedded method is of order 3: γ₀ of the rate at the start, and the weights with the defect
    for k in range(3):
        assert (GAMMA if k == 0 else 0.0) + (COEFFICIENTS[-1] + DEFECT) @ NODES**k == pytest.approx(1.0 / (k + 1))
