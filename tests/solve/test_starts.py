"""Losses that vanish at rest in higher order: a spring on a damper of the force |v|ⁿ moves at once, by each method."""

import numpy as np
import pytest

import ephs
from ephs import Pattern
from ephs import library as lib
from ephs.solve.methods import paced, radau
from tests.semantics.zoo import drag

POWERS, STIFFNESSES = (1.5, 2.0, 3.0), (1e-3, 1e4)
METHODS = {
    "auto": {"method": "auto", "rtol": 1e-8, "atol": 1e-10},
    "radau, constant steps": {"method": "radau", "parts": 100},
    "natural": {"method": "natural", "rtol": 1e-4, "atol": 1e-6},
    "natural, constant steps": {"method": "natural", "parts": 100},
    "natural4": {"method": "natural4", "rtol": 1e-6, "atol": 1e-8},
}
ORDERS = {"radau": 5, "natural": 2}
"""Of methods at constant steps, whose errors are (1/parts)^order of the motion, and some times as much."""


def damped(n, k, *, pushed=False):
    """A spring on a damper of power n; ``pushed``: by a force at an outer port, too."""

    momentum = "p: momentum, exposed" if pushed else "p: momentum"
    return Pattern.from_text(f"q: displacement; {momentum}; s: entropy; k(q); g(q, p); d(p, s); env(s)")(
        k=lib.spring(k=k), g=lib.pkc(), d=drag(lambda p, s: abs(p) ** (n - 1.0))(), env=lib.environment()
    )


def halving(n, k):
    """Time in s in which q̇ = −(k q)^(1/n) halves q = 1."""
    u = 1.0 - 1.0 / n
    return (1.0 - 0.5**u) / (u * k ** (1.0 / n))


def allowed(options):
    """Relative error: a hundred tolerances, as of the audit, or some times that of the order."""
    if parts := options.get("parts"):
        return 10.0 * parts ** -ORDERS[options["method"]]
    return 100.0 * options["rtol"]


def end(system, until, options):
    options = dict(options)
    if parts := options.pop("parts", 0):
        options["step"] = until / parts
    return ephs.simulate(system, until, initial={"k.q": 1.0}, **options)["k.q"].ravel()[-1]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("n", POWERS)
@pytest.mark.parametrize("k", STIFFNESSES)
def test_a_damper_without_slope_at_rest_moves(method, n, k):
    options = METHODS[method]
    assert end(damped(n, k), halving(n, k), options) == pytest.approx(0.5, rel=allowed(options))


@pytest.mark.parametrize("method", ["auto", "natural"])
def test_it_moves_as_it_is_pushed(method):
    """A force of 1 N that changes in time beside the spring's of 1 N: q̇ = −√(q + f)."""
    system, until = damped(2.0, 1.0, pushed=True), halving(2.0, 2.0)
    force = {"p": {"flow": lambda t: -1.0 + 0.0 * t}}
    sol = ephs.simulate(system, until, initial={"k.q": 1.0}, inputs=force, **METHODS[method])
    assert np.sqrt(sol["k.q"].ravel()[-1] + 1.0) == pytest.approx(
        np.sqrt(2.0) - 0.5 * until, rel=allowed(METHODS[method])
    )


@pytest.mark.parametrize("method", ["auto", "natural"])
def test_the_efforts_of_storages_alone_are_no_guess_there(method, monkeypatch):
    """The control: without other unknowns such a start is refused."""
    for module in (paced, radau):
        monkeypatch.setattr(module, "unknowns_away", lambda *_: None)
    with pytest.raises(ephs.SimulationError, match="t = 0 s"):
        end(damped(2.0, 1.0), 1.0, METHODS[method])
