"""Systems without a link are the case of no links: the methods of mechanisms solve what is attached to nothing."""

import numpy as np
import pytest
from scipy.linalg import expm

import ephs
from ephs import Pattern
from ephs import library as lib
from ephs import quantity as Q
from ephs.mechanics.methods.registry import METHODS
from tests.oscillator import damped_oscillator

CHOOSING = [
    name
    for name, method in METHODS.items()
    if method.scenes and method.adaptive and name != "natural" and not method.posed
]
CONSTANT = [name for name, method in METHODS.items() if method.scenes and method.fixed and not method.posed]
MASS, STIFFNESS, DRAG, THETA = 2.0, 1.5, 0.3, 293.15
START = {"osc.pe.q": 1.0}
SWINGING = damped_oscillator(STIFFNESS, MASS, DRAG)


def swung(until, stiffness=STIFFNESS):
    """Displacement and momentum of the oscillator by the matrix exponential; complex stiffness is taken."""
    a = np.array([[0.0, 1.0 / MASS], [-stiffness, -DRAG / MASS]])
    return expm(until * a) @ np.array([1.0, 0.0])


@pytest.mark.parametrize("method", CHOOSING)
def test_an_oscillator_is_its_matrix_exponential(method):
    order = METHODS[method].order
    rtol = 1e-5 if order <= 2 else 1e-9
    sol = ephs.simulate(SWINGING, 1.0, method=method, initial=START, rtol=rtol, atol=rtol, audit="warn")
    q, p = swung(1.0)
    assert abs(sol["osc.pe.q"][-1] - q) + abs(sol["osc.ke.p"][-1] - p) <= 100.0 * rtol * len(sol) ** 0.5
    energy = 0.5 * STIFFNESS * q * q + 0.5 * p * p / MASS
    heat = THETA * (sol["env.s"][-1] - sol["env.s"][0])
    assert heat == pytest.approx(0.5 * STIFFNESS - energy, abs=100.0 * rtol * len(sol) ** 0.5)
    assert np.diff(sol["env.s"]).min() >= 0.0


@pytest.mark.parametrize("method", CONSTANT)
def test_constant_steps_have_their_order(method):
    """Half the step: 2 to the order less error, down to rounding."""
    q, p = swung(1.0)

    def missed(step):
        sol = ephs.simulate(SWINGING, 1.0, method=method, initial=START, step=step, audit="off")
        return abs(sol["osc.pe.q"][-1] - q) + abs(sol["osc.ke.p"][-1] - p)

    order, step = METHODS[method].order, 0.25 if METHODS[method].order >= 4 else 0.0625
    coarse, fine = missed(step), missed(0.5 * step)
    assert fine <= max(coarse / 2.0 ** (order - 0.5), 1e-12)


def test_a_derivative_is_that_of_the_exponential():
    """By a complex step, which shares no difference with the tangent."""
    found = ephs.sensitivity(SWINGING, ["osc.pe.k"], 1.0, method="rk87", step=0.05, initial=START)
    expected = swung(1.0, STIFFNESS + 1e-30j).imag / 1e-30
    for path, exact in zip(("osc.pe.q", "osc.ke.p"), expected, strict=True):
        assert found[path][-1, 0] == pytest.approx(exact, abs=1e-11)


def test_what_depends_on_each_other_is_refused_by_name():
    """Two inductors in series carry one current: their fluxes are no states of an explicit method."""
    series = ephs.transformer({"b": Q.flux_linkage, "c": Q.flux_linkage}, [[1]])
    pattern = Pattern.from_text("b: flux_linkage; c: flux_linkage; one(b); other(b=c); series(b, c)")
    system = pattern(one=lib.inductor(l=1.0), other=lib.inductor(l=2.0), series=series)
    with pytest.raises(ephs.OptionError, match=r"expected natural, natural4, radau: .* stores what other states"):
        ephs.simulate(system, 1.0, method="rk87", initial={"one.b": 1.0, "other.b": 2.0})


def test_what_only_reacts_is_measured_by_what_it_destroys():
    """Energy of a closed vessel stays: its exchange is the entropy that is made, at the temperature around."""
    pattern = Pattern.from_text("a: entropy; b: entropy; hot(s=a); cold(s=b); wall(s1=a, s2=b)")
    stores = {"hot": lib.thermal_capacity(c1=2e3, c2=5.0), "cold": lib.thermal_capacity(c1=2e3, c2=5.0)}
    system = pattern(**stores, wall=lib.heat_transfer(h=3.0))
    sol = ephs.simulate(system, 2.0, method="rk87", initial={"hot.s": 1.0, "cold.s": 0.0}, audit="fail")
    assert sol.ledgers.scale == pytest.approx(sol.ledgers.temperature * sol.ledgers.made[-1])
    assert sol.energy_error.max() < 1e-8


@pytest.mark.parametrize("apart", [1e-13, 1e-10, 1e-7])
@pytest.mark.parametrize("method", [name for name, method in METHODS.items() if not method.posed])
def test_nearly_equal_temperatures_make_what_the_square_of_their_difference_says(method, apart):
    """Two stores of C whose temperatures differ by a part δ make C/4 δ² (1 − exp(−4 h t/C)), as small as that is."""
    pattern = Pattern.from_text("a: entropy; b: entropy; warm(s=a); other(s=b); wall(s1=a, s2=b)")
    stores = {name: lib.thermal_capacity(c1=1500.0, c2=5.0) for name in ("warm", "other")}
    system, steps = pattern(**stores, wall=lib.heat_transfer(h=1.0)), {"step": 0.1} if METHODS[method].fixed else {}
    start = {"warm.s": 5.0 * np.log1p(apart)}
    sol = ephs.simulate(system, 5.0, method=method, initial=start, audit="off", **steps)
    made = 1.25 * apart**2 * -np.expm1(-4.0)
    assert sol.stats["least_production"] >= 0.0
    assert sol.ledgers.made[-1] == pytest.approx(made, rel=0.03)
    assert "entropy" not in [finding.law for finding in sol.audit.findings]
