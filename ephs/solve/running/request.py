"""What users ask for of a run besides its steps: events, times to keep, progress, a journal, an audit."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, final

from ephs.semantics.bundles.bundle import Array
from ephs.solve.auditing.audit import Bounds
from ephs.solve.posing.events import Event
from ephs.solve.running.journal import Written
from ephs.solve.running.watching import Progress


@final
@dataclass(frozen=True, slots=True, eq=False)
class RunRequest:
    """What is asked for of a run besides its steps.

    Parameters
    ----------
    save_at
        Times to keep; None: every step.
    remarks
        What else the statistics are to say.
    journal
        Where the run is written down, and what an earlier part of it left there.
    bounds
        What the audit of the run allows; None: there is none.
    """

    events: tuple[Event, ...] = ()
    save_at: Array | None = None
    progress: Progress | None = None
    remarks: Mapping[str, Any] = field(default_factory=dict)
    journal: Written | None = None
    bounds: Bounds | None = None
