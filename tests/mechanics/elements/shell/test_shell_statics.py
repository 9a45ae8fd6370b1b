"""Shells at rest, their snaps, critical loads and modes: published values, closed forms, laws."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import assume, given
from scipy.sparse import csc_array

from benchmarks import shells
from benchmarks.shells import ALL, X, Z, made
from ephs.mechanics.elements.shell import spectra, statics
from ephs.mechanics.elements.shell.section import ShellSection
from ephs.semantics.bundles.errors import StructureError
from tests.numerics import EPS, largest


@pytest.mark.parametrize(
    ("name", "ratios"),
    [  # what is recorded of the element in double precision, by an independent program
        ("roof", (0.983, 0.992, 0.995)),
        ("pinched cylinder", (0.599, 0.876, 0.976)),
        ("hemisphere", (0.976, 0.997, 1.002)),
        ("Cook's membrane", (0.996, 0.987, 0.991)),
        ("twisted beam", (0.976, 0.991, 0.994)),
        ("twisted beam, thin", (0.986, 0.982, 0.994)),
    ],
)
def test_published_displacements_are_met_by_the_recorded_ratios(name, ratios):
    problem, sizes, known = shells.PUBLISHED[name]
    assert [problem(n) / known for n in sizes] == pytest.approx(ratios, abs=1e-3)  # a unit of the last digit


def test_thin_and_distorted_meshes_do_not_lock():
    for ratio in (1e-2, 1e-3, 1e-4):
        assert shells.plate(8, ratio, 0.3) / 0.00126532 == pytest.approx(1.0, abs=0.03)
    assert shells.hemisphere(8, 1e-3) / 0.0930 == pytest.approx(0.953, abs=5e-4)
    assert shells.roof(8, 0.3) / 0.3024 == pytest.approx(0.99, abs=0.02)


def test_displacements_converge_by_order_two():
    off = [abs(shells.plate(n, 1e-3) / 0.00126532 - 1.0) for n in (4, 8, 16)]
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.1)
    assert off[1] / off[2] == pytest.approx(4.0, rel=0.1)


# ---- large displacements ---------------------------------------------------------------------------------------------


def test_four_elements_roll_up_to_a_circle():
    held, poses = shells.rolled(4)
    start, end = poses[held.node(0, 0)], poses[held.node(1, 0)]
    assert largest(end[4:] - start[4:]) <= 1e3 * EPS * 12.0
    assert abs(abs(end[:4] @ start[:4]) - 1.0) <= 1e3 * EPS
    bent = 0.5 * 1.2e6 * 0.1**3 / 12.0 * (2.0 * np.pi / 12.0) ** 2 * 12.0
    assert held.shell.energy(poses).sum() == pytest.approx(bent, rel=1e-10)


def test_a_cantilever_and_a_hemisphere_deflect_as_published():
    assert shells.cantilever(16) == pytest.approx((6.696, 3.287), abs=1e-3)  # Sze: 6.698, 3.286
    held = shells.ball(8)
    path = statics.follow(held.shell, 200.0 * held.load, held.free, step=0.05)
    assert path.shares[-1] == 1.0
    out, into = path.poses[-1, held.node(0, 0), 4] - 10.0, 10.0 - path.poses[-1, held.node(1, 0), 5]
    assert (out, into) == pytest.approx((4.067, 8.178), rel=0.05)  # 8 × 8 elements


def test_a_hinged_roof_is_followed_through_its_snap_and_is_unstable_while_the_load_falls():
    path = shells.snapped(4)
    assert shells.limit(path) == pytest.approx(2.2, rel=0.1)
    assert path.unstable[[0, -1]].tolist() == [0, 0] and path.unstable.max() == 1
    falls = np.diff(path.shares) < 0.0
    assert falls.any() and not falls.all()
    assert (np.diff(path.poses[:, 0, 6]) < 0.0).all()  # it never turns back


def test_dead_forces_do_work_that_the_shell_stores():
    """Over a fine path ∫ load · displacement is the strain energy, by the trapezoidal rule's order 2."""
    held = made(lambda u, v: (2 * u, v, 0.1 * u * u), (3, 2), ShellSection.isotropic(0.05, 1e4, 0.3))
    held.hold(held.side(0, 0), *ALL)
    held.edge(held.side(0, 1), Z, 0.03)

    def missing(count):
        poses, work, before = held.shell.poses, 0.0, 0.0
        for share in np.arange(1, count + 1) / count:
            poses, _ = statics.equilibrium(held.shell, share * held.load, held.free, poses)
            height = float(held.load[:, Z] @ (poses[:, 6] - held.shell.points[:, 2]))
            work, before = work + (share - 0.5 / count) * (height - before), height
        return work - held.shell.energy(poses).sum(), work

    (coarse, work), (fine, _) = missing(4), missing(8)
    assert abs(coarse) < 0.05 * work and coarse / fine == pytest.approx(4.0, rel=0.2)


def test_what_cannot_be_at_rest_is_told():
    held = made(lambda u, v: (u, v, 0.0), (2, 2), ShellSection.isotropic(0.05, 1e3, 0.3))
    held.hold(held.side(0, 0), *ALL)
    held.edge(held.side(0, 1), Z, 1e4)
    with pytest.raises(statics.NoEquilibrium, match="smaller parts"):
        statics.equilibrium(held.shell, held.load, held.free)
    with pytest.raises(StructureError, match=r"load.*9, 6"):
        statics.displacements(held.shell, held.load[:4], held.free)
    with pytest.raises(StructureError, match=r"free.*9, 6"):
        statics.displacements(held.shell, held.load, np.zeros((9, 6), dtype=bool))


# ---- spectra ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "published"),
    [("FV12", (1.622, 2.360, 2.922, 4.233, 4.233)), ("FV16", (0.421, 1.029, 2.582, 3.306, 3.753))],
)
def test_plates_vibrate_as_published(kind, published):
    assert shells.plate_modes(8, kind)[:5] == pytest.approx(published, rel=0.12)
    assert shells.plate_modes(16, kind)[:5] == pytest.approx(published, rel=0.035)


def test_a_ring_vibrates_by_rayleigh():
    off = [np.abs(np.array(shells.ring(n)) - 1.0) for n in (32, 64)]
    assert off[1].max() < 0.01
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.25)


@given(st.integers(1, 12), st.data())
def test_negative_eigenvalues_are_counted_where_pivots_are_zero(size, data):
    part = st.lists(st.integers(-2, 2), min_size=size, max_size=size)
    full = np.array(data.draw(st.lists(part, min_size=size, max_size=size)), dtype=float)
    full = full + full.T
    values = np.linalg.eigvalsh(full)
    assume(np.abs(values).min() > 1e-9)
    assert statics.negative(csc_array(full)) == (values < 0.0).sum()


def test_a_matrix_of_zeros_has_no_count():
    assert statics.negative(csc_array(np.array([[0.0, 1.0], [1.0, 0.0]]))) == 1  # no pivot on the diagonal at first
    with pytest.raises(statics.NoEquilibrium, match="cannot be counted"):
        statics.negative(csc_array(np.zeros((2, 2))))


def test_critical_loads_are_counted_and_end_the_vibration():
    """ω² of a loaded plate falls in a line to 0 at the critical load, with the first negative value."""
    off = [abs(shells.compressed(n) - 4.0) for n in (8, 16)]
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.1)
    held = made(lambda u, v: (u, v, 0.0), (4, 4), ShellSection.isotropic(0.01, 1.0, 0.3, 1.0))
    held.hold(((held.at == 0) | (held.at == 1)).any(axis=1), Z)
    held.hold(held.side(0, 0), *ALL)
    held.edge(held.side(0, 1), X, -1e-6)
    found = spectra.buckling(held.shell, held.load, held.free, 3).values
    assert (np.diff(found) > 0.0).all()
    squares = []
    for part in (0.0, 0.5, 0.99, 1.01):
        poses, _ = statics.equilibrium(held.shell, part * found[0] * held.load, held.free)
        tangent = statics.ReducedTangent.of(held.shell.tangent(poses), held.free).matrix
        assert statics.negative(tangent) == (part > 1.0)
        value = spectra.modes(held.shell, held.free, 1, poses).values[0]
        squares.append(np.copysign(value**2, value))
    assert squares[1] / squares[0] == pytest.approx(0.5, abs=0.02)
    assert abs(squares[2]) < 0.02 * squares[0] and squares[3] < 0.0 < squares[2]


def test_modes_are_those_of_the_dense_pencil_and_multiple_ones_are_complete():
    held = made(lambda u, v: (u, v, 0.0), (4, 4), ShellSection.isotropic(0.05, 1.0, 0.3, 1.0))
    shell, free = held.shell, np.ones((25, 6), dtype=bool)
    mass = np.sqrt(shell.inertia.ravel())
    exact = np.linalg.eigvalsh(shell.tangent(shell.poses).toarray() / np.outer(mass, mass))
    found = spectra.modes(shell, free, 10)
    assert len(found.values) == 11  # two of a square plate's are one
    size = 1e2 * EPS * exact[-1]
    assert largest(found.values * np.abs(found.values) - exact[:11]) <= size
    assert spectra.modes(shell, free, 1).values.size == 6
    assert largest(shell.tangent(shell.poses) @ found.shapes[:6].reshape(6, -1).T) <= 1e3 * size
