"""Solutions of systems made by hand come back from files and journals with their system: joints, motion, pictures."""

import numpy as np
import pytest

import ephs
from ephs import Pattern
from ephs import library as lib
from ephs.show.plots.panels import motion_panels
from ephs.show.report import write_report
from tests.mechanics.methods.test_by_hand import four_bar
from tests.scenes import shipped

WAYS = {
    "a constant": ({"flow": 4.0}, {"method": "natural", "step": 0.01}),
    "folded": ({"flow": 4.0}, {"method": "natural", "step": 0.01, "form": "folded"}),
    "a function": ({"flow": lambda t: 4.0 * np.cos(t)}, {"method": "rk54"}),
    "a motion law": ({"effort": ephs.HarmonicMotion(0.3, 2.0, 0.5 * np.pi)}, {"method": "rk54"}),
    "a constant rate": ({"effort": ephs.PolynomialMotion((0.0,))}, {"method": "natural", "step": 0.01}),
}


@pytest.mark.parametrize("way", WAYS)
def test_joints_of_a_system_come_back_from_its_file(tmp_path, way):
    given, options = WAYS[way]
    _, system, poses, _ = four_bar()
    surroundings = ephs.Reference(temperature=300.0, pressure=9e4)
    sol = ephs.simulate(
        system, 0.05, initial=poses, inputs={"motor": given}, reference=surroundings, audit="off", **options
    )
    sol.save(tmp_path / "sol.nc")
    again = ephs.load_solution(tmp_path / "sol.nc")
    assert again.system == system and again.problem.reference == surroundings
    assert list(again.states) and all(np.array_equal(again[path], sol[path]) for path in sol.states)
    for name in ("main", "pin", "knee", "pivot"):
        one, other = again.joint(name), sol.joint(name)
        assert np.array_equal(one.coordinate, other.coordinate)
        for what in ("rate", "wrench"):
            found, expected = getattr(one, what), getattr(other, what)
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.nanmax(np.abs(expected), initial=1.0))
    assert again.animate().html == sol.animate().html


def test_a_journal_of_a_system_has_the_system_in_it(tmp_path):
    _, system, poses, inputs = four_bar()
    sol = ephs.simulate(
        system, 0.05, initial=poses, inputs=inputs, method="natural", step=0.01, journal=tmp_path / "run.journal"
    )
    again = ephs.load_solution(tmp_path / "run.journal")
    assert again.system == system
    np.testing.assert_allclose(again.joint("knee").rate, sol.joint("knee").rate, rtol=0, atol=1e-12)


def test_a_system_that_cannot_be_written_leaves_its_states(tmp_path):
    class Law(ephs.solve.posing.motion_law.MotionLaw):
        """A law of a user's own, which no file can hold."""

        displacement = rate = acceleration = lambda self, t: 0.0
        numbers = ()

        def rescaled(self, length, time):
            return self

    _, system, poses, _ = four_bar()
    sol = ephs.simulate(system, 0.02, initial=poses, inputs={"motor": {"effort": Law()}}, method="natural", step=0.01)
    sol.save(tmp_path / "sol.nc")
    again = ephs.load_solution(tmp_path / "sol.nc")
    assert again.system is None and np.array_equal(again["bars.crank.pe.q"], sol["bars.crank.pe.q"])


def test_joints_of_a_system_are_in_its_report_its_plots_and_its_summary(tmp_path):
    scene, system, poses, inputs = four_bar()
    run = {"method": "natural", "step": 0.01}
    of_scene, sol = (
        ephs.simulate(scene, 0.05, **run),
        ephs.simulate(system, 0.05, initial=poses, inputs=inputs, **run),
    )
    names = {"main", "pin", "knee", "pivot"}
    assert set(sol.freedoms) == names and sol.freedoms == of_scene.freedoms
    by_title = {panel.title: panel for panel in motion_panels(sol)}
    angles = {curve.name: curve.values for curve in by_title["joint angle [rad]"].curves}
    assert all(np.array_equal(angles[name], sol.joint(name).coordinate[:, 0]) for name in names)
    page = write_report(sol, tmp_path).read_text(encoding="utf-8")
    assert "joint angle [rad]" in page and "Joints hold to" in page
    expected = of_scene.summary()["joints"]
    for name, found in sol.summary()["joints"].items():
        np.testing.assert_allclose(found["coordinate"], expected[name]["coordinate"], atol=1e-10)
    shown = sol.plot("signals", "joints.knee.rate").axes[0].get_lines()[0].get_ydata()
    assert np.array_equal(shown, sol.joint("knee").rate[:, 0])
    assert len(sol.plot("phase", "pin").axes) == 1 and len(sol.plot("wrenches", "pin").axes) == 2


@pytest.mark.parametrize("capacities", [(20.0, 50.0), (3.0, 1.0)])
def test_temperatures_of_systems_relax_as_the_closed_form_says(capacities):
    """d(θ₁ − θ₂)/dt = −h (1/C₁ + 1/C₂)(θ₁ − θ₂), and C₁ θ₁ + C₂ θ₂ stays."""
    first, second = capacities
    pattern = Pattern.from_text("s1: entropy; s2: entropy; hot(s=s1); cold(s=s2); wall(s1, s2)")
    system = pattern(
        hot=lib.thermal_capacity(capacity=first, temperature=400.0),
        cold=lib.thermal_capacity(capacity=second, temperature=300.0),
        wall=lib.heat_transfer(h=2.0),
    )
    sol = ephs.simulate(system, 4.0, rtol=1e-10, atol=1e-10)
    gone = 100.0 * np.exp(-2.0 * (1.0 / first + 1.0 / second) * sol.t)
    mean = (first * 400.0 + second * 300.0) / (first + second)
    one, other = mean + second / (first + second) * gone, mean - first / (first + second) * gone
    np.testing.assert_allclose(sol.temperature("hot"), one, rtol=1e-7)
    np.testing.assert_allclose(sol.temperature("cold.s"), other, rtol=1e-7)
    assert sol.summary()["thermal"]["hot"]["temperature"] == sol.temperature("hot")[-1]
    titles = [panel.title for panel in motion_panels(sol)]
    assert "temperature [K]" in titles
    with pytest.raises(KeyError, match=r"hott: no such storage with one entropy; known: hot, cold.*did you mean"):
        sol.temperature("hott")


def test_temperatures_of_scenes_are_those_of_their_nodes():
    sol = ephs.simulate(shipped("hot-brake"), 0.5)
    for name, _ in sol.scene.all_thermal():
        np.testing.assert_allclose(sol.temperature(f"thermal.{name}"), sol.thermal(name).temperature, rtol=1e-14)
    assert np.all(sol.temperature("environment") == sol.scene.world.temperature)
