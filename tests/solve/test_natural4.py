"""Natural steps of several stages: energy, closed joints, angular momentum about the vertical, and their order."""

import numpy as np
import pytest

import ephs
from ephs import library
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.semantics.spaces import SE3
from ephs.solve.equations.model import compile_model
from ephs.solve.methods.natural import Natural
from tests.numerics import EPS
from tests.oscillator import rubbed_oscillator
from tests.scenes import ROOT, model_of
from tests.written import scene_of_text

TOP = """format = 1
name = "top"

[bodies.top]
mass = 2.0
inertia = [0.3, 0.4, 0.5]
position = [0.3, 0.1, 0.4]
rotation = [0.8, 0.0, 0.6, 0.0]
angular_velocity = [1.0, 2.0, 3.0]

[joints.tip]
type = "spherical"
bodies = ["ground", "top"]
at = [0.0, 0.0, 0.0]

[assembly]
adjust = true
"""


@pytest.fixture(scope="module")
def top():
    problem = problem_of_scene(scene_of_text(TOP))
    return problem, model_of(problem)


def test_momentum_about_the_vertical_is_kept_to_the_order(top):
    problem, model = top
    method, begin = Natural(model, 3), problem.descriptor.pack(problem.initial)

    def vertical(x):
        found = problem.descriptor.unpack(x)
        pose, momentum = (found[ephs.Path.of(f"bodies.top.{part}")] for part in ("pe.q", "ke.p"))
        return (SE3.adjoint(SE3.inverse(pose)).T @ momentum)[2]

    start = vertical(begin)
    missed = [abs(vertical(method.step(method.init(begin), h).x) - start) for h in (0.1, 0.05)]
    assert missed[0] < 1e-4 * abs(start)
    assert missed[1] <= missed[0] / 14.0 or missed[0] <= 1e-12 * abs(start)


@pytest.fixture(scope="module")
def chain():
    problem = problem_of_scene(ephs.load(ROOT / "benchmarks/scenes/spherical-chain-2.toml"))
    model = model_of(problem)
    return problem, model, moved(problem, model, 3, 320)


def moved(problem, model, stages, steps):
    """Poses and momenta after 0.4 s."""
    method = Natural(model, stages)
    state, chunk = method.advance(method.init(problem.descriptor.pack(problem.initial)), 0.4 / steps, steps)
    assert chunk.failure is None
    found = problem.descriptor.unpack(state.x)
    return [np.concatenate([found[path] for path in found if str(path).endswith(end)]) for end in ("pe.q", "ke.p")]


@pytest.mark.parametrize("stages", [1, 2, 3])
def test_poses_have_twice_the_order_of_stages_and_momenta_what_the_method_says(chain, stages):
    """What momenta have across the constraints adds up from step to step where the number of stages is even."""
    problem, model, exact = chain
    order = Natural(model, stages).order
    assert order == {1: 2, 2: 2, 3: 4}[stages]
    ends = [moved(problem, model, stages, steps) for steps in (10, 20)]
    coarse, fine = ([np.linalg.norm(one - other) for one, other in zip(end, exact, strict=True)] for end in ends)
    assert np.log2(np.array(coarse) / fine) == pytest.approx([2.0 * stages, order], abs=0.1)


@pytest.mark.parametrize("stages", [1, 2, 3])
def test_energy_is_kept_and_entropy_made_by_any_number_of_stages(stages):
    hard = ephs.storage({"q": ephs.quantity.displacement}, lambda q: 0.25 * q**4)
    system = rubbed_oscillator(pe=hard, env=library.thermal_capacity(c1=293.15, c2=1.0))
    descriptor = system.descriptor()
    method = Natural(compile_model(descriptor, ephs.Reference(), {}), stages)
    start = method.init(descriptor.pack(system.state({"pe.q": 1.0})))
    energy = method.energies(start.x).sum()
    for h in (0.1, 1.0):
        state, chunk = method.advance(start, h, 10)
        assert chunk.failure is None
        assert abs(method.energies(state.x).sum() - energy) <= 10 * 8 * 5 * EPS * energy
        assert chunk.rows.ledgers[:, 4].min() > 0.0
