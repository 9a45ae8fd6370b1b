"""The folded form of an initial value problem: fewer unknowns, the same steps, and all results of the original."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ephs.mechanics.rewrite.folding import FOLD
from ephs.mechanics.rewrite.rewrite import rewrite
from ephs.solve.posing.problem import Problem
from ephs.solve.result.record import RunRecord


def folded_problem(problem: Problem) -> Problem:
    """The problem with its transformers folded; solutions refer to the original problem.

    All states are kept, so that inputs and events read what they did.
    """
    done = rewrite(problem.system, [FOLD])
    descriptor = done.system.descriptor()
    paper = problem.descriptor
    number = {slot.path: i for i, slot in enumerate(paper.components)}
    columns = [number[slot.path] for slot in descriptor.components]
    places = {slot.path: slot.point for slot in paper.states}
    order = [i for slot in descriptor.states for i in range(places[slot.path].start, places[slot.path].stop)]

    def shown(record: RunRecord, stats: Mapping[str, Any]) -> tuple[Problem, RunRecord, Mapping[str, Any]]:
        x = np.zeros_like(record.x)
        x[:, order] = record.x
        energies = np.zeros((record.energies.shape[0], len(paper.components)))
        energies[:, columns] = record.energies
        return problem, replace(record, x=x, energies=energies), stats

    return replace(
        problem,
        system=done.system,
        descriptor=descriptor,
        initial=done.states.forward(problem.initial),
        shown=shown,
        remarks={"form": "folded", "paper_unknowns": paper.unknowns(problem.inputs(0.0, problem.initial))},
    )
