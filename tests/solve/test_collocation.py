"""Polynomials through stages: values and integrals of all powers that they can have, for any nodes."""

import numpy as np
import pytest

from ephs.solve.methods.collocation import moments, radau, values
from tests.numerics import largest

STAGES = (3, 5, 7)
SETS = {
    **{f"radau, {stages} stages": radau(stages).nodes for stages in STAGES},
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
    assert largest(moments(nodes, nodes) - [moments(nodes, node) for node in nodes]) <= 1e-12


@pytest.mark.parametrize("stages", STAGES)
def test_the_coefficients_of_radau_have_their_order_and_fall_apart(stages):
    """B(2s − 1) and not B(2s); C(s); the embedded method has order s; eigenvalues lie right of the axis (A-stable)."""
    scheme = radau(stages)
    nodes, a = scheme.nodes, scheme.coefficients
    missed = [a[-1] @ nodes**k - 1.0 / (k + 1) for k in range(2 * stages)]
    assert largest(missed[:-1]) <= 1e-14 and abs(missed[-1]) > 1e-9
    for k in range(stages):
        assert largest(a @ nodes**k - nodes ** (k + 1) / (k + 1)) <= 1e-14
        embedded = (scheme.gamma if k == 0 else 0.0) + (a[-1] + scheme.defect) @ nodes**k
        assert embedded == pytest.approx(1.0 / (k + 1), abs=1e-13)
    assert scheme.values[0] == scheme.gamma and all(value.real > 0.0 for value in scheme.values)
    assert len(scheme.values) == (stages + 1) // 2 and all(value.imag > 0.0 for value in scheme.values[1:])
    assert largest(np.real(scheme.back @ np.diag(scheme.values) @ scheme.into) - a) <= 1e-13
    line = np.outer(nodes, np.arange(2.0))  # of the polynomial through the stages, a step twice as long goes on
    assert np.allclose(scheme.ahead(2.0) @ line, line * 2.0 + np.arange(2.0), atol=1e-12)


def test_the_coefficients_with_three_stages_are_those_of_the_book():
    """Hairer and Wanner, IV.5 and IV.8."""
    root, scheme = 6.0**0.5, radau(3)
    assert largest(scheme.nodes - [(4 - root) / 10, (4 + root) / 10, 1.0]) <= 1e-15
    assert np.allclose(scheme.coefficients[-1], [(16 - root) / 36, (16 + root) / 36, 1 / 9], atol=1e-14)
    first = [(88 - 7 * root) / 360, (296 - 169 * root) / 1800, (-2 + 3 * root) / 225]
    assert np.allclose(scheme.coefficients[0], first, atol=1e-14)
    assert pytest.approx((6.0 + 81.0 ** (1 / 3) - 9.0 ** (1 / 3)) / 30.0) == scheme.gamma
