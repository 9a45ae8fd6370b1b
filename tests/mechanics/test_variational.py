"""The variational formulation as an oracle: the same motion from an action, without patterns, ports or adjoints."""

import numpy as np
import pytest
from hypothesis import given, settings

from ephs.semantics import Reference
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import rotation_log
from ephs.solve.equations.instant import instant
from tests.mechanics.mechanisms import GRAVITY, TwoBodies, kinds
from tests.numerics import jacobian, largest, seeds, slope

few = settings(max_examples=10)


def solved(two):
    """Rates and multipliers of the composed system at its state."""
    descriptor = two.system.descriptor()
    state = two.system.state(two.state)
    return instant(descriptor, Reference(), descriptor.pack(state))


@pytest.mark.parametrize("kind", kinds())
@few
@given(seed=seeds)
def test_velocities_stay_on_the_constraint(kind, seed):
    """C u̇ + Ċ u = 0, with Ċ from differences of the poses' own rows."""
    two = TwoBodies.draw(kind, seed)
    now = solved(two)
    rates = {str(path): rate for path, rate in now.rates.items()}
    accelerations = [np.linalg.solve(m, rates[f"body{i + 1}.ke.p"]) for i, m in enumerate(two.metric)]

    def slack(t):
        x = two.of.manifold.retract(two.x, t * two.u_r)
        first = SE3.adjoint(SE3.inverse(SE3.compose(two.offsets[0], two.of.include(x))))
        moved = first @ (two.u1 + t * accelerations[0]) - two.to_c2 @ (two.u2 + t * accelerations[1])
        outside = np.eye(6) - two.of.basis @ np.linalg.pinv(two.of.basis)
        return outside @ moved

    change = slope(slack, 2e-4, 1)
    assert largest(change) <= 1e-8 * max(1.0, *(largest(a) for a in accelerations))


@pytest.mark.parametrize("kind", kinds())
@pytest.mark.parametrize("seed", [1, 2])
def test_an_independent_lagrangian_gives_the_same_accelerations(kind, seed):
    """L(z, ż) = T − V from poses alone, in minimal coordinates; Euler and Lagrange by differences.

    Neither ad nor C occurs in it: signs in gyroscopic forces, offsets and constraints are all caught at once.
    """
    two = TwoBodies.draw(kind, seed)
    now = solved(two)
    acceleration = np.linalg.solve(two.metric[0], dict((str(p), r) for p, r in now.rates.items())["body1.ke.p"])
    n = 6 + two.of.dim
    rate = np.concatenate([two.u1, two.u_r])

    def poses(z):
        q1, q2, x = two.coordinates_from(z[:6], z[6:])
        return (q1, q2), x

    def lagrangian(z, w):
        """Kinetic energy from the change of the poses along w, potential energies from the poses."""
        h = 2e-3
        value = 0.0
        ahead, behind = poses(z + h * w)[0], poses(z - h * w)[0]
        further, before = poses(z + 2 * h * w)[0], poses(z - 2 * h * w)[0]
        here, x = poses(z)
        for i in range(2):
            # twist = d/dt log(q(0)⁻¹ q(t)) at 0, by differences of sixth order in effect through oddness
            near = 0.5 * (_increment(here[i], ahead[i]) - _increment(here[i], behind[i]))
            far = 0.5 * (_increment(here[i], further[i]) - _increment(here[i], before[i]))
            u = (8.0 * near - far) / (6.0 * h)
            value += 0.5 * u @ two.metric[i] @ u + two.masses[i] * GRAVITY @ here[i][4:]
        return value - 0.5 * float(two.stiffness @ _square(two, x))

    d = 8e-3
    eye = np.eye(n)

    # L is quadratic in ż up to the rounding of differences: second differences in ż are exact
    zero = np.zeros(n)
    mass = np.array(
        [
            [lagrangian(zero, a + b) - lagrangian(zero, a) - lagrangian(zero, b) + lagrangian(zero, zero) for b in eye]
            for a in eye
        ]
    )

    def momentum(z):
        return np.array([0.5 * (lagrangian(z, rate + e) - lagrangian(z, rate - e)) for e in eye])

    # ṗ along ż less ∂L/∂z plus friction = 0
    drift = slope(lambda t: momentum(t * rate), d, 1)
    force = jacobian(lambda z: lagrangian(z, rate), n, d, 1)
    friction = np.concatenate([np.zeros(6), two.mu @ two.u_r])
    found = np.linalg.solve(mass, force - drift - friction)
    # at the origin of exponential coordinates u̇ = z̈
    assert largest(found[:6] - acceleration) <= 2e-5 * max(1.0, largest(acceleration))


def _increment(here, there):
    return SE3.log(SE3.compose(SE3.inverse(here), there))


def _square(two, x):
    if two.of.name == "spherical":
        return rotation_log(x) ** 2
    return x * x
