"""Rotations by angles, and inertia from shapes: the same scenes as by quaternions and tensors."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation as Turn

from ephs.mechanics.scene.bodies import BodyEntry
from ephs.mechanics.scene.entries import validate
from ephs.mechanics.scene.inertia import mass_and_moments
from ephs.mechanics.scene.rotations import RotationEntry
from tests.numerics import largest
from tests.written import scene_of_text

ANGLES = st.lists(st.floats(-4.0, 4.0), min_size=3, max_size=3)
LENGTH = st.floats(0.01, 2.0)


def same_turn(one, other):
    return abs(abs(float(np.dot(one, other))) - 1.0) < 1e-14


@given(ANGLES)
def test_roll_pitch_yaw_are_about_fixed_axes(angles):
    x, y, z, w = Turn.from_euler("xyz", angles).as_quat()
    degrees = [math.degrees(a) for a in angles]
    for entry in (RotationEntry(rpy=angles), RotationEntry(rpy_deg=degrees)):
        assert same_turn(entry.quaternion(), [w, x, y, z])
    if max(map(abs, angles)) > 0.1:  # the order of the turns matters
        moving = Turn.from_euler("XYZ", angles)
        assume(np.abs(moving.as_matrix() - Turn.from_euler("xyz", angles).as_matrix()).max() > 1e-3)
        assert not same_turn(RotationEntry(rpy=angles).quaternion(), np.roll(moving.as_quat(), 1))


@given(ANGLES, st.floats(-7.0, 7.0))
def test_an_axis_and_an_angle_are_a_rotation_vector(axis, angle):
    size = math.hypot(*axis)
    assume(size > 1e-3)
    x, y, z, w = Turn.from_rotvec(angle * np.array(axis) / size).as_quat()
    for entry in (RotationEntry(axis=axis, angle=angle), RotationEntry(axis=axis, angle_deg=math.degrees(angle))):
        assert same_turn(entry.quaternion(), [w, x, y, z])


def moments_of(raw):
    faults = []
    found = mass_and_moments(validate(BodyEntry, raw, "bodies.a", faults))
    assert not faults
    return found


def cloud(shape, n=24):
    """Points and weights of a product rule that is exact for second moments of the shape."""
    x, w = np.polynomial.legendre.leggauss(n)
    u, v, t = (g.ravel() for g in np.meshgrid(x, x, x, indexing="ij"))
    weight = np.prod(np.meshgrid(w, w, w, indexing="ij"), axis=0).ravel()
    ((kind, sizes),) = shape.items()
    if kind == "box":
        half = np.array(sizes) / 2
        return np.column_stack([u, v, t]) * half, weight * half.prod()
    radius, turn = (1 + u) / 2, np.pi * (1 + v)
    if kind == "cylinder":
        r, length = sizes
        at = [r * radius * np.cos(turn), r * radius * np.sin(turn), length / 2 * t]
        return np.column_stack(at), weight * (r / 2) * np.pi * (length / 2) * r * radius
    rise = np.sqrt(1 - t**2)
    at = sizes * radius * np.array([rise * np.cos(turn), rise * np.sin(turn), t])
    return at.T, weight * (sizes / 2) * np.pi * (sizes * radius) ** 2


SHAPES = st.one_of(
    st.builds(lambda a, b, c: {"box": [a, b, c]}, LENGTH, LENGTH, LENGTH),
    st.builds(lambda r, h: {"cylinder": [r, h]}, LENGTH, LENGTH),
    st.builds(lambda r: {"sphere": r}, LENGTH),
)


@given(SHAPES, ANGLES, ANGLES, st.floats(1.0, 1e4))
def test_inertia_of_shapes_is_the_integral_over_them(shape, angles, place, density):
    points, volumes = cloud(shape)
    points = Turn.from_euler("xyz", angles).apply(points)
    mirrored = [{**shape, "position": [s * x for x in place], "rotation": {"rpy": angles}} for s in (1.0, -1.0)]
    mass, moments = moments_of({"density": density, "shapes": mirrored})
    points = np.concatenate([points + place, points - place])
    weights = density * np.concatenate([volumes, volumes])
    second = (points.T * weights) @ points
    wanted = np.trace(second) * np.eye(3) - second
    assert mass == pytest.approx(weights.sum(), rel=1e-12)
    xx, yy, zz, xy, xz, yz = moments
    found = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    assert largest(found - wanted) <= 1e-12 * np.trace(wanted)
    assert moments_of({"mass": mass, "shapes": mirrored})[1] == pytest.approx(moments, rel=1e-13, abs=1e-15 * mass)


def scene(body):
    return scene_of_text(f"format = 1\n[bodies.a]\n{body}\n")


def test_a_scene_takes_both():
    found = scene("density = 2.0\nshape = { box = [1, 1, 1] }\nrotation = { rpy_deg = [0, 0, 90] }").body("a")
    assert found.mass == 2.0
    np.testing.assert_allclose(found.inertia, np.eye(3) / 3, rtol=1e-15)
    np.testing.assert_allclose(found.pose[:4], [0.5**0.5, 0, 0, 0.5**0.5], atol=1e-16)
