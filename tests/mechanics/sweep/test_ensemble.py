"""An ensemble equals its single runs bit for bit: members share what is bound, and nothing that is computed."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.scene.parameters import read, varied
from ephs.mechanics.sweep.axes import Axes
from ephs.mechanics.sweep.ensemble import Ensemble, _Runs
from ephs.mechanics.sweep.images import STARTS, Images
from ephs.mechanics.sweep.outputs import outputs_of
from ephs.mechanics.tree.finding.tables import TREE
from ephs.show.charts.family_scenes import parallelogram
from ephs.solve.march.records import Ending
from tests.scenes import ROOT, equations_of

CHAIN, GRAVITY = ROOT / "benchmarks/scenes/revolute-chain-4.toml", "world.gravity[2]"
SCENES = {
    "tree": (CHAIN, ("bodies.rod1.mass", "joints.j0.rate", "joints.j1.coordinate", "joints.j2.friction", GRAVITY)),
    "ball": (ROOT / "scenes/heavy-top.toml", ("bodies.top.mass", GRAVITY)),
    "loop": (ROOT / "scenes/four-bar.toml", ("bodies.coupler.mass", GRAVITY)),
    "slider": (ROOT / "scenes/slider-crank.toml", ("bodies.rod.mass", "joints.bearing.friction")),
    "windows": (ROOT / "benchmarks/scenes/four-bar-windows-1.toml", (GRAVITY,)),
    "repeated rows": (ROOT / "scenes/bricard.toml", (GRAVITY,)),
    "heat": (ROOT / "scenes/hot-brake.toml", ("bodies.flywheel.mass", "thermal.disc.capacity")),
    "rank that changes": (parallelogram(0.0), (GRAVITY, "bodies.coupler.mass")),
}
OPTIONS = ({}, {"rtol": 1e-3, "atol": 1e-3}, {"method": "rk87", "rtol": 1e-8}, {"method": "rk54", "step": 0.01})
TIMES = np.array([0.0, 0.02, 0.05, 0.3])


def made(scene, vary, options, *, paired=True):
    """An ensemble with the outputs that compiled members have: of the tree's joints."""
    reduced = equations_of(scene).reduced
    names = [e.name for e, kind in zip(reduced.edges, reduced.tables.kind, strict=True) if kind == TREE]
    outputs = outputs_of(scene, [*(f"joints.{name}.coordinate" for name in names), "heat", "work"])
    axes = Axes.of(vary, paired=paired)
    return Ensemble(scene, axes, 0.0, float(TIMES[-1]), TIMES, options, outputs), axes.members, outputs


def assert_single(scene, ensemble, vary, outputs, options):
    """All members that were run are the runs of `simulate`."""
    ran = ensemble.run(np.column_stack(list(vary.values())))
    for k in np.flatnonzero(ran.done):
        model = varied(scene, {path: float(values[k]) for path, values in vary.items()})
        solution = ephs.simulate(model, TIMES[-1], save_at=TIMES, audit="off", **options)
        assert solution.audit.passed, "compiled members are held to stricter bounds"
        assert (ran.steps[k], ran.rejected[k]) == (solution.stats["steps"], solution.stats["rejected"])
        for output, found in zip(outputs, ran.values, strict=True):
            assert np.array_equal(found[k], output.read(solution).reshape(found[k].shape)), output.name
    return ran.done


@settings(max_examples=16)
@given(data=st.data(), kind=st.sampled_from(sorted(SCENES)), options=st.sampled_from(OPTIONS))
def test_an_ensemble_equals_its_single_runs_bit_for_bit(data, kind, options):
    """Where a path has few values, numbers of a member are those of its scene: its run is the run of `simulate`."""
    model, paths = SCENES[kind]
    scene = ephs.load(model) if isinstance(model, Path) else model
    path = data.draw(st.sampled_from(paths))
    factors = data.draw(st.lists(st.floats(0.3, 1.9), min_size=3, max_size=4, unique=True))
    values = [(read(scene, path) or 0.7) * factor for factor in factors]
    vary = {path: values}
    ensemble, _, outputs = made(scene, vary, options)
    done = assert_single(scene, ensemble, vary, outputs, options)
    assert done.any() or "step" in options  # constant steps may not resolve a fast motion


@settings(max_examples=8)
@given(data=st.data(), kind=st.sampled_from(sorted(SCENES)), options=st.sampled_from(OPTIONS))
def test_a_member_does_not_depend_on_those_before_it(data, kind, options):
    """In another order, in parts, among many values of two paths, which are interpolated."""
    model, paths = SCENES[kind]
    scene = ephs.load(model) if isinstance(model, Path) else model
    chosen = data.draw(st.permutations(paths))[:2]
    vary = {path: (read(scene, path) or 0.7) * np.linspace(0.5, 1.3, 15) for path in chosen}
    ensemble, members, _ = made(scene, vary, options)
    order = np.array(data.draw(st.permutations(range(len(members)))))
    ensemble.together = data.draw(st.integers(1, len(members)))
    ran, other = ensemble.run(members), _Runs(ensemble)
    again = [other.run(members[k][None]) for k in order]
    for at, k in enumerate(order):
        one = again[at]
        assert (one.done[0], one.steps[0], one.rejected[0]) == (ran.done[k], ran.steps[k], ran.rejected[k])
        if ran.done[k]:
            assert all(np.array_equal(a[0], b[k]) for a, b in zip(one.values, ran.values, strict=True))


def test_members_at_a_change_of_rank_take_careful_steps_together(monkeypatch):
    """The law above holds of them, too, and they stay in the ensemble."""
    careful, run = [], _Runs._carefully

    def noted(self, *arguments):
        careful.append(run(self, *arguments))
        return careful[-1]

    monkeypatch.setattr(_Runs, "_carefully", noted)
    ensemble, members, _ = made(parallelogram(0.0), {GRAVITY: [-9.81, -3.0, 2.0]}, {})
    assert ensemble.run(members).done.all()
    assert careful == [Ending.DONE] * 3


@pytest.mark.parametrize("path", ["joints.j1.coordinate", "bodies.rod1.mass"])
def test_tables_that_no_path_changes_are_shared(path):
    """Members from other starts have the same tables; other masses are few numbers of them."""
    ensemble, _, _ = made(ephs.load(CHAIN), {path: np.linspace(0.5, 1.5, 20)}, {})
    arrays = ensemble.images.made.arrays()
    changed = {number for number, *_ in ensemble.images.parts()}
    assert (min(changed) >= len(arrays) - STARTS) == path.startswith("joints.")
    assert ensemble.images.columns.size < 0.01 * ensemble.images.base.size


def test_members_that_are_not_put_together_are_built_in_full(monkeypatch):
    """Where images of some members fail the check, members are built from their scenes."""
    holds = Images._holds
    monkeypatch.setattr(Images, "_holds", lambda self: holds(self) and False)
    scene, vary = ephs.load(CHAIN), {"joints.j0.coordinate": [0.3, 0.7], "bodies.rod2.mass": [0.4, 0.9]}
    ensemble, _, outputs = made(scene, vary, {})
    assert assert_single(scene, ensemble, vary, outputs, {}).all()


def test_rounding_along_a_path_leaves_the_numbers_of_another_one():
    """The rates of a chain are found from momenta: a rate changes another one by rounding, which does not undo it."""
    vary = {"joints.j2.rate": [0.3, 0.7, 1.2], "joints.j0.rate": [0.4, 0.6, -0.9]}
    ensemble, *_ = made(ephs.load(CHAIN), vary, {}, paired=False)
    assert ensemble.images.columns.size < 0.01 * ensemble.images.base.size
