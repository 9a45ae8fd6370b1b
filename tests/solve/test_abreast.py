"""Independent parts take steps of their own: what a run of the whole says is what the runs of its parts do."""

import re

import numpy as np
import pytest

import ephs
from benchmarks.touching import bouncing
from ephs import Path, Pattern
from ephs import library as lib
from ephs.mechanics.scene.rescaled import rescaled
from ephs.semantics.descriptor.product import factors_of
from tests.mechanics.drawn_scenes import drawn, toml
from tests.numerics import EPS, largest
from tests.semantics.test_product import coils, walls
from tests.written import scene_of_text

TIMES = np.linspace(0.0, 0.2, 5)
TIGHT = {"rtol": 1e-9, "atol": 1e-12, "save_at": TIMES}
SAME = 1e-7
"""Differences of runs whose steps differ, over 1 + what is compared: a hundred times what is asked of each step."""
START = {"coil1.b": 3.0, "coil2.b": -1.0, "room.s": 0.5}
HOT = {"inputs": {"s": {"effort": lambda t: 10.0 + 5.0 * t}}, "initial": {"one.s": 0.1, "two.s": -0.1}}
TOPS = """
format = 1
name = "tops"
[bodies.slow]
mass = 1.0
inertia = [1.0, 2.0, 3.0]
angular_velocity = {slow}
rotation = {{ rpy = [0.3, 0.2, 0.1] }}
[bodies.fast]
mass = 1.0
inertia = [1.0, 2.0, 3.0]
angular_velocity = {fast}
rotation = {{ rpy = [0.3, 0.2, 0.1] }}
"""
WELDED = TOPS.replace("name =", "assembly.adjust = true\nname =").format(slow=[0, 0.3, 3], fast=[0.2, 0, 9]) + "".join(
    f"""
[bodies.{top}_tip]
mass = 0.5
inertia = [0.1, 0.1, 0.1]
position = [0.5, 0.0, 0.0]
[joints.{top}_weld]
type = "fixed"
bodies = ["{top}", "{top}_tip"]
at = [0.2, 0.0, 0.0]
"""
    for top in ("slow", "fast")
)
"""Each part has a fixed joint, whose friction stands still."""
RUNS = {
    "coils in one room": (coils(lib.environment()), {"initial": START, "method": "radau"}),
    "coils in one room, natural": (coils(lib.environment()), {"initial": START, "method": "natural", "rtol": 1e-8}),
    "bodies at one wall": (walls(), {**HOT, "method": "radau"}),
    "scene 9": (scene_of_text(toml(drawn(9))), {"method": "rk87"}),
    "scene 33": (scene_of_text(toml(drawn(33))), {"method": "rk54"}),
    "scene 38": (scene_of_text(toml(drawn(38))), {"method": "radau"}),
    "welded tops": (scene_of_text(WELDED), {"method": "rk87"}),
}


def whole(model, **options):
    """The control, as one: events are of the whole."""
    found = ephs.simulate(model, TIMES[-1], **(TIGHT | {"events": [lambda t, state: 1.0]} | options))
    assert "independent_parts" not in found.stats
    return found


def apart(one, other):
    """The largest difference of two solutions, over 1 + what is compared."""
    pairs = [(one[path], other[path]) for path in one.states]
    pairs += [(getattr(one, name), getattr(other, name)) for name in ("energy", "exergy", "entropy", "heat", "work")]
    books = ((one.ledgers.storages, other.ledgers.storages), (one.ledgers.makers, other.ledgers.makers))
    pairs += [(book[path], its[path]) for book, its in books for path in book]
    return max(largest(x - y, initial=0.0) / (1.0 + largest(y, initial=0.0)) for x, y in pairs)


@pytest.mark.parametrize("name", RUNS)
def test_a_run_of_parts_is_that_of_the_whole(name):
    model, options = RUNS[name]
    parts, one = ephs.simulate(model, TIMES[-1], **(TIGHT | options)), whole(model, **options)
    assert parts.stats["independent_parts"] == 2 and np.array_equal(parts.t, TIMES)
    assert apart(parts, one) < SAME
    assert parts.energy_error.max() < 1e-12 and not parts.audit.findings


@pytest.mark.parametrize("scale", [2.0**-12, 2.0**12])
def test_parts_far_from_metres_and_seconds_are_those_of_the_whole(scale):
    """Runs are in units of the mechanism then."""
    model = rescaled(scene_of_text(TOPS.format(slow=[0.0, 0.0, 3.0], fast=[0.0, 0.0, 9.0])), scale, 1.0, scale)
    times, options = scale * TIMES, {"rtol": 1e-9, "atol": 1e-12}
    parts = ephs.simulate(model, times[-1], save_at=times, **options)
    one = ephs.simulate(model, times[-1], save_at=times, events=[lambda t, state: 1.0], **options)
    assert parts.stats["independent_parts"] == 2 and np.array_equal(parts.t, one.t)
    for path, values in one.states.items():
        assert np.allclose(parts[path], values, rtol=SAME, atol=SAME * largest(values, initial=0.0))


def test_parts_run_backward_to_where_they_came_from():
    tops = scene_of_text(TOPS.format(slow=[0.0, 0.1, 3.0], fast=[0.2, 0.0, 9.0]))
    there = ephs.simulate(tops, 1.0, save_at=[0.5, 1.0], rtol=1e-11, atol=1e-13)
    options = {"t0": 1.0, "save_at": [0.5, 0.0], "rtol": 1e-11, "atol": 1e-13}
    back = ephs.simulate(tops.at(there, 1.0), 0.0, **options)
    assert back.stats["independent_parts"] == 2
    start = tops.system().state()
    for path in back.states:
        assert largest(back[path][0] - there[path][0]) <= SAME
        assert largest(back[path][1] - start[path]) <= SAME


def test_a_run_of_the_whole_has_the_states_and_ledgers_of_runs_of_its_parts_to_the_bit():
    system = coils(lib.environment())
    options = {**TIGHT, "method": "radau", "initial": START}
    sol, parts = ephs.simulate(system, TIMES[-1], **options), factors_of(system.descriptor(), frozenset())
    alone = [
        ephs.simulate(
            part.descriptor.system,
            TIMES[-1],
            **{**options, "initial": {f"coil{i}.b": START[f"coil{i}.b"], "room.s": 0.5}},
        )
        for i, part in enumerate(parts, start=1)
    ]
    for i, run in enumerate(alone, start=1):
        assert np.array_equal(sol[f"coil{i}.b"], run[f"coil{i}.b"])
        wire = Path.of(f"wire{i}")
        assert np.array_equal(sol.ledgers.makers[wire], run.ledgers.makers[wire])
    for key in ("steps", "rejected", "unknowns"):
        assert sol.stats[key] == sum(run.stats[key] for run in alone)
    for read in (lambda run: run["room.s"] - 0.5, lambda run: run.heat, lambda run: run.work):
        assert np.allclose(read(sol), sum(map(read, alone)), rtol=4 * EPS, atol=4 * EPS)


def rings(*names):
    """Ten coils in one room, which ring down at rates from 1 to 2⁹ 1/s; of these names they have outer ports."""
    junctions = "; ".join(
        f"b{i}: flux_linkage{', exposed' * (f'b{i}' in names)}; coil{i}(b=b{i}); wire{i}(b=b{i}, s)" for i in range(10)
    )
    parts = {f"coil{i}": lib.inductor(l=1.0) for i in range(10)}
    parts |= {f"wire{i}": lib.resistor(r=2.0**i) for i in range(10)} | {"room": lib.environment()}
    return Pattern.from_text(f"s: entropy; room(s); {junctions}")(**parts)


RINGING = {"initial": {f"coil{i}.b": 1.0 for i in range(10)}, "method": "radau", "rtol": 1e-6, "atol": 1e-8}
RATES = 2.0 ** np.arange(10)


def test_each_part_takes_the_steps_that_it_needs():
    """As one, each coil follows the fastest."""
    found, one = ephs.simulate(rings(), TIMES[-1], **(TIGHT | RINGING)), whole(rings(), **RINGING)
    exact = np.exp(-np.outer(TIMES, RATES))
    for sol in (found, one):
        assert max(largest(sol[f"coil{i}.b"] - exact[:, i]) for i in range(10)) < 1e-5
    assert found.stats["independent_parts"] == 10 and found.stats["steps"] < 5 * one.stats["steps"]


def stops_at(t):
    """A voltage that has no value from a time on."""
    return lambda now: 0.0 if now < t else float("nan")


def test_where_a_part_fails_the_partial_solution_is_of_all():
    inputs = {f"b{i}": {"flow": stops_at(t)} for i, t in ((2, 0.17), (6, 0.12))}
    with pytest.raises(ephs.SimulationError, match="b6") as caught:
        ephs.simulate(rings("b2", "b6"), TIMES[-1], inputs=inputs, **(TIGHT | RINGING))
    partial, full = caught.value.partial, ephs.simulate(rings(), TIMES[-1], **(TIGHT | RINGING))
    assert 0.1 < caught.value.time <= 0.12 and np.array_equal(partial.t, TIMES[TIMES <= 0.12])
    assert all(np.allclose(partial[path], full[path][: len(partial)], atol=1e-5) for path in full.states)
    assert partial.stats["independent_parts"] == 10


def test_the_failure_that_is_told_is_the_first_in_time():
    """The slow ball needs more than so many steps until the end; the fast one, which is asked later, until before."""
    slow, fast = ([0.0, 0.0, spin] for spin in (300.0, 1000.0))
    scene = scene_of_text(TOPS.format(slow=slow, fast=fast))
    options = {"method": "rk54", "rtol": 1e-9, "atol": 1e-12, "max_steps": 40, "save_at": [1.0]}
    with pytest.raises(ephs.SimulationError) as caught:
        ephs.simulate(scene, 1.0, **options)
    with pytest.raises(ephs.SimulationError) as alone:
        ephs.simulate(scene_of_text(TOPS.format(slow=slow, fast=slow)), 1.0, **options)
    assert caught.value.time < 0.5 * alone.value.time


def test_progress_is_that_of_the_part_that_is_behind(monkeypatch):
    monkeypatch.setattr("ephs.solve.running.abreast.RESPONSE", -1.0)  # every step is told
    told = []

    def tell(t, until, stats):
        told.append((t, until, stats["steps"]))

    sol = ephs.simulate(rings(), TIMES[-1], progress=tell, **(TIGHT | RINGING))
    times, ends, steps = zip(*told, strict=True)
    assert list(times) == sorted(times) and times[-1] == TIMES[-1] and set(ends) == {TIMES[-1]}
    assert list(steps) == sorted(steps) and steps[-1] == sol.stats["steps"]


def test_an_interrupted_run_of_parts_keeps_what_all_have(monkeypatch):
    monkeypatch.setattr("ephs.solve.running.abreast.RESPONSE", -1.0)

    def stop(t, until, stats):
        if t > 0.07:
            raise KeyboardInterrupt

    full = ephs.simulate(rings(), TIMES[-1], **(TIGHT | RINGING))
    with pytest.raises(ephs.Interrupted) as caught:
        ephs.simulate(rings(), TIMES[-1], progress=stop, **(TIGHT | RINGING))
    partial = caught.value.partial
    assert np.array_equal(partial.t, TIMES[:2])
    assert all(np.array_equal(partial[path], full[path][:2]) for path in full.states)


@pytest.mark.parametrize(
    "options",
    [
        {"save_at": None},
        {"events": [lambda t, state: t - 0.1]},
        {"method": "natural", "step": 1e-3},
        {"rtol": 1e-3},
        {"journal": "run.ephs"},
        {"inputs": {"b2": {"flow": lambda t, state: state["coil7.b"]}}},
        {"inputs": {"b2": {"flow": ephs.Sampled(0.01, lambda t, state: state["coil7.b"])}}},
    ],
    ids=lambda options: min(options),
)
def test_what_asks_for_the_whole_runs_as_one(options, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    inputs = {"b2": {"flow": 0.0}}
    sol = ephs.simulate(rings("b2"), 0.05, **({"save_at": [0.05], "inputs": inputs} | RINGING | options))
    assert "independent_parts" not in sol.stats


HARD = re.sub(r"stiffness = .*\nloss = .*\n(.*)\nslip = .*", r"restitution = 0.5\n\1", bouncing(2).scene)


@pytest.mark.parametrize("scene", [toml(drawn(17)), HARD], ids=["heat apart from bodies", "impacts"])
def test_what_has_no_body_is_no_part_and_what_strikes_runs_as_one(scene):
    model = scene_of_text(scene)
    assert len(factors_of(model.system().descriptor(), frozenset())) > 1
    assert "independent_parts" not in ephs.simulate(model, 0.01, save_at=[0.01], method="rk54", audit="off").stats


def test_bodies_on_a_floor_are_parts_until_a_spring_joins_them():
    balls, ends = bouncing(2).scene, "at1 = [0.0, 0.0, 0.2]\nat2 = [0.3, 0.0, 0.2]\nstiffness = 1.0\n"
    tied = f'{balls}\n[springs.tie]\nbodies = ["ball0", "ball1"]\n{ends}'
    found = ephs.simulate(scene_of_text(balls), TIMES[-1], **TIGHT)
    assert found.stats["independent_parts"] == 2 and apart(found, whole(scene_of_text(balls))) < SAME
    assert "independent_parts" not in ephs.simulate(scene_of_text(tied), TIMES[-1], save_at=TIMES).stats
