"""The programs of the natural methods: floats and machine code give the same bits, whatever a step meets."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.semantics.spaces import codes
from ephs.semantics.spaces.differentials import DIMENSIONS, differentials
from ephs.solve.equations.model import Model, compile_model
from ephs.solve.methods.natural import Natural
from ephs.solve.methods.newton import natural_program
from ephs.solve.methods.records import DONE
from ephs.solve.running.snapshot import parts
from tests.numerics import generators, seeds
from tests.scenes import shipped
from tests.staged import run_both

pytestmark = pytest.mark.optimised


SCENES = ["heavy-top", "hot-brake"]
"""A body on a spherical joint; a wheel, its brake and their heat."""


@cache
def model_of(name: str) -> tuple[Model, np.ndarray]:
    problem = problem_of_scene(shipped(name))
    made = compile_model(problem.descriptor, problem.reference, problem.inputs(0.0, problem.initial))
    return made, problem.descriptor.pack(problem.initial)


def disturbed(model: Model, x, seed, stages):
    """A step, the method, and a state whose unknowns are off by something."""
    rng = np.random.default_rng(seed)
    method = Natural(model, stages)
    state = method.init(x)
    z = state.z + 1e-3 * rng.choice([0.0, 1.0]) * rng.standard_normal(state.z.shape)
    return 10.0 ** rng.uniform(-4.0, -2.0), method, replace(state, z=z)


@pytest.mark.parametrize("name", SCENES)
@settings(max_examples=2)
@given(seed=seeds)
def test_a_step_of_order_2(name, seed):
    made, x = model_of(name)
    h, method, state = disturbed(made, x, seed, 1)
    method.prepare(state, h)
    rows = [np.zeros((1, width)) for width in (x.size, made.tables.kind.size, 5)]

    tables = made.tables, method._groups, method.elimination
    _, *found = run_both(
        natural_program(1), "advance",
        *map(parts, tables), parts(method._memory), parts(method._scratch), x, state.z, state.previous,
        made.scal(h), made.scal(0.0), made.input_values()[None], state.sums, *rows, np.zeros(4, dtype=np.int64), 1,
    )  # fmt: skip
    assert found[-2][2] == (found[-2][0] == DONE)
    assert np.array_equal(found[5], x) != (found[-2][0] == DONE)


@pytest.mark.parametrize("name", SCENES)
@settings(max_examples=1)
@given(seed=seeds)
def test_the_stages_of_order_4(name, seed):
    made, x = model_of(name)
    h, method, state = disturbed(made, x, seed, 3)
    status, *found = run_both(
        natural_program(3), "linearise",
        parts(made.tables), parts(method._groups), np.zeros(made.unknowns, dtype=np.int64), x, state.z,
        made.scal(h), made.scal(0.0), np.tile(made.input_values(), (3, 1)), parts(made.memory()),
        parts(method._scratch), 1,
    )  # fmt: skip
    assert status == 0
    assert found[-2]["slope"].any()


@settings(max_examples=10)
@given(rng=generators, size=st.sampled_from([0.0, 1e-9, 0.1, 1.0, 3.0]))
@pytest.mark.parametrize("code", DIMENSIONS)
def test_differentials(code, rng, size):
    v = size * rng.standard_normal(DIMENSIONS[code])
    for name in (f"dexp_left_{code}", f"dexp_left_inv_{code}"):
        run_both(differentials(), name, v, np.zeros((v.size, v.size)), signed=False)


def test_every_group_but_vectors_has_differentials():
    assert set(DIMENSIONS) == {codes.SO3, codes.SE2, codes.SE3, codes.SO3xR3}
