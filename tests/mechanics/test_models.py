"""Bodies, joints and their composition: the patterns, and that they mean the equations of the literature."""

import numpy as np
import pytest
from hypothesis import given, settings

from ephs.mechanics import (
    body_pattern,
    joint,
    joint_pattern,
    mbs_pattern,
    rigid_body,
    universal_joint,
)
from ephs.operad import Path
from ephs.semantics import Reference, StructureError, System
from ephs.semantics.spaces import PAIRS, SE3, SO3xR3, pair
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from tests.mechanics.mechanisms import GRAVITY, TwoBodies, kinds
from tests.numerics import seeds
from tests.semantics.subspace import subspace_of

few = settings(max_examples=10)
THETA = Reference().temperature


# ---- patterns --------------------------------------------------------------------------------------------------


def test_a_body_has_four_boxes_and_a_joint_seven():
    assert sorted(map(str, body_pattern().boxes)) == ["ke", "lp", "pe", "pkc"]
    assert sorted(map(str, body_pattern().junctions)) == ["p", "q"]
    for name in PAIRS:
        pattern = joint_pattern(pair(name, **dict.fromkeys(PAIRS[name].parameters, 0.1)))
        assert sorted(map(str, pattern.boxes)) == ["env", "hc", "mf", "o1", "o2", "pe", "pkc"]
        assert sorted(map(str, pattern.junctions)) == ["p1", "p2", "p_j1", "p_j2", "p_r", "q_r", "s"]
        assert sorted(map(str, pattern.interface)) == ["p1", "p2"]


# ---- bodies ----------------------------------------------------------------------------------------------------


@few
@given(seeds)
def test_a_body_means_newton_and_euler(seed):
    """q̇ = u, ṗ = ad*_u p − T*L dV + p.f, p.e = u, for both groups."""
    two = TwoBodies.draw("revolute", seed)
    rng = np.random.default_rng(seed)
    for group, space in (("SE3", SE3), ("SO3xR3", SO3xR3)):
        metric, u, f = two.metric[0], two.u1, rng.standard_normal(6)
        body = rigid_body(two.masses[0], two.inertias[0], (0.3, -0.2, -9.81), group=group)
        relation = body.relation().at({"pe.q": two.q1, "ke.p": metric @ u})
        force = -two.masses[0] * np.array([0.3, -0.2, -9.81])
        turned = quaternion_to_matrix(two.q1[:4]).T @ force if group == "SE3" else force
        rates = {"ke.p": space.ad(u).T @ (metric @ u) - np.concatenate([np.zeros(3), turned]) + f, "pe.q": u}
        point = np.concatenate([*(rates[str(path)] for path, _ in relation.rates), f, u, [1.0]])
        assert subspace_of(relation).contains(point) <= 1e-13
        assert relation.dimension == 7


def test_a_massless_frame_has_no_kinetic_energy():
    frame = rigid_body(0.0, [0.0, 0.0, 0.0])
    assert sorted(map(str, frame.pattern.boxes)) == ["pe", "pkc"]


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ({"mass": -1.0}, "mass"), ({"mass": np.nan}, "mass"), ({"inertia": [1.0, 1.0, 3.0]}, "inertia"),
        ({"inertia": [1.0, -1.0, 1.0]}, "inertia"), ({"inertia": [1.0]}, "inertia"),
        ({"inertia": [[1.0, 0.5, 0], [0, 1, 0], [0, 0, 1]]}, "inertia"), ({"gravity": [0.0]}, "gravity"),
        ({"group": "SO3"}, "group"), ({"mass": 0.0}, "inertia"),
    ],
)  # fmt: skip
def test_impossible_bodies_are_refused(arguments, key):
    with pytest.raises(StructureError, match=f"parameter {key} is"):
        rigid_body(**{"mass": 1.0, "inertia": [1.0, 1.0, 1.0], **arguments})


# ---- joints ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", kinds())
@few
@given(seed=seeds)
def test_the_flat_system_means_its_equations(kind, seed):
    """q̇ᵢ = uᵢ, ṗ₁ = ad*p₁ − dV₁ − Ad*Ad*λ, ṗ₂ = ad*p₂ − dV₂ + Ad*λ, q̇_r = u_r, ṡ = μ(u_r, u_r)/θ₀."""
    two = TwoBodies.draw(kind, seed)
    relation = two.system.relation().at(two.state, efforts=two.efforts)
    d = two.of.dim
    # λ is free up to Bᵀλ = −dV_r − μ u_r: 6 − d of it remain, beside the constant
    assert relation.dimension == 6 - d + 1
    rng = np.random.default_rng(seed)
    lam = -np.linalg.pinv(two.of.basis.T) @ (two.spring + two.mu @ two.u_r)
    lam += (np.eye(6) - np.linalg.pinv(two.of.basis.T) @ two.of.basis.T) @ rng.standard_normal(6)
    rates = {
        "body1.pe.q": two.u1, "body2.pe.q": two.u2, "joint.pe.q_r": two.u_r,
        "body1.ke.p": two.gyroscopic[0] - two.weight(0) - two.to_c1.T @ lam,
        "body2.ke.p": two.gyroscopic[1] - two.weight(1) + two.to_c2.T @ lam,
        "joint.env.s": [two.u_r @ two.mu @ two.u_r / THETA],
    }  # fmt: skip
    point = np.concatenate([*(np.atleast_1d(rates[str(path)]) for path, _ in relation.rates), [1.0]])
    assert subspace_of(relation).contains(point) <= 1e-12
    nested = two.system.relation(route="nested").at(two.state, efforts=two.efforts)
    assert relation.distance(nested) <= 1e-12


def test_a_universal_joint_is_two_revolutes_and_its_frame_is_massless():
    cross = universal_joint(None, SE3.exp(np.array([np.pi / 2, 0, 0, 0, 0, 0])), None, [0.1, 0.2])
    assert sorted(map(str, cross.pattern.boxes)) == ["first", "second"]
    assert len(cross.flatten().pattern.boxes) == 14
    flat, nested = (cross.relation(route=route).at() for route in ("flat", "nested"))
    assert flat.distance(nested) <= 1e-13
    with pytest.raises(StructureError, match="coupling"):
        universal_joint(None, None, None, [[0.1, 0.1], [0.1, 0.2]])


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ({"kind": "hinge"}, "kind"), ({"frame1": [1.0, 0, 0]}, "frame"), ({"frame2": {"at": [0, 0, 0]}}, "frame"),
        ({"frame1": [2.0, 0, 0, 0, 0, 0, 0]}, "frame"), ({"stiffness": [1.0, 2.0]}, "stiffness"),
        ({"friction": [[1.0, 0.0], [0.0, 1.0]]}, "friction"),
    ],
)  # fmt: skip
def test_impossible_joints_are_refused(arguments, key):
    with pytest.raises(StructureError, match=f"parameter {key} is"):
        joint(**{"kind": "revolute", **arguments})


def test_friction_that_is_no_friction_is_refused():
    with pytest.raises(StructureError, match="negative eigenvalue"):
        joint("revolute", friction=-0.1)
    with pytest.raises(StructureError, match="Onsager symmetric"):
        joint("cylindrical", friction=[[1.0, 0.5], [0.0, 1.0]])


@few
@given(seeds)
def test_functions_of_the_user_mean_what_the_built_in_parts_mean(seed):
    """A potential and a friction from Python functions, against the spring and the constant they equal."""
    two = TwoBodies.draw("cylindrical", seed)
    own = System.of(
        mbs_pattern(),
        {
            "body1": rigid_body(
                two.masses[0], two.inertias[0], (0, 0, 0), potential=lambda q: float(-two.masses[0] * GRAVITY @ q[4:])
            ),
            "body2": two.system.fillings[Path.of("body2")],
            "joint": joint(
                "cylindrical", *two.offsets,
                friction=lambda _x, _u, _theta: two.mu, potential=lambda x: 0.85 * float(x @ x),
            ),
        },
    )  # fmt: skip
    ours, theirs = (s.relation().at(two.state, efforts=two.efforts) for s in (own, two.system))
    assert ours.distance(theirs) <= 1e-9


def test_friction_may_depend_on_the_temperature():
    """μ(θ) = 0.1 θ is taken at the local temperature θ₀ + s.e."""
    friction = joint("revolute", friction=lambda x, u, theta: [[0.1 * theta]], heat=True).fillings[Path.of("mf")]
    flow = friction.flow({Path.of("q_r"): np.zeros(1)}, np.array([2.0, 10.0]), Reference())
    theta = THETA + 10.0
    assert flow == pytest.approx([0.2 * theta, -0.4])
