"""The compiled engine against the sweeps over dense matrices, and in growth."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings

import ephs
from benchmarks.cases import CASES
from ephs.mechanics.road.elimination import closing
from ephs.mechanics.tree.engine.links import links_of
from ephs.solve.posing.errors import SolveError
from ephs.testing import mechanisms
from tests.numerics import largest
from tests.scenes import ROOT, equations_of
from tests.written import scene_of_text

SCENES = {file.stem: file for file in sorted((ROOT / "scenes").glob("*.toml"))} | {
    case.name: ROOT / "benchmarks" / "scenes" / f"{case.name}.toml" for case in CASES
}


def moved(eq, seed=0, far=0.3):
    """A state aside of the initial one, its loops closed, moving."""
    rng = np.random.default_rng(seed)
    start = eq.start(0.0)
    for size in (far, 0.3 * far, 0.0):
        q = eq.moved(start.q, size * rng.standard_normal(eq.n))
        try:
            return eq.closed(replace(start, q=q, r=rng.standard_normal(eq.n)))
        except SolveError:
            continue
    return start


def both(eq, state):
    """(ṙ, rates of heats, flows, powers) of the engine and of the dense sweeps."""
    y, dense = eq.vector(state), np.zeros(eq.size)
    status, q, found = eq.engine.rates(state.q, y)
    assert status == 0
    assert eq.dense.rates(q, y, eq.given, eq.heats, dense)[0] == 0
    at = np.cumsum([eq.nv, eq.n, eq.ns, 2])
    return [[part[k] for k in (1, 2, 4, 3)] for part in (np.split(found, at), np.split(dense, at))]


def agree(eq, state):
    """Equal to rounding: generalised forces of the difference against those of the accelerations themselves."""
    (a, heat, made, powers), (b, heat_b, made_b, powers_b) = both(eq, state)
    mass = eq.mass(state.q, state.r)
    if not eq.n:  # everything is fixed
        return
    size = largest(mass) * max(1.0, largest(b)) * np.linalg.cond(mass) ** 0.5
    assert largest(mass @ (a - b)) <= 1e-11 * size
    for one, two in ((heat, heat_b), (made, made_b), (powers, powers_b)):
        assert largest(one - two, initial=0.0) <= 1e-9 * max(1.0, largest(two, initial=0.0))


@pytest.mark.parametrize("name", SCENES)
def test_scenes_accelerate_as_the_dense_sweeps_say(name):
    eq = equations_of(ephs.load(SCENES[name]))
    for seed in range(3):
        agree(eq, moved(eq, seed))


@settings(max_examples=40)
@given(scene=mechanisms(max_bodies=4))
def test_so_do_generated_mechanisms(scene):
    eq = equations_of(scene)
    agree(eq, moved(eq))


@settings(max_examples=15)
@given(scene=mechanisms(max_bodies=3))
def test_least_corrections_take_rates_onto_the_constraints(scene):
    """J (x + change) = 0 on all rows, and the change is M⁻¹Jᵀμ: the least in the mass metric."""
    eq = equations_of(scene)
    state = moved(eq)
    if not eq.engine.closing.row.size:
        return
    eq.closed(state)
    x = np.random.default_rng(1).standard_normal(eq.n)
    change = eq.engine.along(state.q, x) - x
    mass = eq.mass(state.q, state.r)
    rows = eq.rows()
    assert largest(rows @ (x + change)) <= 1e-10
    push = mass @ change
    left = push - rows.T @ np.linalg.lstsq(rows.T, push, rcond=1e-9)[0]
    assert largest(left) <= 1e-9 * max(1.0, largest(push))


@pytest.mark.parametrize(
    ("method", "name"),
    [*product(("rk54", "rk87"), ("four-bar", "chain", "mbs")), *product(("semi",), ("four-bar", "hot-brake", "biped"))],
)
def test_a_compiled_run_takes_the_steps_of_one_step_a_call(name, method):
    """To rounding where steps are constant; chosen ones hang on estimates that begin as rounding."""
    scene, until = ephs.load(SCENES[name]), 0.1 if method == "semi" else 0.5
    for options, near in (({"step": until / 50.0}, 1e-11), ({"rtol": 1e-4, "atol": 1e-5}, 1e-5)):
        run = {"method": method, "save_at": np.linspace(0.0, until, 7), "audit": "off", **options}
        one, other = (ephs.simulate(scene, until, events=events, **run) for events in ((), (lambda t, x: 1.0,)))
        assert one.stats["steps"] == other.stats["steps"]
        for found, expected in [*((one[path], other[path]) for path in one), (one.heat, other.heat)]:
            assert largest(found - expected, initial=0.0) <= near * (1.0 + largest(expected, initial=0.0))
        assert max(largest(sol.energy_error) for sol in (one, other)) <= 1e-11


def test_rows_that_are_kept_do_not_depend_on_how_many_fit():
    """More steps than one call hands over."""
    scene = ephs.load(SCENES["chain"])
    sol = ephs.simulate(scene, 1.5, method="rk54", step=1e-3)
    assert len(sol) == 1501
    assert np.allclose(sol.t, 1e-3 * np.arange(1501), atol=1e-12)
    last = ephs.simulate(scene, 1.5, method="rk54", step=1e-3, save_at=[1.5])
    assert all(np.array_equal(sol[path][-1], last[path][-1]) for path in sol)


@pytest.mark.parametrize("windows", [10, 40])
def test_a_ladder_of_loops_has_few_rows_open_at_once(windows):
    """Uprights on the ground, a beam from each to the next, cut at the next."""
    parents = [-1] * (windows + 1) + list(range(windows))
    ends = [(windows + 1 + k, k + 1) for k in range(windows) for _ in range(2)]
    program = closing(parents, ends)
    assert program.slot.shape[0] <= 7 * program.row.shape[0]
    assert program.flat.size <= 40 * program.row.shape[0]
    assert program.blocks == 1


def test_a_run_that_leaves_the_range_of_numbers_is_not_blamed_on_masses():
    with pytest.raises(ephs.SimulationError, match="beyond the range of numbers"):
        ephs.simulate(ephs.load(SCENES["chain"]), 2000.0, method="rk54", step=20.0)


TWO_SPRINGS = """
format = 1
name = "sprung"
[world]
gravity = [0.0, 0.0, 0.0]
[bodies.one]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.5, 0.0, 0.0]
[bodies.two]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [1.5, 0.0, 0.0]
[joints.first]
type = "revolute"
bodies = ["ground", "one"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
stiffness = 3.0
[joints.second]
type = "{second}"
bodies = ["one", "two"]
at = [1.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
stiffness = {stiffness}
"""


def sprung(second="revolute", stiffness="5.0"):
    return scene_of_text(TWO_SPRINGS.format(second=second, stiffness=stiffness))


def test_each_spring_has_the_energy_of_its_own_joint():
    eq = equations_of(sprung())
    start = eq.start(0.0)
    for q in np.random.default_rng(0).standard_normal((4, 2)):
        found = eq.engine.energy(q, 0.0 * start.r, start.heats)[1]
        assert found == pytest.approx(0.5 * (3.0 * q[0] ** 2 + 5.0 * q[1] ** 2), rel=1e-14)


def test_only_pins_and_slides_are_taken_for_planar():
    """A planar pair moves in the plane as well, by elements that the planar sweeps do not have."""
    plain = links_of(equations_of(sprung()).reduced)
    wider = links_of(equations_of(sprung("planar", "[5.0, 1.0, 2.0]")).reduced)
    assert plain.planar and not wider.planar
