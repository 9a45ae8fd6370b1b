"""Which methods are maps of algebras: steps of a whole that are the steps of its parts.

The least composition there is, two mechanisms beside each other that share nothing, tells methods whose steps are made
part by part from those that look at the energy of the whole. What else composing has to commute with, junctions,
nesting and elimination, is measured of `natural` in `tests/semantics/test_naturality.py`.
"""

import pytest

import ephs
from ephs.mechanics.methods.registry import METHODS
from tests.mechanics.plain import uncorrected
from tests.numerics import largest
from tests.written import scene_of_text

ROUNDING = 1e-12
"""Of ten steps whose equations are solved to rounding, with a condition of some hundreds."""
MAPS = {
    "natural": True, "natural4": True, "variational": True,
    "rk54": False, "rk87": False, "radau": False, "semi": False,
}  # fmt: skip
"""Whether the steps of a method, as it is by default, are those of the parts."""
STEPS = {"rk87": 0.25, "radau": 0.2}
"""Steps in s at which the correction of a method is far above rounding; of the others 0.1 s."""


PENDULUM = """
[bodies.{name}]
mass = {mass}
inertia = [0.1, 0.2, 0.15]
position = [{far}, 0.0, 0.0]
[joints.at-{name}]
type = "spherical"
bodies = ["ground", "{name}"]
at = [0.0, 0.0, 0.0]
rate = [0.4, -0.3, 0.2]
"""
HEAD = """format = 1
[assembly]
adjust = true
"""


def beside():
    """Two pendulums, and each alone."""
    texts = {
        name: PENDULUM.format(name=name, mass=mass, far=far) for name, mass, far in (("a", 1.0, 0.8), ("b", 2.0, 1.3))
    }
    both = scene_of_text(HEAD + "".join(texts.values()))
    return both, {name: scene_of_text(HEAD + text) for name, text in texts.items()}


def missed(method):
    """By how much a run of both is not the runs of each, in m; and whether the balance is kept."""
    both, parts = beside()
    step = STEPS.get(method, 0.1)
    run = {"method": method, "step": step, "audit": "off"}
    whole = ephs.simulate(both, 10 * step, **run)
    apart = [
        largest(whole.body(name).position - ephs.simulate(scene, 10 * step, **run).body(name).position)
        for name, scene in parts.items()
    ]
    return max(apart), whole.energy_error.max()


@pytest.mark.parametrize("method", MAPS)
def test_a_step_of_the_whole_is_the_steps_of_its_parts_or_keeps_the_energy_of_the_whole(method):
    found, error = missed(method)
    assert (found <= ROUNDING) == MAPS[method]
    if not MAPS[method]:
        assert error <= 1e-13


@pytest.mark.parametrize("method", [name for name, composes in MAPS.items() if not composes])
def test_what_does_not_commute_is_the_correction_alone(method):
    with uncorrected():
        found, error = missed(method)
    assert found <= ROUNDING < error


def test_every_method_of_constant_steps_is_in_the_table():
    assert set(MAPS) == {name for name, method in METHODS.items() if method.fixed}
