"""What follows from coordinates that are set: joints tied by gears, stretches of belts and of tendons over joints."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from tests.numerics import EPS, largest
from tests.written import scene_of_text

TENDON = """<mujoco><option gravity="0 0 0"/><worldbody>
<body name="a"><joint name="ja" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
<body name="b" pos="0 0 1"><joint name="jb" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
</worldbody>{more}</mujoco>"""
SPRING = """<tendon><fixed name="diff" stiffness="5"><joint joint="ja" coef="1"/><joint joint="jb" coef="-1"/></fixed>
</tendon>"""
EQUALITY = """<equality><joint joint1="jb" joint2="ja" polycoef="0 -1 0 0 0"/></equality>"""
LINK = """<inertial><origin xyz="0.1 0 0"/><mass value="1"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>"""
MIMIC = f"""<robot name="grip"><link name="base"/><link name="l1">{LINK}</link><link name="l2">{LINK}</link>
<joint name="ja" type="continuous"><parent link="base"/><child link="l1"/><axis xyz="0 1 0"/>
</joint>
<joint name="jb" type="continuous"><parent link="base"/><child link="l2"/><axis xyz="0 1 0"/>
<mimic joint="ja" multiplier="-1" offset="0.3"/></joint></robot>"""


@pytest.fixture
def load(tmp_path):
    def load(text, suffix):
        file = tmp_path / f"model{suffix}"
        file.write_text(text, encoding="utf-8")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ephs.ModelWarning)  # MuJoCo's equalities are soft
            return ephs.load(file)

    return load


def test_a_tendon_over_joints_is_stretched_by_what_they_moved(load):
    """Two wheels of 1 kg m² and a spring of 5 N m/rad between them: ±5 rad/s² at (1, 0)."""
    scene = load(TENDON.format(more=SPRING), ".xml")
    moved, plain = ephs.dynamics(scene.with_state({"ja": 1.0})), ephs.dynamics(scene)
    for model, state in ((moved, moved.state0), (plain, plain.state({"ja": 1.0}))):
        found = model.acceleration(state)
        assert (found["ja"][0], found["jb"][0]) == pytest.approx((-5.0, 5.0), rel=8 * 4 * EPS)
    (run,) = (ephs.simulate(scene.with_state({"ja": 1.0}), 0.4, method="rk87", step=0.01),)
    rest = ephs.simulate(scene.at(run, 0.2), 0.4, t0=0.2, method="rk87", step=0.01)
    for sol in (run, rest):  # the difference of the angles is cos(√10 t), their sum stays
        angles = [sol.joint(name).coordinate[-1, 0] for name in ("ja", "jb")]
        expected = 0.5 * (1.0 + np.array([1.0, -1.0]) * np.cos(np.sqrt(10.0) * 0.4))
        assert largest(angles - expected) <= 1e-12  # (√10 · 0.01)⁸ a step, by steps


@pytest.mark.parametrize(
    ("text", "suffix", "offset"), [(MIMIC, ".urdf", 0.3), (TENDON.format(more=EQUALITY), ".xml", 0.0)]
)
def test_a_tied_joint_follows_and_the_given_one_is_kept(load, text, suffix, offset):
    """jb = offset − ja."""
    scene = load(text, suffix)
    near = 8 * EPS
    there = scene.with_state({"ja": 0.5}, {"ja": 2.0})
    assert there.joint("ja").coordinate[0] == 0.5
    assert there.joint("jb").coordinate[0] == pytest.approx(offset - 0.5, abs=near)
    assert there.joint("jb").rate[0] == pytest.approx(-2.0, abs=2.0 * near)
    state = ephs.dynamics(scene).state({"ja": 0.5}, {"ja": 2.0})
    assert state.coordinates["ja"][0] == pytest.approx(0.5, abs=near)
    assert state.coordinates["jb"][0] == pytest.approx(offset - 0.5, abs=near)
    assert state.rates["jb"][0] == pytest.approx(-2.0, abs=2.0 * near)
    both = scene.with_state({"ja": 0.5, "jb": 0.1})  # who gives both means both
    assert both.joint("jb").coordinate[0] == 0.1


WHEELS = """
format = 1
name = "train"
{bodies}
[gears.one]
joints = ["j0", "j1", "j2"]
ratio = [{a}, {b}]
[gears.two]
joints = ["j2", "j3"]
ratio = [{c}]
[gears.belt]
joints = ["j3", "j0"]
ratio = [{a}]
stiffness = 3.0
stretch = 0.1
"""
WHEEL = """
[bodies.b{i}]
mass = 1.0
inertia = [1.0, 1.0, 1.0]
position = [{i}.0, 0.0, 0.0]
[joints.j{i}]
type = "revolute"
bodies = ["ground", "b{i}"]
at = [{i}.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
"""
RATIOS = st.sampled_from([-2.0, -0.5, 0.3, 1.0, 4.0])


@settings(deadline=None, max_examples=15)
@given(st.tuples(RATIOS, RATIOS, RATIOS), st.sets(st.sampled_from(["j0", "j1", "j2"]), min_size=1, max_size=2))
def test_gears_keep_their_offsets_whatever_is_given(ratios, names):
    a, b, c = ratios
    text = WHEELS.format(bodies="".join(WHEEL.format(i=i) for i in range(4)), a=a, b=b, c=c)
    scene = scene_of_text(text)
    there = scene.with_state(dict.fromkeys(sorted(names), 0.4))
    x = {name: float(j.coordinate[0]) for name, j in there.all_joints()}
    assert all(abs(x[name] - 0.4) <= 8 * EPS for name in names)
    size = 8 * 16 * EPS * sum(map(abs, x.values()))  # of a pseudo-inverse of numbers up to 4
    assert abs(x["j0"] - a * x["j1"] - b * x["j2"]) <= 4.0 * size
    assert abs(x["j2"] - c * x["j3"]) <= 4.0 * size
    assert abs(there.gears["belt"].stretch - (0.1 + x["j3"] - a * x["j0"])) <= 4.0 * size
