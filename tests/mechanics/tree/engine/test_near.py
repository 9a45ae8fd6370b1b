"""Where nothing acts: never where gaps of segments or points of a contact act, and wherever a plane is between."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ephs.mechanics.shapes.gap import edges, segments
from ephs.mechanics.tree.engine.near import segments_apart
from ephs.mechanics.tree.engine.tables import contacts
from ephs.mechanics.tree.sweeps.acting import ABOVE, APART, ON_BODIES
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.stage import PLAIN

SIZES = st.tuples(*[st.floats(0.05, 0.5), st.floats(0.01, 0.1)] * 2)
TURNS = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda x: np.linalg.norm(x) > 0.1)
NEARLY = st.tuples(st.just(1.0), *[st.sampled_from([0.0, 1e-9, 1e-6, 1e-3, 0.01, 0.02])] * 3)
WAYS = st.tuples(*[st.floats(-0.7, 0.7)] * 3)
SOME = st.floats(-1.0, 1.0)


def found(pose, gap):
    support = gap.support
    axis = [float(x) for x in quaternion_to_matrix(pose[:4])[:, 2]]
    halves = support.halves[2], support.halves[5]
    return segments_apart(PLAIN, axis, [float(x) for x in pose[4:]], halves, support.margin, support.parallel)


def pose_of(turn, way):
    return np.array([*(np.array(turn) / np.linalg.norm(turn)), *way])


def touching(sizes, turn, at, out):
    """Segments that are out from touching, or overlap, at places of both, as far as their ends allow it."""
    half1, radius1, half2, radius2 = sizes
    axis = quaternion_to_matrix(np.array(turn) / np.linalg.norm(turn))[:, 2]
    across = np.cross(axis, [0.0, 0.0, 1.0])
    across = across / np.linalg.norm(across) if np.linalg.norm(across) > 1e-12 else np.array([1.0, 0.0, 0.0])
    way = np.array([0.0, 0.0, at[0] * half1]) + (radius1 + radius2 + out) * across - at[1] * half2 * axis
    return pose_of(turn, way)


@settings(max_examples=400, deadline=None)
@given(SIZES, TURNS | NEARLY, st.tuples(SOME, SOME), st.sampled_from([-1e-2, -1e-6, -1e-12, 1e-12, 1e-6, 1e-2]))
def test_segments_that_touch_are_never_apart(sizes, turn, at, out):
    pose = touching(sizes, turn, at, out)
    for gap in (segments(*sizes), edges(*sizes)):
        assert not found(pose, gap) or gap.distance(pose) >= 0.0


@settings(max_examples=400, deadline=None)
@given(SIZES, TURNS | NEARLY, WAYS)
def test_segments_are_apart_where_their_gap_is_positive(sizes, turn, way):
    """But that of near points, of which the gap takes others where segments are nearly parallel."""
    pose, gap = pose_of(turn, way), segments(*sizes)
    distance = gap.distance(pose)
    assert distance <= 1e-3 * sum(sizes) or found(pose, gap)
    assert distance >= 0.0 or not found(pose, gap)


@given(SIZES, st.floats(0.0, 0.999), st.floats(0.0, 2.0 * np.pi), WAYS)
def test_edges_that_are_parallel_are_apart_wherever_they_are(sizes, share, about, way):
    gap = edges(*sizes)
    assume(gap.support.parallel > 0.0)
    half = 0.5 * np.arcsin(np.sqrt(share * gap.support.parallel))
    pose = pose_of([np.cos(half), np.sin(half) * np.cos(about), np.sin(half) * np.sin(about), 0.0], way)
    assert gap.distance(pose) > 0.0
    assert found(pose, gap)


def test_edges_beyond_the_angle_of_parallel_are_closed():
    gap = edges(0.2, 0.02, 0.2, 0.02)
    half = 0.5 * np.arcsin(np.sqrt(1.02 * gap.support.parallel))
    pose = pose_of([np.cos(half), np.sin(half), 0.0, 0.0], (0.0, 0.0, 0.0))
    assert gap.distance(pose) < 0.0
    assert not found(pose, gap)


@settings(max_examples=200, deadline=None)
@given(st.integers(2, 12), st.floats(0.0, 0.3), st.integers(0, 10_000), st.sampled_from([0.9, 0.999999, 1.000001, 1.5]))
def test_no_contact_is_left_out_of_which_a_point_acts(count, reach, seed, share):
    """One point is about as far as it acts; the edges before and after are a plane's, and one of other links."""
    rng = np.random.default_rng(seed)
    inner, outer = rng.normal(size=(2, count, 3))
    edge = np.array([[ON_BODIES, 0, 1, ABOVE], *[[ON_BODIES, 0, 1, APART]] * count, [ON_BODIES, 0, 2, APART]])
    ends = [np.concatenate([rng.normal(size=(1, 3)), each, rng.normal(size=(1, 3))]) for each in (inner, outer)]
    points, around = contacts(edge, *ends, np.full(count + 2, reach))
    assert points.ravel().tolist() == [0, count, *[0] * count]
    turn = quaternion_to_matrix(pose_of(rng.normal(size=4), (0.0, 0.0, 0.0))[:4])
    point, way = rng.integers(count), rng.normal(size=3)
    place = inner[point] - turn @ outer[point] + share * reach * way / np.linalg.norm(way)
    away = np.linalg.norm(turn @ around[1, 3:6] + place - around[1, :3]) > around[1, 6]
    nearest = np.linalg.norm(inner - (outer @ turn.T + place), axis=1).min()
    assert not away or nearest > reach
