"""A solution made of given states, not of a run."""

from collections.abc import Sequence

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.problem import Problem
from ephs.solve.result.record import UNSOLVED, RowBlocks, record_of
from ephs.solve.result.solution import Solution
from ephs.solve.running.ending import solution_of
from ephs.solve.running.stepping import Row


def replay(problem: Problem, t: Array, rows: Sequence[Row], remark: str) -> Solution:
    """The solution of what is kept at the times t; ``remark`` stands for the method. What steps made is not known."""
    found = record_of([(float(when), None, np.nan) for when in t], rows)
    record = found if rows else RowBlocks().whole(problem.descriptor)
    return solution_of(problem, record, {**UNSOLVED, "method": remark, "steps": max(0, len(rows) - 1)})
