"""`dynamics` of systems: of a linkage made by hand, and inside another system, the digits of its scene."""

import numpy as np
import pytest

import ephs
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.systems.system import System
from ephs.solve.posing.errors import OptionError
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
    second = other.state(rates={names["main"]: 2.0})
    first = one.unpack(second.array)
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


@pytest.mark.parametrize(("angle", "rate"), [(0.4, 2.0), (-0.3, 0.0), (1.2, -5.0), (0.0, 1.0)])
def test_what_is_given_is_kept_and_the_loop_follows(angle, rate):
    """Coupler and rocker meet, in place and in velocity, at the angle and rate of the crank that are given."""
    scene, system, poses, inputs = four_bar()
    model = ephs.dynamics(system, initial=poses, inputs=inputs)
    state = model.state({"main": angle}, {"main": rate})
    states = {str(path): value for path, value in model.states(state).items()}
    assert states["main.pe.q_r"][0] == pytest.approx(angle, abs=1e-12)
    assert state.rates["main"][0] == pytest.approx(rate, abs=1e-12)
    knee = scene.joint("knee")
    bodies = model.bodies(state)
    places, speeds = [], []
    for body, frame in (("bars.coupler", knee.frame1), ("bars.rocker", knee.frame2)):
        turn = quaternion_to_matrix(bodies[body].pose[:4])
        places.append(bodies[body].pose[4:] + turn @ frame[4:])
        speeds.append(turn @ (bodies[body].twist[3:] + np.cross(bodies[body].twist[:3], frame[4:])))
    np.testing.assert_allclose(places[0], places[1], atol=1e-9)
    np.testing.assert_allclose(speeds[0], speeds[1], atol=1e-9)


MIMIC = """<robot name="pair"><link name="base"/>{links}</robot>"""
LINK = """<link name="{name}"><inertial><mass value="{mass}"/>
<inertia ixx="{mass}" iyy="{mass}" izz="{mass}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="{joint}" type="continuous"><parent link="base"/><child link="{name}"/><axis xyz="0 0 1"/>{mimic}</joint>"""


@pytest.mark.parametrize(("ratio", "offset"), [(-1.0, 0.3), (2.5, -0.1)])
def test_geared_joints_follow_the_driver_that_is_given(tmp_path, ratio, offset):
    """Follower = ratio · driver + offset, whichever of both is given; with 1 and 7 kg m² neither gives way."""
    mimic = f'<mimic joint="driver" multiplier="{ratio}" offset="{offset}"/>'
    links = LINK.format(name="a", mass=1, joint="driver", mimic="")
    links += LINK.format(name="b", mass=7, joint="follower", mimic=mimic)
    (tmp_path / "pair.urdf").write_text(MIMIC.format(links=links))
    scene = ephs.load(tmp_path / "pair.urdf")
    model = ephs.dynamics(scene.system())
    driver, follower = "joints.driver", "joints.follower"
    for given in ({driver: 0.5}, {follower: ratio * 0.5 + offset}):
        state = model.state(given, {driver: 3.0})
        states = {str(path): value for path, value in model.states(state).items()}
        assert states[f"{driver}.pe.q_r"][0] == pytest.approx(0.5, abs=1e-12)
        assert states[f"{follower}.pe.q_r"][0] == pytest.approx(ratio * 0.5 + offset, abs=1e-12)
        assert state.rates[driver][0] == pytest.approx(3.0, abs=1e-12)
        assert state.rates[follower][0] == pytest.approx(3.0 * ratio, abs=1e-11)


def test_what_a_system_cannot_have_is_said():
    scene, system, poses, inputs = four_bar()
    model = ephs.dynamics(system, initial=poses, inputs=inputs)
    with pytest.raises(OptionError, match=r"outer port"):
        model.step(model.state0, 1e-3, method="natural", forces={"knee": [1.0]})
    with pytest.raises(OptionError, match=r"initial"):
        ephs.dynamics(scene, initial=poses)
