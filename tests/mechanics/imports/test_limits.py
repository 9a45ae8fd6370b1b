"""Limits of joints and contacts of models: those of the file where they are asked for, else named and left."""

import warnings

import numpy as np
import pytest

import ephs

LINK = "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>"
MODELS = {
    "urdf": """<robot name="m"><link name="post"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1"/></inertial><collision><geometry><sphere radius="1"/></geometry></collision></link>
<joint name="j" type="{kind}"><parent link="post"/><child link="arm"/><axis xyz="0 1 0"/>
<limit {limit} effort="1" velocity="1"/></joint></robot>""",
    "sdf": f"""<sdf version="1.7"><model name="m"><link name="arm">{LINK}<collision name="c"><geometry><sphere>
<radius>1</radius></sphere></geometry></collision></link><joint name="j" type="{{kind}}"><parent>world</parent>
<child>arm</child><axis><xyz>0 1 0</xyz><limit>{{limit}}</limit></axis></joint></model></sdf>""",
    "xml": """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="arm" pos="0 0 3">
<joint name="j" type="{kind}" axis="0 1 0" {limit}/><geom size="1"/></body></worldbody></mujoco>""",
}
NONE = [np.nan, np.nan]
LIMITS = [
    ("urdf", "revolute", 'lower="-1" upper="2"', [-1.0, 2.0]),
    ("urdf", "prismatic", 'upper="0.5"', [0.0, 0.5]),
    ("urdf", "continuous", 'lower="-1" upper="2"', NONE),
    ("urdf", "revolute", "", NONE),
    ("sdf", "revolute", "<lower>-1</lower><upper>2</upper>", [-1.0, 2.0]),
    ("sdf", "prismatic", "<upper>0.5</upper>", [np.nan, 0.5]),
    ("sdf", "revolute", "<lower>-inf</lower><upper>inf</upper>", NONE),
    ("sdf", "continuous", "<lower>-1</lower><upper>2</upper>", NONE),
    ("xml", "hinge", 'range="-30 45" ref="10" limited="true"', np.radians([-40.0, 35.0])),
    ("xml", "slide", 'range="0 0.1" limited="true"', [0.0, 0.1]),
]
for large in ("1.79769e+308", "1e16", "inf"):
    LIMITS += [
        *(("urdf", "revolute", 'lower="{}" upper="{}"'.format(*ends), found) for ends, found in (
            (("-1", large), [-1.0, np.nan]), ((f"-{large}", "1"), [np.nan, 1.0]))),
        *(("sdf", "revolute", "<lower>{}</lower><upper>{}</upper>".format(*ends), found) for ends, found in (
            (("-1", large), [-1.0, np.nan]), ((f"-{large}", "1"), [np.nan, 1.0]))),
    ]  # fmt: skip


def loaded(file, **options):
    """A model, and all that is said of it."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        return ephs.load(file, **options), "\n".join(str(each.message) for each in said)


@pytest.mark.parametrize(("suffix", "kind", "limit", "found"), LIMITS)
def test_limits_are_those_of_the_file(suffix, kind, limit, found, write):
    """Large ones are none; those that are missing or of a joint that turns for ever are named."""
    file = write(MODELS[suffix].format(kind=kind, limit=limit), suffix)
    scene, said = loaded(file, contact=True)
    limits = NONE if scene.joint("j").limits is None else scene.joint("j").limits
    assert limits == pytest.approx(found, nan_ok=True)
    assert ("limits of: j" in said) == (kind == "continuous" or not limit)
    scene, said = loaded(file)
    assert not scene.contacts and scene.joint("j").limits is None
    assert "limits of: j" in said or np.isnan(found).all()
    assert ("contacts of: " in said) and ("arm" in said)


@pytest.mark.parametrize(("lower", "beyond"), [(0.25, 0.25), (0.005, None), (-1.0, None)])
def test_a_start_beyond_a_limit_is_said_by_name(lower, beyond, write):
    text = MODELS["urdf"].format(kind="revolute", limit=f'lower="{lower}" upper="1"')
    said = loaded(write(text), contact=True)[1]
    if beyond is None:
        assert "beyond them" not in said
    else:
        assert f"joints.j.limits: found a start {beyond} beyond them" in said
