"""Power ports: the energy that they make is what is missing in the whole, and stays bounded where it is given back."""

import numpy as np
import pytest

import ephs
from ephs import Pattern
from ephs import library as lib
from ephs.solve.running import loop
from tests.numerics import largest

PORT = {"effort": "force", "flow": "speed"}
PERIOD, UNTIL = 0.02, 5.0
STIFFNESS, MASS, ENERGY = 100.0, 1.0, 0.5
"""10 rad/s: a fifth of a radian a period, in which a force that lags by half a period feeds the motion."""


def on_a_spring(cart, file, port, *, balanced, **options):
    """A cart of the package on a spring of C."""
    unit = ephs.library.fmu(file, ports={"end": port})
    coupling = ephs.Exchange({"spring": unit}, PERIOD).couple({"joints.rail": "spring.end"}, balanced=balanced)
    times = PERIOD * np.arange(round(UNTIL / PERIOD) + 1)
    sol = ephs.simulate(cart, UNTIL, inputs=coupling.inputs, method="rk87", save_at=times, **options)
    return sol, coupling.traffic


def on_a_cart(file, *, balanced):
    """A spring of the package whose end is a cart of FMI."""
    port = {"effort": "joints.rail", "flow": "joints.rail.rate", "integral": "joints.rail.coordinate"}
    unit = ephs.library.fmu(file, ports={"push": port})
    system = Pattern.from_text("q: displacement, exposed; pe(q)")(pe=lib.spring(k=STIFFNESS))
    bond = ephs.Bond("cart.push", lambda t, state: STIFFNESS * state["pe.q"][0])
    coupling = ephs.Exchange({"cart": unit}, PERIOD).couple({"q": bond}, balanced=balanced)
    ephs.simulate(system, 1.0, inputs=coupling.inputs, method="natural", step=PERIOD)
    return coupling.traffic.debt["q"]


@pytest.mark.parametrize("integral", [False, True])
def test_the_energy_that_is_made_is_what_the_whole_gains(cart, springs, integral):
    port = {**PORT, "integral": "impulse"} if integral else PORT
    for balanced in (True, False):
        sol, traffic = on_a_spring(cart, springs, port, balanced=balanced)
        rail, debt = sol.joint("rail"), traffic.debt["joints.rail"]
        assert np.allclose(traffic.t, sol.t[1:-1], rtol=1e-14)  # samples before the end
        # the spring moves by the mean speed, so it is as long as the cart is far; plainly it moves by sampled speeds
        moved = rail.coordinate[:, 0] if balanced else PERIOD * np.cumsum([0.0, *rail.rate[:-1, 0]])
        whole = 0.5 * MASS * rail.rate[:, 0] ** 2 + 0.5 * STIFFNESS * moved**2
        gained = whole[1:-1] - ENERGY
        assert largest(gained - debt) <= 1e-9 * whole.max()
        # and it is what the run's ledger calls work of inputs, beside what the spring took
        assert np.allclose(sol.work[1:], 0.5 * MASS * (rail.rate[1:, 0] ** 2 - 1.0), atol=1e-9 * whole.max())


def test_it_is_given_back_and_bounded(cart, springs):
    kept, plain = (on_a_spring(cart, springs, PORT, balanced=each)[1].debt["joints.rail"] for each in (True, False))
    half = len(kept) // 2
    # the first period has no prediction: its error, k v² h²/2, is the largest, and later ones are of third order
    assert largest(kept) <= 1.01 * 0.5 * STIFFNESS * PERIOD**2
    assert largest(kept[half:]) <= 0.5 * largest(kept[:half])
    assert largest(plain[half:]) > 10.0 * largest(plain[:half]) > 100.0 * ENERGY, "the control"


def test_it_is_bounded_where_the_unit_gives_the_flow(carts):
    kept, plain = (on_a_cart(carts, balanced=each) for each in (True, False))
    half = len(kept) // 2
    assert largest(kept[half:]) <= 2.0 * largest(kept[:half]) <= 0.01
    assert largest(plain[half:]) >= 3.0 * largest(plain[:half]) >= 1.0, "the control"


def test_errors_fall_with_the_square_of_the_period_at_least(cart, springs):
    """Plain exchange is of first order."""
    unit = ephs.library.fmu(springs, ports={"end": PORT})
    off = []
    for period in (0.02, 0.01):
        coupling = ephs.Exchange({"spring": unit}, period).couple({"joints.rail": "spring.end"})
        sol = ephs.simulate(cart, 2.0, inputs=coupling.inputs, method="rk87", save_at=[1.0, 2.0])
        off.append(largest(sol.joint("rail").coordinate[1:, 0] - 0.1 * np.sin(10.0 * sol.t[1:])))
    assert off[0] / off[1] > 3.5
    assert off[1] < 1e-3


def test_a_run_goes_on_from_its_journal_to_the_same_bits(cart, springs, tmp_path):
    file = tmp_path / "run.journal"
    whole, traffic = on_a_spring(cart, springs, PORT, balanced=True)

    def stop(t, until, stats):
        if t > 2.0:
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop, "RESPONSE", -1.0)  # progress is told at every step
        with pytest.raises((ephs.Interrupted, KeyboardInterrupt)):
            on_a_spring(cart, springs, PORT, balanced=True, journal=file, progress=stop)
    sol, again = on_a_spring(cart, springs, PORT, balanced=True, journal=file)
    assert np.array_equal(sol.t, whole.t)
    assert np.array_equal(sol.joint("rail").coordinate, whole.joint("rail").coordinate)
    assert np.array_equal(again.made["joints.rail"], traffic.made["joints.rail"])
