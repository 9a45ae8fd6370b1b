"""Discretising commutes with composing for gradients of one storage alone; what does not commute fails as measured."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import quantity as Q
from ephs.operad import Path
from ephs.semantics import Reference
from ephs.semantics.meaning.step import solved as solve
from ephs.semantics.primitives.behaviour import GRADIENTS, NaturalBehaviour
from ephs.semantics.systems.laws import random_probe
from ephs.testing import systems
from tests.numerics import EPS, largest
from tests.oscillator import rubbed_oscillator

REFERENCE = Reference()
K, CUBIC, M, D = 1.0, 2.0, 1.3, 0.4
ROUNDING = EPS

DUFFING = rubbed_oscillator(
    m=M, d=D, pe=ephs.storage({"q": Q.displacement}, lambda q: 0.5 * K * q**2 + 0.25 * CUBIC * q**4)
)
START = np.array([1.0, 0.5])


@pytest.mark.parametrize("gradient", GRADIENTS)
@settings(max_examples=4)
@given(system=systems(max_depth=2, max_junctions=2), seed=st.integers(0, 2**16))
def test_flatten_then_discretise_is_discretise_then_compose(gradient, system, seed):
    probe = random_probe(system, seed)
    behaviour = NaturalBehaviour(probe.reference, probe.h, GRADIENTS[gradient])
    flat, nested = (solve(each, probe.state, behaviour, probe.inputs) for each in (system.flatten(), system))
    if max(flat.residual, nested.residual) > 1e-6:
        return  # a random state may contradict a constraint: then there is no step
    scale = max([1.0, *(float(largest(w, initial=0.0)) for w in flat.rates.values())])
    for path, rate in flat.rates.items():
        # two Newton iterations in different unknowns: condition 10⁴ times the rounding of an evaluation
        allowed = 1e4 * 8.0 * ROUNDING * scale + flat.rounding + nested.rounding
        assert largest(rate - nested.rates[path], initial=0.0) <= allowed


def duffing(x):
    """The equations after all interface variables are eliminated."""
    return np.array([x[1] / M, -K * x[0] - CUBIC * x[0] ** 3 - D * x[1] / M])


def midpoint(f, x0, h):
    """One step of the midpoint rule on the whole."""
    x = x0
    for _ in range(100):  # a contraction by h
        x = x0 + h * f(0.5 * (x0 + x))
    return x


def composed(h, gradient):
    """One step of the parts, each discretised on its own."""
    state = {Path.of("pe.q"): START[:1], Path.of("ke.p"): START[1:], Path.of("env.s"): np.zeros(1)}
    solved = solve(DUFFING, state, NaturalBehaviour(REFERENCE, h, GRADIENTS[gradient]), {})
    return START + h * np.concatenate([solved.rates[Path.of("pe.q")], solved.rates[Path.of("ke.p")]])


@pytest.mark.parametrize("h", [0.1, 0.05, 0.025])
def test_the_midpoint_rule_may_be_applied_before_or_after_elimination(h):
    assert largest(composed(h, "midpoint") - midpoint(duffing, START, h)) <= 1e-15


def test_the_average_gradient_of_the_parts_is_that_of_the_whole():
    """As it is linear in the energy; the parts' own gradients give the rise of the whole, too."""
    v, parts = np.array([0.5, -0.8]), dict(DUFFING.leaves())

    def of_parts(name):
        pairs = ((parts[Path.of("pe")], "q", 0), (parts[Path.of("ke")], "p", 1))
        found = [
            GRADIENTS[name](part, {Path.of(port): START[i : i + 1]}, v[i : i + 1], REFERENCE) for part, port, i in pairs
        ]
        return np.concatenate(found)

    def energy(x):
        return 0.5 * K * x[0] ** 2 + 0.25 * CUBIC * x[0] ** 4 + 0.5 * x[1] ** 2 / M

    assert of_parts("own") @ v == pytest.approx(energy(START + v) - energy(START), rel=1e-14)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    points = (START + 0.5 * (1.0 + s) * v for s in nodes)
    average = sum(
        0.5 * w * np.array([K * x[0] + CUBIC * x[0] ** 3, x[1] / M]) for w, x in zip(weights, points, strict=True)
    )
    assert largest(average - of_parts("average")) <= 4.0 * ROUNDING * largest(average)
