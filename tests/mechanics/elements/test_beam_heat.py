"""Heat along a rod: stores in its elements, conduction between them, and colours of what it stores."""

import numpy as np
import pytest

import ephs
from ephs.show.motions.stage import stage_of
from tests.written import scene_of_text

ELEMENTS, LENGTH, CAPACITY, CONDUCTION, COLD = 6, 0.6, 40.0, 5.0, 300.0
ROD = """
format = 1
[world]
gravity = [0.0, 0.0, {gravity}]
[beams.rod]
from = [0.0, 0.0, 0.0]
to = [0.6, 0.0, 0.0]
up = [0.0, 0.0, 1.0]
elements = 6
section = {{ rectangle = [0.02, 0.004], E = 2e9, nu = 0.3, rho = 2000.0 }}
damping = 5e-3
ends = ["ground", "free"]
{heat}
"""
WARM = "thermal = { capacity = 40.0, conduction = 5.0, temperature = 300.0 }"


def rod(heat=WARM, gravity=0.0, more=""):
    return scene_of_text(ROD.format(gravity=gravity, heat=heat) + more)


def temperatures(sol):
    return np.array([sol.thermal(f"rod-{i + 1}").temperature for i in range(ELEMENTS)])


@pytest.mark.parametrize("method", ["radau", "natural4"])
def test_a_rod_cools_by_the_modes_of_its_cells(method):
    """ΔT of the first mode of n cells of length Δ falls as exp(−k/(c Δ²) (2 − 2 cos(π/n)) t), k and c per length."""
    first = 20.0 * np.cos(np.pi * (np.arange(ELEMENTS) + 0.5) / ELEMENTS)
    cell = LENGTH / ELEMENTS
    initial = {f"thermal.rod-{i + 1}.s": CAPACITY * cell * np.log1p(first[i] / COLD) for i in range(ELEMENTS)}
    options = {"rtol": 1e-10} if method == "radau" else {"step": 0.01}
    sol = ephs.simulate(rod(), 0.5, initial=initial, method=method, **options)
    rate = CONDUCTION / (CAPACITY * cell**2) * (2.0 - 2.0 * np.cos(np.pi / ELEMENTS))
    wanted = COLD + first[:, None] * np.exp(-rate * sol.t)
    np.testing.assert_allclose(temperatures(sol), wanted, atol=1e-6 * 20.0)


def test_what_damps_a_rod_warms_it_where_it_bends():
    sol = ephs.simulate(rod(gravity=-9.81), 0.4, method="radau", rtol=1e-6)
    warmed = temperatures(sol)[:, -1] - COLD
    assert CAPACITY * LENGTH / ELEMENTS * warmed.sum() == pytest.approx(sol.heat[-1], rel=1e-9)
    assert np.all(np.diff(warmed) < 0.0) and warmed[-1] > 0.0  # most at the wall
    assert sol.energy_error.max() < 1e-11
    assert sol.stats["least_production"] >= 0.0


def test_temperature_is_a_colour_of_elements_and_of_nodes_between_them():
    sol = ephs.simulate(rod(gravity=-9.81), 0.1, method="radau", rtol=1e-4)
    (warm,) = stage_of(sol, colour="temperature", fps=20.0, duration=None).shades
    assert warm.ends[0].endswith(" K")
    beside = [warm.values[name] for name in ("rod-1", "rod-2")]
    np.testing.assert_allclose(warm.values["rod.1"], np.mean(beside, axis=0), rtol=1e-12)
