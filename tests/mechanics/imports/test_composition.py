"""Models of an SDF within each other and beside each other, and files that strict parsers of XML refuse."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.imports.draft import pose
from ephs.mechanics.imports.read import read_model
from ephs.semantics.spaces import SE3
from tests.numerics import largest

MASS = "<inertial><mass>{}</mass><inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.25</izz></inertia></inertial>"
LINK = '<link name="{}">{}' + MASS + "</link>"
HINGE = '<joint name="{}" type="revolute"><parent>{}</parent><child>{}</child>{}<axis><xyz>0 1 0</xyz></axis></joint>'
PLACES = {"place": "0.3 -0.2 0.5 0.1 0.2 0.3", "inner": "1 0 0 0 0.4 0", "tip": "0.2 0 0.1 0.5 0 0"}


def pose_of(text):
    """A pose (7,) of six numbers."""
    x = np.array(text.split(), dtype=float)
    return pose(x[:3], x[3:])


def file(text, version="1.9"):
    return f'<sdf version="{version}">{text}</sdf>'


def arm(name, place=""):
    """A model with a hand on an arm, the hand in a model of its own."""
    hand = LINK.format("hand", "<pose>{tip}</pose>".format(**PLACES), 1)
    return (
        f'<model name="{name}"><pose>{place}</pose>{LINK.format("upper", "", 2)}'
        + '<model name="wrist"><pose>{inner}</pose>'.format(**PLACES)
        + f"{hand}</model>"
        + HINGE.format("elbow", "upper", "wrist::hand", "")
        + HINGE.format("shoulder", "world", "upper", "")
        + "</model>"
    )


def test_models_within_models_are_the_flat_model(write, quiet):
    nested = quiet(write(file(arm("m", PLACES["place"])), "sdf", "nested"))
    place, inner, tip = (pose_of(PLACES[key]) for key in ("place", "inner", "tip"))
    hand = SE3.compose(place, SE3.compose(inner, tip))
    assert set(nested.bodies) == {"upper", "wrist::hand"}
    assert largest(nested.body("wrist::hand").pose - hand) < 1e-15 * 8
    text = (
        '<model name="m"><pose>{place}</pose><frame name="wrist"><pose>{inner}</pose></frame>'.format(**PLACES)
        + LINK.format("upper", "", 2)
        + LINK.format("hand", '<pose relative_to="wrist">{tip}</pose>'.format(**PLACES), 1)
        + HINGE.format("elbow", "upper", "hand", "")
        + HINGE.format("shoulder", "world", "upper", "")
        + "</model>"
    )
    flat = quiet(write(file(text), "sdf", "flat"))
    turned = {"shoulder": 0.3, "elbow": -0.7}, {"shoulder": 1.1, "elbow": 0.4}
    found, expected = (
        np.array([ephs.dynamics(s).acceleration(ephs.dynamics(s).state(*turned))[j][0] for j in ("shoulder", "elbow")])
        for s in (nested, flat)
    )
    assert largest(found - expected) < 1e-13 * largest(expected)


def test_several_models_of_a_world_move_as_each_alone(write, quiet):
    world = f'<world name="two">{arm("one")}{arm("other", "5 0 0 0 0 0")}</world>'
    both, alone = quiet(write(file(world), "sdf")), quiet(write(file(arm("one")), "sdf", "alone"))
    assert both.name == "two"
    assert set(both.bodies) == {"one::upper", "one::wrist::hand", "other::upper", "other::wrist::hand"}
    assert both.world.gravity.tolist() == [0.0, 0.0, -9.8]
    heavier = ephs.dynamics(both).acceleration(ephs.dynamics(both).state0)
    lone = ephs.dynamics(alone).acceleration(ephs.dynamics(alone).state0)
    for name, rate in lone.items():
        for model in ("one", "other"):
            assert heavier[f"{model}::{name}"] * 9.81 / 9.8 == pytest.approx(rate, rel=1e-12)


def test_joints_of_a_world_connect_models(write, quiet):
    two = "".join(f'<model name="{n}">{LINK.format("l", "", 1)}</model>' for n in "ab")
    text = f'<world name="w">{two}{HINGE.format("j", "a", "b::l", "")}{HINGE.format("g", "world", "a::l", "")}</world>'
    scene = quiet(write(file(text), "sdf"))
    assert {name: (j.body1, j.body2) for name, j in scene.joints.items()} == {
        "j": ("a::l", "b::l"),
        "g": ("ground", "a::l"),
    }


ENDS = {
    "__model__": "a",
    "f": "b",
    "j0": "b",
    "inner": "inner::c",
    "inner::c": "inner::c",
    "inner::__model__": "inner::c",
}


@pytest.mark.parametrize("end", ENDS)
def test_an_end_of_a_joint_is_the_link_that_its_name_stands_for(end, write, quiet):
    text = (
        f'<model name="m" canonical_link="a">{LINK.format("a", "", 1)}{LINK.format("b", "<pose>1 0 0 0 0 0</pose>", 1)}'
        f'{LINK.format("x", "<pose>0 1 0 0 0 0</pose>", 1)}<frame name="f" attached_to="b"/>'
        f'<model name="inner">{LINK.format("c", "", 1)}</model>'
        + HINGE.format("j0", "a", "b", "")
        + HINGE.format("j", end, "x", "")
        + "</model>"
    )
    joint = quiet(write(file(text), "sdf")).joints["j"]
    assert (joint.body1, joint.body2) == (ENDS[end], "x")


WRITTEN = {
    "a comment with hyphens": lambda text: text.replace("<model", "<!-- sim --verbose\n 4 --><model", 1),
    "a declaration after blank lines": lambda text: '\n\n<?xml version="1.0"?>\n' + text,
    "a declaration after a comment": lambda text: '<!-- by --hand --><?xml version="1.0"?>' + text,
    "a section of characters": lambda text: text.replace("<mass>1</mass>", "<mass><![CDATA[1]]></mass>"),
    "a comment with a document type": lambda text: text.replace("<model", "<!-- <!DOCTYPE x> --><model", 1),
    "a prefix": lambda text: text.replace("<inertial>", "<drake:mu>0.5</drake:mu><inertial>", 1),
}


@pytest.mark.parametrize("way", WRITTEN)
def test_texts_that_the_formats_own_parsers_take_are_read(way, write):
    def read(text, name):
        faults, left = [], []
        tables = read_model(write(text, "sdf", name), "fixed", faults, left)
        assert not faults
        return tables, left

    plain = file(f'<model name="m">{LINK.format("w", "", 1)}</model>')
    (tables, left), (same, said) = read(plain, "plain"), read(WRITTEN[way](plain), "written")
    assert tables["bodies"] == same["bodies"] and not left
    assert said == (["not modelled: drake:mu of links: w"] if way == "a prefix" else [])


def test_places_of_faults_count_the_lines_of_comments(write):
    text = "<!-- a --\n b -->\n<sdf>\n<model"
    with pytest.raises(ephs.SceneError, match="line 4, column 1"):
        ephs.load(write(text, "sdf"))


# what the older text becomes: attributes are values, gravity is of physics
OLD = """<sdf version="1.0"><world name="w"><physics type="ode"><gravity xyz="0 0 -3"/></physics><model name="m">
<link name="a"><origin pose="0 0 1 0 0 0"/><inertial mass="2"><origin pose="0.1 0 0 0 0 0"/>
<inertia ixx="0.1" iyy="0.2" izz="0.25"/></inertial></link>
<joint name="j" type="revolute"><parent link="world"/><child link="a"/><axis xyz="0 1 0">
<limit lower="-1" upper="1"/><dynamics damping="0.5" friction="0.25"/></axis></joint></model></world></sdf>"""
NEW = """<sdf version="1.0"><world name="w"><physics type="ode"><gravity>0 0 -3</gravity></physics><model name="m">
<link name="a"><pose>0 0 1 0 0 0</pose><inertial><mass>2</mass><pose>0.1 0 0 0 0 0</pose>
<inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.25</izz></inertia></inertial></link>
<joint name="j" type="revolute"><parent>world</parent><child>a</child><axis><xyz>0 1 0</xyz>
<limit><lower>-1</lower><upper>1</upper></limit><dynamics><damping>0.5</damping><friction>0.25</friction></dynamics>
</axis></joint></model></world></sdf>"""


def test_attributes_of_the_first_version_are_the_later_elements(write):
    found = []
    for name, text in (("old", OLD), ("new", NEW)):
        faults, left = [], []
        found.append((read_model(write(text, "sdf", name), "fixed", faults, left, contact=True), left))
        assert not faults
    assert found[0] == found[1]
    tables, left = found[0]
    assert not left
    assert tables["bodies"]["a"]["mass"] == 2.0 and tables["world"]["gravity"] == [0.0, 0.0, -3.0]


@pytest.mark.parametrize(("text", "gravity"), [(f"<world name='w'>{arm('m')}</world>", -9.8), (arm("m"), -9.81)])
def test_a_world_without_gravity_has_that_of_the_specification(text, gravity, write, quiet):
    assert quiet(write(file(text), "sdf")).world.gravity.tolist() == [0.0, 0.0, gravity]
