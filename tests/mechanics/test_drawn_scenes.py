"""A scene, written, made, run or read another way, is the same motion: drawn ones, and written ones of what is rare."""

import tomllib
from functools import cache

import numpy as np
import pytest

import ephs
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from ephs.mechanics.scene.parameters import names, read, varied
from ephs.mechanics.scene.rescaled import rescaled
from ephs.mechanics.scene.soundness import check_scene
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from tests.mechanics.drawn_scenes import FREEDOMS, SECTIONS, drawn, toml
from tests.mechanics.own_elements import registered
from tests.mechanics.touching_scenes import SHAPES, drawn_hard, drawn_sheet, drawn_touching
from tests.mechanics.written_scenes import WRITTEN
from tests.numerics import largest
from tests.written import scene_of_text


def written(name):
    """Tables of a written scene."""
    return tomllib.loads(WRITTEN[name])


DRAWN = {"jointed": drawn, "touching": drawn_touching, "sheet": drawn_sheet, "hard": drawn_hard, "written": written}
UNTIL = {"jointed": 0.2, "touching": 0.03, "sheet": 0.03, "hard": 0.03, "written": 0.03}
TIGHT = {"method": "rk87", "rtol": 1e-9, "atol": 1e-11}
SAME = 1e-7
"""Differences of runs whose steps differ, over 1 + what is compared: a hundred times what is asked of each step."""
ALIKE = 1e-3
"""The same where two long bodies of one kind change roles: a rounding of their gaps is that of the first, see `gap`."""
NEAR = 8.0, 0.25, 2.0
"""Other units of length, mass and time."""
FAR = 2.0**12, 2.0**-11, 2.0**10
"""So far from metres, kilograms and seconds that runs are in units of their own."""
SEEDS = {
    "jointed": range(24),
    "touching": range(16),
    "sheet": range(6),
    "hard": (0, 1, 2, 4, 5),
    "written": tuple(WRITTEN),
}  # hard 3, of boxes on boxes, is slow
SHORT = {"jointed": 4, "touching": 3, "sheet": 1, "hard": 1, "written": 2}


@pytest.fixture(autouse=True)
def elements():
    """Of users, in one of the written scenes."""
    with registered():
        yield


def drawings(*kinds):
    found = [((kind, seed), i >= SHORT[kind]) for kind in kinds for i, seed in enumerate(SEEDS[kind])]
    marked = [pytest.param(each, marks=pytest.mark.long if long else ()) for each, long in found]
    return pytest.mark.parametrize("drawing", marked, ids=lambda each: f"{each[0]}-{each[1]}")


def tables_of(drawing):
    return DRAWN[drawing[0]](drawing[1])


@cache
def scene(drawing):
    return scene_of_text(toml(tables_of(drawing)))


def ran(drawing, model, part=1.0, unit=1.0, **options):
    """By chosen steps; impulses in constant ones, of order two."""
    until = unit * UNTIL[drawing[0]]
    steps = {"method": "rk54", "step": until / 32.0} if drawing[0] == "hard" else TIGHT
    return ephs.simulate(model, part * until, **(steps | options))


@cache
def run(drawing):
    return ran(drawing, scene(drawing))


def ends(solution, prefix="", at=-1):
    """Coordinates, energy of sheets, temperatures, heat and work at the end; names without what is before them."""
    joints = {name: np.array(solution.joint(name).coordinate[at]) for name in solution.freedoms if ".point" not in name}
    found = {name.removeprefix(prefix): value for name, value in joints.items()}
    if (model := solution.scene) is not None:
        found |= {name.removeprefix(prefix): solution.shell(name).energy[at] for name, _ in model.all_shells()}
        warm = ((name, solution.thermal(name).temperature[at]) for name, _ in model.all_thermal())
        found |= {f"{name.removeprefix(prefix)} in K": kelvin for name, kelvin in warm}
    return found | {"heat": solution.ledgers.heat[at], "work": solution.work[at]}


def places(solution, length=1.0):
    """Of bodies and sheets at the end, in units of a length."""
    found = {name: solution.body(name).position[-1] / length for name, _ in solution.scene.all_bodies()}
    return found | {name: solution.shell(name).position[-1] / length for name, _ in solution.scene.all_shells()}


def assert_same(found, expected, tolerance=SAME):
    for name, value in expected.items():
        np.testing.assert_allclose(
            found[name], value, rtol=0.0, atol=tolerance * (1.0 + largest(value, initial=0.0)), err_msg=name
        )


def test_all_kinds_are_drawn_in_these_scenes():
    tables = [drawn(seed) for seed in SEEDS["jointed"]]
    assert {name for each in tables for name in each} >= set(SECTIONS)
    assert {joint["type"] for each in tables for joint in each["joints"].values()} == set(FREEDOMS)
    assert sum(len(each) > 6 for each in tables) > len(tables) // 4  # several at once


def test_all_shapes_touch_in_these_scenes():
    """Surfaces of all kinds overlap in a run, and most bodies more than the ground."""
    met = []
    for seed in SEEDS["touching"]:
        drawing = "touching", seed
        surfaces, at = tables_of(drawing)["surfaces"], run(drawing)
        pairs = [each.surfaces for name, each in scene(drawing).all_contacts() if at.contact(name).gap.min() < 0.0]
        met += [{next(iter(surfaces[name]["shape"])) for name in pair} for pair in pairs]
    assert set().union(*met) == {"plane", *SHAPES}
    assert sum(not {"plane"} & pair for pair in met) > len(met) // 4


def test_a_percent_of_a_mass_is_seen():
    """The control: it is another motion."""
    for drawing in (("jointed", 0), ("touching", 0)):
        tables = tables_of(drawing)
        tables["bodies"]["b0"]["mass"] *= 1.01
        with pytest.raises(AssertionError):
            assert_same(ends(ran(drawing, scene_of_text(toml(tables)))), ends(run(drawing)))


@drawings("jointed", "touching", "sheet", "written")
def test_by_another_method(drawing):
    assert_same(ends(ran(drawing, scene(drawing), method="radau", rtol=1e-8)), ends(run(drawing)), 10.0 * SAME)


@drawings("touching", "sheet", "hard")
def test_with_bodies_of_contacts_named_the_other_way_round(drawing):
    tables = tables_of(drawing)
    pairs = {name: each.surfaces[::-1] for name, each in scene(drawing).all_contacts()}
    tables["contacts"] = {name: {"surfaces": pair} for name, pair in pairs.items()}
    kinds = [[next(iter(tables["surfaces"][name]["shape"])) for name in pair] for pair in pairs.values()]
    alike = any(pair in (["capsule"] * 2, ["cylinder"] * 2) for pair in kinds)
    found = ends(ran(drawing, scene_of_text(toml(tables))))
    assert_same(found, ends(run(drawing)), ALIKE if alike else SAME)


@drawings("jointed", "touching", "sheet", "hard", "written")
def test_in_other_units(drawing):
    """Near metres, kilograms and seconds, and so far from them that the run is in units of its own."""
    for length, mass, time in [NEAR, *[FAR] * (drawing[0] != "hard")]:
        found = ran(drawing, rescaled(scene(drawing), length, mass, time), unit=time)
        assert_same(places(found, length), places(run(drawing)))
        energy = mass * length**2 / time**2
        for ledger in ("heat", "work"):
            here, there = (getattr(sol.ledgers, ledger)[-1] for sol in (found, run(drawing)))
            assert here / energy == pytest.approx(there, abs=SAME)


@drawings("jointed", "touching", "sheet", "hard", "written")
def test_with_tables_in_another_order(drawing):
    single = ("world", "assembly")
    tables = {
        name: each if name in single else dict(reversed(each.items())) for name, each in tables_of(drawing).items()
    }
    assert_same(ends(ran(drawing, scene_of_text(toml(tables)))), ends(run(drawing)))


@drawings("jointed", "touching", "sheet", "hard", "written")
def test_as_a_part_that_is_turned_and_shifted(drawing, tmp_path):
    tables, turn = tables_of(drawing), np.array([0.3, 0.5, -0.4, 0.6]) / np.sqrt(0.86)
    world = tables.pop("world")
    gravity = (quaternion_to_matrix(turn) @ world["gravity"]).tolist()
    part = {"use": "part.toml", "position": [1.0, -2.0, 0.5], "rotation": turn.tolist()}
    (tmp_path / "part.toml").write_text(toml(tables))
    whole = {"world": world | {"gravity": gravity}, "parts": {"it": part}}
    whole |= {"assembly": tables["assembly"]} if "assembly" in tables else {}
    (tmp_path / "whole.toml").write_text(toml(whole))
    found = ran(drawing, ephs.load(tmp_path / "whole.toml"))
    assert_same(ends(found, "it."), ends(run(drawing)))


@drawings("jointed", "touching", "sheet", "hard", "written")
def test_as_a_system_made_by_hand(drawing):
    """With all that acts from outside at its ports."""
    signals = problem_of_scene(scene(drawing)).signals
    inputs = {str(port): {"effort" if of.effort else "flow": of.at if not of.constant else of.value}
              for port, of in signals.items()}  # fmt: skip
    system, expected = scene(drawing).system(), ends(run(drawing))
    assert set(inputs) == set(map(str, system.interface))
    reference = ephs.Reference(temperature=tables_of(drawing)["world"]["temperature"])
    found = ends(ran(drawing, system, inputs=inputs, reference=reference), "joints.")
    joints = scene(drawing).all_joints()
    halves = {name for name, joint in joints if joint.kind == "universal"}  # two joints of the system
    named = halves | {name for name, _ in scene(drawing).all_shells()}
    of_joints = {name: value for name, value in expected.items() if name not in named and not name.endswith(" in K")}
    assert_same(found, of_joints)


@drawings("jointed", "touching", "sheet", "hard", "written")
def test_from_its_document(drawing):
    """To the letter, also from halfway."""
    for model in (scene(drawing), scene(drawing).at(run(drawing), run(drawing).t[-1])):
        text = scene_to_text(model)
        again = scene_from_text(text)
        check_scene(again)
        assert scene_to_text(again) == text
        assert again.system() == model.system()


@drawings("jointed", "touching", "sheet", "hard", "written")
def test_it_keeps_both_laws(drawing):
    sol = run(drawing)
    assert sol.energy_error.max() <= 1e-11
    assert sol.stats["least_production"] >= 0.0 and np.diff(sol.ledgers.heat).min() >= 0.0


@drawings("jointed", "touching", "sheet", "hard", "written")
def test_in_two_runs(drawing):
    """The second one in other units."""
    middle, (length, mass, time) = 0.5 * UNTIL[drawing[0]], NEAR
    half = ran(drawing, scene(drawing), part=0.5)
    later = rescaled(scene(drawing).at(half, middle), length, mass, time)
    then = ran(drawing, later, unit=time, t0=middle * time)
    assert_same(places(then, length), places(run(drawing)))
    for name, _ in scene(drawing).all_thermal():
        expected = run(drawing).thermal(name).temperature[-1]
        assert then.thermal(name).temperature[-1] == pytest.approx(expected, rel=SAME)


@drawings("jointed", "touching", "sheet", "hard", "written")
def test_from_its_file(drawing, tmp_path):
    run(drawing).save(tmp_path / "run.nc")
    again = ephs.load_solution(tmp_path / "run.nc")

    def readings(solution):
        joints = [solution.joint(name) for name in solution.freedoms]
        contacts = [solution.contact(name).force for name, _ in scene(drawing).all_contacts()]
        of_joints = [array for each in joints for array in (each.coordinate, each.rate, each.wrench)]
        return [*of_joints, *contacts, *places(solution).values()]

    for one, other in zip(readings(again), readings(run(drawing)), strict=True):
        assert largest(one - other, initial=0.0) <= 1e-12 * (1.0 + largest(other, initial=0.0))


@drawings("jointed", "touching", "hard")
def test_of_its_dynamics(drawing):
    model, h = ephs.dynamics(scene(drawing)), 1e-7  # rods swing by 1e4 rad/s; rounding of rates over h is 1e-8
    start = ephs.simulate(scene(drawing), 2.0 * h, method="rk87", step=h)
    for name, a in model.acceleration(model.state0).items():
        if a.size:
            rate = start.joint(name).rate
            differenced = (-3.0 * rate[0] + 4.0 * rate[1] - rate[2]) / (2.0 * h)
            assert largest(a - differenced) <= 1e-4 * (1.0 + largest(a)), name


@drawings("jointed", "touching", "written")
def test_of_its_derivatives(drawing):
    """By four of its numbers, as differences of runs; inputs that read states have none."""
    tables = tables_of(drawing)
    tables.pop("loads", None)
    for sheet in tables.get("shells", {}).values():
        sheet.pop("pressure", None)
    model = scene_of_text(toml(tables))
    known = [path for path in names(model) if "velocity" not in path and abs(read(model, path)) > 1e-3]
    for path in np.random.default_rng(SEEDS[drawing[0]].index(drawing[1])).permutation(known).tolist()[:4]:
        value, h = read(model, path), 1e-4 * abs(read(model, path))
        try:
            found = ephs.sensitivity(model, [path], UNTIL[drawing[0]], **TIGHT)
        except ephs.OptionError as error:
            assert path in str(error)  # it is refused, not wrong
            continue
        ways = [ran(drawing, varied(model, {path: value + by}, strict=False)) for by in (h, -h)]
        for name in model.bodies:
            one, other = (way.body(name).position[-1] for way in ways)
            mine = found[f"bodies.{name}.position"][-1, :, 0]
            assert largest((one - other) / (2.0 * h) - mine) * abs(value) <= 1e-4, (path, name)  # 10 rtol over h
