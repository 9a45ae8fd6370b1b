"""Steps and rates that are solved part by part are those of the flattened system."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks import condensed
from benchmarks.condensed import solved_by_parts
from benchmarks.copies import copies_of
from benchmarks.parts import FAMILIES
from ephs import AssemblyError, Reference
from ephs.semantics.descriptor.descriptor import Input, descriptor_of
from ephs.semantics.systems.laws import random_probe
from ephs.solve.equations.model import compile_model, evaluate_at
from ephs.solve.equations.sparse import equilibrate
from ephs.solve.methods.natural import Natural
from ephs.solve.posing.errors import SolveError
from tests.benchmarks.test_copies import repeating
from tests.numerics import largest

ROUNDING = float(np.finfo(float).eps)


def models(system, inputs):
    """The compiled system, nested and flattened."""
    return tuple(compile_model(descriptor_of(each), Reference(), inputs) for each in (system, system.flatten()))


def at_rest(system):
    """No flow at any outer port but the first, where the effort is prescribed."""
    ports = [(path, port.quantity.space.dim) for path, port in system.interface.items() if port.power]
    return {path: Input(np.full(dim, 0.1), i == 0) for i, (path, dim) in enumerate(ports)}


def scaled(model, x, z, h):
    """The matrix at a solution with rows and columns of size one, and the columns' scale."""
    _, _, memory = evaluate_at(model, x, z, h)
    t, n = model.tables, model.unknowns
    there = memory.data != 0.0
    by_row, by_column = equilibrate(n, t.row[there], t.column[there], memory.data[there])
    matrix = np.zeros((n, n))
    np.add.at(matrix, (t.row[there], t.column[there]), memory.data[there])
    return by_row[:, None] * matrix * by_column, by_column


def distance(model, x, z, other, h):
    """How far two solutions are apart, as a multiple of what the matrix' condition and rounding allow."""
    matrix, scale = scaled(model, x, z, h)
    sigma = np.linalg.svd(matrix, compute_uv=False)
    condition = sigma[0] / sigma[sigma > 1e-12 * sigma[0]][-1] if sigma.size else 1.0
    size = largest(z / scale, initial=1.0)
    return float(largest((z - other) / scale, initial=0.0) / (10.0 * condition * ROUNDING * size)), sigma


@settings(max_examples=25)
@given(repeating(), st.integers(0, 2**16))
def test_a_step_by_parts_is_that_of_the_flattened_system(system, seed):
    try:
        descriptor_of(system)
    except AssemblyError:
        return  # a state is stored twice or nowhere
    probe = random_probe(system, seed)
    parts, flat = models(system, probe.inputs)
    x = flat.descriptor.pack(probe.state)
    method = Natural(flat)
    try:
        expected = method.step(method.init(x), probe.h)
    except SolveError:
        return  # a random state may contradict a constraint
    apart, sigma = distance(flat, x, expected.z[0], solved_by_parts(parts, x, probe.h), probe.h)
    unique = not sigma.size or sigma[-1] > 1e-12 * sigma[0]
    assert apart <= 1.0 or not unique  # else multipliers differ


@pytest.mark.parametrize("h", [1e-3, 0.0])
@pytest.mark.parametrize("family", ["RLC ladder", "wall", "walls of ten"])
def test_rates_and_steps_of_chains_of_parts(family, h):
    system = FAMILIES[family](40)
    parts, flat = models(system, at_rest(system))
    assert len(copies_of(system)) == (2 if family == "walls of ten" else 1)
    x = flat.descriptor.pack(system.state()) + 1e-3 * np.random.default_rng(3).standard_normal(
        flat.descriptor.point_size
    )
    found, plain = solved_by_parts(parts, x, h), solved_by_parts(flat, x, h)
    assert distance(flat, x, plain, found, h)[0] <= 1.0
    if h:
        method = Natural(flat)
        assert distance(flat, x, method.step(method.init(x), h).z[0], found, h)[0] <= 1.0


def linear_defect(system):
    """How far a linear solution by parts is from the dense one, as a multiple of what rounding allows."""
    model, _ = models(system, at_rest(system))
    x, z, h = model.descriptor.pack(system.state()), np.zeros(model.unknowns), 1e-3
    _, _, memory = evaluate_at(model, x, z, h)
    t = model.tables
    matrix = np.zeros((model.unknowns, model.unknowns))
    np.add.at(matrix, (t.row, t.column), memory.data)
    exact = np.linalg.solve(matrix, memory.residual)
    return distance(model, x, exact, condensed.condensed(model, memory.data, memory.residual), h)[0]


def test_a_part_that_forgets_what_is_around_it_is_noticed(monkeypatch):
    assert linear_defect(FAMILIES["wall"](10)) <= 1.0
    monkeypatch.setattr(condensed._Back, "fill", lambda self, z: z.__setitem__(self.inner, self.constant))
    assert linear_defect(FAMILIES["wall"](10)) > 1e6
