"""Shells: the laws of the element, of meshes and of sections."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.shells import made
from ephs.mechanics.elements.shell.mesh import grid
from ephs.mechanics.elements.shell.section import Ply, ShellSection
from ephs.mechanics.elements.shell.shell import Shell, moved
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from tests.numerics import EPS, largest, seeds

WX, WY, WZ, X, Y, Z = range(6)

STEEL = ShellSection.isotropic(0.05, 1e3, 0.3, 2.0)
CROSSED = ShellSection.laminate([Ply(0.02, 2e3, 1e3, 4e2, 0.3, 0.3), Ply(0.03, 2e3, 7e2, 3e2, 0.2, -0.9)])


def curved(seed, section=STEEL, n=3):
    """A mesh on a saddle, of drawn distortion."""
    return made(lambda u, v: (u, v, 0.3 * u * v + 0.2 * v * v), (n, n), section, None, 0.3, seed).shell


def flat(seed, section):
    """Elements of a unit square, of drawn distortion, and which nodes lie on its rim."""
    held = made(lambda u, v: (u, v, 0.0), (3, 3), section, None, 0.25, seed, [1.0, 0.0, 0.0])
    return held.shell, ((held.at == 0) | (held.at == 1)).any(axis=1)


def changed(rng, shell, size):
    return moved(shell.poses, size * rng.standard_normal((len(shell.points), 6)))


def patch_is_exact(shell, rim, kind):
    """Nodes on the rim are moved as a constant strain does, those inside follow; another field does not pass."""
    x, y = shell.points[:, 0], shell.points[:, 1]
    exact, other = np.zeros((2, len(x), 6))
    if kind == "membrane":
        exact[:, X], exact[:, Y], exact[:, WZ] = x + 0.7 * y, y + 0.5 * x, -0.1
    else:
        exact[:, Z], exact[:, WX], exact[:, WY] = 0.5 * (x * x + x * y + y * y), y + 0.5 * x, -(x + 0.5 * y)
    other[:, X] = other[:, Z] = np.sin(3.0 * x)
    tangent = shell.tangent(shell.poses).toarray()
    outer, inner = np.flatnonzero(np.repeat(rim, 6)), np.flatnonzero(np.repeat(~rim, 6))
    condition = np.linalg.cond(tangent[np.ix_(inner, inner)])
    inside, beside = tangent[np.ix_(inner, inner)], tangent[np.ix_(inner, outer)]
    fields = [field.ravel() for field in (exact, other)]
    errors = [np.abs(np.linalg.solve(inside, -beside @ field[outer]) - field[inner]) for field in fields]
    assert errors[0].max() <= 10 * condition * EPS
    assert errors[1].max() > 1e-3


# ---- the element -----------------------------------------------------------------------------------------------------


@settings(max_examples=5)
@given(seeds)
def test_rigid_motions_change_neither_energy_nor_forces_in_the_nodes_axes(seed):
    rng = np.random.default_rng(seed)
    shell, motion = curved(seed), SE3.exp(rng.standard_normal(6))
    here = changed(rng, shell, 0.02)
    there = np.array([SE3.compose(motion, pose) for pose in here])
    energies = [shell.energy(poses) for poses in (here, there)]
    size = STEEL.plane[0, 0] * 16.0  # of numbers whose differences are strains
    assert largest(energies[1] - energies[0]) <= 64 * EPS * size
    forces = [shell.forces(poses) for poses in (here, there)]
    assert largest(forces[1][:, :3] - forces[0][:, :3]) <= 64 * EPS * size
    at_rest = shell.energy(np.array([SE3.compose(motion, pose) for pose in shell.poses]))
    assert at_rest.max() <= size * (64 * EPS) ** 2 < 1e-6 * energies[0].min()  # the control: strains are seen


@settings(max_examples=5)
@given(seeds, st.sampled_from([STEEL, CROSSED]))
def test_free_shells_have_six_motions_without_force(seed, section):
    shell = curved(seed, section)
    values = np.linalg.eigvalsh(shell.tangent(shell.poses).toarray())
    assert largest(values[:6]) <= 1e3 * EPS * values[-1] < 1e-3 * values[6]


@settings(max_examples=8)
@given(seeds, st.sampled_from(["membrane", "bending"]))
def test_constant_strains_are_exact_on_distorted_meshes(seed, kind):
    """Patch tests: nodes on the rim are moved, those inside follow; other fields do not pass."""
    shell, rim = flat(seed, STEEL)
    patch_is_exact(shell, rim, kind)


@settings(max_examples=8)
@given(seeds)
def test_the_energy_of_constant_strains_is_that_of_the_section(seed):
    """Of any laminate, stretching coupled with bending, on any mesh of a unit square."""
    shell, _ = flat(seed, CROSSED)
    strain = np.random.default_rng(seed).standard_normal(6)
    x, y = shell.points[:, 0], shell.points[:, 1]
    e, g, k, t = strain[:2], 0.5 * strain[2], strain[3:5], 0.5 * strain[5]
    field = np.zeros((len(x), 6))
    field[:, X], field[:, Y] = e[0] * x + g * y, g * x + e[1] * y
    field[:, Z] = -0.5 * (k[0] * x * x + k[1] * y * y) - t * x * y
    field[:, WX], field[:, WY] = -(k[1] * y + t * x), k[0] * x + t * y
    found = field.ravel() @ (shell.tangent(shell.poses) @ field.ravel())
    assert found == pytest.approx(strain @ CROSSED.plane @ strain, rel=1e-11)
    small, stress = 1e-7, CROSSED.plane @ strain
    resultants = shell.resultants(moved(shell.poses, small * field)) / small
    assert largest(resultants - [*stress, 0.0, 0.0]) <= 1e-5 * largest(stress)  # of order 1 in what is small


@settings(max_examples=8)
@given(seeds)
def test_forces_are_the_slope_of_the_energy_and_the_tangent_is_theirs(seed):
    rng = np.random.default_rng(seed)
    shell = curved(seed, CROSSED)
    poses, way = changed(rng, shell, 0.1), rng.standard_normal((len(shell.points), 6))
    steps = 1e-3 * np.array([1.0, -1.0, 2.0, -2.0])
    weights = np.array([8.0, -8.0, -1.0, 1.0]) / 12.0e-3  # of order 4
    energies, forces = zip(
        *((shell.energy(p).sum(), shell.forces(p)) for p in (moved(poses, h * way) for h in steps)), strict=True
    )
    assert weights @ energies == pytest.approx(np.sum(shell.forces(poses) * way), rel=1e-7)
    found = np.einsum("k,kij->ij", weights, np.array(forces)).ravel()
    assert largest(shell.tangent(poses) @ way.ravel() - found) <= 1e-7 * largest(found)


@settings(max_examples=10)
@given(seeds)
def test_inner_forces_have_neither_sum_nor_moment(seed):
    rng = np.random.default_rng(seed)
    shell = curved(seed)
    poses = changed(rng, shell, 0.1)
    force = shell.forces(poses)
    moments = np.array([quaternion_to_matrix(q[:4]) @ m for q, m in zip(poses, force[:, :3], strict=True)])
    whole = np.concatenate([moments + np.cross(poses[:, 4:], force[:, 3:]), force[:, 3:]], axis=1)
    assert largest(whole.sum(axis=0)) <= 64 * EPS * np.abs(whole).sum()


# ---- meshes and sections that are refused ----------------------------------------------------------------------------


def square():
    return grid(lambda u, v: (2.0 * u, 2.0 * v, 0.0 * u), (2, 2))


def test_a_mesh_that_is_no_shell_is_refused_by_the_name_of_its_element():
    points, _, cells = square()
    Shell.of(points, cells, STEEL)  # the control

    def with_points(**moves):
        out = points.copy()
        for name, place in moves.items():
            out[int(name[1:])] = place
        return out

    def with_cells(change):
        out = cells.copy()
        change(out)
        return out

    def turned(c):
        c[3] = c[3][::-1]

    third = np.array([*points.tolist(), [1.0, 0.5, 1.0], [1.0, 1.0, 1.0]])
    centre = cells[0, 2]
    for mesh, place, words in (
        ((with_points(n4=[0.0, 0.0, 0.0]), cells), "elements[0]", "an area"),
        ((with_points(n4=[2.5, 2.5, 0.0]), cells), "elements[1]", "convex corners"),
        ((points * [1.0, 0.0, 0.0], cells), "elements[0]", "an area"),
        ((with_points(n4=[1.0, 1.0, 1.5]), cells), "elements[0]", "of a plane"),
        ((points, with_cells(turned)), "elements[3]", "orientation of its neighbour"),
        ((third, np.vstack([cells, [cells[0, 1], centre, 10, 9]])), "elements[4]", "at most two elements at the edge"),
        ((points, cells + 1), "elements[3]", "a node of 0 … 8"),
        ((points[:, :2], cells), "points", "(m, 3)"),
        ((points, cells[:, :3]), "elements", "integers (n, 4)"),
        ((third[:10], cells), "points[9]", "elements that match"),
    ):
        with pytest.raises(StructureError) as refused:
            Shell.of(*mesh, STEEL)
        text = str(refused.value)
        assert f"parameter {place} is" in text and words in text, text
    with pytest.raises(StructureError, match="normals"):
        Shell.of(points, cells, STEEL, np.zeros((9, 3)))
    with pytest.raises(StructureError, match=r"elements\[0\].*60°"):
        Shell.of(points, cells, STEEL, np.tile([1.0, 0.0, 0.0], (9, 1)))


@pytest.mark.parametrize(
    ("given", "key"),
    [((0.0, 1.0), "thickness"), ((1.0, -1.0), "E1"), ((1.0, 1.0, 0.6), "nu"), ((1.0, 1.0, 0.3, -1.0), "rho"),
     ((np.nan, 1.0), "thickness")],
)  # fmt: skip
def test_a_section_out_of_range_is_refused(given, key):
    with pytest.raises(StructureError, match=key):
        ShellSection.isotropic(*given)


def test_layers_add_up_to_their_material_and_turn_with_it():
    whole = ShellSection.isotropic(0.05, 1e3, 0.3, 2.0)
    ply = Ply(0.0, 1e3, 1e3, 0.5e3 / 1.3, 0.3, 0.7, 2.0)
    split = ShellSection.laminate(
        [replace(ply, thickness=h, angle=a) for h, a in ((0.01, 0.1), (0.03, 2.0), (0.01, 0.5))]
    )
    for key in ("plane", "shear", "mass", "thickness"):
        assert np.allclose(getattr(split, key), getattr(whole, key), rtol=1e-13, atol=1e-13 * largest(whole.plane))
    along, across = (ShellSection.laminate([Ply(0.1, 3.0, 1.0, 0.5, 0.25, a, G23=0.2)]) for a in (0.0, np.pi / 2.0))
    order = [1, 0, 2, 4, 3, 5]
    assert np.allclose(across.plane[np.ix_(order, order)], along.plane, rtol=1e-14, atol=1e-16)
    assert np.allclose(across.shear[::-1, ::-1], along.shear, rtol=1e-14)
    assert along.plane[0, 0] > 2.0 * across.plane[0, 0]  # the control
    with pytest.raises(StructureError, match=r"plies\[1\].E2"):
        ShellSection.laminate([Ply(0.1, 3.0, 1.0, 0.5), Ply(0.1, 3.0, 0.0, 0.5)])


def test_a_crease_keeps_the_normals_of_its_elements():
    points = np.array([[0.0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [1, 0, 1], [1, 1, 1]])
    cells = np.array([[0, 2, 3, 1], [2, 4, 5, 3]])
    sharp, round_ = (Shell.of(points, cells, STEEL, crease=c) for c in (0.5, 2.0))
    assert largest(sharp.rest[..., :3]) <= 8 * EPS
    assert largest(round_.rest[..., :3]) > 0.5
