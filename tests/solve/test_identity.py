"""A journal is that of one run: what differs in a number of a function is refused, what is the same is not."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import pytest

import ephs
from ephs import Pattern
from ephs import library as lib
from ephs import quantity as Q
from ephs.mechanics.runs import journaling
from ephs.mechanics.runs.functions import function_digest
from tests.scenes import shipped

SCENE = shipped("slider-crank")
SIZE = 1.0


def _pull(size: float, t: float) -> float:
    return 1e-3 * size * t


def _of_global(t):
    return 1e-3 * SIZE * t


@dataclass(frozen=True)
class Pull:
    """A controller with a number, and with a memory that no identity has."""

    size: float
    seen: list[float] = field(default_factory=list)

    def __call__(self, t: float) -> float:
        self.seen.append(t)
        return 1e-3 * self.size * t

    def pull(self, t: float) -> float:
        return self(t)


def _counting(size):
    count = 0

    def pull(t):
        nonlocal count
        count += 1
        return 1e-3 * size * t

    return pull


def _logging(size):
    times = np.zeros(1)

    def pull(t):
        times[0] = t
        return 1e-3 * size * t

    return pull


def _by_defaults(size):
    def pull(t, *, k=size):
        return 1e-3 * k * t

    return pull


def _nested(size):
    def inner(t):
        return size * t

    return lambda t: 1e-3 * inner(t)


def _by_module(size):
    """A function whose number is a global: one of another module of the same name and code."""
    return type(_of_global)(_of_global.__code__, {**globals(), "SIZE": size}, "_of_global")


FUNCTIONS: dict[str, Callable[[float], Any]] = {
    "closure": lambda size: lambda t: 1e-3 * size * t,
    "array": lambda size: (lambda gains: lambda t: 1e-3 * gains[0] * t)(np.array([size])),
    "default": _by_defaults,
    "partial": lambda size: partial(_pull, size),
    "object": Pull,
    "method": lambda size: Pull(size).pull,
    "counter": _counting,
    "log": _logging,
    "function in a closure": _nested,
    "global": _by_module,
    "constant": lambda size: (lambda t: 1e-3 * t) if size == 1.0 else (lambda t: 2e-3 * t),
}


def unrecorded(size):
    """An oscillator whose energy cannot be recorded, with a number of its own."""
    parts = Pattern.from_text("q: displacement; p: momentum; pe(q); ke(p); pkc(q, p)")
    spring = ephs.storage({"q": Q.displacement}, lambda q: 0.5 * size * float(q) ** 2, initial={"q": 1.0})
    return parts(pe=spring, ke=lib.point_mass(m=1.0), pkc=lib.pkc())


LOOSE = {"rtol": 1e-4, "atol": 1e-6}
RUNS: dict[str, Callable[[float], tuple[Any, dict[str, Any]]]] = {
    **{
        f"input, {name}": lambda size, make=make: (SCENE, {"inputs": {"joints.bearing": make(size)}, **LOOSE})
        for name, make in FUNCTIONS.items()
    },
    "sampled": lambda size: (
        SCENE,
        {"inputs": {"joints.bearing": ephs.Sampled(0.01 * size, lambda t, state: 1e-3)}, **LOOSE},
    ),
    "event": lambda size: (SCENE, {"events": [lambda t, state: t - 0.01 * size], **LOOSE}),
    "unrecorded energy": lambda size: (unrecorded(size), {"step": 0.01}),
}


@pytest.mark.parametrize("name", RUNS)
def test_a_run_that_differs_in_a_number_of_a_function_is_another_run(name, tmp_path):
    file = tmp_path / "run.journal"

    def run(size):
        model, options = RUNS[name](size)
        return ephs.simulate(model, 0.05, audit="off", journal=file, **options)

    first = run(1.0)
    assert np.array_equal(run(1.0).energy, first.energy)
    model = RUNS[name](1.0)[0] if name == "unrecorded energy" else None
    assert np.array_equal(ephs.load_solution(file, model=model).energy, first.energy)
    with pytest.raises(ephs.OptionError, match="expected the journal of this run"):
        run(2.0)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_identities_of_functions_do_not_depend_on_what_they_have_counted(name):
    make = FUNCTIONS[name]
    used = make(1.0)
    used(0.3)
    assert function_digest(used) == function_digest(make(1.0)) != function_digest(make(2.0))


def test_names_alone_do_not_tell_functions_apart(tmp_path, monkeypatch):
    """The control: without what functions compute, another run goes on from this one's journal."""
    monkeypatch.setattr(journaling, "function_digest", lambda _: "")
    file = tmp_path / "run.journal"
    for size in (1.0, 2.0):
        model, options = RUNS["input, closure"](size)
        ephs.simulate(model, 0.05, audit="off", journal=file, **options)


def test_a_result_is_read_without_a_model(tmp_path):
    system = unrecorded(1.0)
    ephs.simulate(system, 0.05, step=0.01).save(tmp_path / "run.nc")
    with pytest.raises(ValueError, match="expected no model="):
        ephs.load_solution(tmp_path / "run.nc", model=system)


def test_where_a_function_is_written_is_not_what_it_is():
    code = _of_global.__code__
    elsewhere = type(_of_global)(code.replace(co_firstlineno=code.co_firstlineno + 40), globals())
    assert function_digest(elsewhere) == function_digest(_of_global)
