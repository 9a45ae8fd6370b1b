"""The mechanical primitives, and that the compiled kernels compute what their plain definitions say."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ephs.mechanics.elements import components, springs
from ephs.mechanics.elements.closing import closing
from ephs.mechanics.elements.offset import frame_change
from ephs.mechanics.elements.tendon import tension_spring
from ephs.operad import Path
from ephs.operad import quantity as Q
from ephs.semantics import Irreversible, Storage, StructureError, library
from ephs.semantics.descriptor.kernel_table import DOMAIN, OK, TEMPERATURE, TURN
from ephs.semantics.descriptor.sparsity import jacobian_mask
from ephs.semantics.spaces import PAIRS, SE3, SO3, pair
from ephs.semantics.verdicts.search import search
from ephs.testing import check_primitive, mechanisms
from tests.mechanics.kernels import REFERENCE, Draw, agreeing
from tests.numerics import EPS, generators, largest, seeds
from tests.semantics.subspace import assert_dirac

SIZES = [0.0, 1e-10, 1e-7, 1e-4, 0.02, 0.3]

END, OTHER = (
    (SE3.exp(np.array(offset)), np.diag(masses))
    for offset, masses in (
        ([0.3, -0.2, 0.5, 1.0, 2.0, -1.0], [1.0, 2.0, 2.5, 3.0, 3.0, 3.0]),
        ([-0.1, 0.4, 0.2, 0.3, -0.5, 0.7], [0.2, 0.3, 0.4, 0.7, 0.7, 0.7]),
    )
)
"""Offsets and inertias of two bodies at a joint."""


def pairs():
    return {name: pair(name, **dict.fromkeys(entry.parameters, 0.3)) for name, entry in PAIRS.items()}


def primitives():
    """Every primitive that names a kernel, by an id."""
    out = {}
    for group in ("SE3", "SO3xR3"):
        out[f"kinetic {group}"] = components.kinetic(
            2.0, np.array([[1.0, 0.1, 0.0], [0.1, 2.0, 0.2], [0.0, 0.2, 2.5]]), group
        )
        out[f"gravity {group}"] = components.gravity(np.array([1.0, -2.0, 3.0]), group)
        out[f"lie_poisson {group}"] = components.lie_poisson(group)
    for name, of in pairs().items():
        stiffness, rest = np.arange(1.0, of.dim + 1.0), np.linspace(0.1, 0.4, of.dim)
        if name in ("spherical", "free"):
            stiffness[:3], rest[:3] = 2.0, 0.0
        factor = np.arange(1.0, of.dim**2 + 1.0).reshape(of.dim, of.dim) / 10.0
        out[f"pair_spring {name}"] = components.pair_spring(of, stiffness, rest)
        out[f"holonomic {name}"] = components.holonomic(of)
        out[f"velocity_relation {name}"] = components.holonomic(of, on_group=False)
        out[f"closing {name}"] = closing(of, END, None if name == "planar" else OTHER)
        out[f"joint_friction {name}"] = components.joint_friction(of, factor @ factor.T)
    out["pkc"] = components.kinematic_coupling(Q.pose, Q.body_momentum, "q", "p")
    out["no_potential"] = components.no_potential(Q.pose, "q")
    out["frame_change"] = frame_change(SE3.exp(np.array([0.3, -0.2, 0.5, 1.0, 2.0, -1.0])), "p_j1", "p1")
    out["point_spring"] = springs.point_spring(2.0, 1.0)
    out["point_damper"] = springs.point_damper(3.0)
    out["point_stretch"] = springs.point_stretch()
    out["tension_spring"], out["slack_spring"] = tension_spring(3.0, 1.0), tension_spring(3.0, 1.0, slack=True)
    out["ground"] = components.ground()
    out["thermal_node"] = components.thermal_node(50.0, 300.0)
    out["ideal_gas"] = library.ideal_gas(c1=2.0, c2=1.5, v0=1.0, c=1.5)
    out["heat_transfer"] = library.heat_transfer(h=2.0)
    out["mkc"] = library.mkc()
    out["environment"] = library.environment()
    return out


PRIMITIVES = primitives()


@pytest.mark.parametrize("name", PRIMITIVES)
@settings(max_examples=15)
@given(seed=seeds, size=st.sampled_from(SIZES))
def test_a_kernel_is_its_plain_definition(name, seed, size):
    draw = Draw(PRIMITIVES[name], seed, size)
    energy = agreeing(draw)
    if isinstance(draw.primitive, Storage) and not draw.primitive.environment:
        there = draw.primitive.energy(draw.primitive.retract(draw.x, draw.v))
        assert abs(energy - there) <= 4e-15 * max(1.0, abs(there))


WITHOUT_LOSSES = [n for n, p in PRIMITIVES.items() if not isinstance(p, Irreversible)]


@pytest.mark.parametrize("name", [name for name in WITHOUT_LOSSES if not name.startswith("velocity_relation")])
def test_a_mask_has_no_more_entries_than_its_jacobian(name):
    """Of the others parts count that cancel each other."""
    drawn = [Draw(PRIMITIVES[name], seed, 0.3).compiled() for seed in range(12)]
    found = np.any([jacobian != 0.0 for status, _, jacobian, _ in drawn if status == OK], axis=0)
    assert np.array_equal(found, jacobian_mask(PRIMITIVES[name]))


@pytest.mark.parametrize("name", [n for n, p in PRIMITIVES.items() if isinstance(p, Storage) and not p.environment])
@given(seed=seeds, size=st.sampled_from(SIZES))
def test_a_discrete_gradient_gives_the_rise_and_is_symmetric(name, seed, size):
    draw = Draw(PRIMITIVES[name], seed, 0.5 * size)
    storage, x, v = draw.primitive, draw.x, draw.v
    intensive = storage.bundle.intensive(REFERENCE)
    effort = storage.discrete_effort(x, v, REFERENCE)
    x1 = storage.retract(x, v)
    rise = storage.energy(x1) - storage.energy(x)
    scale = abs(storage.energy(x)) + abs(storage.energy(x1)) + (np.abs(effort) + np.abs(intensive)) @ np.abs(v)
    # where an energy is a small difference of terms, it feels the rounding of the states
    rounded = np.abs(effort + intensive).sum() * max(float(largest(value, initial=0.0)) for value in x.values())
    assert abs(rise - (effort + intensive) @ v) <= 2e-14 * scale + 2e-15 * rounded + 8e-16 * np.abs(v).sum()
    back = storage.discrete_effort(x1, -v, REFERENCE)
    assert largest(back - effort, initial=0.0) <= 1e-12 * max(1.0, largest(effort, initial=0.0))


@given(seed=seeds, size=st.sampled_from([1e-6, 1e-3, 0.1]))
def test_a_spring_is_exact_where_its_rotation_vector_jumps(seed, size):
    """Past half a turn the principal rotation vector changes its sign: the energy has an edge there, and no jump."""
    rng = np.random.default_rng(seed)
    of = pair("spherical")
    axis = rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    storage = components.pair_spring(of, np.full(3, 2.0), np.zeros(3))
    (port,) = storage.reads
    draw = Draw(storage, seed, size)
    draw.x = {port: of.manifold.exp((np.pi - 0.3 * size) * axis)}
    draw.v = size * (axis + 0.3 * rng.standard_normal(3))
    rise = storage.energy(storage.retract(draw.x, draw.v)) - storage.energy(draw.x)
    status, effort, _, energy = draw.compiled()
    assert status == OK
    assert abs(effort @ draw.v - rise) <= 1e-14 * storage.energy(draw.x)
    assert abs(draw.plain(draw.v) @ draw.v - rise) <= 1e-14 * storage.energy(draw.x)
    assert abs(energy - storage.energy(storage.retract(draw.x, draw.v))) <= 1e-14 * energy


# ---- the joint relation ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", PAIRS)
@given(seed=seeds)
def test_the_discrete_joint_relation_is_a_dirac_structure(kind, seed):
    """C_h e = F, so that ⟨e|C_h*λ⟩ = ⟨λ|F⟩ = 0 on it; isotropic, and of full dimension."""
    primitive = components.holonomic(pairs()[kind])
    draw = Draw(primitive, seed, 0.1)
    discrete, residual = primitive.discrete(draw.h, draw.x, draw.steps(draw.v), draw.e)
    assert largest(discrete @ draw.e - residual) <= 1e-13 * (np.abs(discrete) @ np.abs(draw.e)).max()
    assert_dirac(np.zeros((draw.n, draw.n)), discrete)


@pytest.mark.parametrize("kind", PAIRS)
@given(rng=generators)
def test_the_discrete_joint_relation_keeps_the_joint_closed(kind, rng):
    """Frames that fit at the start fit at the end: q_1 o_1 I(q_r) = q_2 o_2, exactly."""
    of = pairs()[kind]
    h, u1, u_r = 0.05, rng.standard_normal(6), rng.standard_normal(of.dim)
    x0 = of.manifold.random(rng)
    carried = SE3.compose(SE3.exp(h * SE3.adjoint(SE3.inverse(of.include(x0))) @ u1), SE3.exp(h * of.basis @ u_r))
    e = np.concatenate([u1, SE3.log(carried) / h, u_r])  # the third frame's twist, from the group relation
    primitive = components.holonomic(of)
    (port,) = primitive.reads
    _, residual = primitive.discrete(h, {port: x0}, {port: h * u_r}, e)
    assert largest(residual) <= 1e-13 / h * 0.1 * max(1.0, largest(e))
    first = SE3.random(rng)
    second = SE3.compose(first, of.include(x0))
    ended = SE3.compose(SE3.retract(first, h * u1), of.include(of.manifold.retract(x0, h * u_r)))
    gap = SE3.log(SE3.compose(SE3.inverse(ended), SE3.retract(second, h * e[6:12])))
    assert largest(gap) <= 2e-15 * max(1.0, largest(ended)) * 4


# ---- domains ---------------------------------------------------------------------------------------------------


def test_a_rotation_of_half_a_turn_in_a_step_is_refused():
    draw = Draw(components.holonomic(pairs()["spherical"]), 0, 0.01)
    draw.h, draw.e = 1.0, 4.0 * np.ones_like(draw.e)
    assert draw.compiled()[0] == TURN
    with pytest.raises(StructureError, match="rotation of π"):
        draw.plain(draw.z)


@pytest.mark.parametrize("name", ["joint_friction revolute", "point_damper", "heat_transfer"])
def test_a_temperature_below_zero_is_refused(name):
    draw = Draw(PRIMITIVES[name], 0, 0.01)
    hot = draw.primitive.bundle.indicator("entropy") == 1.0
    draw.e = np.where(hot, -400.0, draw.e)
    assert draw.compiled()[0] == TEMPERATURE
    with pytest.raises(StructureError, match="temperature"):
        draw.plain(draw.z)


@pytest.mark.parametrize("e", [[0.0] * 6 + [1.0], [1.0] * 7])
def test_a_stretch_without_length_has_no_direction(e):
    draw = Draw(PRIMITIVES["point_stretch"], 0, 0.0)
    for value in draw.x.values():
        value[4:] = 0.0
    draw.e = np.array(e)
    assert draw.compiled()[0] == DOMAIN


def test_a_spring_without_length_has_no_direction():
    draw = Draw(PRIMITIVES["point_spring"], 0, 0.0)
    for value in draw.x.values():
        value[4:] = 0.0
    assert draw.compiled()[0] == DOMAIN
    assert np.isnan(draw.primitive.energy_gradient(draw.x)).any()


def test_springs_on_rotation_vectors_rest_at_zero():
    with pytest.raises(StructureError, match="rest"):
        components.pair_spring(pair("spherical"), np.ones(3), np.array([0.1, 0.0, 0.0]))


@given(st.integers(0, 2**32 - 1), st.floats(1e-9, 3.0))
def test_springs_on_rotation_vectors_may_be_stiffer_about_one_axis(seed, size):
    """½ Σ k_i θ_i² with θ = log q, and what its effort does on a small turn is the change of that."""
    rng, k = np.random.default_rng(seed), np.array([5.0, 1.0, 2.0])
    spring, at = components.pair_spring(pair("spherical"), k, np.zeros(3)), Path.of("q_r")
    theta = rng.standard_normal(3)
    theta *= size / np.linalg.norm(theta)
    energy = 0.5 * float(k @ theta**2)
    q = SO3.exp(theta)
    assert abs(spring.energy({at: q}) - energy) <= 64 * EPS * energy
    assert abs(spring.energy({at: -q}) - energy) <= 64 * EPS * energy
    v = 0.1 * rng.standard_normal(3)
    after = spring.energy({at: SO3.retract(q, v)})
    work = float(spring.discrete_gradient({at: q}, v) @ v)
    assert abs(work - (after - energy)) <= 256 * EPS * (energy + after)


def test_springs_stiffer_about_one_axis_pass_their_checks():
    check_primitive(components.pair_spring(pair("spherical"), np.array([5.0, 1.0, 2.0]), np.zeros(3)), max_examples=20)


@settings(max_examples=30)
@given(mechanisms())
def test_what_is_trusted_is_proved_and_passes_the_checks(scene):
    for path, primitive in scene.system().leaves():
        assert primitive.verdict == "proved", f"{path}: {primitive.verdict.text}"
        search(primitive, 5)  # raises where a check fails


@pytest.mark.parametrize("mu", [[[1.0, 0.5], [0.0, 1.0]], [[1.0, 2.0], [2.0, 1.0]], [[-1.0, 0.0], [0.0, 1.0]]])
def test_friction_that_makes_energy_is_not_trusted(mu):
    with pytest.raises(StructureError):
        components.joint_friction(pair("cylindrical"), np.array(mu))
