"""The oracle that joint coordinates are held against: a closed form, the other evaluation, and what it tells apart."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from ephs import Pattern, library, quantity
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.operad import Path
from ephs.semantics.descriptor.descriptor import Input
from ephs.solve.equations.instant import instant
from ephs.testing import mechanisms
from tests.mechanics.methods.systems import oracle_of, problem_of
from tests.scenes import shipped
from tests.written import scene_of_text

PENDULUM = """format = 1
name = "pendulum"
[bodies.bar]
mass = 2.0
inertia = [0.1, 0.2, 0.3]
position = [0.4, 0.3, 0.0]
[joints.pin]
type = "revolute"
bodies = ["ground", "bar"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
[world]
gravity = [0.0, -9.81, 0.0]
"""


def general(problem, states):
    d = problem.descriptor
    inputs = {port: Input(np.atleast_1d(np.array(of.value)), of.effort) for port, of in problem.signals.items()}
    return instant(d, problem.reference, d.pack(states), inputs).rates


def test_a_pendulum_falls_as_in_books():
    problem = problem_of_scene(scene_of_text(PENDULUM))
    rates = oracle_of(problem).rates(problem.initial)
    turn = -2.0 * 9.81 * 0.4 / (0.3 + 2.0 * (0.4**2 + 0.3**2))  # −m g x / (I + m l²)
    expected = np.array([0.0, 0.0, 0.3 * turn, -2.0 * turn * 0.3, 2.0 * turn * 0.4, 0.0])
    found = rates[Path.of("bodies.bar.ke.p")]
    assert np.abs(found - expected).max() <= 1e-11 * np.abs(expected).max()


@settings(max_examples=10)
@given(mechanisms(max_bodies=3))
def test_two_evaluations_of_the_relations_agree(scene):
    problem = problem_of_scene(scene)
    one, other = oracle_of(problem).rates(problem.initial), general(problem, problem.initial)
    assert one.keys() == other.keys()
    largest = max([1.0, *(float(np.abs(rate).max(initial=0.0)) for rate in other.values())])
    for path, rate in other.items():
        assert np.abs(one[path] - rate).max(initial=0.0) <= 1e-8 * largest, path  # both by differences


def test_differences_stay_within_the_domain_of_states():
    """A thimble of gas between pistons: a step of a litre would be longer than its volume."""
    size, q = 1e-3, quantity
    gas = library.ideal_gas(c1=2.5 * 101325.0 * size, c2=2.5 * 101325.0 * size / 293.15, v0=size, c=2.5)
    pattern = Pattern.from_text(
        "v: volume; w: volume; s: entropy; p: momentum; gas(v, s); air(v=w); bar(p); piston(v1=v, v2=w, p)"
    )
    system = pattern(
        gas=gas, air=library.environment(v=q.volume), bar=library.point_mass(m=2.0), piston=library.piston(a=0.01)
    )
    start = {"gas.v": [0.7 * size], "gas.s": [0.1], "bar.p": [0.3], "air.v": [1.0]}
    problem = problem_of(system, system.state(start))
    one, other = oracle_of(problem).rates(problem.initial), general(problem, problem.initial)
    for path, rate in other.items():
        assert np.isfinite(rate).all()
        assert np.abs(one[path] - rate).max() <= 1e-10 * max(1.0, np.abs(rate).max()), path


@pytest.mark.parametrize("part", [1e-6, -1e-6])
def test_a_millionth_of_a_mass_is_seen(part):
    scene = shipped("four-bar")
    crank = scene.bodies["crank"]
    other = replace(scene, bodies={**scene.bodies, "crank": replace(crank, mass=(1.0 + part) * crank.mass)})
    problem = problem_of_scene(scene)
    rates, changed = (oracle_of(problem_of_scene(of)).rates(problem.initial) for of in (scene, other))
    path = Path.of("bodies.crank.ke.p")
    assert 1e-8 < np.abs(rates[path] - changed[path]).max() / np.abs(rates[path]).max() < 1e-4
