"""Gaps of plain shapes: their exact slopes are wrenches of the normal at the contact point, parallel axes included."""

import numpy as np
import pytest
from hypothesis import given, settings

from ephs.mechanics.elements.contact import lever
from ephs.mechanics.shapes.gap import (
    CROSSED,
    CROSSING,
    PARALLEL,
    PASSES,
    UPRIGHT,
    edges,
    plane_rim,
    plane_sphere,
    rounded_box_sphere,
    segments,
    sphere_rounded_box,
)
from ephs.mechanics.shapes.solids import LEANING, cylinder, meeting, point, rim, segment
from ephs.semantics.derive.recording import record
from ephs.semantics.derive.slopes import Slope, Slopes
from ephs.semantics.derive.tape import over_step
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.stage.plain import PLAIN
from tests.numerics import generators, largest, seeds

ROUNDING = 4e-13
"""Of some two hundred operations, relative to the lengths that they begin with: 8 n ε."""
ROUND = {
    "plane_sphere": plane_sphere(0.1),
    "plane_rim": plane_rim(0.2),
    "sphere_rounded_box": sphere_rounded_box(0.1, (0.2, 0.1, 0.3), 0.05),
    "rounded_box_sphere": rounded_box_sphere((0.2, 0.0, 0.3), 0.05, 0.1),
}


def slope(gap, pose):
    """(6,) the derivative of a gap along twists of C2, by the program's own rules at a step of no length."""
    found = record(gap.distance, {"pose": 7})
    given = [Slope(np.float64(x), np.float64(x), {i: np.float64(1.0)}) for i, x in enumerate(pose)]
    whole = over_step(Slopes(PLAIN), found.tape, given, [np.float64(x) for x in found.parameters]).slopes
    (w, x, y, z), turn = pose[:4], quaternion_to_matrix(pose[:4])
    quaternions = 0.5 * np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]])
    by = np.array([whole.get(i, 0.0) for i in range(7)])
    return np.concatenate([by[:4] @ quaternions, by[4:] @ turn])


def wrench(gap, pose):
    """(6,) of a unit force along the normal at the contact point."""
    return np.array(lever(*gap.contact(pose)))


def tilted(rng, angle):
    """A rotation whose z axis is off that of the ground by an angle of this size; any, where it is 1 or more."""
    turn = rng.normal(size=4) if angle >= 1.0 else np.array([1.0, *(0.5 * angle * rng.normal(size=2)), rng.normal()])
    return turn / np.linalg.norm(turn)


def beside(rng, turn, half1, half2, far):
    """Pose of a segment that is so far from another one: across both, or anywhere around the points that face."""
    axis = quaternion_to_matrix(turn)[:, 2]
    way = np.cross([0.0, 0.0, 1.0], axis)
    if np.linalg.norm(way) < 1e-12 or rng.random() < 0.3:
        way = rng.normal(size=3)
    one, other = np.clip(rng.uniform(-1.3, 1.3, 2), -1.0, 1.0) * [half1, half2]
    return np.concatenate([turn, [0.0, 0.0, one] + far * way / np.linalg.norm(way) - other * axis])


def drawn(rng, slender):
    """Sizes of two segments, the longer up to so many radii long, and a pose in which they nearly touch."""
    radii = rng.uniform(0.02, 0.2, 2)
    half1, half2 = rng.uniform(0.1, 1.0, 2) * slender * radii.sum()
    pose = beside(rng, tilted(rng, 10.0 ** rng.uniform(-8, 0.5)), half1, half2, radii.sum() * rng.uniform(0.5, 1.5))
    return (half1, radii[0], half2, radii[1]), pose


@pytest.mark.parametrize("name", ROUND)
@given(seed=seeds)
@settings(max_examples=25, deadline=None)
def test_slopes_of_round_shapes_are_wrenches(name, seed):
    rng, gap = np.random.default_rng(seed), ROUND[name]
    place = rng.choice([1.0, 0.1]) * rng.normal(size=3)  # a centre within a box, too
    pose = np.concatenate([tilted(rng, 10.0 ** rng.uniform(-8, 0.5)), place])
    assert largest(slope(gap, pose) - wrench(gap, pose)) <= ROUNDING * (1.0 + np.abs(pose).sum())


def touched(rng, feature, body, *, first):
    """A gap of a feature and a body, and a pose in which they touch: any, or with axes nearly parallel or crossing."""
    gap, way = meeting(feature, body, first=first), rng.normal(size=3)
    turn = NEARLY[rng.integers(3)] + 10.0 ** rng.uniform(-6.0, 1.0) * rng.normal(size=4)
    near, far = 0.0, 5.0
    for _ in range(30):
        middle = 0.5 * (near + far)
        pose = np.concatenate([turn / np.linalg.norm(turn), middle * way / np.linalg.norm(way)])
        near, far = (middle, far) if float(gap.distance(pose)) < 0.0 else (near, middle)
    return gap, pose


NEARLY = np.array([[1.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0]])
NEAR = 1e-8
"""Of two surfaces that touch, in m: half of 5 m, thirty times."""
FOUND = {
    "rim on a cap": (rim(0.3, 0.03), cylinder(0.25, 0.2, 0.02, 0.05), 0.25),
    "edge on a cylinder": (segment(0.4, 0.03), cylinder(0.25, 0.2, 0.02), 0.4),
    "point on a cylinder": (point(0.03), cylinder(0.25, 0.2, 0.02), 0.0),
}
"""Feature, body, and the length over which the gap is longer by `UPRIGHT` at the most."""


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("name", FOUND)
@given(rng=generators)
@settings(max_examples=25, deadline=None)
def test_slopes_of_features_are_along_wrenches(name, first, rng):
    """The points that are searched are stationary, so nothing but the size of the slope differs.

    Chords of a disc are off by `LEANING`, and their nearest point moves along the disc by its size where it tilts by
    `UPRIGHT`.
    """
    feature, body, length = FOUND[name]
    gap, pose = touched(rng, feature, body, first=first)
    found, expected = slope(gap, pose), wrench(gap, pose)
    size = found @ expected / (expected @ expected)
    assert largest(found - size * expected) <= LEANING / UPRIGHT
    assert abs(size - 1.0) <= UPRIGHT * length / (feature.radius + body.radius) + LEANING


def seen(gap, pose):
    """Normal and contact point in the axes of C1."""
    turn = quaternion_to_matrix(pose[:4])
    normal, at = (turn @ np.array(part) for part in gap.contact(pose))
    return normal, at + pose[4:]


def assert_half_way(gap, back, pose, within):
    """Of one pair of surfaces, named in both orders, the point is one and the normals are opposite."""
    (normal, at), (opposite, same) = seen(gap, pose), (np.array(part) for part in back.contact(SE3.inverse(pose)))
    assert largest(at - same) <= within
    assert largest(normal + opposite) <= within / max(gap.radius, back.radius)


@given(rng=generators)
@settings(max_examples=25, deadline=None)
def test_contact_points_are_half_way_between_the_surfaces(rng):
    """Slopes do not tell: a force has the same moments wherever on its line it acts; friction has not."""
    pose = np.concatenate([tilted(rng, 1.0), rng.normal(size=3)])
    for gap, within in ((plane_sphere(0.1), ROUNDING), (plane_rim(0.2), 2.0 * UPRIGHT * 0.2)):
        assert seen(gap, pose)[1][2] == pytest.approx(0.5 * gap.distance(pose), abs=within)
    for box, rounding, radius in (((0.2, 0.1, 0.3), 0.05, 0.1), ((0.2, 0.0, 0.3), 0.05, 0.1)):
        gap, back = rounded_box_sphere(box, rounding, radius), sphere_rounded_box(radius, box, rounding)
        assert_half_way(gap, back, pose, ROUNDING * (1.0 + np.abs(pose).sum()))
    for feature, body, length in FOUND.values():
        gap, touching = touched(rng, feature, body, first=True)
        assert_half_way(gap, meeting(feature, body, first=False), touching, ROUNDING)
        assert body.distance(gap.contact(touching)[1]) == pytest.approx(body.radius, abs=UPRIGHT * length + NEAR)
    sizes, near = drawn(rng, 3.0)
    turned = np.concatenate([tilted(rng, 1.0), near[4:]])
    assert_half_way(edges(*sizes), edges(*sizes[2:], *sizes[:2]), turned, ROUNDING)


def errors(sizes, pose, length, parallel, passes):
    """What the slopes of `segments` are off by at most: by rounding, and by passes, as its docstring says."""
    half1, radius1, half2, radius2 = sizes
    radii, (x, y, _) = radius1 + radius2, quaternion_to_matrix(pose[:4])[:, 2]
    bend, reach = 0.25 * parallel / radii, half1 + half2 + radii
    # the place a is a quotient: of its numerator no derivative is above 4 (1 + reach), of its denominator above 2
    place = (4.0 * (1.0 + reach) + 2.0 * half1) / (x * x + y * y + bend * length)
    left = bend * half1 * place * (bend * half1**2 / length) ** (passes - 1) * abs(length - radii) / length
    return ROUNDING * (1.0 + reach) ** 2 / length, left


@pytest.mark.parametrize("slender", [1.0, 10.0, 50.0])
@given(rng=generators)
@settings(max_examples=60, deadline=None)
def test_slopes_of_segments_are_wrenches(slender, rng):
    """To rounding where they are not slender, whatever their angle."""
    sizes, pose = drawn(rng, slender)
    gap = segments(*sizes)
    length = float(gap.distance(pose)) + sizes[1] + sizes[3]
    rounding, left = errors(sizes, pose, length, PARALLEL, PASSES)
    assert largest(slope(gap, pose) - wrench(gap, pose)) <= rounding + (left if slender > 1.0 else 0.0)


@given(generators)
@settings(max_examples=60, deadline=None)
def test_slopes_of_edges_are_wrenches_and_moments_about_the_common_normal(rng):
    """Moments only where they are nearly parallel, which lengthens the gap."""
    sizes, pose = drawn(rng, 10.0)
    half1, radius1, half2, radius2 = sizes
    gap, axes = edges(*sizes), quaternion_to_matrix(pose[:4])
    sine = float(np.hypot(axes[0, 2], axes[1, 2]))
    square = CROSSING * min(radius1, radius2) * (radius1 + radius2) / max(half1, half2) ** 2
    if sine**2 < 0.25 * square:
        return  # too parallel to act
    length = float(segments(*sizes).distance(pose)) + radius1 + radius2
    rest, most = slope(gap, pose) - wrench(gap, pose), sum(errors(sizes, pose, length, CROSSED, 1))
    assert largest(rest[3:]) <= most
    if sine**2 >= square:
        assert largest(rest) <= most
    else:
        moment = 4.0 * (half1 + half2) * sine / square
        assert largest(np.array([axes[2], [0.0, 0.0, 1.0]]) @ rest[:3]) <= most + ROUNDING * moment


@given(generators)
@settings(max_examples=60, deadline=None)
def test_gaps_of_segments_change_by_no_more_than_their_points_move(rng):
    """So they are continuous, where axes come to be parallel, too."""
    sizes, pose = drawn(rng, 10.0)
    gap, twist = segments(*sizes), rng.normal(size=6)
    if rng.random() < 0.5:
        twist[:2] = -2.0 * pose[1:3] / pose[0]  # to where they are parallel, nearly
    size = 10.0 ** rng.uniform(-9, 0)
    after = SE3.compose(pose, SE3.exp(size * twist))
    moved = size * (np.linalg.norm(twist[3:]) + np.linalg.norm(twist[:3]) * (sizes[2] + np.linalg.norm(twist[3:])))
    reach = sum(sizes)
    assert abs(float(gap.distance(after)) - float(gap.distance(pose))) <= moved + ROUNDING * reach
