"""Shells that move beside published and closed forms: frequencies, ribs, bodies on sheets, and the rigid limit."""

import numpy as np
import pytest

import ephs
from benchmarks import shells
from ephs import Pattern, junction
from ephs.mechanics import Shell, ShellSection, rigid_body
from ephs.mechanics.elements.shell import spectra
from ephs.mechanics.elements.shell.mesh import grid
from ephs.mechanics.elements.shell.system import shell_system
from ephs.mechanics.motion.batch import compose
from tests.numerics import EPS, largest

PUBLISHED = {"FV12": (1.622, 2.360, 2.922, 4.233, 4.233), "FV16": (0.421, 1.029, 2.582, 3.306, 3.753)}
MOMENTUM = junction(ephs.quantity.body_momentum)
STILL = (0.0, 0.0, 0.0)


def shifted(*place):
    return np.array([1.0, 0.0, 0.0, 0.0, *place])


def frequencies(system):
    """Angular frequencies of the linearised motion, the lowest first; rigid ones are 0."""
    return np.sort(np.abs(ephs.linearize(system).eigenvalues.imag))[::2]


def extrapolated(coarse, fine):
    """The limit of values of order 2, of which one has elements half as long."""
    return (4.0 * np.asarray(fine) - np.asarray(coarse)) / 3.0


@pytest.mark.parametrize("kind", ["FV12", "FV16"])
def test_the_linearised_motion_of_nafems_plates_has_the_published_frequencies(kind):
    """It has those of statics at every size, and these extrapolate to the published ones, which are of thin plates."""
    section = ShellSection.isotropic(0.05, 200e9, 0.3, 8000.0)
    points, where, cells = grid(lambda u, v: (10.0 * u, 10.0 * v, 0.0 * u), (4, 4))
    held = np.flatnonzero(where[:, 0] == 0.0).tolist() if kind == "FV16" else []
    shell = Shell.of(points, cells, section)
    free = np.ones((len(points), 6), dtype=bool)
    free[held] = False
    moving, rigid = frequencies(shell_system(shell, held=held)), 0 if held else 6
    known = spectra.modes(shell, free, rigid + 6).values
    # squares are eigenvalues of matrices whose entries are known to 100 roundings of their largest
    assert largest(moving[: len(known)] ** 2 - known**2) <= 1000 * EPS * moving[-1] ** 2
    flat = 2.0 * np.pi * shells.plate_modes(4, kind)[:6]  # on the plane
    assert moving[rigid : rigid + 6] == pytest.approx(flat, rel=1e-6)
    sizes = [shells.plate_modes(n, kind)[:5] for n in (8, 16)]
    off = [largest(each / PUBLISHED[kind] - 1.0) for each in (*sizes, extrapolated(*sizes))]
    assert off[2] < 0.012 < off[1] < off[0]


RIB_AREA, RIB_SECOND = 4e-4, 4e-4 * 0.02**2 / 12.0


def mounted(n, arm=0.05, mass=1.0, inertia=0.1):
    """Both bending frequencies of a heavy body at the end of a light clamped sheet over those of a massless beam."""
    length, width, h, young, rho = 0.5, 0.1, 0.005, 1e8, 10.0
    points, where, cells = grid(lambda u, v: (length * u, width * (v - 0.5), 0.0 * u), (n, 1))
    shell = Shell.of(points, cells, ShellSection.isotropic(h, young, 0.0, rho))
    clamped, end = (np.flatnonzero(where[:, 0] == side).tolist() for side in (0.0, 1.0))
    pose = shifted(length + arm, 0.0, 0.0)
    sheet = shell_system(shell, held=clamped, carried={"p_body": (pose, end)})
    body = rigid_body(mass, [inertia] * 3, STILL).with_initial({"pe.q": pose})
    system = Pattern.from_text("p: body_momentum; sheet(p_body=p); body(p)")(sheet=sheet, body=body)
    bend = young * width * h**3 / 12.0 / length**3
    stiffness = bend * np.array([[12.0, -6.0 * length], [-6.0 * length, 4.0 * length**2]])
    inner = np.array([[mass, mass * arm], [mass * arm, inertia + mass * arm**2]])  # of deflection and slope of the end
    known = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(inner, stiffness)).real))
    values = frequencies(system)
    return np.array([values[np.abs(values - each).argmin()] / each for each in known])


def test_a_body_at_the_end_of_a_sheet_vibrates_as_on_a_beam():
    """By order 2 up to a quarter of the sheet's mass, 2.5e-3 of the body's and 6e-3 of its inertia over length²."""
    coarse, fine = mounted(4), mounted(8)
    assert largest(extrapolated(coarse, fine) - 1.0) <= 0.25 * 6e-3
    assert (np.abs(coarse - 1.0) > 3.0 * np.abs(fine - 1.0)).all() and largest(coarse - 1.0) > 0.02


def off_rigid(young):
    """Largest distance of nodes of a free, spinning strip from those of a rigid body with the same start."""
    points, _, cells = grid(lambda u, v: (0.4 * u, 0.2 * v, 0.05 * u * u), (2, 1))
    shell = Shell.of(points, cells, ShellSection.isotropic(0.02, young, 0.3, 1000.0))
    mass, turning = shell.inertia[:, 3], shell.inertia[:, :3]
    centre = mass @ points / mass.sum()
    arms, spin = points - centre, np.array([3.0, 1.0, 2.0])
    inertia = np.diag(turning.sum(axis=0)) + np.einsum(
        "n,nij->ij", mass, [a @ a * np.eye(3) - np.outer(a, a) for a in arms]
    )
    speeds = np.cross(spin, arms)
    start = {f"node{i}.ke.p": [*(turning[i] * spin), *(mass[i] * speeds[i])] for i in range(len(points))}
    options = {"method": "rk87", "rtol": 1e-8, "atol": 1e-11, "save_at": np.linspace(0.0, 0.2, 41)}
    sheet = ephs.simulate(shell_system(shell), 0.2, initial=start, **options)
    whole = Pattern.from_text("p: body_momentum; body(p)")(body=rigid_body(mass.sum(), inertia, STILL))
    begun = {"body.pe.q": shifted(*centre), "body.ke.p": [*(inertia @ spin), 0.0, 0.0, 0.0]}
    pose = ephs.simulate(whole, 0.2, initial=begun, **options)["body.pe.q"]
    places = [compose(pose, np.broadcast_to(shifted(*arm), pose.shape))[:, 4:] for arm in arms]
    return max(np.linalg.norm(sheet[f"node{i}.pe.q"][:, 4:] - at, axis=1).max() for i, at in enumerate(places))


def test_a_stiff_shell_moves_as_one_rigid_body_by_order_one_in_its_flexibility():
    soft, stiff, stiffer = (off_rigid(young) for young in (1e6, 1e7, 1e8))
    assert soft > 1e-4, "in m: it bends"
    assert stiff / stiffer == pytest.approx(10.0, rel=0.05)  # the next order is a tenth of the one before
    assert soft / stiff == pytest.approx(10.0, rel=0.2)
