"""Contacts of MJCF against MuJoCo: pairs and parameters of its compiled models, distances of its geoms; notes."""

import re
import warnings

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs.mechanics.imports import convert
from ephs.mechanics.imports.mjcf_contacts import LOSS
from ephs.mechanics.shapes.gap import UPRIGHT
from ephs.mechanics.shapes.pairs import touches
from ephs.semantics.spaces import SE3
from tests.mechanics.imports.by_mujoco import compiled, forward
from tests.mechanics.shapes.test_meshes import prism
from tests.numerics import generators

SINGLE = 1e-6
"""MuJoCo keeps meshes in single precision, and its general distances have this tolerance."""
SIZE = {"sphere": "0.1", "capsule": "0.1 0.2", "box": "0.1 0.2 0.3", "cylinder": "0.15 0.2", "mesh": ""}
numbers = st.floats(0.25, 4.0, width=16)


def loaded(text, folder, suffix="xml", **options):
    """The scene of a model with its surfaces, and all that was said of it."""
    file = folder / f"model.{suffix}"
    file.write_text(text, encoding="utf-8")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        return ephs.load(file, contact=True, **options), "\n".join(str(one.message) for one in said)


@st.composite
def crowds(draw):
    """Balls at one place, with drawn bits, priorities and parameters, some of whose pairs are named or excluded."""
    count = draw(st.integers(2, 5))
    bits = st.integers(0, 3)

    def solref():
        if draw(st.booleans()):
            return f"{draw(numbers) / 64} {draw(numbers)}"
        return f"{-1000 * draw(numbers)} {-50 * draw(numbers)}"

    bodies = [
        f'<body name="b{i}"><freejoint/><geom name="g{i}" size="0.1" mass="{draw(numbers)}" contype="{draw(bits)}"'
        f' conaffinity="{draw(bits)}" condim="{draw(st.sampled_from([1, 3, 4, 6]))}"'
        f' priority="{draw(st.integers(0, 1))}" solmix="{draw(numbers)}" solref="{solref()}"'
        f' friction="{draw(numbers)} {draw(numbers)} {draw(numbers)}"/></body>'
        for i in range(count)
    ]
    ends = st.lists(st.integers(0, count - 1), min_size=2, max_size=2, unique=True).map(tuple)
    named = {frozenset(pair): pair for pair in draw(st.lists(ends, max_size=2))}.values()
    excluded = {frozenset(pair): pair for pair in draw(st.lists(ends, max_size=2))}.values()
    pairs = [
        f'<pair geom1="g{i}" geom2="g{j}" condim="{draw(st.sampled_from([1, 3, 4, 6]))}" solref="{solref()}"'
        f' friction="{(mu := draw(numbers))} {mu} {draw(numbers)} {(arm := draw(numbers))} {arm}"/>'
        for i, j in named
    ] + [f'<exclude body1="b{i}" body2="b{j}"/>' for i, j in excluded]
    return f"<mujoco><worldbody>{''.join(bodies)}</worldbody><contact>{''.join(pairs)}</contact></mujoco>"


@given(text=crowds())
def test_pairs_and_parameters_are_those_that_mujoco_computes(text, tmp_path_factory):
    model = compiled(text)
    data = forward(model)
    scene, said = loaded(text, tmp_path_factory.mktemp("crowd"))
    assert "contact pairs" not in said
    found = {tuple(sorted(each.surfaces)): each.law for _, each in scene.all_contacts()}
    mass = sum(body.mass for _, body in scene.all_bodies())
    expected = {tuple(sorted(model.geom(g).name for g in c.geom)): c for c in data.contact}
    assert set(found) == set(expected)
    for pair, contact in expected.items():
        law, (first, second) = found[pair], contact.solref
        rate = np.sqrt(-first) if first < 0.0 else 1.0 / (first * second)
        ratio = -second / (2.0 * rate) if first < 0.0 else second
        sizes = [
            value if contact.dim >= least else 0.0
            for value, least in zip(contact.friction[[0, 2, 3]], (3, 4, 6), strict=True)
        ]
        assert [law.friction, law.spinning, law.rolling] == pytest.approx(sizes, rel=1e-12)
        assert law.stiffness == pytest.approx(mass * rate**2, rel=1e-12)
        assert law.loss == pytest.approx(LOSS * ratio, rel=1e-12)


def solid(kind, name, place, points):
    at, quat = place
    mesh = f'mesh="{points}"' if kind == "mesh" else f'size="{SIZE[kind]}"'
    return (
        f'<body name="{name}" pos="{" ".join(map(repr, at))}" quat="{" ".join(map(repr, quat))}"><freejoint/>'
        f'<geom name="{name}" type="{kind}" {mesh} pos="0.1 0.2 -0.3" quat="0.5 0.5 -0.5 0.5"/></body>'
    )


def distance(scene, first, second):
    """Gap of two surfaces: the least of all points'."""
    surfaces, poses = (
        scene.surfaces,
        {"ground": np.array([1.0, 0, 0, 0, 0, 0, 0])} | {name: body.pose for name, body in scene.all_bodies()},
    )
    one, other = surfaces[first], surfaces[second]
    points, swapped = touches(one.shape, one.frame, other.shape, other.frame)
    one, other = (other, one) if swapped else (one, other)
    gaps = []
    for at1, at2, gap in points:
        here, there = SE3.compose(poses[one.body], at1), SE3.compose(poses[other.body], at2)
        gaps.append(float(gap.distance(SE3.compose(SE3.inverse(here), there))))
    return min(gaps)


@pytest.mark.parametrize("kind", SIZE)
@given(data=st.data())
def test_distances_are_those_of_mujoco(kind, data, tmp_path_factory):
    """A ball and a plane meet each shape at MuJoCo's distance: no edge is rounded there."""
    rng = data.draw(generators)
    points = " ".join(map(repr, rng.uniform(-0.5, 0.5, 36).tolist()))
    quat = rng.normal(size=4)
    place = rng.uniform(-0.3, 0.3, 3).tolist(), (quat / np.linalg.norm(quat)).tolist()
    away = rng.normal(size=3)
    ball = (2.0 * away / np.linalg.norm(away)).tolist(), [1.0, 0.0, 0.0, 0.0]
    text = (
        f'<mujoco><asset><mesh name="m" vertex="{points}"/></asset><worldbody>'
        f'<geom name="floor" type="plane" size="1 1 1" pos="0 0 -3"/>{solid(kind, "it", place, "m")}'
        f"{solid('sphere', 'ball', ball, 'm')}</worldbody></mujoco>"
    )
    model = compiled(text)
    state = forward(model)
    scene, _ = loaded(text, tmp_path_factory.mktemp("pair"))
    g = {name: model.geom(name).id for name in ("floor", "it", "ball")}
    apart = mujoco.mj_geomDistance(model, state, g["it"], g["ball"], 10.0, None)
    assert distance(scene, "it", "ball") == pytest.approx(apart, abs=10 * SINGLE)
    if kind != "mesh":
        height = mujoco.mj_geomDistance(model, state, g["floor"], g["it"], 10.0, None)
    else:  # the lowest vertex
        m = int(model.geom_dataid[g["it"]])
        own = model.mesh_vert[model.mesh_vertadr[m] :][: model.mesh_vertnum[m]]
        turned = own @ state.geom_xmat[g["it"]].reshape(3, 3).T + state.geom_xpos[g["it"]]
        height = turned[:, 2].min() + 3.0
    late = UPRIGHT * scene.surfaces["it"].shape["cylinder"][0] if kind == "cylinder" else 0.0  # of a rim that is tilted
    assert -10 * SINGLE <= distance(scene, "floor", "it") - height <= late + 10 * SINGLE


def ring(count, height=0.1):
    """Vertices of a prism with 2 count corners."""
    return " ".join(f"{x:.9g}" for x in prism(count, -height, height).ravel())


NOTES = {
    "ellipsoid": ('<geom name="x" type="ellipsoid" size="1 2 3"/>', "", "contacts between: floor and x"),
    "height field": ('<geom name="x" type="hfield" hfield="h"/><geom size="1"/>', "", "height fields: x"),
    "pair of a height field": (
        '<geom name="x" type="hfield" hfield="h"/><geom size="1"/>', '<pair geom1="x" geom2="floor"/>',
        "contacts between: x and floor",
    ),
    "corners": (
        '<geom name="x" type="mesh" mesh="wheel"/>', "", "corners of convex hulls but the farthest: x ",
    ),
    "edges": (
        '<geom name="x" type="mesh" mesh="coin"/></body><body><freejoint/><geom name="y" type="box" size="1 1 1"/>', "",
        "contacts but those with planes, of meshes with more than 64 faces and edges: x",
    ),
    "points": (
        '<geom name="x" type="mesh" mesh="nut"/></body><body><freejoint/><geom name="y" type="mesh" mesh="bar"/>', "",
        "contacts between shapes with many edges: x and y",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", NOTES)
def test_what_is_not_imported_is_said_by_name(kind, tmp_path):
    geom, pair, said = NOTES[kind]
    joint = "" if "<joint" in geom else "<freejoint/>"
    text = (
        '<mujoco><asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/>'
        f'<mesh name="wheel" vertex="{ring(200)}"/><mesh name="coin" vertex="{ring(40)}"/>'
        f'<mesh name="nut" vertex="{ring(9)}"/><mesh name="bar" vertex="{ring(9, 0.5)}"/></asset>'
        f'<worldbody><geom name="floor" type="plane" size="1 1 1"/><body pos="0 0 9">{joint}{geom}</body></worldbody>'
        f"<contact>{pair}</contact></mujoco>"
    )
    _, found = loaded(text, tmp_path)
    assert re.search(f"not modelled: {said}", found), found


def test_a_converted_mesh_is_the_same_surface(tmp_path):
    text = (
        f'<mujoco><asset><mesh name="coin" vertex="{ring(9)}" scale="1 2 3"/></asset><worldbody>'
        '<geom name="floor" type="plane" size="1 1 1"/><body pos="0 0 1"><freejoint/>'
        '<geom name="x" type="mesh" mesh="coin"/></body></worldbody></mujoco>'
    )
    scene, _ = loaded(text, tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        convert(tmp_path / "model.xml", tmp_path / "again.toml", contact=True)
        again = ephs.load(tmp_path / "again.toml")
    assert again.surfaces["x"].shape == scene.surfaces["x"].shape and len(scene.surfaces["x"].shape["mesh"]) == 18
