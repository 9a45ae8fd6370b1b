"""Motions that are small beside what is stored, and none at all: rounding of the states is what remains, no error."""

import math

import numpy as np
import pytest

import ephs
from ephs import Pattern, library
from ephs.solve.auditing.audit import Bounds, audit
from examples.failing import scene, truss
from tests.numerics import EPS, largest
from tests.solve.test_audit import bent

METHODS = {
    "natural": 0.01, "natural4": 0.01, "variational": 0.01, "radau": 0.01, "rk54": 0.01, "rk87": 0.01,
    "auto": None,
}  # fmt: skip
MASS, SPIN, AWAY, HEIGHT, GRAVITY = 2.0, 0.02, 0.1, 0.3, 9.81


def screw(pitch):
    """A nut on an upright screw, its centre 0.1 m off the axis and 0.3 m up."""
    return scene(
        f"""
        [bodies.nut]
        mass = {MASS}
        inertia = [0.01, 0.01, {SPIN}]
        position = [{AWAY}, 0.0, {HEIGHT}]
        [joints.screw]
        type = "screw"
        bodies = ["ground", "nut"]
        at = [0.0, 0.0, 0.0]
        axis = [0.0, 0.0, 1.0]
        pitch = {pitch!r}
        """,
        f"[world]\ngravity = [0.0, 0.0, {-GRAVITY}]\n",
    )


@pytest.mark.parametrize("pitch", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("method", METHODS)
def test_a_fine_screw_falls_as_its_one_equation_says(method, pitch):
    """(J + m a² + m p²) α = −m g p. Its energies are known to the rounding of m g z, not of what it fell."""
    step = {"step": METHODS[method]} if METHODS[method] else {}
    sol = ephs.simulate(screw(pitch), 1.0, method=method, **step)
    exact = -MASS * GRAVITY * pitch / (SPIN + MASS * (AWAY**2 + pitch**2))
    rate, angle = sol.joint("screw").rate[:, 0], sol.joint("screw").coordinate[:, 0]
    assert largest(rate - exact * sol.t) <= 1e-9 * abs(exact)
    assert largest(angle - 0.5 * exact * sol.t**2) <= 1e-9 * abs(exact)
    stored = MASS * GRAVITY * HEIGHT
    moved = 0.5 * (SPIN + MASS * (AWAY**2 + pitch**2)) * exact**2
    bound = 10.0 * math.sqrt(sol.stats["steps"]) * 10.0 * EPS * (stored + moved)
    assert sol.energy_error.max() * moved <= bound


def hanging():
    """A rod that hangs from a pin, 1 m above the origin."""
    return scene(
        """
        [bodies.rod]
        mass = 1.0
        inertia = [0.1, 0.1, 0.01]
        position = [0.0, 0.0, 0.5]
        [joints.pin]
        type = "revolute"
        bodies = ["ground", "rod"]
        at = [0.0, 0.0, 1.0]
        axis = [0.0, 1.0, 0.0]
        """
    )


@pytest.mark.parametrize("method", METHODS)
def test_what_is_at_rest_stays_there(method):
    """A rod in equilibrium, whose weight is balanced to 8 n ε of n = 10 terms, and two bars in line without a load."""
    step = {"step": METHODS[method]} if METHODS[method] else {}
    for model, body, weight in ((hanging(), "rod", GRAVITY), (truss(0.0), "left", 0.0)):
        sol = ephs.simulate(model, 1.0, method=method, **step)
        moved = largest(sol.body(body).position - sol.body(body).position[0])
        bound = 8.0 * 10.0 * EPS * (1.0 + weight)
        assert moved <= bound and largest(sol.body(body).angular_velocity) <= bound
        assert not sol.audit.findings


CAPACITY, CONDUCTANCE, ROOM = 10.0, 1.0, 293.15


def conducting(above, apart, method):
    """Two stores of heat that conduct to each other, the first warmer by ``apart`` K."""
    pattern = Pattern.from_text("a: entropy; b: entropy; one(s=a); two(s=b); passage(s1=a, s2=b)")
    store = library.thermal_capacity(c1=CAPACITY * ROOM, c2=CAPACITY)
    system = pattern(one=store, two=store, passage=library.heat_transfer(h=CONDUCTANCE))
    start = {f"{name}.s": CAPACITY * math.log1p(x / ROOM) for name, x in (("one", above + apart), ("two", above))}
    return ephs.simulate(system, 2.0, initial=start, method=method, step=0.1, audit="off")


@pytest.mark.parametrize("method", ["natural", "natural4"])
@pytest.mark.parametrize("above", [0.0, 50.0])
@pytest.mark.parametrize("apart", [1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3])
def test_nearly_equal_temperatures_conduct_no_energy_away(method, above, apart):
    """Efforts are known to the rounding of temperatures; what is passed on is taken up all the same."""
    sol = conducting(above, apart, method)
    assert not sol.audit.findings
    held = np.array(list(sol.ledgers.storages.values()))
    passed, stored = float(np.abs(np.diff(held)).sum()), float(largest(held))
    defect = largest((held - held[:, :1]).sum(axis=0))
    assert defect <= 8.0 * EPS * len(sol) * passed + 8.0 * EPS * stored
    entropy, most = sol.entropy, sum(largest(sol[f"{name}.s"]) for name in ("one", "two"))
    assert np.diff(entropy).min() >= -8.0 * EPS * most
    if above == 0.0:  # differences of the states are not rounding
        ends = [ROOM * math.expm1(float(np.ravel(sol[f"{name}.s"])[-1]) / CAPACITY) for name in ("one", "two")]
        expected = apart * math.exp(-4.0 * CONDUCTANCE / CAPACITY)
        assert ends[0] - ends[1] == pytest.approx(expected, rel=1e-4 + 10.0 * EPS * ROOM / apart)


@pytest.mark.parametrize("method", ["natural", "natural4"])
@pytest.mark.parametrize("apart", [1e-9, 1e-7, 1e-5])
@pytest.mark.parametrize("law", ["energy", "ledger"])
def test_little_heat_that_is_lost_is_found(method, apart, law):
    """The control: a part of 10⁻⁶ of what was passed on, of energy or of entropy."""
    sol = conducting(0.0, apart, method)
    ledgers = sol.ledgers
    part = 1e-6 * np.abs(np.diff(next(iter(ledgers.storages.values())))).sum() * np.linspace(0.0, 1.0, len(sol))
    changed = {"thermal": ledgers.thermal + part} if law == "energy" else {"made": ledgers.made + part / ROOM}
    found = audit(bent(sol, **changed), Bounds(0.0, 0.1, lawful=True)).findings
    assert law in [one.law for one in found]
