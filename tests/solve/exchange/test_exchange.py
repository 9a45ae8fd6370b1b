"""Units by themselves: exported mechanisms that are read back move as they do here, and signals go where wires say."""

import fmpy
import numpy as np
import pytest

import ephs
from tests.numerics import largest
from tests.scenes import shipped

SHARP = {"method": "rk87", "rtol": 1e-11, "atol": 1e-13}
"""Two runs at this tolerance over less than a second, whose steps end at different times, differ by less than 1e-9."""


@pytest.mark.parametrize(("name", "joint", "size"), [("slider-crank", "bearing", 0.2), ("motor-four-bar", "main", 0.5)])
def test_exported_and_read_back_it_moves_as_here(tmp_path, name, joint, size):
    scene, period, until = shipped(name), 0.02, 0.4
    file = tmp_path / "unit.fmu"
    made = ephs.export_fmu(scene, file, inputs=[f"joints.{joint}"], **SHARP, platforms=[fmpy.platform_tuple])
    unit = ephs.library.fmu(file)

    def force(t, state=None):
        return size * np.cos(9.0 * t)

    wires = {f"unit.joints.{joint}": lambda t, state: made.inputs[0].start + force(t)}
    found = ephs.Exchange({"unit": unit}, period, wires).run(until)
    held = {f"joints.{joint}": ephs.Sampled(period, force)}
    sol = ephs.simulate(scene, until, inputs=held, save_at=found.t, **SHARP)
    free = ephs.Exchange({"unit": unit}, period).run(until)
    scale = largest(sol.joint(joint).rate)
    for what in ("coordinate", "rate"):
        here = getattr(sol.joint(joint), what)[:, 0]
        assert largest(found[f"unit.joints.{joint}.{what}"] - here) <= 1e-9 * scale
        assert largest(free[f"unit.joints.{joint}.{what}"] - here) > 1e-3 * scale, "the control"


def test_signals_go_from_unit_to_unit(springs, carts):
    """A cart on a spring by plain exchange: the map from sample to sample, in closed form."""
    period, count = 0.01, 50
    wires = {"spring.speed": "cart.joints.rail.rate", "back.speed": lambda t, state: 0.0}
    units = {"cart": ephs.library.fmu(carts), "spring": ephs.library.fmu(springs), "back": ephs.library.fmu(springs)}
    found = ephs.Exchange(units, period, {**wires, "cart.joints.rail": "spring.force"}).run(period * count)
    x, v, q = 0.0, 1.0, 0.0
    for k in range(count + 1):
        assert found["cart.joints.rail.coordinate"][k] == pytest.approx(x, rel=1e-11, abs=1e-12)
        assert found["spring.force"][k] == pytest.approx(100.0 * q, rel=1e-11, abs=1e-12)
        force = 100.0 * q
        x, v, q = x + period * v + 0.5 * period**2 * force, v + period * force, q + period * v
    assert np.all(found["back.force"] == 0.0)


def test_signals_of_units_are_sampled_inputs(cart, springs):
    unit = ephs.library.fmu(springs, start={"stiffness": 40.0})
    exchange = ephs.Exchange({"spring": unit}, 0.05, {"spring.speed": lambda t, state: state.joints.rail.rate})
    sol = ephs.simulate(cart, 0.5, inputs=exchange.couple({"joints.rail": "spring.force"}).inputs, method="rk87")
    place = 0.0

    def force(t, state):
        nonlocal place
        given = 40.0 * place
        place += 0.05 * float(state.joints.rail.rate[0])
        return given

    same = ephs.simulate(cart, 0.5, inputs={"joints.rail": ephs.Sampled(0.05, force)}, method="rk87")
    assert np.array_equal(sol.t, same.t)
    assert np.allclose(sol.joint("rail").coordinate, same.joint("rail").coordinate, rtol=1e-13, atol=1e-14)
