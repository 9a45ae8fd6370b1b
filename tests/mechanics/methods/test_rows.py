"""Rows of compiled steps stay arrays: they are the records of the states that are made of them, bit for bit."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.semantics.primitives.primitives import Storage
from ephs.solve.auditing import rounding
from ephs.solve.running.stepping import Taken
from tests.scenes import SCENES, of_all_scenes


@pytest.mark.parametrize("save_at", [None, np.linspace(0.0, 0.3, 8)])
@pytest.mark.parametrize("method", ["rk54", "radau", "semi"])
@pytest.mark.parametrize("name", ["heavy-top", "hot-brake", "motor-four-bar"])
def test_records_of_arrays_are_those_of_states(name, method, save_at, monkeypatch):
    record, rows = ReducedMethod.record, []

    def both(self, taken):
        noted = self.equations.accounts.noted
        before = noted.snapshot()
        found, after = record(self, taken), noted.snapshot()
        if isinstance(taken, Taken) and len(taken):
            rows.append(len(taken))
            noted.restore(before)
            states = record(self, list(taken))
            assert noted.snapshot() == after
            for field in ("t", "x", "energies", "ledgers"):
                assert getattr(found, field).tobytes() == getattr(states, field).tobytes(), field
        return found

    monkeypatch.setattr(ReducedMethod, "record", both)
    scene = ephs.load(next(file for file in SCENES if file.stem == name))
    solution = ephs.simulate(scene, 0.3, method=method, rtol=1e-6, save_at=save_at, audit="off")
    compiled = method != "radau" or name != "motor-four-bar"
    assert len(solution) > 4 and bool(rows) == compiled, "only loops and attached parts have no compiled implicit steps"


@of_all_scenes
def test_mass_and_forces_on_places_are_those_of_bodies_and_storages_one_by_one(file):
    problem = problem_of_scene(ephs.load(file))
    d = problem.descriptor
    x = d.pack(problem.initial)
    sizes = np.zeros(2)
    for slot in d.components:
        if isinstance(slot.primitive, Storage):
            effort = np.abs(slot.primitive.effort(d.point(slot, x), problem.reference))
            for _, where, quantity in slot.primitive.bundle.items():
                twists = rounding._twists(quantity)
                if twists is not None:
                    turns = np.any(twists[:3], axis=0)
                    sizes += effort[where][turns].sum(), effort[where][~turns].sum()
    mass = sum(body.mass for _, body in problem.scene.all_bodies())
    np.testing.assert_allclose(rounding._storage_sizes(problem, 0.0, x), [mass, *sizes], rtol=1e-12)
