"""A sweep as a value for its workers: threads, or other processes."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.runs.simulate import simulate
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from ephs.mechanics.scene.errors import SceneError
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.parameters import varied
from ephs.mechanics.scene.registry import REGISTERED
from ephs.mechanics.sweep.axes import Axes
from ephs.mechanics.sweep.ensemble import Ensemble
from ephs.mechanics.sweep.images import FAULTS
from ephs.mechanics.sweep.outputs import Output
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import AssemblyError, SemanticsError
from ephs.solve.equations.sparse import Index
from ephs.solve.posing.errors import Interrupted, SimulationError

if TYPE_CHECKING:
    from ephs.semantics.systems.system import System

DONE = "done"
"""The status of a member that ran to the end."""
ALIKE = 3
"""Members below which no tables are shared."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class MemberBatch:
    """Some members that were run.

    Parameters
    ----------
    numbers
        Which ones.
    values
        Of each output (members, instants, columns), NaN where a member failed.
    status
        ``"done"``, or why not.
    steps, rejected
        (members,).
    """

    numbers: Index
    values: tuple[Array, ...]
    status: tuple[str, ...]
    steps: Index
    rejected: Index


@final
@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """Specification of a run.

    Parameters
    ----------
    model
        A scene as text, which goes anywhere, or a system.
    save_at
        Times to keep, s.
    options
        Those of `ephs.simulate`.
    token
        What tells it from other jobs.
    elements
        Classes of registered sections that the scene has: other processes register them.
    """

    model: "str | System"
    axes: Axes
    t0: float
    until: float
    save_at: Array
    options: Mapping[str, Any]
    outputs: tuple[Output, ...]
    token: str
    elements: tuple[type[Any], ...] = ()

    @staticmethod
    def document(model: "Scene | System") -> "str | System":
        """Form in which a job holds a model."""
        return scene_to_text(model) if isinstance(model, Scene) else model

    def run(self, numbers: Index) -> MemberBatch:
        """Some members, one after the other; one that fails does not stop the others."""
        return _prepared(_Key(self)).run(numbers)

    def prepare(self) -> None:
        """Make the data shared by all members."""
        _prepared(_Key(self))


class _Key:
    """A job, equal to its copies in the same process."""

    def __init__(self, job: Job) -> None:
        self.job = job

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and other.job.token == self.job.token

    def __hash__(self) -> int:
        return hash(self.job.token)


@lru_cache(maxsize=4)
def _prepared(key: _Key) -> "_Prepared":
    return _Prepared(key.job)


@final
class _Prepared:
    """A job in the process that runs it."""

    def __init__(self, job: Job) -> None:
        self.job = job
        for kind in job.elements:
            REGISTERED.setdefault(kind.section, kind)
        self.model: Any = scene_from_text(job.model) if isinstance(job.model, str) else job.model
        self.members = job.axes.members
        self.ensemble: Ensemble | None = None
        if isinstance(self.model, Scene) and len(self.members) >= ALIKE:
            try:
                self.ensemble = Ensemble(self.model, job.axes, job.t0, job.until, job.save_at, job.options, job.outputs)
            except FAULTS:  # members report their own faults
                self.ensemble = None

    def run(self, numbers: Index) -> MemberBatch:
        members, count = self.members[numbers], len(numbers)
        status, steps, rejected = [DONE] * count, *np.zeros((2, count), dtype=np.int64)
        values: list[Array] = []
        missing = np.arange(count)
        if self.ensemble is not None:
            ran = self.ensemble.run(members)
            values, steps, rejected, missing = list(ran.values), ran.steps, ran.rejected, np.flatnonzero(~ran.done)
        for k in missing.tolist():
            read, status[k], steps[k], rejected[k] = self._alone(members[k])
            if read is not None and not values:
                values = [np.full((count, *row.shape), np.nan) for row in read]
            for i, column in enumerate(values):
                column[k] = np.nan if read is None else read[i]
        return MemberBatch(numbers, tuple(values), tuple(status), steps, rejected)

    def _alone(self, values: Array) -> tuple[list[Array] | None, str, int, int]:
        """By `simulate`, which reports failures with time and path; the audit's findings become a member's status."""
        job = self.job
        try:
            model = varied(self.model, dict(zip(job.axes.paths, values.tolist(), strict=True)))
            options = {**job.options, "audit": "off"}
            solution = simulate(model, job.until, t0=job.t0, save_at=job.save_at, **options)
        except Interrupted:
            raise KeyboardInterrupt from None
        except SimulationError as error:
            stats = error.partial.stats if error.partial is not None else {}
            return None, str(error), int(stats.get("steps", 0)), int(stats.get("rejected", 0))
        except (SceneError, AssemblyError, SemanticsError) as error:
            return None, str(error), 0, 0
        read = [np.asarray(output.read(solution)) for output in job.outputs]
        stats = solution.stats
        columns = [row.reshape(len(solution), -1) for row in read]
        status = DONE if solution.audit.passed else str(solution.audit)
        return columns, status, int(stats["steps"]), int(stats["rejected"])
