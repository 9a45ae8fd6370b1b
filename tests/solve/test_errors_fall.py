"""Errors fall with the tolerance: every method that chooses steps, against closed forms."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from benchmarks.hard.pushes import MASS, OMEGA, sprung
from ephs import quantity as Q
from ephs.mechanics.methods.registry import METHODS
from ephs.solve.posing import probe
from ephs.solve.posing.breakpoints import Breakpoints
from ephs.solve.posing.probe import WIDTH
from tests.numerics import largest
from tests.oscillator import free_oscillator, oscillator, rubbed_oscillator

MOST = 10.0
"""Error of a run in tolerances of a step: about as many steps as methods of high order take."""
KINKS = 100.0
"""The same where a push starts or ends in a step, at whose ends it is not smooth."""
ADAPTIVE = ["auto", *(name for name, method in METHODS.items() if method.adaptive)]
FLAT = [name for name in ADAPTIVE if name == "auto" or METHODS[name].systems]
TOLERANCES = {2: (1e-2, 1e-3, 1e-4), 3: (1e-4, 1e-5, 1e-6)}
"""By the order, of methods whose steps are too many at those of the others."""
USUAL = 1e-4, 1e-6, 1e-8
HARD, FAR = 10.0, 5.0
"""Of a wall: its steepness in 1/m, and the way to it in m."""
SPAN = 10.0
SCENE = sprung()


def pulse(t, width, middle, round_):
    """A push of an impulse of one, a triangle or a bell that ends."""
    x = 2.0 * abs(t - middle) / width
    return 0.0 if x >= 1.0 else (1.0 + np.cos(np.pi * x)) / width if round_ else 2.0 * (1.0 - x) / width


def swung(t, push, middle, width, omega):
    """Place at times of a mass of 1 kg at rest on a spring, pushed once: the integral of Duhamel by Gauss, in parts."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    out = np.zeros(t.size)
    for a in (middle - 0.5 * width, middle):
        for k in range(t.size):
            half = 0.5 * np.clip(t[k] - a, 0.0, 0.5 * width)
            at = a + half * (1.0 + nodes)
            out[k] += half * (weights * [push(s) for s in at]) @ np.sin(omega * (t[k] - at)) / omega
    return out


def wall(t):
    """Place of a mass of 1 kg that comes to a wall of energy exp(HARD q) from q = −FAR at 1 m/s, and leaves it."""
    energy = 0.5 + np.exp(-HARD * FAR)
    rate = 0.5 * HARD * np.sqrt(2.0 * energy)
    turn = np.arccosh(np.exp(0.5 * HARD * FAR) * np.sqrt(energy)) / rate
    return (np.log(energy) - 2.0 * np.logaddexp(rate * (t - turn), rate * (turn - t)) + 2.0 * np.log(2.0)) / HARD


def error(kind, method, rtol, width=0.05, middle=4.0, size=1.0, round_=True):
    """Largest error of places in a run, where places are about 1 m."""
    options = {"method": method, "rtol": rtol, "atol": rtol, "audit": "off"}
    push = partial(pulse, width=width, middle=middle, round_=round_)
    if kind == "pushed scene":
        given_ = {"joints.rail": lambda t: MASS * OMEGA * size * push(t)}
        run = ephs.simulate(SCENE, SPAN, inputs=given_, **options)
        return largest(run.joint("rail").coordinate[:, 0] - size * OMEGA * swung(run.t, push, middle, width, OMEGA))
    if kind == "pushed":
        run = ephs.simulate(oscillator(k=1.0), SPAN, inputs={"p": {"flow": lambda t: size * push(t)}}, **options)
        exact = size * swung(run.t, push, middle, width, 1.0)
    elif kind == "wall":
        system = free_oscillator(pe=ephs.storage({"q": Q.displacement}, lambda q: np.exp(HARD * q)))
        run = ephs.simulate(system, 2.0 * FAR, initial={"pe.q": -FAR, "ke.p": 1.0}, **options)
        exact = wall(run.t)
    elif kind == "free":
        run = ephs.simulate(free_oscillator(), SPAN, initial={"pe.q": 1.0}, **options)
        exact = np.cos(run.t)
    else:
        run = ephs.simulate(rubbed_oscillator(d=50.0), SPAN, initial={"pe.q": 1.0}, **options)
        slow, fast = -25.0 + np.sqrt(624.0), -25.0 - np.sqrt(624.0)
        exact = (slow * np.exp(fast * run.t) - fast * np.exp(slow * run.t)) / (slow - fast)
    return largest(run["pe.q"] - exact)


CASES = [(kind, name) for kind in ("free", "stiff", "wall", "pushed") for name in FLAT]
CASES += [("pushed scene", name) for name in ADAPTIVE]


@pytest.mark.parametrize(("kind", "method"), CASES)
@pytest.mark.filterwarnings("ignore::ephs.CostWarning")
def test_errors_fall_with_the_tolerance(kind, method):
    tolerances = TOLERANCES.get(8 if method == "auto" else METHODS[method].order, USUAL)
    errors = [error(kind, method, rtol) for rtol in tolerances]
    for rtol, found in zip(tolerances, errors, strict=True):
        assert found <= MOST * rtol
    for k in (1, 2):  # by a third of the digits at least, where the longer steps are no better than was wanted
        assert errors[k] <= max(errors[k - 1] * (tolerances[k] / tolerances[k - 1]) ** (1.0 / 3.0), tolerances[k])


@pytest.mark.filterwarnings("ignore::ephs.CostWarning")
@settings(max_examples=25)
@given(
    st.sampled_from(FLAT), st.floats(0.0, 5.7), st.floats(0.0, 1.0), st.sampled_from([-1.0, 1.0]), st.booleans()
)  # fmt: skip
def test_no_step_passes_over_a_pulse(method, wide, place, size, round_):
    """From as wide as the search to 300 times that, anywhere."""
    rtol, width = 1e-3 if method == "natural" else 1e-5, WIDTH * SPAN * np.exp(wide)
    middle = width + place * (SPAN - 2.0 * width)
    assert error("pushed", method, rtol, width, middle, size, round_) <= KINKS * rtol


def test_without_limits_steps_pass_over_a_pulse(monkeypatch):
    """The control: from rest, where no edge of it is found either."""
    monkeypatch.setattr(probe, "SHARP", np.inf)
    assert error("pushed", "natural4", 1e-5, 0.15) <= MOST * 1e-5
    monkeypatch.setattr(Breakpoints, "followed", lambda _self, _t, h: h)
    assert error("pushed", "natural4", 1e-5, 0.15) > 0.1
