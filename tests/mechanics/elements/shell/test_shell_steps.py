"""Steps of shells of many elements: losses between joints, sparse matrices of implicit stages, rates of joints."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

import ephs
from ephs.mechanics import Shell, ShellSection, shell_system
from ephs.mechanics.elements.shell.mesh import grid
from ephs.mechanics.methods import jacobian, radau
from ephs.mechanics.methods.jacobian import Jacobian
from ephs.mechanics.methods.sparse import PIVOTS, SparseSystems
from ephs.mechanics.motion.reduced import ReducedMotion
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.tree.engine import apart
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.operad import Path
from ephs.semantics.spaces import SE3, pair
from ephs.solve.methods.solvers import Solvers, dissected
from ephs.testing import mechanisms
from tests.mechanics.elements.shell.test_shell_scenes import sheet
from tests.mechanics.tree.general import held_to_the_general_form
from tests.numerics import EPS, generators, largest, seeds
from tests.scenes import equations_of


def patch(elements=(3, 2), damping=1e-3, gravity=(0.0, 0.0, -9.81), **options):
    """A curved sheet that is clamped on one side."""
    points, at, cells = grid(lambda u, v: (0.4 * u, 0.2 * v, 0.05 * u * u), elements)
    shell = Shell.of(points, cells, ShellSection.isotropic(0.02, E=1e5, nu=0.3, rho=1000.0))
    held = np.flatnonzero(at[:, 0] == 0.0)
    return shell_system(shell, damping=damping, held=held, gravity=gravity, **options)


PATCH = problem_of_system(patch())


def strained(equations, rng, size=0.02):
    """A state with relative poses and rates."""
    start = equations.start(0.0)
    state = type(start)(
        0.0, equations.moved(start.q, size * rng.standard_normal(equations.n)), start.r, start.heats, start.totals
    )
    return type(start)(0.0, state.q, rng.standard_normal(equations.n), state.heats, state.totals)


def matrix_of(equations, state, *, sparse):
    found = Jacobian(equations)
    found.sparse = sparse
    return found.at(state)


# ---- set-up ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [{}, {"damping": 0.0}, {"heat": True}, {"spread": True}])
def test_parts_that_are_not_checked_one_by_one_pass_the_checks(options):
    """Elements fit as the first one does, bodies as without states of their own, the flat system as its levels."""
    whole = patch(**options)
    for part in (*whole.fillings.values(), whole.flatten()):
        if isinstance(part, ephs.System):
            assert ephs.System(part.pattern, part.fillings) == part
    element = whole.fillings["element1"]
    torn = ephs.Directory({path: part for path, part in element.fillings.items() if path != Path.of("pe")})
    with pytest.raises(ephs.SemanticsError):  # the control
        ephs.System(element.pattern, torn)


# ---- losses between several joints ----------------------------------------------------------------------------------


@settings(max_examples=3)
@given(generators)
def test_a_loss_of_several_poses_acts_as_the_relations_say(rng):
    problem = problem_of_system(patch((2, 1)))
    equations = ReducedEquations(problem, 0.0)
    held_to_the_general_form(equations, problem, strained(equations, rng))


def test_what_is_damped_has_no_cut_joints_and_no_network():
    equations = ReducedEquations(PATCH, 0.0)
    assert not equations.engine.looped
    assert not equations.reduced.attaching.network.attached
    assert equations.nv == equations.n
    assert not ReducedEquations(problem_of_system(patch(damping=0.0)), 0.0).reduced.made  # the control: no loss


def test_a_loss_slows_down_and_warms():
    """The control of the above: without it rates are others."""
    rates = []
    for damping in (0.0, 1e-3):
        equations = ReducedEquations(problem_of_system(patch((2, 1), damping)), 0.0)
        state = strained(equations, np.random.default_rng(1))
        rates.append(equations.rates(0.0, state.q, equations.vector(state))[equations.nv :][: equations.n].copy())
    assert largest(rates[0] - rates[1]) > 1e-3 * largest(rates[0])


def test_a_linearised_damped_sheet_has_the_modes_of_kelvin_and_voigt():
    """λ² + τ ω² λ + ω² = 0, with the frequencies ω of the sheet without damping."""
    tau = 1e-3
    still, damped = (ephs.linearize(patch((2, 1), damping, (0.0, 0.0, 0.0))).eigenvalues for damping in (0.0, tau))
    squares = np.sort(still.imag[still.imag > 0.0] ** 2)
    waves = damped[damped.imag > 0.0]
    assert largest(2.0 * waves.real + tau * np.abs(waves) ** 2) <= 1e-10 * largest(waves)
    found = np.sort(np.abs(waves) ** 2)
    # squares are eigenvalues of matrices whose entries are known to 100 roundings of their largest
    assert largest(found - squares[: found.size]) <= 1000 * EPS * squares[-1]


# ---- sparse matrices ------------------------------------------------------------------------------------------------


@settings(max_examples=4)
@given(seeds)
def test_a_sparse_matrix_is_the_one_of_all_columns_apart(seed):
    """To the last bit, as it is made of the same tangents; all that is left out is zero."""
    problem = problem_of_system(patch((6, 1)))
    equations = ReducedEquations(problem, 0.0)
    state = strained(equations, np.random.default_rng(seed))
    found = matrix_of(equations, state, sparse=True)
    assert found.nnz < 0.5 * found.shape[0] ** 2
    whole = ReducedEquations(problem_of_system(patch((6, 1))), 0.0)
    with pytest.MonkeyPatch.context() as patched:
        alone = np.arange(found.shape[0])
        patched.setattr(jacobian, "directions", lambda columns, size: [[(column, alone)] for column, _ in columns])
        dense = matrix_of(whole, strained(whole, np.random.default_rng(seed)), sparse=False)
    assert np.array_equal(found.toarray(), dense)


def test_a_pattern_without_the_elements_is_another_matrix(monkeypatch):
    """The control: bodies that act on none but themselves."""
    columns = apart.columns_of_trees

    def torn(tables, *sizes):
        alone = tables._replace(
            several=np.full_like(tables.several, -1),
            poses=np.zeros_like(tables.poses),
            first=np.full_like(tables.first, -1),
        )
        return columns(alone, *sizes)

    equations = ReducedEquations(PATCH, 0.0)
    state = strained(equations, np.random.default_rng(0))
    sound = matrix_of(equations, state, sparse=True).toarray()
    monkeypatch.setattr(jacobian, "columns_of_trees", torn)
    other = ReducedEquations(problem_of_system(patch()), 0.0)
    found = matrix_of(other, state, sparse=True).toarray()
    assert largest(found - sound) > 1e-3 * largest(sound)


@settings(max_examples=15)
@given(mechanisms(loops=False))
def test_sparse_matrices_of_mechanisms_are_dense_ones(scene):
    equations = equations_of(scene)
    assume(equations.n)
    state = equations.start(0.0)
    sparse = matrix_of(equations, state, sparse=True)
    assert np.array_equal(sparse.toarray(), matrix_of(equations, state, sparse=False))


@settings(max_examples=15)
@given(generators, st.floats(1e-5, 1e-2), st.booleans(), st.booleans(), st.booleans())
def test_systems_of_sparse_matrices_are_solved(rng, h, pair, heated, dissecting):
    """(1/(h μ) − J) x = b to 10 κ ε, with the rates of a node alone where none depends on heats, and with all else."""
    equations = ReducedEquations(PATCH, 0.0)
    matrix = matrix_of(equations, strained(equations, rng), sparse=True).tolil()
    n, size = equations.n, matrix.shape[0]
    if heated:
        matrix[n : n + 3, size - 1] = matrix[n, n + 1]
    matrix = matrix.tocsc()
    length = h * (0.16 + 0.2j * pair)
    right = rng.standard_normal(size) * (1.0 + 1j * pair)
    places = rng.standard_normal((n, 3)) if dissecting else None
    systems = SparseSystems(matrix, equations.nv, n, Solvers(lambda _: "", PIVOTS, places))
    found = systems.solver(length)(right)
    whole = np.eye(size) / length - matrix.toarray()
    expected = np.linalg.solve(whole, right)
    # increments and rates by their own sizes: rates are some 1/h of increments
    scale = np.concatenate([np.full(n, h), np.ones(n), np.full(size - 2 * n, h)])
    condition = np.linalg.cond(whole * scale)
    off = np.abs(found - expected) / scale
    assert off.max() <= 10.0 * condition * EPS * largest(expected / scale)


def lattice(points, ways):
    """The matrix of points (n, 3) each of which acts on all within one step in each direction."""
    near = largest(points[:, None] - points[None], axis=2) < 1.5
    return csc_array(np.where(near, -1.0, 0.0) + np.diag(ways + near.sum(axis=1)))


@settings(max_examples=10)
@given(st.integers(8, 16), st.integers(8, 16), generators)
def test_halves_of_a_dissected_mesh_do_not_meet_in_its_factors(wide, high, rng):
    """Whatever the numbers of its unknowns: entries between the halves stay zero, as their order puts what joins last.

    In the order of the rows the control has such entries.
    """
    grid_points = np.array([(x, y, 0.0) for x in range(wide) for y in range(high)])
    points = grid_points[rng.permutation(wide * high)]
    matrix = lattice(points, 1.0)
    order = dissected(matrix, points)
    assert np.array_equal(np.sort(order), np.arange(wide * high))
    across = int(np.argmax([wide, high]))
    middle = np.sort(points[:, across])[points.shape[0] // 2]

    def meeting(one):
        found = splu(csc_array(matrix[one][:, one]), **{**PIVOTS, "permc_spec": "NATURAL"}).L.tocoo()
        side = np.sign(points[one, across] - middle)
        return int(np.sum(side[found.row] * side[found.col] < 0.0))

    assert meeting(order) == 0
    assert meeting(np.argsort(points[:, 1 - across], kind="stable")) > 0


def run(problem_system, *, sparse, **options):
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(jacobian, "MANY", 0 if sparse else 10**9)
        patched.setattr(jacobian, "FULL", 1.0)
        patched.setattr(radau, "HELD", 1.0)
        return ephs.simulate(problem_system, 0.01, method="radau", rtol=1e-7, audit="warn", **options)


@pytest.mark.filterwarnings("ignore::ephs.AuditWarning")
@pytest.mark.parametrize("heat", [False, True])
def test_sparse_steps_are_dense_ones(heat):
    """Their number, and where they lead, to the tolerance; and energy is kept to rounding."""
    system = patch((3, 1))
    if heat:
        node = ephs.library.thermal_capacity(c1=3e3, c2=10.0)
        inner = patch((3, 1), heat=True)
        pattern = ephs.Pattern({"s": ephs.junction(ephs.quantity.entropy)}, {"sheet": {"s": "s"}, "store": {"s": "s"}})
        system = pattern(sheet=inner, store=node)
    sparse, dense = (run(system, sparse=which) for which in (True, False))
    assert abs(sparse.stats["steps"] - dense.stats["steps"]) <= 1
    for path, rows in sparse.states.items():
        other = dense.states[path][-1]
        assert largest(rows[-1] - other) <= 1e-5 * max(1.0, largest(other)), path
    assert sparse.summary()["max_energy_error"] <= 1e-12


def test_many_elements_have_sparse_matrices_and_few_have_dense_ones():
    few, many = (ReducedEquations(problem_of_system(patch(size)), 0.0) for size in ((2, 2), (9, 8)))
    assert not Jacobian(few).sparse
    assert Jacobian(many).sparse


# ---- results --------------------------------------------------------------------------------------------------------


def test_rates_of_elements_are_differences_of_their_poses():
    solution = ephs.simulate(patch((2, 1)), 1e-3, method="rk87", rtol=1e-10, save_at=np.linspace(0.0, 1e-3, 21))
    motion = ReducedMotion.of(solution)
    middle = 10
    for path, state in (("element0.hc2", "element0.pe.q_2"), ("element1.hc4", "element1.pe.q_4")):
        poses = [pair("free").element(row) for row in solution[state]]
        back = SE3.inverse(poses[middle])
        steps = [SE3.log(SE3.compose(back, poses[middle + k])) for k in (-2, -1, 1, 2)]
        rate = (steps[0] - 8.0 * steps[1] + 8.0 * steps[2] - steps[3]) / (12.0 * 5e-5)
        found = motion.rate(Path.of(path))[middle]
        assert largest(found - rate) <= 1e-4 * max(largest(rate), 1e-3)


@pytest.mark.parametrize("pressure", [{}, {"pressure": "0.0"}], ids=["many steps a call", "one step a call"])
def test_auto_leaves_steps_of_thin_sheets_that_rounding_holds_short(pressure):
    stiff = {"thickness": "2e-3", "E": "7e10", "rho": "2700.0", "damping": "0.0", "elements": "[2, 2]"}
    with pytest.raises(ephs.SimulationError) as ended:
        ephs.simulate(sheet(**stiff, **pressure), 1e-3, max_steps=1100)
    (switch,) = ended.value.partial.stats["switches"]
    assert switch["to"] == "radau" and "steps: rounding of the rate of shells.skin" in switch["reason"]
