"""Stability of the methods on scenes of growing difficulty."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.mechanics.methods.registry import METHODS, MethodEntry
from ephs.mechanics.scene.model import Scene
from ephs.show.charts.families import Family
from ephs.show.charts.outcomes import CONDITION, SILENT, ChartOutcome, horizon, judge, right
from ephs.show.charts.reference import PosesInTime, ReferenceMotion, condition, resting_reference, tight_reference
from ephs.show.charts.runs import Array, ChartRun, RunEnding, RunSetting, attempt
from ephs.show.shared.errors import ShowError

if TYPE_CHECKING:
    from ephs.show.charts.keeping import KeptCells

INSTANTS = 41
MOST_STEPS = 100_000
LIMIT = 1.5
"""Processor time in s of a cell."""
DOUBT = 5e-3
"""Part of the size of mechanism and motion to which a reference must be known."""
TOLERANCES = {False: (1e-4, 1e-6, 1e-8), True: (1e-6,)}
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
        Where the motion is judged, relative to the size of mechanism and motion; NaN where there is no result.
    horizon
        The last time in s up to which the error was small; NaN where there is no result.
    message
        The error, or the findings of the audit where the result is not accurate.
    reference, cross_check
        What it was compared with, and how well that is known.
    judged, condition
        Up to which time in s, and by how many times a relative change of data changes the motion to there.
    """

    family: str
    value: float
    method: str
    setting: RunSetting
    outcome: ChartOutcome
    error: float
    horizon: float
    seconds: float
    message: str
    reference: str
    cross_check: float
    judged: float
    condition: float


def settings_of(family: Family, value: float, method: MethodEntry, *, quick: bool = False) -> list[RunSetting]:
    """A method's settings for a value: constant steps, the coarse ones first, then tolerances."""
    steps = family.steps_at(value)[:1] if quick else family.steps_at(value)
    found = [RunSetting("step", step) for step in steps] if method.fixed else []
    return found + [RunSetting("tolerance", each) for each in (TOLERANCES[method.fixed] if method.adaptive else ())]


def stability(
    family: Family,
    methods: Sequence[str] | None = None,
    *,
    quick: bool = False,
    limit: float = LIMIT,
    note: Callable[[str], None] | None = None,
    kept: "KeptCells | None" = None,
) -> list[Cell]:
    """Run every method for scenes over the family's values and its settings.

    Parameters
    ----------
    methods
        Names of `METHODS`; all for scenes unless given.
    quick
        Only the easiest and the most difficult value, and the largest step.
    limit
        Processor time in s of a cell.
    note
        Called with a label before each cell is run.
    kept
        Cells that are known, to which new ones are added.
    """
    chosen = [m for m in METHODS.values() if m.scenes and (methods is None or m.name in methods)]
    values = (family.values[0], family.values[-1]) if quick else family.values
    cells: list[Cell] = []
    for value in values:
        trial: _ValueTrial | None = None
        for method in chosen:
            slow: dict[str, RunSetting] = {}
            for setting in settings_of(family, value, method, quick=quick):
                cell = None if kept is None else kept.get(family.name, value, method.name, setting)
                if cell is None:
                    if note is not None:
                        note(f"{family.name} {family.label(value)}: {method.name}, {setting}")
                    trial = trial or _ValueTrial.prepared(family, value, limit)
                    cell = trial.cell(method, setting, limit, slow.get(setting.kind))
                    if kept is not None:
                        kept.add(cell)
                if cell.outcome is ChartOutcome.SLOW:
                    slow.setdefault(setting.kind, setting)
                cells.append(cell)
    return cells


@final
@dataclass(frozen=True, slots=True, eq=False)
class _ValueTrial:
    """A value's scene with its reference motion up to the horizon of judgement."""

    family: Family
    value: float
    scene: Scene
    times: Array
    truth: ReferenceMotion | None
    condition: float
    why: str

    @classmethod
    def prepared(cls, family: Family, value: float, limit: float) -> "_ValueTrial":
        """Reference for a value of a family's parameter."""
        times = np.linspace(0.0, family.end(value), INSTANTS)
        truth, why = _truth(family, value, times, limit)
        if truth is None:
            return cls(family, value, family.make(value), times, None, np.nan, why)
        scene = family.make(value) if family.meant is None else family.meant(value)
        conditions = condition(scene, truth, 4.0 * limit)
        count = max(2, int(np.sum(conditions <= CONDITION)))
        truth = replace(truth, motion=truth.motion.until(count))
        return cls(family, value, family.make(value), times, truth, float(conditions[count - 1]), why)

    def cell(self, method: MethodEntry, setting: RunSetting, limit: float, slow: RunSetting | None) -> Cell:
        """One run, omitted if a coarser one took too long."""
        if slow is None:
            until = float(self.times[-1])
            run = attempt(self.scene, until, method, setting, limit=limit, save_at=self.times, max_steps=MOST_STEPS)
        else:
            run = ChartRun(None, RunEnding.SLOW, f"{RunEnding.SLOW}: already at {slow}", 0.0)
        found = None if run.solution is None else PosesInTime.of_solution(run.solution)
        steps = 0 if run.solution is None else int(run.solution.stats["steps"])
        outcome, error, held = _outcome(found, self.truth, right(setting, self.condition, steps))
        said = run.message or self.why
        if run.solution is not None:
            if outcome in SILENT | {ChartOutcome.UNKNOWN} and not run.solution.audit.passed:
                outcome, said = ChartOutcome.FLAGGED, str(run.solution.audit)
        elif run.ending is RunEnding.SLOW:
            outcome = ChartOutcome.SLOW
        return Cell(
            self.family.name,
            self.value,
            method.name,
            setting,
            outcome,
            error,
            held,
            run.wall,
            said,
            "none" if self.truth is None else self.truth.source,
            np.nan if self.truth is None else self.truth.cross_check,
            np.nan if self.truth is None else float(self.truth.motion.t[-1]),
            self.condition,
        )


def _truth(family: Family, value: float, times: Array, limit: float) -> tuple[ReferenceMotion | None, str]:
    scene = family.make(value) if family.meant is None else family.meant(value)
    if family.rests:
        return resting_reference(scene, times), ""
    try:
        found = tight_reference(scene, float(times[-1]), save_at=times, limit=4.0 * limit)
        off, most = found.cross_check / found.motion.length, DOUBT
        if not off <= most:
            raise ShowError("doubt", path=scene.name, found=f"{off:.1e}", expected=f"{most:.0e}")
    except ShowError as error:
        return None, str(error)
    return found, ""


def _outcome(
    found: PosesInTime | None, truth: ReferenceMotion | None, allowed: float
) -> tuple[ChartOutcome, float, float]:
    """Outcome, error and horizon; without a reference as far as the motion alone shows them."""
    if found is None:
        return ChartOutcome.REFUSED, np.nan, np.nan
    if truth is None:
        alone, _ = judge(found, found)
        return (alone if alone is ChartOutcome.DIVERGED else ChartOutcome.UNKNOWN), np.nan, np.nan
    found = found.until(len(truth.motion.t))
    outcome, error = judge(found, truth.motion, allowed)
    return outcome, error, horizon(found, truth.motion)
