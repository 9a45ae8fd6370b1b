"""Solutions of systems made by hand come back from files and journals with their system: joints, motion, pictures."""

import numpy as np
import pytest

import ephs
from tests.mechanics.methods.test_by_hand import four_bar

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
    class Law(ephs.solve.motion_law.MotionLaw):
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
