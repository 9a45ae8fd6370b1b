"""Where nothing acts: never where gaps of segments or points of a contact act, and wherever a plane is between."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ephs.mechanics.shapes.gap import edges, segments
from ephs.mechanics.tree.engine.near import segments_apart
from ephs.mechanics.tree.engine.tables import groups_of
from ephs.mechanics.tree.sweeps.acting import ABOVE, APART, BEYOND, ON_BODIES, ON_TREE
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


@settings(max_examples=400)
@given(SIZES, TURNS | NEARLY, st.tuples(SOME, SOME), st.sampled_from([-1e-2, -1e-6, -1e-12, 1e-12, 1e-6, 1e-2]))
def test_segments_that_touch_are_never_apart(sizes, turn, at, out):
    pose = touching(sizes, turn, at, out)
    for gap in (segments(*sizes), edges(*sizes)):
        assert not found(pose, gap) or gap.distance(pose) >= 0.0


@settings(max_examples=400)
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


def pose_between(rng, inner, outer, way):
    """Of the second link in the first, where ``outer`` of that is at inner + way of this."""
    turn = quaternion_to_matrix(pose_of(rng.normal(size=4), (0.0, 0.0, 0.0))[:4])
    return turn, inner + way - turn @ outer


@settings(max_examples=200)
@given(st.integers(1, 12), st.floats(0.0, 0.3), st.integers(0, 10_000), st.sampled_from([0.9, 0.999999, 1.000001, 1.5]))
def test_no_group_is_left_out_of_which_an_edge_acts(count, reach, seed, share):
    """One edge is about as far as it acts; before are joints and points of a plane, behind an edge of other links."""
    rng = np.random.default_rng(seed)
    inner, outer = rng.normal(size=(2, 2 * count + 3, 3))
    inner[2 : 2 + count], axis = inner[2], np.tile(rng.normal(size=3), (2 * count + 3, 1))
    axis /= np.linalg.norm(axis[0])
    rows = [
        *[[ON_TREE, i, i + 1, 0] for i in range(2)], *[[ON_BODIES, 0, 1, ABOVE]] * count,
        *[[ON_BODIES, 0, 1, APART]] * count, [ON_BODIES, 0, 2, APART],
    ]  # fmt: skip
    group, middle = groups_of(np.array(rows), axis, inner, outer, np.full(len(rows), reach))
    found = [(group[g].support, group[g].start, group[g].end) for g in range(4)]
    assert group.size == 4
    assert found == [
        (0, 0, 2),
        (ABOVE, 2, 2 + count),
        (BEYOND, 2 + count, 2 + 2 * count),
        (BEYOND, len(rows) - 1, len(rows)),
    ]
    plane, points = (slice(group[g].start, group[g].end) for g in (1, 2))
    for g, edges_of in ((1, plane), (2, points)):
        nearest = rng.integers(edges_of.start, edges_of.stop)
        way = rng.normal(size=3) if g == 2 else axis[0]
        turn, place = pose_between(rng, inner[nearest], outer[nearest], share * reach * way / np.linalg.norm(way))
        one, other = middle[group[g].one], middle[group[g].two]
        between = turn @ [other.at[k] for k in range(3)] + place - [one.at[k] for k in range(3)]
        away = outer[edges_of] @ turn.T + place - inner[edges_of]
        if g == 1:
            far = between @ [one.axis[k] for k in range(3)] > group[g].spread
            least = (away @ axis[0]).min()
        else:
            far, least = np.linalg.norm(between) > group[g].spread, np.linalg.norm(away, axis=1).min()
        assert not far or least > reach
        assert (one.link, other.link) == (0, 1)


def test_points_that_are_shared_stand_once():
    """Balls that all meet a floor and each other."""
    pairs = [(i, j) for i in range(-1, 5) for j in range(i + 1, 5)]
    edge = np.array([[ON_BODIES, i, j, ABOVE if i < 0 else BEYOND] for i, j in pairs])
    zero = np.zeros((len(pairs), 3))
    group, middle = groups_of(edge, np.tile([0.0, 0.0, 1.0], (len(pairs), 1)), zero, zero, np.ones(len(pairs)))
    assert (group.size, middle.size) == (len(pairs), 6)
