"""Shipped programs: floats, object code of each level of x86-64, and that of arm64 give the same bits."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks import families
from ephs.mechanics.elements.shell.edges import SIZE
from ephs.mechanics.road.loops import ARGUMENTS as LOOPS
from ephs.mechanics.road.programs import ARGUMENTS as SWEEPS
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.semantics.spaces.differentials import DIMENSIONS
from ephs.semantics.stage import llvm
from ephs.semantics.stage.calling import Call
from ephs.semantics.stage.objects import FITTING, emitted, fitting
from ephs.semantics.stage.programs import _staged
from ephs.shipped import programs
from tests.numerics import largest, seeds
from tests.scenes import equations_of, shipped
from tests.semantics.linear.test_rows import problems, solved
from tests.semantics.stage.arm import Arm
from tests.semantics.stage.test_elementary import EDGES

pytestmark = pytest.mark.optimised

PROGRAMS = {program.name: program for program in programs()}
RUNS = ["compiled", *fitting(llvm.host()), "linux-arm64 in an emulator"]


@cache
def calls(name: str, run: str) -> Mapping[str, Callable[..., Any]]:
    """The entry functions of a program, by one way to run them."""
    program, (target, *_) = PROGRAMS[name], run.split()
    if target not in FITTING:
        return program.plain() if run == "plain" else program.compiled()
    *_, results = _staged(program, 1, ())
    code = emitted(program.text(), target)
    if target == run:
        library = llvm.load(code)
        return {
            key: Call(entry, library, f"{name}_{key}", results[key], lambda _: ())
            for key, entry in program.entries.items()
        }
    arm = Arm(code)

    def call(key: str) -> Callable[..., Any]:
        entry = program.entries[key]
        return lambda *arguments: arm.call(f"{name}_{key}", results[key], *entry.split(arguments, lambda _: ()))

    return {key: call(key) for key in program.entries}


@dataclass(frozen=True, slots=True)
class Heard:
    """Entry functions that write down what they return and leave in their arrays.

    Not ``signed``: zeros have no sign, which what is known to be zero while staging leaves open.
    """

    calls: Mapping[str, Callable[..., Any]]
    heard: list[tuple[str, bytes]]
    signed: bool = True

    def __getitem__(self, key: str) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            with np.errstate(all="ignore"):
                result = self.calls[key](*arguments)
            arrays = [argument for argument in arguments if isinstance(argument, np.ndarray)]
            parts = [*([] if result is None else [np.asarray(result)]), *arrays]
            # Which not-a-number it is, IEEE 754 leaves open.
            kept = [np.where(part == part, part, np.nan) for part in parts]
            self.heard.append((key, b"".join((part if self.signed else part + 0.0).tobytes() for part in kept)))
            return result

        return call


def elementary(run: Heard, x: float, y: float) -> None:
    """Every function at one pair of numbers."""
    for name in ("sin", "cos", "exp", "log"):
        run[name](x)
    run["atan2"](y, x)


def constraint_rows(run: Heard, problem: Any) -> None:
    """Rank, correction and multipliers of drawn rows, and a system with their mass matrix."""
    row, mass, target, _ = problem
    solved(row, mass, target, lambda entry, *arguments: (run[entry](*arguments), *arguments))
    factor, x = np.zeros(mass.shape), np.ones(len(mass))
    run["cholesky"](mass, factor)
    run["solve"](factor, x)


def sparse(run: Heard, n: int, seed: int, least: float) -> None:
    """Pattern, factors and solution of a drawn matrix with a full diagonal, whose pivots may fail."""
    rng = np.random.default_rng(seed)
    a = np.where(rng.random((n, n)) < 0.4, rng.standard_normal((n, n)), 0.0) + 2.0 * np.eye(n)
    row, column = np.nonzero(a)
    first = np.searchsorted(row, np.arange(n + 1)).astype(np.int64)
    start, out = np.zeros(n + 1, dtype=np.int64), np.zeros(n * n, dtype=np.int64)
    link, mark = np.zeros(n + 1, dtype=np.int64), np.full(n, -1, dtype=np.int64)
    count = run["fill"](first, column.astype(np.int64), start, out, link, mark)
    columns = np.ascontiguousarray(out[:count])
    rows = np.repeat(np.arange(n), np.diff(start))
    diagonal = np.flatnonzero(rows == columns).astype(np.int64)
    find = {(int(r), int(c)): k for k, (r, c) in enumerate(zip(rows, columns, strict=True))}
    place = np.array([find[int(r), int(c)] for r, c in zip(row, column, strict=True)], dtype=np.int64)
    value, scratch = np.zeros(count), np.zeros(n)
    pattern = start, columns, diagonal
    good = run["factorise"](place, *pattern, a[row, column], value, scratch, np.full(n, least), np.zeros(n))
    x = np.zeros(n)
    right = rng.standard_normal(n)
    run["solve"](np.arange(n), np.arange(n), *pattern, value, right, x, scratch)
    if good:
        assert largest(a @ x - right) <= 1e-6 * np.linalg.cond(a)


def linear(run: Heard, n: int, k: int, m: int, seed: int) -> None:
    """The relations of n ports with k conditions and m multipliers, at drawn numbers; of a frame change 12 and 6."""
    rng = np.random.default_rng(seed)
    for name in PROGRAMS["linear"].entries:
        n, k, m = (12, 6, 0) if name == "frame_change" else (n, k, m)
        sizes = {"scal": 1, "p": n * (n + k), "x0": n, "v": n, "e": n, "lam": k, "f": n * n, "c": max(k, 1)}
        sizes |= {"jac": (n + k) * (n + k + m), "work": 1}
        run[name](np.array([n, k, m, 0]), *(rng.standard_normal(size) for size in sizes.values()))


@cache
def mechanism(family: str, size: int) -> ReducedEquations:
    scene = shipped("slider-crank") if family == "slider-crank" else families.scene(family, size)
    return equations_of(scene)


def drawn(eq: ReducedEquations, seed: int) -> dict[str, Any]:
    """A mechanism's tables, and drawn numbers in all memory, by the names that entry functions have for them."""
    rng, given = np.random.default_rng(seed), eq.engine.tables
    out = {name: array.copy() for name, array in given.items() if isinstance(array, np.ndarray)}
    out |= {name: rng.standard_normal(array.shape) for name, array in eq.engine.work.items() if name != "fault"}
    n, links = eq.n, given["own"][0].links
    out |= {"size": links, "memory": out["work"], "wrench": out["pushed"], "worst": np.zeros(1)}
    out |= {"motions": out["relative"], "numbers": out["cut_numbers"], "chart": given["chart"].arrays[0].copy()}
    out |= {"base": eq._paper.initial()[0], "v": rng.standard_normal(eq.nv), "out": np.zeros(eq.nv)}
    out |= {"target": out["kept"], "columns": np.zeros((n, 6)), "places": out["work"].reshape(links + 1, -1)}
    return out | {"q": out["base"].copy(), "r": np.ones(n), "x": np.ones(n), "rate": np.zeros(n)}


def swept(family: str, arguments: Mapping[str, Mapping[str, Any]]) -> Callable[..., None]:
    """All functions of a program on a mechanism, in a row."""

    def use(run: Heard, size: int, seed: int) -> None:
        values = drawn(mechanism(family, size), seed)
        for entry in run.calls:
            if entry == "evaluations":
                q, r = values["q"][None], values["r"][None]
                names = list(arguments["accelerations"])[:5]
                run[entry](*(values[name] for name in names), q, r, np.zeros(r.shape), 1)
            else:
                given = values | ({"out": np.zeros(3)} if entry == "energy" else {})
                run[entry](*(given[name] for name in arguments[entry]))

    return use


def differentials(run: Heard, seed: int, size: float) -> None:
    """Those of every group and their inverses, at one drawn motion of each."""
    rng = np.random.default_rng(seed)
    for name in run.calls:
        d = DIMENSIONS[int(name.rpartition("_")[2])]
        run[name](size * rng.standard_normal(d), np.zeros((d, d)))


def reading(run: Heard, rows: int, seed: int) -> None:
    """A tape of rows with two entries each, read backwards from its last row."""
    rng = np.random.default_rng(seed)
    places = np.array([[rng.integers(0, k + 1), rng.integers(0, k + 1), 2] for k in range(rows)])
    counters, bars = np.array([3 * rows, rows + 1, 3 * rows]), np.zeros(rows + 1)
    bars[rows] = 1.0
    run["back"](counters, places.ravel(), rng.standard_normal(3 * rows), bars)


def shell_edges(run: Heard, edges: int, seed: int) -> None:
    """Logarithms of drawn edges of shells, and their derivatives at drawn stresses."""
    rng = np.random.default_rng(seed)
    turns = rng.standard_normal((2, edges, 4))
    poses = np.dstack([turns / np.linalg.norm(turns, axis=2, keepdims=True), rng.standard_normal((2, edges, 3))])
    starts, ends, logs = poses[0].copy(), poses[1].copy(), np.zeros((edges, 6))
    run["logarithms"](starts, ends, logs)
    run["slopes"](logs, rng.standard_normal((edges, 6)), np.zeros((edges, SIZE)), np.zeros((edges, SIZE)))


NUMBERS = st.one_of(st.floats(-10.0, 10.0), st.sampled_from(EDGES), st.floats())
SIZES = [0.0, 1e-9, 1e-3, 1.0, 9.0]
MECHANISMS = st.tuples(st.integers(1, 2), seeds)
USES: dict[str, tuple[Callable[..., None], st.SearchStrategy[Any]]] = {
    "ephs": (elementary, st.tuples(NUMBERS, NUMBERS)),
    "differentials": (differentials, st.tuples(seeds, st.sampled_from(SIZES))),
    "reading": (reading, st.tuples(st.integers(1, 9), seeds)),
    "constraint_rows": (constraint_rows, st.tuples(problems())),
    "linear": (linear, st.tuples(*[st.integers(1, 4), *[st.integers(0, 3)] * 2, seeds])),
    "sparse_lu": (sparse, st.tuples(st.integers(1, 8), seeds, st.sampled_from([0.0, 0.1, 0.9]))),
    "shell_edges": (shell_edges, st.tuples(st.integers(1, 4), seeds)),
    "sweeps_planar_turn_trees": (swept("planar-chain", SWEEPS), MECHANISMS),
    "sweeps_planar_turn_loops": (swept("four-bar-windows", SWEEPS), MECHANISMS),
    "sweeps_planar_slide_turn_loops": (swept("slider-crank", SWEEPS), MECHANISMS),
    "loops_0_1": (swept("four-bar-windows", LOOPS), MECHANISMS),
}
"""Of each shipped program, calls of all its entry functions, and what they are drawn from."""


REACHING = {
    "motion_of_loops", "motion_of_trees", "stiff_steps_of_trees", "network", "natural", "natural_along",
    "natural_of_3_stages", "evaluation", "integral", "outputs", "rates_of_loops_along_4", "rates_of_trees_along_4",
    "settling", "point", "lagged_steps_of_trees",
}  # fmt: skip
"""Programs that call others by address: the emulator of arm64 has no others, so their bits there are not known."""


def test_programs_are_used_or_reach_others():
    assert set(PROGRAMS) == USES.keys() | REACHING


@pytest.mark.parametrize("name", USES)
@pytest.mark.parametrize("run", RUNS)
@given(data=st.data())
@settings(max_examples=20, deadline=None)
def test_all_ways_to_run_a_program_give_the_same_bits(name, run, data):
    use, strategy = USES[name]
    drawn = data.draw(strategy)
    signed = not name.startswith(("sweeps", "loops", "differentials", "shell"))
    plain, found = Heard(calls(name, "plain"), [], signed), Heard(calls(name, run), [], signed)
    use(plain, *drawn)
    use(found, *drawn)
    assert plain.heard == found.heard
    assert {key for key, _ in plain.heard} == set(PROGRAMS[name].entries)


def test_another_last_bit_is_noticed():
    one, other = Heard(calls("ephs", "plain"), []), Heard(calls("ephs", "plain"), [])
    one["exp"](1.0)
    other["exp"](1.0 + 2.0**-52)
    assert one.heard != other.heard
