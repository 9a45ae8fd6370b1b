"""Members of an ensemble that may violate a law of their audit: they are run again individually, with the whole audit.

What is looked at is cheap beside a member's run, and stricter than the audit: the balance of energy at a few of its
instants, the entropy made in its steps, and at constant steps the distance from a run with longer ones.
"""

import numpy as np

from ephs.mechanics.sweep.images import Truths
from ephs.semantics.bundles.bundle import Array
from ephs.solve.auditing.audit import MOTION, Bounds
from ephs.solve.auditing.growth import apart
from ephs.solve.posing.problem import Problem

LONGER = 4
"""Length of comparison steps in constant steps."""
INSTANTS = 5
"""Number of instants at which a member's energies are checked, besides the first and the last."""
ROUNDING = 1e-12
"""Rounding of an energy balance, relative to the energies."""


def suspicious(bounds: Bounds, held: Array, totals: Array, put: Array, least: Array) -> Truths:
    """(members,) whether a member has to be run on its own, with the audit's bounds.

    Parameters
    ----------
    held
        (members, instants, components) mechanical energies in J, the first ones at the start.
    totals
        (members, instants, 2) heat and work in J since then.
    put
        (members, …) energies in J that corrections put in.
    least
        (members,) the least entropy in J/K that a component made in a step.
    """
    changes, (heat, work) = held - held[:, :1], np.moveaxis(totals, 2, 0)
    gross = np.max(np.abs(changes).sum(axis=2) + np.abs(heat) + np.abs(work), axis=1)
    defect = np.max(np.abs(changes.sum(axis=2) + heat - work), axis=1)
    balanced = defect <= bounds.energy * gross + ROUNDING * np.abs(held).sum(axis=2).max(axis=1)
    return ~(balanced & (np.abs(put).max(axis=1) <= bounds.accuracy * gross)) | (least < 0.0)


def resolved(problem: Problem, x: Array, other: Array) -> Truths:
    """(members,) whether states (members, …) are near those of runs with steps that are `LONGER` times as long."""
    poses = [slot.point for slot in problem.descriptor.states if slot.quantity.kind == "pose"]
    return np.all([apart(x[:, at], other[:, at], problem.length) <= MOTION for at in poses], axis=0)
