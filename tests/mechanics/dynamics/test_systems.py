"""`dynamics` of systems: of a linkage made by hand, and inside another system, the digits of its scene."""

import numpy as np
import pytest

import ephs
from ephs.semantics.system import System
from ephs.solve.errors import OptionError
from tests.mechanics.methods.systems import nested
from tests.mechanics.methods.test_by_hand import four_bar


def inside():
    """The same linkage with some of its boxes in a box of their own, and the names that paths then have."""
    scene, system, poses, inputs = four_bar()
    flat = system.flatten()
    made, _ = nested(System.of(flat.pattern, dict(flat.fillings.items())), np.random.default_rng(3))
    places = {name: next(str(path) for path in made.states if str(path).endswith(name)) for name in poses}
    return scene, made, {places[name]: pose for name, pose in poses.items()}, inputs


def both(way):
    scene, system, poses, inputs = four_bar() if way == "by hand" else inside()
    return scene, ephs.dynamics(scene), ephs.dynamics(system, initial=poses, inputs=inputs)


@pytest.mark.parametrize("way", ["by hand", "nested"])
def test_a_system_has_the_dynamics_of_its_scene(way):
    scene, one, other = both(way)
    names = {name: next(j for j in other.joints if j.endswith(name)) for name in one.joints}
    first = one.closed(one.placing.moved(one.state0, {}, {"main": 2.0}))
    second = other.state(rates={names["main"]: 2.0})
    assert [names[j] for j in one.joints] == list(other.joints)
    assert np.array_equal(first.array, second.array)
    assert np.array_equal(one.mass_matrix(first), other.mass_matrix(second))
    force = np.arange(1.0, 1.0 + one.layout.n)
    assert np.array_equal(one.acceleration(first, force), other.acceleration(second, force))
    for of in scene.bodies:
        body = next(b for b in other.bodies(second) if b.endswith(of))
        assert np.array_equal(one.jacobian(first, of), other.jacobian(second, body))
        assert np.array_equal(one.bodies(first)[of].pose, other.bodies(second)[body].pose)
    assert np.array_equal(one.derivatives(first).acceleration_q, other.derivatives(second).acceleration_q)
    assert np.array_equal(one.constraints(first).rows, other.constraints(second).rows)


@pytest.mark.parametrize("method", ["rk87", "natural", "radau"])
def test_steps_of_a_system_are_those_of_its_scene(method):
    _, one, other = both("by hand")
    forces = {"main": [1.5]}
    first = one.step(one.state0, 2e-3, method=method, forces=forces)
    second = other.step(other.state0, 2e-3, method=method, forces=forces)
    assert np.abs(first.array - second.array).max() <= 1e-12 * np.abs(first.array).max()
    plain = other.step(other.state0, 2e-3, method=method)
    assert np.abs(plain.array - second.array).max() > 1e-6


def test_what_a_system_cannot_have_is_said():
    scene, system, poses, inputs = four_bar()
    model = ephs.dynamics(system, initial=poses, inputs=inputs)
    with pytest.raises(OptionError, match=r"outer port"):
        model.step(model.state0, 1e-3, method="natural", forces={"knee": [1.0]})
    with pytest.raises(OptionError, match=r"initial"):
        ephs.dynamics(scene, initial=poses)
