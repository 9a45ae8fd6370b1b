"""Shells that move: the laws of the element as a storage, and of meshes by every method."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag, eigh
from scipy.spatial.transform import Rotation

import ephs
from ephs import Pattern
from ephs.mechanics import Shell, ShellSection, joint, rigid_body
from ephs.mechanics.elements.shell.mesh import grid
from ephs.mechanics.elements.shell.shell import moved
from ephs.mechanics.elements.shell.stiffness import EDGES
from ephs.mechanics.elements.shell.system import shell_damper, shell_spring, shell_system
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Reference
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.derive import relations
from ephs.semantics.spaces import SE3
from ephs.testing import check_primitive
from tests.mechanics.kernels import Draw, agreeing
from tests.numerics import EPS, generators, jacobian, largest, seeds, slope

POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [1.1, 0.9, 0.1], [-0.1, 0.8, 0.0]])
ELEMENT = Shell.of(POINTS, [[0, 1, 2, 3]], ShellSection.isotropic(0.1, E=1e3, nu=0.3, rho=4.0))
SPRING = shell_spring(ELEMENT.rest[0], ELEMENT.matrix[0])
DAMPER = shell_damper(ELEMENT.rest[0], ELEMENT.matrix[0], 0.01)
PORTS = [Path.of(f"q_{corner}") for corner in (2, 3, 4)]


def states(rng, size):
    return {port: SE3.exp(size * rng.standard_normal(6)) for port in PORTS}


def relative(shell, poses, cell=0):
    """States of an element's storage at poses of the nodes."""
    axes = [np.concatenate([turn, np.zeros(3)]) for turn in shell.axes[cell]]
    now, still = (
        [SE3.compose(at[node], axis) for node, axis in zip(shell.cells[cell], axes, strict=True)]
        for at in (poses, shell.poses)
    )
    rest, here = ([SE3.compose(SE3.inverse(s[0]), s[k]) for k in (1, 2, 3)] for s in (still, now))
    return {port: SE3.compose(SE3.inverse(a), b) for port, a, b in zip(PORTS, rest, here, strict=True)}


def disturbed(shell, rng, size):
    return moved(shell.poses, size * rng.standard_normal((len(shell.points), 6)))


# ---- the element ----------------------------------------------------------------------------------------------------


def test_the_element_is_a_storage():
    check_primitive(SPRING, max_examples=40)  # each looks at 36 differences


@settings(max_examples=20)
@given(generators, st.floats(1e-8, 0.3), st.floats(1e-8, 0.3))
def test_the_work_of_a_step_is_the_difference_of_energies(rng, size, step):
    x, v = states(rng, size), step * rng.standard_normal(18)
    end = SPRING.retract(x, v)
    effort = SPRING.discrete_effort(x, v, Reference())
    back = SPRING.discrete_effort(end, -v, Reference())
    # 40 operations from poses to logarithms at either end, and as many back: rounding of Δ works against K Δ
    scale = np.abs(effort) @ np.abs(v) + np.abs(ELEMENT.matrix[0]).sum() * (size + step)
    assert abs(effort @ v - (SPRING.energy(end) - SPRING.energy(x))) <= 80 * EPS * scale
    # backwards it is the same effort: the rules of slopes are symmetric in the ends
    assert largest(effort - back) <= 400 * EPS * (largest(effort) + largest(ELEMENT.matrix[0]))


def test_the_effort_in_the_middle_of_a_step_does_other_work():
    """The control: the gradient at the middle misses the difference of energies."""
    rng = np.random.default_rng(1)
    x, v = states(rng, 0.2), 0.2 * rng.standard_normal(18)
    middle = SPRING.energy_gradient(SPRING.retract(x, 0.5 * v))
    change = SPRING.energy(SPRING.retract(x, v)) - SPRING.energy(x)
    assert abs(middle @ v - change) > 1e-4 * abs(change)


@settings(max_examples=10)
@given(seeds)
def test_derivatives_of_efforts_are_their_differences(seed):
    draw = Draw(SPRING, seed, 0.2)
    draw.x = states(np.random.default_rng(seed), 0.2)
    agreeing(draw, 1e-8)


@settings(max_examples=15)
@given(generators, st.floats(1e-6, 0.2))
def test_energy_and_efforts_are_those_of_statics(rng, size):
    """`Shell` has the same energy, by another program; its forces are the efforts, seen from the nodes."""
    poses = disturbed(ELEMENT, rng, size)
    x = relative(ELEMENT, poses)
    energy = ELEMENT.energy(poses)[0]
    floor = 400 * EPS * np.abs(ELEMENT.matrix).sum() * size
    assert abs(SPRING.energy(x) - energy) <= 100 * EPS * energy + floor
    change, step = rng.standard_normal((4, 6)), 1e-6
    ends = [relative(ELEMENT, moved(poses, sign * step * change)) for sign in (1.0, -1.0)]
    rates = np.concatenate([SE3.log(SE3.compose(SE3.inverse(b[p]), a[p])) for a, b in [ends] for p in PORTS]) / 2e-6
    power = SPRING.energy_gradient(x) @ rates
    scale = np.abs(SPRING.energy_gradient(x)) @ np.abs(rates)
    assert abs(power - np.sum(ELEMENT.forces(poses) * change)) <= 1e-8 * scale + floor


def test_other_numbers_compile_nothing():
    other = shell_spring(2.0 * ELEMENT.rest[0], 3.0 * ELEMENT.matrix[0])
    assert relations.program(other.kernel.relation) is relations.program(SPRING.kernel.relation)


def test_the_damper_is_a_process():
    check_primitive(DAMPER, max_examples=40)


@settings(max_examples=5)
@given(generators)
def test_derivatives_of_a_loss_are_its_differences(rng):
    relation = DAMPER.kernel.relation
    n, _, m, _ = dims = np.array(relation.dimensions)
    numbers = {name: np.zeros(size) for name, size in relations.sizes(relation).items()}
    numbers |= {"p": np.array(DAMPER.kernel.parameters), "x0": np.concatenate(list(states(rng, 0.2).values()))}
    numbers["scal"][:] = 1.0, 300.0, 1e5
    call, z = relations.program(relation).compiled()["value"], 0.2 * rng.standard_normal(n + m)

    def flows(z):
        numbers["e"][:], numbers["v"][:] = z[:n], z[n:]
        assert call(dims, *numbers.values()) == 0
        return numbers["f"].copy()

    slopes = jacobian(lambda v: flows(z + v), n + m, 1e-5)
    flows(z)
    assert largest(slopes - numbers["jac"].reshape(n, n + m)) <= 1e-8 * largest(slopes)


@settings(max_examples=10)
@given(generators)
def test_the_loss_of_a_rate_is_what_the_stress_of_its_strain_rate_does(rng):
    """⟨u|μ u⟩ = τ ḋᵀ K ḋ with the rates ḋ of the logarithms, by differences of statics."""
    x, u = states(rng, 0.2), rng.standard_normal(18)
    effort = np.append(u, 0.0)
    lost = effort @ DAMPER.matrix(x, effort, Reference()) @ effort / Reference().temperature

    def stress_free(step):
        ends = SPRING.retract(x, step * u)
        poses = np.array([SE3.identity(), *ends.values()])
        rest = [SE3.exp(log) for log in ELEMENT.rest[0]]
        logs = [
            SE3.log(SE3.compose(SE3.inverse(poses[a]), SE3.compose(place, poses[b])))
            for (a, b), place in zip(EDGES, rest, strict=True)
        ]
        return np.concatenate(logs)

    rate = slope(stress_free, 1e-6)
    expected = 0.01 * rate @ ELEMENT.matrix[0] @ rate
    assert abs(lost - expected) <= 1e-8 * expected


@pytest.mark.parametrize(
    ("key", "rest", "stiffness"),
    [
        ("rest", np.zeros((3, 6)), np.eye(24)),
        ("stiffness", np.zeros((4, 6)), np.eye(23)),
        ("stiffness", np.zeros((4, 6)), np.eye(24) + np.diag(np.ones(23), 1)),
        ("rest", np.full((4, 6), np.nan), np.eye(24)),
        ("stiffness", np.zeros((4, 6)), np.diag([1.0] * 23 + [-1e-6])),  # entropy would fall by its loss
    ],
)
def test_wrong_numbers_are_refused(key, rest, stiffness):
    with pytest.raises(StructureError, match=key):
        shell_spring(rest, stiffness)


# ---- motion ---------------------------------------------------------------------------------------------------------


def strip(**options):
    points, _, cells = grid(lambda u, v: (0.4 * u, 0.2 * v, 0.05 * u * u), (2, 1))
    shell = Shell.of(points, cells, ShellSection.isotropic(0.02, E=1e5, nu=0.3, rho=1000.0))
    return shell, shell_system(shell, **options)


STRIP, FREE_STRIP = strip()
FLIGHT = {"node0.ke.p": [1e-4, 2e-4, 0.0, 0.1, 0.02, 0.05], "node5.ke.p": [0.0, 1e-4, 1e-4, 0.02, -0.05, -0.1]}
FIXED = {"natural": 1e-3, "natural4": 2e-3, "variational": 1e-3}
LAWFUL = ("rk54", "rk87", "radau", "semi", "auto")


def flown(method, share=1.0):
    options = {"rtol": 1e-5 if method == "semi" else 1e-9, "atol": 1e-12}
    if method in FIXED:
        options = {"step": share * FIXED[method]}
    return ephs.simulate(FREE_STRIP, 0.02, method=method, initial=FLIGHT, audit="warn", **options)


def of_nodes(shell, solution, of, held=()):
    """(times, nodes, …) poses or momenta of the nodes that are bodies."""
    nodes = [i for i in range(len(shell.points)) if i not in held]
    return np.stack([np.asarray(solution[f"node{i}.{of}"]) for i in nodes], axis=1)


def energy_of(shell, solution):
    """(times,) strain energy by statics, and kinetic energy by the nodes' momenta."""
    poses, momenta = (of_nodes(shell, solution, of) for of in ("pe.q", "ke.p"))
    return np.array([shell.energy(at).sum() for at in poses]) + 0.5 * np.sum(momenta**2 / shell.inertia, axis=(1, 2))


def momentum_of(shell, solution):
    """(times, 6) moment of momentum about the origin, and momentum."""
    poses, momenta = (of_nodes(shell, solution, of) for of in ("pe.q", "ke.p"))
    turn = Rotation.from_quat(poses[..., :4].reshape(-1, 4), scalar_first=True)
    spin, force = (turn.apply(part.reshape(-1, 3)).reshape(part.shape) for part in np.split(momenta, 2, axis=2))
    return np.concatenate([spin + np.cross(poses[..., 4:], force), force], axis=2).sum(axis=1)


def assert_energy_is_kept(method):
    energy = energy_of(STRIP, flown(method))
    # in each of some 40 steps rounding of Δ, 1e-15, against stiffness times Δ
    assert largest(energy - energy[0]) <= 1e-11 * energy[0]


@pytest.mark.filterwarnings("ignore::ephs.AuditWarning")
@pytest.mark.parametrize("method", LAWFUL)
def test_the_energy_of_a_flight_is_exact_by_every_method_that_keeps_it(method):
    assert_energy_is_kept(method)


@pytest.mark.filterwarnings("ignore::ephs.AuditWarning")
@pytest.mark.parametrize("method", ["natural", "natural4"])
def test_the_energy_of_a_flight_is_exact_by_steps_of_relations(method):
    assert_energy_is_kept(method)


@pytest.mark.filterwarnings("ignore::ephs.AuditWarning")
def test_momenta_of_a_flight_are_exact_by_variational_and_not_its_energy():
    solution = flown("variational")
    momentum, energy = momentum_of(STRIP, solution), energy_of(STRIP, solution)
    size = np.abs(of_nodes(STRIP, solution, "ke.p")).sum(axis=(1, 2)).max()
    assert largest(momentum - momentum[0]) <= 1e-11 * size
    assert largest(energy - energy[0]) > 1e-9 * energy[0]  # the control: a law that it has not
    natural = momentum_of(STRIP, flown("natural"))
    assert largest(natural - natural[0]) > 1e-11 * size


@pytest.mark.filterwarnings("ignore::ephs.AuditWarning")
def test_methods_agree_about_a_flight():
    """Those with tolerances to a millionth; steps of order 2 to a quarter when they are half as long."""
    expected = of_nodes(STRIP, flown("rk87"), "pe.q")[-1]

    def off(method, share=1.0):
        return largest(of_nodes(STRIP, flown(method, share), "pe.q")[-1] - expected)

    far = largest(expected - STRIP.poses)
    assert max(off(method) for method in ("rk54", "radau", "semi")) <= 1e-6 * far
    for method in ("natural", "variational"):
        assert 3.5 <= off(method, 0.5) / off(method, 0.25) <= 4.5  # ωh is 0.4 of the highest mode: its square off 4


def test_a_strained_shell_starts_with_the_forces_of_statics():
    poses = disturbed(STRIP, np.random.default_rng(4), 1e-2)
    start = {f"node{i}.pe.q": pose for i, pose in enumerate(poses)}
    h = 1e-7
    solution = ephs.simulate(FREE_STRIP, h, method="rk54", step=h, initial=start, audit="warn")
    force = STRIP.forces(poses)
    world = Rotation.from_quat(poses[:, :4], scalar_first=True)
    expected = -np.concatenate([force[:, :3], world.inv().apply(force[:, 3:])], axis=1)
    found = of_nodes(STRIP, solution, "ke.p")[-1] / h
    assert largest(found - expected) <= 1e-6 * largest(expected)


@pytest.mark.filterwarnings("ignore::ephs.AuditWarning")
@pytest.mark.parametrize("method", ["natural", "rk54", "rk87", "radau", "semi", "auto"])
def test_a_damped_flight_heats_by_what_it_loses_and_entropy_never_falls(method):
    system = shell_system(STRIP, damping=1e-3)
    options = {"step": 1e-3} if method in FIXED else {"rtol": 1e-6}
    solution = ephs.simulate(system, 0.01, method=method, initial=FLIGHT, audit="warn", **options)
    energy = energy_of(STRIP, solution)
    made = sum(np.ravel(np.asarray(solution[f"element{e}.env.s"])) for e in range(len(STRIP.cells)))
    lost, heat = energy[0] - energy[-1], Reference().temperature * (made[-1] - made[0])
    assert lost > 1e-2 * energy[0]
    assert abs(lost - heat) <= 1e-11 * energy[0]
    assert np.diff(made).min() >= 0.0


@pytest.mark.parametrize("method", ["rk54", "rk87"])
def test_a_damped_sheet_falls_from_rest_by_explicit_steps_whatever_is_rounding(method):
    """Far from what holds it rates are rounding at first: negative weights of methods make of it no loss of entropy."""
    points, where, cells = grid(lambda u, v: (0.3 * u, 0.3 * v, 0.0), (4, 4))
    shell = Shell.of(points, cells, ShellSection.isotropic(2e-3, E=2e9, nu=0.3, rho=1000.0))
    held = np.flatnonzero(where[:, 0] == 0.0).tolist()
    system, stiff = (shell_system(shell, gravity=(0.0, 0.0, -9.81), damping=tau, held=held) for tau in (1e-6, 1e-3))
    solution = ephs.simulate(system, 2e-6, method=method, audit="fail")
    assert solution.stats["least_production"] >= 0.0
    assert solution["node24.pe.q"][-1, 6] == pytest.approx(-0.5 * 9.81 * 4e-12, rel=1e-4)
    assert solution.heat[-1] > 0.0
    with pytest.raises(ephs.SimulationError, match="damping may be stiff"):  # the control: ten times its time constants
        ephs.simulate(stiff, 2e-6, method="rk54", step=1e-8, audit="off")


def test_inertia_spread_over_elements_slows_turns_about_the_normal_and_changes_slow_modes_by_order_2():
    """In the plane of a sheet; modes across it have no such turns."""
    lowest, highest = [], []
    for n in (8, 16):
        points, where, cells = grid(lambda u, v: (u, v, 0.0), (n, n))
        shell = Shell.of(points, cells, ShellSection.isotropic(0.01, E=1.0, nu=0.3, rho=1.0))
        for spread in (False, True):
            mass = np.zeros((len(points), 6, 6))
            mass[:, :3, :3], mass[:, 3:, 3:] = shell.tensors(spread=spread), shell.inertia[:, 3:, None] * np.eye(3)
            free = np.flatnonzero(np.repeat(where[:, 0] > 0.0, 6) & np.tile([0, 0, 1, 1, 1, 0], len(points)))
            stiff = shell.tangent(shell.poses).toarray()[np.ix_(free, free)]
            whole = block_diag(*mass)
            values = eigh(0.5 * (stiff + stiff.T), whole[np.ix_(free, free)], eigvals_only=True)
            lowest.append(np.sqrt(values[0]))
            highest.append(np.sqrt(values[-1]))
    changes = [1.0 - lowest[1] / lowest[0], 1.0 - lowest[3] / lowest[2]]
    assert 3.5 <= changes[0] / changes[1] <= 4.5 and 0.0 < changes[1] < 1e-3
    assert 0.8 * 6.25 <= highest[2] / highest[3] <= 6.25  # the size of elements in parts of the thickness


def test_a_shell_without_mass_does_not_move():
    with pytest.raises(StructureError, match="damping"):
        shell_system(STRIP, damping=-1.0)
    shell = Shell.of(POINTS, [[0, 1, 2, 3]], ShellSection.isotropic(0.1, E=1e3))
    with pytest.raises(StructureError, match="no mass"):
        shell_system(shell)
    with pytest.raises(StructureError, match="held"):
        shell_system(ELEMENT, held=[4])


def test_a_body_hangs_at_a_shared_node():
    """A weight in a ball joint at the corner of a held strip: the joint stays closed, and methods agree."""
    points, where, cells = grid(lambda u, v: (0.4 * u, 0.2 * v, 0.0 * u), (2, 1))
    shell = Shell.of(points, cells, STRIP.section)
    parts = {
        "strip": shell_system(shell, held=np.flatnonzero(where[:, 0] == 0.0).tolist(), shared=[5]),
        "weight": rigid_body(0.1, [1e-4] * 3).with_initial({"pe.q": [1.0, 0.0, 0.0, 0.0, 0.4, 0.2, -0.05]}),
        "joint": joint("spherical", frame2={"position": [0.0, 0.0, 0.05]}),
    }
    pattern = "p: body_momentum; q: body_momentum; strip(p5=p); weight(p=q); joint(p1=p, p2=q)"
    system = Pattern.from_text(pattern)(**parts)
    ends = []
    for method in ("auto", "radau"):
        solution = ephs.simulate(system, 0.01, method=method, rtol=1e-8)
        node, weight = (np.asarray(solution[name])[-1] for name in ("strip.node5.pe.q", "weight.pe.q"))
        hung = weight[4:] + Rotation.from_quat(weight[:4], scalar_first=True).apply([0.0, 0.0, 0.05])
        assert largest(hung - node[4:]) <= 1e-9  # a tolerance of steps, in m
        assert node[6] < -1e-4
        ends.append(node)
    assert largest(ends[0] - ends[1]) <= 1e-7
