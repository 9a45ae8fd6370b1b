"""Stability: what becomes of every method where scenes get difficult."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.methods import METHODS, Method
from ephs.mechanics.scene.model import Scene
from ephs.show.charts.families import Family
from ephs.show.charts.outcomes import ACCURATE, SILENT, Outcome, horizon, judge
from ephs.show.charts.reference import Motion, Reference, resting_reference, tight_reference
from ephs.show.charts.runs import Array, Ending, Run, Setting, attempt
from ephs.show.charts.specimens import SPECIMENS
from ephs.show.errors import ShowError

__all__ = ["Cell", "stability"]

INSTANTS = 41
MOST_STEPS = 100_000
LIMIT = 1.5
"""Wall time in s of a cell."""
TOLERANCES = {False: (1e-3, 1e-6), True: (1e-6,)}
"""For methods without, and with constant steps too."""


@final
@dataclass(frozen=True, slots=True)
class Cell:
    """One method at one setting on one scene of a family.

    Parameters
    ----------
    value
        Of the family's parameter.
    setting
        Step or tolerance.
    error
        At the end, relative to the size of mechanism and motion; NaN where there is no result.
    horizon
        The last time in s up to which the error was small; NaN where there is no result.
    message
        The error, or the findings of the audit where the result is not accurate.
    reference, cross_check
        What it was compared with, and how well that is known.
    """

    family: str
    value: float
    method: str
    setting: Setting
    outcome: Outcome
    error: float
    horizon: float
    seconds: float
    message: str
    reference: str
    cross_check: float


def stability(
    family: Family,
    methods: Sequence[str] | None = None,
    *,
    quick: bool = False,
    limit: float = LIMIT,
    note: Callable[[str], None] | None = None,
) -> list[Cell]:
    """Run every method for scenes over the family's values and its settings.

    Parameters
    ----------
    methods
        Names of `METHODS` and `SPECIMENS`; all for scenes unless given.
    quick
        Only the easiest and the most difficult value, and the largest step.
    limit
        Wall time in s of a cell.
    note
        Called with each value's label before it is run.
    """
    everything = {**METHODS, **SPECIMENS}
    chosen = [m for m in everything.values() if m.scenes and (methods is None or m.name in methods)]
    values = (family.values[0], family.values[-1]) if quick else family.values
    cells: list[Cell] = []
    for value in values:
        if note is not None:
            note(f"{family.name} {family.label(value)}")
        scene, times = family.make(value), np.linspace(0.0, family.end(value), INSTANTS)
        truth, why = _truth(family, value, times, limit)
        steps = family.steps_at(value)[:1] if quick else family.steps_at(value)
        for method in chosen:
            for setting, run in _runs(scene, method, steps, times, limit):
                found = None if run.solution is None else Motion.of(run.solution)
                outcome, error, held = _outcome(found, truth)
                said = run.message or why
                if outcome in SILENT | {Outcome.UNKNOWN} and run.solution is not None and not run.solution.audit.passed:
                    outcome, said = Outcome.FLAGGED, str(run.solution.audit)
                cells.append(
                    Cell(
                        family.name,
                        value,
                        method.name,
                        setting,
                        outcome,
                        error,
                        held,
                        run.wall,
                        said,
                        "none" if truth is None else truth.source,
                        np.nan if truth is None else truth.cross_check,
                    )
                )
    return cells


def _runs(
    scene: Scene, method: Method, steps: Sequence[float], times: Array, limit: float
) -> Iterator[tuple[Setting, Run]]:
    """A method's runs over its settings, coarse ones first; where one took too long, finer ones are not run."""
    settings = [Setting("step", step) for step in steps] if method.fixed else []
    if method.adaptive:
        settings += [Setting("tolerance", each) for each in TOLERANCES[method.fixed]]
    slow: dict[str, Setting] = {}
    for setting in settings:
        if setting.kind in slow:
            yield setting, Run(None, Ending.SLOW, f"{Ending.SLOW}: already at {slow[setting.kind]}", 0.0)
            continue
        run = attempt(scene, float(times[-1]), method, setting, limit=limit, save_at=times, max_steps=MOST_STEPS)
        if run.ending is Ending.SLOW:
            slow[setting.kind] = setting
        yield setting, run


def _truth(family: Family, value: float, times: Array, limit: float) -> tuple[Reference | None, str]:
    scene = family.make(value) if family.meant is None else family.meant(value)
    if family.rests:
        return resting_reference(scene, times), ""
    try:
        found = tight_reference(scene, float(times[-1]), save_at=times, limit=4.0 * limit)
        off, most = found.cross_check / found.motion.length, ACCURATE / 2.0
        if not off <= most:
            raise ShowError("doubt", path=scene.name, found=f"{off:.1e}", expected=f"{most:.0e}")
    except ShowError as error:
        return None, str(error)
    return found, ""


def _outcome(found: Motion | None, truth: Reference | None) -> tuple[Outcome, float, float]:
    """Outcome, error and horizon; without a reference what can be told from the motion alone."""
    if found is None:
        return Outcome.REFUSED, np.nan, np.nan
    if truth is None:
        alone, _ = judge(found, found)
        return (alone if alone is Outcome.DIVERGED else Outcome.UNKNOWN), np.nan, np.nan
    outcome, error = judge(found, truth.motion)
    return outcome, error, horizon(found, truth.motion)
