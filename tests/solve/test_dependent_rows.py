"""Equations that loops repeat: which of them a step leaves out, and what long steps keep of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import linalg
from scipy.sparse import csr_array

import ephs
from ephs import library
from ephs import quantity as Q
from ephs.solve.methods.analysis import dependent_rows, entangled, entries_at, exchanged
from tests.numerics import EPS, generators, largest
from tests.oscillator import free_oscillator
from tests.scenes import model_of, shipped
from tests.written import scene_of_text

NAMES = ("a", "b", "c", "d", "e")


@pytest.fixture(scope="module")
def exact():
    """Positions after 5 s, in joint coordinates with another equation left out at every instant."""
    sol = ephs.simulate(shipped("bricard"), 5.0, method="rk87", rtol=1e-11, atol=1e-11, save_at=[0.0, 5.0])
    return np.concatenate([sol.body(name).position[-1] for name in NAMES])


def run(method, **options):
    sol = ephs.simulate(shipped("bricard"), 5.0, method=method, audit="off", **options)
    return sol, np.concatenate([sol.body(name).position[-1] for name in NAMES])


def test_long_steps_of_order_4_carry_a_linkage_of_special_geometry(exact):
    """At the stages loops are open by the quadrature's order, where no equation of Bricard's linkage repeats others.

    Over the step one does. Errors fall with the sixth power of the step, as of any mechanism.
    """
    errors = []
    for step in (0.1, 0.05, 0.025, 0.0125):
        sol, found = run("natural4", step=step)
        assert sol.stats["cut_steps"] == 0
        assert sol.energy_error.max() <= 10.0 * np.sqrt(5.0 / step) * 10.0 * EPS
        # ten roundings a step, times the condition of constraints that nearly repeat each other
        assert sol.constraint_error.max() <= 10.0 * 100.0 * np.sqrt(5.0 / step) * EPS
        errors.append(largest(found - exact))
    assert errors[0] <= 1e-5
    assert np.all(np.array(errors[:-1]) >= 40.0 * np.array(errors[1:])), errors


def test_chosen_steps_carry_it_too(exact):
    sol, found = run("natural4", rtol=1e-7, atol=1e-7)
    assert largest(found - exact) <= 1e-6
    assert sol.stats["steps"] <= 100


def ring():
    """Six slender bars of 1 kg along edges of a cube of 1 m, each turning on the next about the axis that is left."""
    corners = [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)]
    lines = ["format = 1", "[world]", "gravity = [0.0, -9.81, 0.0]"]
    for k in range(5):
        a, b = np.array(corners[k]), np.array(corners[k + 1])
        inertia = np.where(b == a, 0.505, 0.01) / 6.0
        lines += [f"[bodies.bar{k}]", "mass = 1.0", f"inertia = {inertia.tolist()}"]
        lines += [f"position = {(0.5 * (a + b)).tolist()}"]
    for k, corner in enumerate(corners):
        one, two = (f"bar{i}" if 0 <= i < 5 else "ground" for i in (k - 1, k))
        axis = [float(i == (1, 2, 0)[k % 3]) for i in range(3)]
        lines += [f"[joints.j{k}]", "type = 'revolute'", f"bodies = ['{one}', '{two}']"]
        lines += [f"at = {list(map(float, corner))}", f"axis = {axis}"]
    return scene_of_text("\n".join(lines))


@pytest.mark.parametrize("method", ["natural", "natural4"])
def test_an_omitted_equation_gives_way_before_its_part_of_the_dependence_vanishes(method):
    """The part of one joint's equation passes zero at 1.247 s; without another choice its gap would grow by 1e-9."""
    scene = ring()
    for step in (0.01, 0.002):
        sol = ephs.simulate(scene, 1.3, method=method, step=step)
        rounding = np.sqrt(1.3 / step) * EPS
        assert sol.constraint_error.max() <= 10.0 * 100.0 * rounding
        assert sol.energy_error.max() <= 10.0 * 10.0 * rounding
        assert sol.stats["dependent_equations"] == 1


@pytest.mark.parametrize("name", ["ring", "bricard", "four-bar", "n-four-bar", "slider-crank"])
def test_rank_depends_on_no_step(name):
    """Within a step that is not solved, loops are open by its third power: equations that depend seem not to."""
    scene = ring() if name == "ring" else shipped(name)
    sol = ephs.simulate(scene, 0.5, method="natural4", step=0.01, save_at=np.linspace(0.0, 0.5, 6))
    problem = sol.problem
    model = model_of(problem)
    rng, found = np.random.default_rng(7), set()
    for k in range(1, len(sol)):
        x = problem.descriptor.pack(sol.state_at(k))
        z = rng.normal(size=model.unknowns)
        entries = [entries_at(model, x, z, step)[1] for step in (0.03, 0.01, 1e-3, 1e-4)]
        found |= {dependent_rows(model, x, values).sum() for values in entries}
    assert found == {sol.stats["dependent_equations"]}


@settings(max_examples=50)
@given(rng=generators, count=st.integers(2, 9), short=st.integers(1, 3))
def test_what_is_left_out_depends_on_the_rest_and_is_of_the_preferred(rng, count, short):
    """Random rows of rank ``count − short``; the control takes the pivots' own choice, which asks no preference."""
    rank = max(1, count - short)
    rows = rng.standard_normal((count, rank)) @ rng.standard_normal((rank, count + 2))
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    triangle, pivots = linalg.qr(rows.T, mode="r", pivoting=True)
    rather = np.zeros(count, dtype=bool)
    rather[rng.permutation(count)[: count - rank]] = True
    left = exchanged(triangle, pivots, rank, np.where(rather, 1.0, 1e-3))
    assert left.size == count - rank
    kept = np.delete(rows, left, axis=0)
    sizes = np.linalg.svd(kept, compute_uv=False)
    assert sizes[-1] > 1e-9 * sizes[0], "what is kept is independent"
    sound = np.linalg.svd(rows[~rather], compute_uv=False)
    if sound[-1] > 0.05:  # the preferred can all be left out
        assert set(left) == set(np.flatnonzero(rather))


def test_the_control_leaves_out_whatever_the_pivots_say():
    """Of two rows that repeat each other the second, though the first is preferred."""
    rows = np.array([[2.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    triangle, pivots = linalg.qr(rows.T, mode="r", pivoting=True)
    assert list(pivots[2:]) == [1]
    assert list(exchanged(triangle, pivots, 2, np.array([1.0, 1e-3, 1e-3]))) == [0]


@settings(max_examples=50)
@given(rng=generators, loops=st.integers(0, 3))
def test_rows_with_an_effort_of_their_own_take_part_in_no_dependence(rng, loops):
    """A chain whose rows have two neighbours' efforts and one of their own, in any order, beside dependent rows."""
    count = 12
    chain = np.zeros((count, 2 * count + 1 + 3))
    for i in range(count):
        chain[i, [i, i + 1, count + 1 + i]] = rng.uniform(0.5, 1.0, 3)
    repeated = np.zeros((2 * loops, chain.shape[1]))
    repeated[:, -3:] = rng.uniform(0.5, 1.0, 3)
    rows = np.concatenate([chain, repeated])
    order = rng.permutation(len(rows))
    left = entangled(csr_array(rows[order]))
    assert set(order[left]) == set(range(count, len(rows)))
    assert np.linalg.matrix_rank(rows) == count + np.linalg.matrix_rank(rows[order[left]])


def test_an_effort_too_small_beside_its_row_makes_no_row_independent():
    rows = np.array([[1.0, 1.0, 1e-6], [1.0, 1.0, 0.0]])
    assert list(entangled(csr_array(rows))) == [0, 1]


METHODS = ("natural", "natural4", "rk54", "rk87", "radau", "auto", "variational")


def oscillator(row=None):
    """A spring and a mass, and a constraint whose ports are all on the momentum's junction."""
    if row is None:
        return free_oscillator(k=1.5)
    wires = ", ".join(f"{port}=p" if each.power else f"{port}=~q" for port, each in row.interface.items())
    pattern = ephs.Pattern.from_text(f"q: displacement; p: momentum; pe(q); ke(p); pkc(q, p); row({wires})")
    return pattern(pe=library.spring(k=1.5), ke=library.point_mass(m=1.0), pkc=library.pkc(), row=row)


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=8)
@given(entries=st.lists(st.floats(0.1, 1.0), min_size=1, max_size=3), data=st.data())
def test_a_constraint_that_cancels_on_a_junction_but_for_rounding_holds_nothing(method, entries, data):
    """0 = Σ aᵢ e − (Σ aᵢ) e, rounded otherwise; the relation has no equation there either."""
    reads = method in ("natural", "natural4", "radau") and data.draw(st.booleans())
    entries = [*(1.1 * entry for entry in entries), -1.1 * sum(entries)]
    ports = {f"p{i}": Q.momentum for i in range(len(entries))}
    if reads:
        ports["~x"] = Q.displacement
    row = ephs.constraint(ports, (lambda x: [[a * (2.0 + x) for a in entries]]) if reads else [entries], name="row")
    chosen = method in ("rk54", "rk87", "radau", "auto")
    options = {"rtol": 1e-8, "atol": 1e-8} if chosen else {"step": 0.02}

    def found(system):
        sol = ephs.simulate(system, 0.5, initial={"pe.q": 1.0, "ke.p": 0.5}, method=method, **options)
        return np.array([sol["pe.q"][-1], sol["ke.p"][-1]])

    assert np.allclose(found(oscillator(row)), found(oscillator()), rtol=1e-9, atol=0.0)
