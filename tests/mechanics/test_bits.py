"""The float run and machine code give the same bits: of every program that a mechanism's equations call.

The registry is what the mechanism itself calls: its engine with sweeps and loops, its components, its dense equations;
each as it is, and over dual numbers. Inputs are drawn states, and memory as the calls before left it.
"""

from functools import cache, partial

import numpy as np
import pytest
from hypothesis import given, settings

from ephs.mechanics.methods.explicit import tableau
from ephs.mechanics.sensitivity.family import relation_of
from ephs.mechanics.tree.engine.residuals import ACTIVE, point_program
from ephs.mechanics.tree.engine.tangents import DIRECTIONS, StepTangent, evaluated, step_program, step_tangents
from ephs.semantics.stage import PLAIN, Entry, Program, Table, vector
from tests.numerics import generators, seeds
from tests.scenes import equations_of, shipped

pytestmark = pytest.mark.optimised

SCENES = ("slider-crank", "heavy-top")
"""A closed loop with friction, heat and a drive in a plane; a ball joint in space."""
OWN = ("accelerations", "move", "rows", "poses", "fit", "gaps", "fold", "dependent", "unfold", "resolve", "spread",
       "power", "relative_rates", "across", "advance", "velocities", "displace")  # fmt: skip
"""Functions that the equations call by address, in an order in which memory is what they expect."""
ALIASES = {
    "size": "links", "memory": "work", "numbers": "cut_numbers", "motions": "relative",
    "wrench": "pushed", "worst": "answer",
}  # fmt: skip


@cache
def equations(name):
    eq = equations_of(shipped(name))
    return eq, eq.start(0.0)


@cache
def steps(name):
    eq = equations(name)[0]
    return StepTangent(eq.engine, partial(relation_of, eq.problem.descriptor), tableau("rk54").arrays, corrected=False)


def copied(argument):
    match argument:
        case Table():
            made = argument.record.table(int(argument.size))
            for to, array in zip(made.arrays, argument.arrays, strict=True):
                to[:] = array
            return made
        case tuple():
            return tuple(copied(part) for part in argument)
        case dict():
            return {name: copied(part) for name, part in argument.items()}
        case np.ndarray():
            return argument.copy()
        case _:
            return argument


def arrays(argument):
    match argument:
        case Table():
            return list(argument.arrays)
        case tuple():
            return [array for part in argument for array in arrays(part)]
        case dict():
            return [array for part in argument.values() for array in arrays(part)]
        case np.ndarray():
            return [argument]
        case _:
            return []


def same_bits(program, entry, arguments):
    """Both runs on copies of the arguments: equal results and memory, bit for bit; NaNs where the other has them."""
    mine, theirs = [copied(a) for a in arguments], [copied(a) for a in arguments]
    assert program.plain()[entry](*mine) == program.compiled()[entry](*theirs), entry
    for one, other in zip(arrays(tuple(mine)), arrays(tuple(theirs)), strict=True):
        known = one == one
        assert np.array_equal(known, other == other), entry
        one, other = one[known] + 0, other[known] + 0  # known numbers fold up to the sign of a zero
        assert np.array_equal(one.view(np.int64), other.view(np.int64)), entry
    return theirs


def paired(argument, rng):
    """With drawn slopes, small as those of a unit change."""
    if isinstance(argument, Table):
        return argument, rng.standard_normal((argument.arrays[1].size, DIRECTIONS))
    if isinstance(argument, np.ndarray) and argument.dtype == np.float64:
        return argument, rng.standard_normal((*argument.shape, DIRECTIONS))
    return argument


def drawn(name, seed):
    eq, start = equations(name)
    rng = np.random.default_rng(seed)
    q = eq.moved(start.q, 0.1 * rng.standard_normal(eq.n))
    return eq, q, rng.standard_normal(eq.n), rng


@pytest.mark.parametrize("name", SCENES)
@settings(max_examples=2)
@given(seed=seeds)
def test_what_the_equations_call(name, seed):
    eq, q, r, rng = drawn(name, seed)
    engine = eq.engine
    known = {**engine.tables, **engine.work, "links": int(engine.tables["own"][0].links), "q": q, "r": r}
    known |= {
        "base": q,
        "v": 0.1 * rng.standard_normal(eq.nv),
        "x": r,
        "out": np.zeros(eq.size),
        "rate": np.zeros(eq.n),
    }
    known["places"] = known["work"].reshape(known["links"] + 1, -1)
    charts = engine.tables["chart"].arrays[0]
    for own in (field for field in OWN if field in engine.reached):
        program, entry = engine.reached[own]
        kinds = program.entries[entry].kinds
        special = {"chart": charts, "out": np.zeros(1 if own == "power" else eq.size)}
        if own in ("move", "advance") and "v" in kinds:
            special["r"] = r
        given = [special.get(key, known[ALIASES.get(key, key)]) for key in kinds]
        for key, value in zip(kinds, same_bits(program, entry, given), strict=True):
            if isinstance(value, np.ndarray) and key not in special:
                known[ALIASES.get(key, key)][:] = value
        same_bits(program.tangent(DIRECTIONS), entry, [paired(copied(argument), rng) for argument in given])


@pytest.mark.parametrize("name", SCENES)
@settings(max_examples=2)
@given(seed=seeds)
def test_rates_and_their_derivatives(name, seed):
    eq, q, r, rng = drawn(name, seed)
    tangent = steps(name)
    y = eq.vector(equations(name)[1])
    y[: eq.nv], y[eq.nv : eq.nv + eq.n] = 0.1 * rng.standard_normal(eq.nv), r
    tables, work, looped = eq.engine.tables, eq.engine.work, eq.engine.looped
    same_bits(step_program(looped=looped), "rates", [tables, work, q, y, q.copy(), np.zeros(eq.size)])
    for pair, value in ((tangent.pairs["base"], q), (tangent.pairs["start"], y)):
        pair[0][:], pair[1][:] = value, rng.standard_normal(pair[1].shape)
    program, given = step_tangents(looped), tangent.arguments | {"k": tangent.stage}
    same_bits(program, "rates", [given[key] for key in program.entries["rates"].kinds])


@pytest.mark.parametrize("name", SCENES)
@settings(max_examples=2)
@given(rng=generators)
def test_components(name, rng):
    """Each relation at drawn numbers about those that it has, and over dual numbers."""
    eq = equations(name)[0]
    t = eq.model.tables
    for i in evaluated(eq.engine.tables):
        slot = eq.problem.descriptor.components[i]
        program, entry = relation_of(eq.problem.descriptor, i)
        n, k, m, size = (int(d) for d in t.dims[i])
        kernel = slot.primitive.kernel
        p = np.array(kernel.numbers(eq.model.reference))
        lengths = {"v": m, "e": n, "lam": k, "f": max(n * n, n), "c": k + 1, "jac": (n + k) * (n + k + m), "work": 0}
        x0 = eq.problem.descriptor.pack(eq.problem.initial)[t.read_x[t.read_x_at[i] : t.read_x_at[i] + size]]
        given = [np.array([n, k, m, size]), np.array([0.1, 293.0, 1e5]), p, x0.astype(float)]
        expected = program.entries[entry].kinds
        for key, length in lengths.items():
            size_of = expected[key].split(np.zeros(length), ())
            given.append(0.1 * rng.standard_normal(length if size_of is not None else _length(expected[key])))
        same_bits(program, entry, given)
        same_bits(program.tangent(DIRECTIONS), entry, [paired(argument, rng) for argument in given])


def _length(kind):
    """The size that a kind of arrays takes."""
    return next(size for size in range(4096) if kind.split(np.zeros(size), ()) is not None)


@pytest.mark.parametrize("name", SCENES)
@settings(max_examples=1)
@given(seed=seeds)
def test_dense_equations(name, seed):
    eq, q, r, rng = drawn(name, seed)
    found = eq.dense.residual
    found.about(q, r, np.zeros(eq.ns), eq.drive, eq.wrench)
    known = {**found.arrays, "link": 0, "driven": 0}
    point = point_program()
    same_bits(point, "about", [known[key] for key in point.entries["about"].kinds])
    known |= {"a": rng.standard_normal(eq.n), "multiplier": rng.standard_normal(found.m)}
    for entry in found.program.program.entries:
        kinds = found.program.program.entries[entry].kinds
        same_bits(found.program.program, entry, [{**known, "out": found.outs.get(entry)}[key] for key in kinds])
    active = {*ACTIVE, "a", "out"}
    for entry in ("residual", "action"):
        program = found.program.tangent(entry, DIRECTIONS)
        kinds = program.entries[entry].kinds
        values = {**known, "out": found.outs[entry]}
        same_bits(program, entry, [paired(values[key], rng) if key in active else values[key] for key in kinds])


def test_one_bit_is_seen():
    """The control: a function that rounds otherwise in the float run."""

    def wrong(on, x, out):
        out[0] = x[0] + (2.0**-52 if on is PLAIN else 2.0**-54)

    program = Program("wrong", wrong=Entry(wrong, x=vector(1), out=vector(1)))
    with pytest.raises(AssertionError):
        same_bits(program, "wrong", [np.ones(1), np.zeros(1)])
