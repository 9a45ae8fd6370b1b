"""Members of one scene that differ in numbers only: one set of compiled tables, filled anew for each.

What a member's tables and start hold is its *image*: all their numbers in one row. Where the numbers that one path
changes are none that another one does, the image of a member is put together from images along each path; where they
follow a path's value in a straight line, or as its inverse does, three images say all others. Both are checked on
members built in full; where they do not hold, every member is.
"""

import threading
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import Any, final

import numpy as np

from ephs.mechanics.methods.auto import Auto
from ephs.mechanics.methods.explicit import Explicit
from ephs.mechanics.methods.registry import Setting, chosen
from ephs.mechanics.runs.pace import longest_step
from ephs.mechanics.runs.signals import times_of
from ephs.mechanics.runs.simulate import control_of, problem_of_scene
from ephs.mechanics.scene.build import component_path
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.own_units import SI, Units
from ephs.mechanics.scene.parameters import varied
from ephs.mechanics.sweep.axes import Axes
from ephs.mechanics.sweep.outputs import Output
from ephs.mechanics.sweep.suspicion import LONGER, Suspicion
from ephs.mechanics.tree.equations.equations import Equations, ReducedState
from ephs.mechanics.tree.finding.tables import TREE
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import Pair
from ephs.solve.auditing.audit import Bounds
from ephs.solve.control import ATOL, RTOL, Control, first_step
from ephs.solve.stepping import Span

__all__ = ["Ensemble", "Unlike"]

AGREE = 1e-12
"""By which an image that was put together may differ from one that was built, relative to the number where above 1."""
STRAIGHT = 12
"""Number of values of one path above which interpolation from three members is tried."""
BURST = 100_000
"""Largest number of compiled steps of a member; longer ones are run individually, with progress."""


class Unlike(Exception):
    """A scene whose tables or method differ from those of the ensemble."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Made:
    """Compiled equations and their initial state."""

    equations: Equations
    start: ReducedState

    @staticmethod
    def of(scene: Scene, t0: float) -> "_Made":
        if Units.of(scene) != SI:
            raise Unlike(f"{scene.name} is solved in units of its own")
        equations = Equations(problem_of_scene(replace(scene)), t0)  # nothing is shared: its tables are overwritten
        return _Made(equations, equations.start(t0))

    def arrays(self) -> list[Array]:
        """All numbers that a run depends on, the start's last."""
        eq = self.equations
        tables = [a for a in self._tables() if a.dtype == np.float64]
        return [
            *tables,
            eq.model.tables.parameters,
            eq.drive,
            eq.wrench,
            eq.scal,
            eq.gravity,
            self.start.q,
            self.start.r,
            self.start.heats,
        ]

    def counts(self) -> list[Any]:
        """Structure that all members share."""
        return [a for a in self._tables() if a.dtype != np.float64]

    def _tables(self) -> list[Any]:
        """Those of the engine, of the dense sweeps that careful steps take, and of states and their energies."""
        eq = self.equations
        every: Iterator[Any] = iter((*eq.engine.arrays(), *eq.reduced.tables, *eq.booking.arrays()))
        return [a for a in every if isinstance(a, np.ndarray)]

    def image(self) -> Array:
        """All numbers in one row."""
        return np.concatenate([a.ravel() for a in self.arrays()])


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Course:
    """Dependence of an image on the value of one path, as α + β·value + γ/value, by three of its values.

    Parameters
    ----------
    low, middle, high
        The values.
    first, slope
        The image at ``low``, and by how much it is more at ``high``.
    bend
        By how much it is more at ``middle`` than on the straight line: what follows the inverse, as a mass does.
    """

    low: float
    middle: float
    high: float
    first: Array
    slope: Array
    bend: Array

    def __call__(self, value: float) -> Array:
        out = self.first + (value - self.low) / (self.high - self.low) * self.slope
        if not self.bend.any():
            return out
        most = (self.middle - self.low) * (self.high - self.middle) / self.middle
        return out + (value - self.low) * (self.high - value) / value / most * self.bend


@final
class Ensemble:
    """The members of a sweep over one scene by explicit steps in compiled code.

    Parameters
    ----------
    options
        Those of `ephs.simulate` that say how steps are taken.

    Raises
    ------
    Unlike
        The scene, the options or the outputs need more than that.
    """

    def __init__(
        self, scene: Scene, axes: Axes, t0: float, until: float, save_at: Array, options: Mapping[str, Any],
        outputs: tuple[Output, ...],
    ) -> None:  # fmt: skip
        self._scene, self._axes, self._t0, self._until = scene, axes, t0, until
        self._options = dict(options)
        if self._options.pop("form", "reduced") != "reduced" or set(self._options) - _STEERING:
            raise Unlike
        self._times = times_of(save_at, t0, until)
        self._last = [float(found[-1]) for found in axes.values]  # the first may be 0, where a part is missing
        self._lock = threading.Lock()
        self._own = threading.local()
        self._along: dict[tuple[int, float], Array] = {}
        base = self._made(self._last)
        if self._stepper(base.equations) is None:
            raise Unlike
        self._base, self._counts, self._sizes = base.image(), base.counts(), [a.size for a in base.arrays()]
        self._reads = [_reading(base.equations, output) for output in outputs]
        self._whole = False
        self._courses: dict[int, _Course] = {}
        self._look()

    # ---- images --------------------------------------------------------------------------------------------------

    def image(self, values: Array) -> Array:
        """The numbers of the member with these values.

        Raises
        ------
        Unlike
            It has other tables than the rest.
        SceneError, SolveError
            There is no such member.
        """
        if self._whole:
            return self._built(values)
        out = self._base.copy()
        for axis, value in enumerate(values.tolist()):
            found = self._one(axis, value)
            changed = found != self._base
            out[changed] = found[changed]
        return out

    def _look(self) -> None:
        """See how paths change the image: each for itself, in straight lines, or all together."""
        values = self._axes.values
        ends = [
            (self._end(i, np.unique(found)), self._end(i, np.unique(found)[::-1])) for i, found in enumerate(values)
        ]
        touched = [np.any([self._apart(end, self._base) for _, end in both], axis=0) for both in ends]
        if any(np.any(one & other) for one, other in combinations(touched, 2)):
            self._whole = True
            return
        for i, (found, (low, high)) in enumerate(zip(values, ends, strict=True)):
            if np.unique(found).size > STRAIGHT:
                course = self._course(i, low, high, touched[i])
                inner = np.sort(found)[[found.size // 5, found.size // 2, (4 * found.size) // 5]]
                if all(self._same(course(x), self._built(self._single(i, x))) for x in inner.tolist()):
                    self._courses[i] = course
        members = self._axes.members
        chosen = np.unique(np.linspace(0, len(members) - 1, 4).astype(int))
        self._whole = not all(self._holds(members[k]) for k in chosen)

    def _end(self, axis: int, values: Array) -> tuple[float, Array]:
        """The first of some values whose member is like the others, and its image; the very first may not be."""
        value = float(values[0])
        with suppress(Unlike):
            return value, self._one(axis, value)
        value = float(values[min(1, values.size - 1)])
        return value, self._one(axis, value)

    def _holds(self, values: Array) -> bool:
        """Whether a member is as it was put together, or has to be run on its own."""
        try:
            return self._same(self.image(values), self._built(values))
        except Unlike:
            return True

    def _course(self, axis: int, least: tuple[float, Array], most: tuple[float, Array], touched: Array) -> _Course:
        (low, first), (high, last) = least, most
        middle = 0.5 * (low + high)
        straight = _Course(low, middle, high, first, np.where(touched, last - first, 0.0), np.zeros_like(first))
        if low <= 0.0 <= high:
            return straight
        between = self._built(self._single(axis, middle))
        on = straight(middle)
        return replace(straight, bend=np.where(self._apart(between, on), between - on, 0.0))

    def _one(self, axis: int, value: float) -> Array:
        """The image where one path alone is varied."""
        course = self._courses.get(axis)
        if course is not None and course.low <= value <= course.high:
            return course(value)
        with self._lock:
            found = self._along.get((axis, value))
        if found is None:
            found = self._built(self._single(axis, value))
            with self._lock:
                self._along[axis, value] = found
        return found

    def _single(self, axis: int, value: float) -> Array:
        return np.array([*self._last[:axis], value, *self._last[axis + 1 :]])

    def _built(self, values: Array) -> Array:
        made = self._made(values.tolist())
        if [a.size for a in made.arrays()] != self._sizes:
            raise Unlike
        if any(a.shape != b.shape or np.any(a != b) for a, b in zip(made.counts(), self._counts, strict=True)):
            raise Unlike
        return made.image()

    def _made(self, values: list[float]) -> _Made:
        return _Made.of(varied(self._scene, dict(zip(self._axes.paths, values, strict=True))), self._t0)

    @staticmethod
    def _apart(one: Array, other: Array) -> Any:
        return np.abs(one - other) > AGREE * np.maximum(1.0, np.abs(other))

    def _same(self, one: Array, other: Array) -> bool:
        return not np.any(self._apart(one, other))

    # ---- running -------------------------------------------------------------------------------------------------

    def run(self, values: Array) -> tuple[list[Array], int, int]:
        """One member: its outputs, steps and rejected steps; several threads may do so at once.

        Raises
        ------
        Unlike
            It has to be run on its own: it is not like the others, or may break a law of its audit.
        SceneError, SolveError
            There is no such member, or a step has no solution.
        """
        image = self.image(values)
        equations, stepper = self._threads_own()
        start = self._fill(equations, image)
        times = self._times
        assert times is not None  # outputs of a sweep are explicit
        first = int(times.size > 0 and times[0] == self._t0)
        control = stepper.control
        leg = self._leg(stepper, start, control, times, first)
        passed, q, y = leg.kept()
        end, longer = leg.state, partial(self._longer, stepper, start)
        if Suspicion(equations, self._bounds(control)).of(start, passed[:, 2], q, y, end, leg.counts.least, longer):
            raise Unlike
        if first:
            beginning = np.concatenate([start.r, start.heats, start.totals])
            q, y = np.concatenate([start.q[None], q]), np.concatenate([beginning[None], y])
        counts = leg.counts
        return [read(q, y) for read in self._reads], counts.steps, counts.rejected

    def _leg(self, stepper: Any, start: ReducedState, control: Control, times: Array, first: int) -> Any:
        """Compiled steps to the end."""
        policy = None if control.step is not None else _CHOSEN
        h = first_step(control, abs(self._until - self._t0))
        leg = stepper.many(Span(start, self._t0, self._until, h, control, policy, times, first))
        if not leg.advance(BURST) or leg.left:
            raise Unlike
        return leg

    def _longer(self, stepper: Any, start: ReducedState) -> ReducedState:
        control = replace(stepper.control, step=LONGER * stepper.control.step)
        return self._leg(stepper, start, control, np.zeros(0), 0).state

    def _bounds(self, control: Control) -> Bounds:
        return Bounds.of(control, control.step, lawful=False)

    def _threads_own(self) -> tuple[Equations, Any]:
        if not getattr(self._own, "ready", None):
            equations = self._made(self._last).equations
            equations.start(self._t0)
            self._own.ready = equations, self._stepper(equations)
        return self._own.ready

    def _fill(self, equations: Equations, image: Array) -> ReducedState:
        """Put an image into the tables; the state that it starts from."""
        q, r, heats = (np.zeros(n) for n in self._sizes[-3:])
        made = _Made(equations, ReducedState(self._t0, q, r, heats, np.zeros(0)))
        at = 0
        for array in made.arrays():
            array[...] = image[at : at + array.size].reshape(array.shape)
            at += array.size
        equations.refilled()
        return ReducedState(self._t0, q, r, heats, np.zeros(2 + len(equations.reduced.made)))

    def _stepper(self, equations: Equations) -> Any:
        """The method on these equations, None where it does not take many steps in one call."""
        given = self._options
        method, _ = chosen(given.get("method", "auto"), equations.problem, step=given.get("step"))
        if (
            given.get("step") is None
            and longest_step(equations.problem.scene, 1, 0.0, (self._t0, self._until)) < np.inf
        ):
            return None  # each member has its own limit
        if equations.led.holds:  # its work is no sum of rows
            return None
        control = control_of(
            equations.problem, method.order, given.get("rtol", RTOL), given.get("atol", ATOL), given.get("step"),
            given.get("min_step"), given.get("max_step"), given.get("max_steps"),
        )  # fmt: skip
        stepper, _ = method.make(Setting(equations.problem, self._t0, control, {}, equations))
        return stepper if isinstance(stepper, Explicit | Auto) and equations.constant else None


_STEERING = {"method", "rtol", "atol", "step", "min_step", "max_step"}
_CHOSEN: Any = True
"""Stands for the policy of steps that are chosen, which compiled code follows on its own."""


def _reading(equations: Equations, output: Output) -> Any:
    """Reader of an output from rows of elements and of rates, entropies and ledgers.

    Raises
    ------
    Unlike
        It needs the whole solution.
    """
    n, ns, reduced = equations.n, equations.ns, equations.reduced
    if output.name in ("heat", "work"):
        at = n + ns + ("heat", "work").index(output.name)
        return lambda q, y: y[:, at]
    kind, _, rest = output.name.partition(".")
    name, _, what = rest.rpartition(".")
    found = [
        i for i, edge in enumerate(reduced.edges) if edge.name == name and edge.path == component_path("joints", name)
    ]
    if kind != "joints" or len(found) != 1 or reduced.tables.kind[found[0]] != TREE:
        raise Unlike
    edge, t = reduced.edges[found[0]], reduced.tables
    if what == "rate":
        at, dim = int(t.r_at[found[0]]), int(t.dim[found[0]])
        return lambda q, y: y[:, at : at + dim]
    if what == "coordinate":
        at, size = int(t.q_at[found[0]]), int(t.q_size[found[0]])
        pair: Pair = edge.pair
        if size == edge.pair.dim:
            return lambda q, y: q[:, at : at + size]
        return lambda q, y: pair.coordinates(q[:, at : at + size])
    raise Unlike
