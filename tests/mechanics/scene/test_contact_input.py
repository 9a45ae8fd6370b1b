"""Bad input of surfaces and contacts: one fault each, with its key, what was found and what was expected."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import ephs
from ephs.mechanics.scene import polytope
from ephs.mechanics.scene.polytope import MOST_VERTICES
from tests.written import scene_of_text

SCENE = """
format = 1
name = "bad"
[bodies.ball]
mass = 2.0
inertia = [8e-3, 8e-3, 8e-3]
position = [0.0, 0.0, 0.15]
[bodies.other]
mass = 2.0
inertia = [8e-3, 8e-3, 8e-3]
position = [0.0, 0.5, 0.15]
[surfaces.ball]
body = "ball"
shape = { sphere = 0.1 }
stiffness = 1e5
exponent = 1.0
loss = 0.1
friction = 0.3
slip = 1e-3
rolling = 1e-3
spinning = 1e-3
[surfaces.other]
body = "other"
shape = { sphere = 0.1 }
stiffness = 1e5
[surfaces.floor]
body = "ground"
shape = { plane = {} }
[surfaces.wall]
body = "ground"
shape = { box = [1.0, 0.1, 1.0] }
position = [5.0, 0.0, 0.0]
"""
HARD = SCENE.replace("stiffness = 1e5\nexponent = 1.0\nloss = 0.1", "restitution = 0.5\ntangential = 0.4")
HARD = HARD.replace("slip = 1e-3\nrolling = 1e-3\nspinning = 1e-3\n", "").replace(
    "stiffness = 1e5", "restitution = 0.5"
)
HARD = HARD.replace("{ plane = {} }", "{ plane = {} }\nrestitution = 1.0")
HARD = HARD.replace("[1.0, 0.1, 1.0] }", "[1.0, 0.1, 1.0] }\nrestitution = 1.0")
CONTACT = '[contacts.one]\nsurfaces = ["ball", "floor"]\n'
WELDS = "".join(
    f'[joints.{name}]\ntype = "fixed"\nbodies = ["ground", "{name}"]\nat = [0.0, 0.0, 0.0]\naxis = [0.0, 0.0, 1.0]\n'
    for name in ("ball", "other")
)
ROUND = np.random.default_rng(0).normal(size=(MOST_VERTICES + 10, 3))
ROUND /= np.linalg.norm(ROUND, axis=1)[:, None]
CUBE = np.array(list(np.ndindex(2, 2, 2))) * 0.2 - 0.1


def stl(points):
    """Text of the hull of points (n, 3); of flat ones, a fan of triangles."""
    flat = np.ptp(points, axis=0).min() == 0.0
    faces = [(0, i, i + 1) for i in range(1, len(points) - 1)] if flat else ConvexHull(points).simplices
    corners = ("\n".join(f"vertex {x!r} {y!r} {z!r}" for x, y, z in points[list(face)].tolist()) for face in faces)
    return "solid it\n" + "\n".join(f"facet\nouter loop\n{text}\nendloop\nendfacet" for text in corners)


MESHES = {
    "empty.stl": "",
    "words.stl": "no mesh at all",
    "torn.stl": "vertex 1 2",
    "flat.stl": stl(CUBE[:4]),
    "thin.stl": stl(CUBE * [1.0, 1.0, 1e-7]),
    "tiny.stl": stl(1e-150 * CUBE),
    "endless.stl": stl(CUBE).replace("vertex 0.1", "vertex nan"),
    "open.stl": stl(CUBE).rpartition("facet\nouter")[0],
    "dented.stl": stl(CUBE) + "\n" + stl(0.5 * CUBE),
    "twice.stl": stl(CUBE) + "\n" + stl(CUBE),
    "round.stl": stl(ROUND),
}


def faults_of(tmp_path, text):
    """The faults of a scene beside the meshes."""
    for name, content in MESHES.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
    (tmp_path / "folder.stl").mkdir()
    file = tmp_path / "bad.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ephs.SceneError) as caught:
        ephs.load(file)
    assert str(caught.value).startswith(str(file))
    return caught.value.faults


BALL = "shape = { sphere = 0.1 }"
KINDS = "sphere, capsule, cylinder, box, plane = {}, mesh, points"
CONVEX = "an STL file of a convex body"
SOLID = "points of a body with volume"
SHAPES = [
    ("{ }", "", "an empty table", KINDS),
    ('"sphere"', "", '"sphere"', "a table"),
    ("{ sphere = 0.1, box = [1.0, 1.0, 1.0] }", "", "sphere and box", KINDS),
    ("{ spere = 0.1 }", ".spere", "an unknown key", "one of box, capsule"),
    ("{ sphere = 0 }", ".sphere", "0", "a number above 0"),
    ("{ sphere = -0.1 }", ".sphere", "-0.1", "a number above 0"),
    ("{ sphere = nan }", ".sphere", "nan", "a finite number"),
    ("{ sphere = [0.1] }", ".sphere", "[0.1]", "a number"),
    ("{ sphere = 1e300 }", ".sphere", "1e+300", "at most 1e+50"),
    ("{ capsule = [0.1, 0.0] }", ".capsule[1]", "0.0", "a number above 0"),
    ("{ capsule = [0.1] }", ".capsule", "[0.1]", "2 entries"),
    ("{ cylinder = [0.0, 0.1] }", ".cylinder[0]", "0.0", "a number above 0"),
    ("{ cylinder = [0.1, -0.1] }", ".cylinder[1]", "-0.1", "a number above 0"),
    ("{ box = [0.1, 0.0, 0.1] }", ".box[1]", "0.0", "a number above 0"),
    ("{ box = [0.1, 0.1] }", ".box", "[0.1, 0.1]", "3 entries"),
    ("{ box = 0.1 }", ".box", "0.1", "a list"),
    ("{ plane = { z = 1.0 } }", ".plane", "a table", "0 entries"),
    ('{ mesh = "none.stl" }', ".mesh", "none.stl, no file", CONVEX),
    ('{ mesh = "folder.stl" }', ".mesh", "folder.stl, no file", CONVEX),
    ('{ mesh = "../cube.stl" }', ".mesh", '"../cube.stl"', "a file in the scene's folder or below"),
    ('{ mesh = "" }', ".mesh", '""', "a text that is not empty"),
    ('{ mesh = "empty.stl" }', ".mesh", "empty.stl, a file without triangles", CONVEX),
    ('{ mesh = "words.stl" }', ".mesh", "words.stl, a file without triangles", CONVEX),
    ('{ mesh = "torn.stl" }', ".mesh", "torn.stl, a file that is no STL", CONVEX),
    ('{ mesh = "flat.stl" }', ".mesh", "flat.stl, a mesh without volume", CONVEX),
    ('{ mesh = "thin.stl" }', ".mesh", "thin.stl, a mesh without volume", CONVEX),
    ('{ mesh = "tiny.stl" }', ".mesh", "tiny.stl, a mesh without volume", CONVEX),
    ('{ mesh = "endless.stl" }', ".mesh", "endless.stl, a mesh with numbers that are not finite", CONVEX),
    ('{ mesh = "open.stl" }', ".mesh", "not convex: of volume 0.00733", CONVEX),
    ('{ mesh = "dented.stl" }', ".mesh", "not convex: a vertex lies 0.05 m inside its convex hull", CONVEX),
    ('{ mesh = "twice.stl" }', ".mesh", "not convex: of volume 0.016 m³, its convex hull 0.008 m³", CONVEX),
    ('{ mesh = "round.stl" }', ".mesh", "a mesh of 266 vertices, more than 256", CONVEX),
    (f"{{ points = {CUBE[:3].tolist()} }}", ".points", "]", "4 to 256 points"),
    (f"{{ points = {ROUND.tolist()} }}", ".points", "of 266 entries", "4 to 256 points"),
    (f"{{ points = {CUBE[:4].tolist()} }}", ".points", "points in a plane, or nearly", SOLID),
    (f"{{ points = {(CUBE * [1, 1, 1e-14]).tolist()} }}", ".points", "points in a plane, or nearly", SOLID),
    (f"{{ points = {(CUBE * [1, 0, 0]).tolist()} }}", ".points", "points in a plane, or nearly", SOLID),
    ("{ points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, nan]] }", ".points[3][2]", "nan", "a finite number"),
    ("{ points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1]] }", ".points[3]", "[0, 1]", "3 entries"),
]


@pytest.mark.parametrize(("shape", "key", "found", "expected"), SHAPES, ids=lambda x: str(x)[:32])
def test_a_shape_has_one_fault(shape, key, found, expected, tmp_path):
    (fault,) = faults_of(tmp_path, SCENE.replace(BALL, f"shape = {shape}", 1))
    assert fault.key == f"surfaces.ball.shape{key}"
    assert found in fault.found
    assert expected in fault.expected


LAWS = {"stiffness": "1e5", "exponent": "1.0", "loss": "0.1", "friction": "0.3", "slip": "1e-3"}
LAWS |= {"rolling": "1e-3", "spinning": "1e-3"}
TABLE = [
    ('body = "ball"', 'body = "bal"', "surfaces.ball.body", '"bal"', '"ground" or a body'),
    ('body = "ball"', "body = 3", "surfaces.ball.body", "3", "a text in quotes"),
    ('body = "ball"\nshape', "shape", "surfaces.ball.body", "nothing", "the body that has it"),
    (BALL, "", "surfaces.ball.shape", "nothing", "sphere, capsule"),
    ("loss = 0.1", "los = 0.1", "surfaces.ball.los", "an unknown key", "loss"),
    ("loss = 0.1", 'heat = "nod"', "surfaces.ball.heat", '"nod"', '"environment" or a [thermal] name'),
    ("loss = 0.1", "rotation = [1.0, 1.0, 0.0, 0.0]", "surfaces.ball.rotation", "of norm 1.41", "a unit quaternion"),
    ("loss = 0.1", "position = [1.0, 1.0]", "surfaces.ball.position", "[1.0, 1.0]", "3 entries"),
    *((f"{k} = {v}", f"{k} = -{v}", f"surfaces.ball.{k}", "-", "a number") for k, v in LAWS.items()),
    *(
        (f"{k} = {LAWS[k]}", f"{k} = 0.0", f"surfaces.ball.{k}", "0.0", "a number not below 1" if n else "above 0")
        for k, n in (("stiffness", 0), ("exponent", 1), ("slip", 0))
    ),
    ("exponent = 1.0", "exponent = 0.5", "surfaces.ball.exponent", "0.5", "not below 1"),
    ("stiffness = 1e5", "stiffness = inf", "surfaces.ball.stiffness", "inf", "a finite number"),
    ("loss = 0.1", "restitution = 0.5", "surfaces.ball", "restitution and stiffness", "stiffness or restitution"),
    ("loss = 0.1", "tangential = 0.5", "surfaces.ball", "tangential and stiffness", "stiffness or restitution"),
    (BALL, "shape = { plane = {} }", "surfaces.ball and surfaces.floor", "a plane and a plane", "one plane at most"),
    ("{ plane = {} }", "{ plane = {} }\nexponent = 1.5", "surfaces.ball and surfaces.floor", "1 and 1.5", "one"),
    ("stiffness = 1e5\nexponent", "exponent", "surfaces.ball and surfaces.floor", "without stiffness", "restitution"),
]
HARDS = [
    ("restitution = 0.5", "restitution = 1.5", "surfaces.ball.restitution", "1.5", "not above 1"),
    ("restitution = 0.5", "restitution = -0.5", "surfaces.ball.restitution", "-0.5", "not below 0"),
    ("tangential = 0.4", "tangential = 2.0", "surfaces.ball.tangential", "2.0", "not above 1"),
    ("tangential = 0.4", "stiffness = 1e5", "surfaces.ball", "restitution and stiffness", "stiffness or restitution"),
    ("tangential = 0.4", "slip = 1e-3", "surfaces.ball", "restitution and slip", "stiffness or restitution"),
    ("0.0, 0.15]", "0.0, 0.07]", "contacts.ball_floor", "ball and floor 0.03 m deep", "without initial overlap"),
    ("0.5, 0.15]", "0.0, 0.3]", "contacts.ball_other", "ball and other 0.05 m deep", "without initial overlap"),
]
FIXED = CONTACT.replace("floor", "other") + WELDS
CONTACTS = [
    (CONTACT.replace("ball", "bal"), ".surfaces[0]", '"bal"', "a surface"),
    (CONTACT.replace("ball", "floor"), ".surfaces", '"floor" twice', "two different bodies"),
    (CONTACT.replace("ball", "wall"), ".surfaces", 'two surfaces of "ground"', "two different bodies"),
    (FIXED, ".surfaces", '"ball" and "other", which fixed joints connect', "can move"),
    (CONTACT + WELDS, ".surfaces", '"ball" and "ground", which fixed joints connect', "can move"),
    ("[contacts.one]\n", ".surfaces", "nothing", "names of two surfaces"),
    (CONTACT.replace(', "floor"', ""), ".surfaces", '["ball"]', "2 entries"),
    (CONTACT.replace('"floor"', '"floor", "other"'), ".surfaces", '"other"]', "2 entries"),
    (CONTACT + "frictoin = 1.0\n", ".frictoin", "an unknown key", "friction"),
    (CONTACT + "stiffness = -1.0\n", ".stiffness", "-1.0", "above 0"),
    (CONTACT + "stiffness = 1.0\nrestitution = 0.5\n", "", "restitution and stiffness", "stiffness or restitution"),
    (CONTACT + 'heat = "nod"\n', ".heat", '"nod"', "[thermal] name"),
    (CONTACT.replace("one", "zero") + CONTACT, ".surfaces", "the surfaces of contacts.zero", "without another contact"),
]


def told(tmp_path, text, key, found, expected):
    faults = faults_of(tmp_path, text)
    assert faults[0].key == key
    assert found in faults[0].found
    assert expected in faults[0].expected
    assert len(faults) == 1 or key.startswith("surfaces.ball and")  # which is said of every pair


@pytest.mark.parametrize(("old", "new", "key", "found", "expected"), TABLE, ids=lambda x: str(x)[:32])
def test_a_table_of_an_elastic_surface_has_one_fault(old, new, key, found, expected, tmp_path):
    assert old in SCENE
    told(tmp_path, SCENE.replace(old, new, 1), key, found, expected)


@pytest.mark.parametrize(("old", "new", "key", "found", "expected"), HARDS, ids=lambda x: str(x)[:32])
def test_a_table_of_a_hard_surface_has_one_fault(old, new, key, found, expected, tmp_path):
    assert old in HARD
    told(tmp_path, HARD.replace(old, new, 1), key, found, expected)


@pytest.mark.parametrize(("table", "key", "found", "expected"), CONTACTS, ids=lambda x: str(x)[:32])
def test_a_contact_has_one_fault(table, key, found, expected, tmp_path):
    told(tmp_path, SCENE + table, f"contacts.one{key}", found, expected)


def test_the_scenes_that_are_spoiled_above_are_sound():
    for text in (SCENE, HARD, SCENE + CONTACT):
        assert scene_of_text(text).contacts


def test_a_large_mesh_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(polytope, "MOST_BYTES", 1_000_000)
    monkeypatch.setitem(MESHES, "large.stl", " " * 1_000_001)
    (fault,) = faults_of(tmp_path, SCENE.replace(BALL, 'shape = { mesh = "large.stl" }', 1))
    assert fault.found == "large.stl, a file of more than 1 MB"


def test_bodies_that_fixed_joints_connect_do_not_meet():
    """Neither is an overlap of theirs, which nothing changes, a fault."""
    assert not scene_of_text(HARD.replace("0.5, 0.15]", "0.0, 0.3]") + WELDS).contacts


def test_an_overlap_of_elastic_surfaces_at_the_start_is_told():
    with pytest.warns(
        ephs.SceneWarning, match=r"contacts\.ball_floor: found ball and floor 0\.03 m deep in each other"
    ):
        scene_of_text(SCENE.replace("0.0, 0.15]", "0.0, 0.07]"))
