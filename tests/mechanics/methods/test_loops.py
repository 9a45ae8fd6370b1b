"""Loops over dense matrices and over trees: rows, gaps, sizes and powers, with two joints that are driven."""

import numpy as np
import pytest

import ephs
from tests.methods import FIXED_OF_SCENES
from tests.numerics import largest, slope
from tests.scenes import equations_of
from tests.written import scene_of_text

BODY = """
[bodies.{name}]
mass = {mass}
inertia = [{inertia}, {inertia}, {inertia}]
position = [{x}, {y}, 0.0]
"""
JOINT = """
[joints.{name}]
type = "revolute"
bodies = ["{first}", "{second}"]
at = [{x}, {y}, 0.0]
axis = [0.0, 0.0, 1.0]
{more}
"""
POINTS = {"left": (0.0, 0.0), "knee": (-0.25, 0.433), "top": (0.6, 1.1), "elbow": (1.45, 0.433), "right": (1.2, 0.0)}
BARS = {"crank": ("left", "knee"), "rod": ("knee", "top"), "link": ("top", "elbow"), "arm": ("elbow", "right")}
BETWEEN = {
    "left": ("ground", "crank", "motion = { rate = 0.7 }\nrate = 0.7\nfriction = 0.3"),
    "right": ("ground", "arm", "motion = { rate = -0.4 }\nrate = -0.4"),
    "knee": ("crank", "rod", "friction = 0.1"),
    "top": ("rod", "link", "stiffness = 2.0"),
    "elbow": ("link", "arm", ""),
}


def five_bar(mass=1.0):
    """Two cranks that are turned, and two rods between them, in a plane."""
    text = 'format = 1\nname = "five-bar"\n[assembly]\nadjust = true\n[world]\ngravity = [0.0, -9.81, 0.0]\n'
    for i, (name, (one, two)) in enumerate(BARS.items(), 1):
        (x, y), (u, v) = POINTS[one], POINTS[two]
        text += BODY.format(name=name, mass=mass * i, inertia=0.1 * mass * i, x=(x + u) / 2, y=(y + v) / 2)
    for name, (first, second, more) in BETWEEN.items():
        x, y = POINTS[name]
        text += JOINT.format(name=name, first=first, second=second, x=x, y=y, more=more)
    return scene_of_text(text)


@pytest.fixture(scope="module")
def closed():
    eq = equations_of(five_bar())
    return eq, eq.start(0.0)


def test_rows_are_what_gaps_change_by(closed):
    eq, state = closed
    assert eq.n == 4 and len(eq.reduced.cut) == 1
    residual, rows = eq.gaps(state.q, state.r)
    assert largest(residual) <= 1e-12 and rows.shape == (2 + residual[2:].size, eq.n)
    driven = np.flatnonzero(eq.reduced.tables.driven)
    assert driven.size == 2 and np.array_equal(rows[:2], np.eye(eq.n)[driven])
    for unit in np.eye(eq.n):
        there, back = (eq.gaps(eq.moved(state.q, h * unit), state.r)[0] for h in (1e-5, -1e-5))
        assert np.array_equal(there[:2], [0.0, 0.0])
        assert np.abs((there - back) / 2e-5 - rows @ unit)[2:].max() <= 1e-9


def test_sizes_of_rows_are_measured_by_inertia(closed):
    """A row is measured in the mass metric: four times the mass, half the size."""
    found = []
    for eq in (closed[0], equations_of(five_bar(4.0))):
        state = eq.start(0.0)
        eq.gaps(state.q, state.r)
        arrays = eq.dense.residual.arrays
        for i, j in enumerate(np.flatnonzero(eq.reduced.tables.driven)):
            assert arrays["terms"][i] == pytest.approx(1.0 / arrays["factor"][j, j], rel=1e-14)
        found.append(arrays["terms"].copy())
        kept = eq.dense.independent(state.q, state.r)
        assert 2 + sum(rows.size for rows in kept) == 4  # two prescribed, two of the loop in its plane
    assert largest(found[0] - 2.0 * found[1]) <= 1e-12 * found[0].max()


def test_power_of_what_is_prescribed_is_the_change_of_energy(closed):
    eq, state = closed
    n, nv = eq.n, eq.nv
    y = eq.vector(state)
    engine = eq.rates(0.0, state.q, y)
    dense = np.zeros(eq.size)
    dense[:nv] = engine[:nv]
    assert eq.dense.rates(np.array(state.q), y, eq.given, eq.heats, dense)[0] == 0
    assert largest(dense - engine) <= 1e-9 * largest(engine)

    def energy(t):
        return np.delete(eq.row(eq.state(state, y + t * engine, t)).energies, eq.booking._makers).sum()

    heat, work = engine[nv + n + eq.ns : nv + n + eq.ns + 2]
    assert abs(work) > 0.1 and heat > 0.0
    assert slope(energy, 1e-4) == pytest.approx(work - heat, abs=1e-6)


def test_gaps_are_counted_from_the_last_prescribed_joint_on(closed):
    eq, state = closed
    open_q = eq.moved(state.q, np.array([0.0, 0.0, 1e-3, 0.0]))
    out, _ = eq.gaps(open_q, state.r)
    eq.fitted(open_q, state.r)
    own, worst = eq.dense.residual.gaps()
    assert np.array_equal(out, [0.0, 0.0, *own]) and worst == largest(own) > 1e-5


@pytest.mark.parametrize("method", FIXED_OF_SCENES)
def test_every_method_turns_what_is_prescribed_and_counts_its_work(method):
    scene, missed = five_bar(), []
    best = ephs.simulate(scene, 0.2, method="rk87", rtol=1e-11, atol=1e-13, save_at=[0.2])
    size = abs(best.work[-1])
    for h in (0.02, 0.01):
        sol = ephs.simulate(scene, 0.2, method=method, step=h)
        for name, rate in (("left", 0.7), ("right", -0.4)):
            assert largest(np.ravel(sol.joint(name).coordinate) - rate * sol.t) <= 1e-9
        assert sol.constraint_error.max() <= 1e-9
        missed.append([abs(sol.work[-1] - best.work[-1]), abs(sol.heat[-1] - best.heat[-1])])
    for far, near in zip(*missed, strict=True):  # of order 2 at least, down to what the best run is good for
        assert near <= max(0.3 * far, 1e-8 * size)
