"""Surfaces that overlap deeply: forces go on until they have no direction, and the run ends there by name."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.shapes.gap import PENETRATED, UPRIGHT
from ephs.mechanics.shapes.pairs import PAIRS, touches
from ephs.semantics.spaces import SE3
from tests.mechanics.elements.test_surface_pairs import DRAWN
from tests.numerics import largest
from tests.written import scene_of_text

STEP, SMALL, FAR = 1e-3, 1e-7, 0.8
SPAN = 0.2
"""Radius in m of the largest curvature of shapes of `DRAWN`: by UPRIGHT times the inverse of what is left of it at a
depth, slopes of gaps differ from normals."""
RADIUS, MASS, G = 0.05, 1.0, 9.81
PLATE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.2, 0.2)]).tolist()
THICK = {"box": "box = [1.0, 1.0, 0.4]", "cylinder": "cylinder = [0.5, 0.4]", "mesh": f"points = {PLATE}"}
"""Shapes whose upper face is 0.2 m above their centre."""
THIN = {"sphere": "sphere = 0.1", "capsule": "capsule = [0.1, 0.3]", "box": "box = [0.5, 0.5, 0.1]"}
SCENE = """
format = 1
[world]
gravity = [0.0, 0.0, -{g}]
[bodies.ball]
mass = {mass}
inertia = [1e-3, 1e-3, 1e-3]
position = [0.001, 0.0, {z}]
[surfaces.ball]
body = "ball"
shape = {{ sphere = {radius} }}
stiffness = {stiffness}
[surfaces.other]
body = "ground"
shape = {{ {shape} }}
stiffness = {stiffness}
"""


def dropped(shape, z, stiffness):
    """A ball above a shape; two surfaces in series have half the stiffness."""
    return scene_of_text(SCENE.format(g=G, mass=MASS, radius=RADIUS, z=z, shape=shape, stiffness=2.0 * stiffness))


@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
@given(seed=st.integers(0, 2**20))
@settings(max_examples=3, deadline=None)
def test_normals_are_slopes_of_gaps_until_the_centre_is_near(pair, seed):
    """Of one shape that moves to the centre of the other: gaps change by no more than it moves, and by the normal.

    From the touch on one gap at least is negative, until one ends the run.
    """
    rng = np.random.default_rng(seed)
    one, other = ({kind: DRAWN[kind](rng)} for kind in pair)
    turn, way = rng.normal(size=4), rng.normal(size=3)
    turn, way = turn / np.linalg.norm(turn), way / np.linalg.norm(way)
    way[2] = -abs(way[2]) if "plane" in pair else way[2]
    identity, ended, touched, far = SE3.identity(), False, False, FAR
    first = np.concatenate([turn if "plane" not in pair else identity[:4], np.zeros(3)])
    points, swapped = touches(one, identity, other, identity)
    while far > 0.0 and not ended:
        nearest = np.inf
        for here, there, gap in points:
            ends = []
            for off in (-SMALL, 0.0, SMALL):
                second = np.concatenate([identity[:4], -(far - off) * way])
                a, b = (second, first) if swapped else (first, second)
                ends.append(SE3.compose(SE3.inverse(SE3.compose(a, here)), SE3.compose(b, there)))
            at = float(gap.distance(ends[1]))
            ended, nearest = ended or -at > gap.support.depth, min(nearest, at)
            if not -gap.support.depth < at < -SMALL:
                continue
            before, after = float(gap.distance(ends[0])), float(gap.distance(ends[2]))
            normal = np.array(gap.contact(ends[1])[0])
            assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-6)
            moved = (SE3.compose(SE3.inverse(ends[0]), ends[2])[4:]) / (2.0 * SMALL)
            rates = np.array([at - before, after - at]) / SMALL
            if gap.name == "face_rim":  # which is longer beside the face
                continue
            assert largest(rates) <= 1.0 + 0.1
            if gap.name != "edges":  # which have a moment where they are nearly parallel
                curved = min(SPAN, gap.support.depth / PENETRATED + at)
                assert np.abs(rates - normal @ moved).min() <= UPRIGHT / curved + 1e-6
        assert nearest < 0.0 or not touched
        touched = touched or nearest < 0.0
        far -= max(STEP, 0.5 * nearest / np.linalg.norm(way))  # no gap changes by more than the shape moves
    assert touched or "plane" in pair


@pytest.mark.parametrize("shape", THICK)
def test_a_ball_swings_on_a_face_that_its_centre_enters(shape):
    """It begins at the touch, so that its centre is at the surface's height less r cos ω t; z − r (1 − cos ω t)."""
    stiffness, until = MASS * G / (0.9 * RADIUS), 0.6
    run = ephs.simulate(dropped(THICK[shape], 0.2 + RADIUS, stiffness), until, method="rk87", rtol=1e-10)
    swing = 0.9 * RADIUS * (1.0 - np.cos(np.sqrt(stiffness / MASS) * run.t))
    assert swing.max() > 1.5 * RADIUS
    assert largest(run.body("ball").position[:, 2] - (0.2 + RADIUS - swing)) <= 1e-8


@pytest.mark.parametrize(
    ("shape", "method"), [*(("box", name) for name in METHODS), *((shape, "rk54") for shape in THIN if shape != "box")]
)
def test_a_run_ends_where_a_ball_passes_the_middle(shape, method):
    kind = METHODS[method]
    scene = dropped(THIN[shape], 0.3, 100.0)
    options = {} if method in ("rk54", "rk87", "radau") else {"step": 2e-3}
    with pytest.raises(ephs.SimulationError) as failure:
        ephs.simulate(scene, 0.5, method=kind.name, **options)
    assert failure.value.path == "contacts.ball_other.point0.pe"
    assert "more stiffness" in str(failure.value)
    assert 0.1 < failure.value.time < 0.3, "it meets the surface at 0.1 s, or later"
