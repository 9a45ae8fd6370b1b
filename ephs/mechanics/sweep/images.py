"""Members of one scene that differ in numbers only: one set of compiled tables, with other numbers for each.

The *image* of a member is one row with all numbers of its tables and its start. If no two paths change the same number,
images along each path are combined into the image of a member. If numbers are linear in the value of a path or in its
inverse, they are interpolated from three images. Both are checked on members built in full; if a check fails, every
member is built in full.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.errors import SceneError
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.own_units import SI, OwnUnits
from ephs.mechanics.scene.parameters import varied
from ephs.mechanics.sweep.axes import Axes
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import SemanticsError
from ephs.solve.equations.sparse import Index
from ephs.solve.posing.errors import SolveError

Truths = NDArray[np.bool_]

AGREE = 1e-12
"""By which an image that was put together may differ from one that was built, relative to the number where above 1."""
STRAIGHT = 12
"""Number of values of one path above which interpolation from three members is tried."""
STARTS = 3
"""Number of arrays of a member, the last ones, that are its start."""


class Unlike(Exception):
    """A scene whose tables or method differ from those of the ensemble."""


FAULTS = Unlike, SolveError, SceneError, SemanticsError
"""Reasons for a member to be run on its own: it reports its own faults."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class CompiledStart:
    """Compiled equations and their initial state."""

    equations: ReducedEquations
    start: ReducedState

    @staticmethod
    def of(scene: Scene, t0: float) -> "CompiledStart":
        """From a scene."""
        if OwnUnits.of(scene) != SI:
            raise Unlike(f"{scene.name} is solved in units of its own")
        equations = ReducedEquations(
            problem_of_scene(replace(scene)), t0
        )  # nothing is shared: its tables are overwritten
        return CompiledStart(equations, equations.start(t0))

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
            eq.reduced.gravity,
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
class _ValueDependence:
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

    def __call__(self, values: Array) -> Array:
        """(values, numbers) the images."""
        value = values[:, None]
        out = self.first + (value - self.low) / (self.high - self.low) * self.slope
        if not self.bend.any():
            return out
        most = (self.middle - self.low) * (self.high - self.middle) / self.middle
        return out + (value - self.low) * (self.high - value) / value / most * self.bend

    def among(self, places: Index) -> "_ValueDependence":
        """The same for some numbers of the image."""
        return replace(self, first=self.first[places], slope=self.slope[places], bend=self.bend[places])


@final
class Images:
    """The images of the members of a sweep over one scene; several threads may ask for them.

    Attributes
    ----------
    made
        One member, of which all others differ in numbers.
    base
        Its image.
    columns
        Places in an image of the numbers in which members may differ.
    """

    def __init__(self, scene: Scene, axes: Axes, t0: float) -> None:
        self._scene, self._axes, self._t0 = scene, axes, t0
        self._middle = [_middle(values) for values in axes.values]
        self._lock, self._spare = threading.Lock(), list[CompiledStart]()
        self._along: dict[tuple[int, float], Array] = {}
        self.made = self._member(self._middle)
        self.base, self._counts = self.made.image(), self.made.counts()
        self._shapes = [a.shape for a in self.made.arrays()]
        self._courses: dict[int, _ValueDependence] = {}
        self._own: list[Index] = []
        everything = np.arange(self.base.size)
        self.columns, self._whole = everything, False
        if not self._followed():
            self.columns, self._whole = everything, True
        self._spare.append(self.made)

    def anew(self) -> CompiledStart:
        """The member of the image ``base``, for one thread, which may overwrite its tables."""
        with self._lock:
            return self._spare.pop() if self._spare else self._member(self._middle)

    def of(self, members: Array) -> tuple[Array, Truths]:
        """(members, columns) their numbers in `columns`, and (members,) whether they are like the others."""
        out, good = np.tile(self.base[self.columns], (len(members), 1)), np.ones(len(members), dtype=bool)
        if self._whole:
            for k, values in enumerate(members):
                good[k] = False
                with suppress(*FAULTS):
                    out[k], good[k] = self._built(values), True
            return out, good
        for axis, (values, own) in enumerate(zip(members.T, self._own, strict=True)):
            course, places = self._courses.get(axis), np.searchsorted(self.columns, own)
            rest = np.ones(values.size, dtype=bool)
            if course is not None:
                rest = (values < course.low) | (course.high < values)
                out[np.ix_(~rest, places)] = course.among(own)(values[~rest])
            for value in np.unique(values[rest]).tolist():
                rows, known = rest & (values == value), False
                with suppress(*FAULTS):
                    found = self._one(axis, value)
                    out[np.ix_(rows, places)] = found[own]
                    known = not np.any(np.delete(_apart(found, self.base), own))
                good[rows] &= known
        return out, good

    def parts(self) -> Iterator[tuple[int, Index, Index]]:
        """Number of each array of `CompiledStart.arrays` that may differ; their places in it and in `columns`."""
        at = 0
        for number, shape in enumerate(self._shapes):
            size = int(np.prod(shape))
            among = np.flatnonzero((self.columns >= at) & (self.columns < at + size))
            if among.size:
                yield number, self.columns[among] - at, among
            at += size

    # ---- how paths change an image -------------------------------------------------------------------------------

    def _followed(self) -> bool:
        """See how paths change the image, each for itself; whether all members are put together from that."""
        values = [np.unique(x) for x in self._axes.values]
        tops = [self._end(i, x[::-1]) for i, x in enumerate(values)]
        many = [i for i, x in enumerate(values) if x.size > STRAIGHT]
        for i in set(range(len(values))) - set(many):
            for value in values[i].tolist():
                with suppress(*FAULTS):
                    self._one(i, value)
        if len(many) > 1:
            self._at_once({i: float(values[i][0]) for i in many})
        ends = [(self._end(i, x), top) for i, (x, top) in enumerate(zip(values, tops, strict=True))]
        touched = self._changed(_apart)
        courses = self._courses = {i: self._course(i, *ends[i], touched[i]) for i in many}
        if self._holds():
            return True
        self._courses = {i: course for i, course in courses.items() if self._follows(i, course)}
        return self._holds()

    def _at_once(self, values: dict[int, float]) -> None:
        """Find the images along several paths in one member, if each path changes numbers that are known to be its."""
        touched = self._changed(_apart)
        with suppress(Unlike):
            built = self._built(np.array([values.get(i, middle) for i, middle in enumerate(self._middle)]))
            if not np.any(_apart(built, self.base) & ~np.any(touched, axis=0)):
                self._along |= {(i, x): np.where(touched[i], built, self.base) for i, x in values.items()}

    def _changed(self, apart: Callable[[Array, Array], Truths]) -> list[Truths]:
        """(numbers,) of each path whether a number changes along it, as far as is known."""
        out = [np.zeros(self.base.size, dtype=bool) for _ in self._axes.paths]
        for (axis, _), image in self._along.items():
            out[axis] |= apart(image, self.base)
        return out

    def _holds(self) -> bool:
        """Find the numbers that each path changes; whether some members are as they are put together from these.

        Where a path is interpolated, what it changes by rounding counts as unchanged.
        """
        touched, differing = self._changed(_apart), self._changed(np.not_equal)
        if any(np.any(one & other) for one, other in combinations(touched, 2)):
            return False
        own: list[Truths] = []
        for i in range(len(touched)):
            others = np.any(touched[:i] + touched[i + 1 :], axis=0)
            own.append((touched if i in self._courses else differing)[i] & ~others)
        self._own, self.columns = [np.flatnonzero(each) for each in own], np.flatnonzero(np.any(own, axis=0))
        members = self._axes.members
        chosen = members[np.unique(np.linspace(0, len(members) - 1, 4).astype(int))]
        for values, row, known in zip(chosen, *self.of(chosen), strict=True):
            image = self.base.copy()
            image[self.columns] = row
            with suppress(Unlike):
                if known and np.any(_apart(image, self._built(values))):
                    return False
        return True

    def _end(self, axis: int, values: Array) -> tuple[float, Array]:
        """The first of some values whose member is like the others, and its image; the very first may not be."""
        value = float(values[0])
        with suppress(Unlike):
            return value, self._one(axis, value)
        value = float(values[min(1, values.size - 1)])
        return value, self._one(axis, value)

    def _course(
        self, axis: int, least: tuple[float, Array], most: tuple[float, Array], touched: Truths
    ) -> _ValueDependence:
        (low, first), (high, last), middle = least, most, self._middle[axis]
        straight = _ValueDependence(
            low, middle, high, first, np.where(touched, last - first, 0.0), np.zeros_like(first)
        )
        if low <= 0.0 <= high or not low < middle < high:
            return straight
        on = straight(np.array([middle]))[0]
        return replace(straight, bend=np.where(_apart(self.base, on), self.base - on, 0.0))

    def _follows(self, axis: int, course: _ValueDependence) -> bool:
        """Whether some values of a path have the images that are interpolated."""
        found = self._axes.values[axis]
        inner = np.sort(found)[[found.size // 5, found.size // 2, (4 * found.size) // 5]]
        return not any(np.any(_apart(course(inner[k : k + 1])[0], self._one(axis, x))) for k, x in enumerate(inner))

    # ---- members built in full -----------------------------------------------------------------------------------

    def _one(self, axis: int, value: float) -> Array:
        """The image where one path alone is varied."""
        with self._lock:
            found = self._along.get((axis, value))
        if found is None:
            found = self._built(np.array([*self._middle[:axis], value, *self._middle[axis + 1 :]]))
            with self._lock:
                self._along[axis, value] = found
        return found

    def _built(self, values: Array) -> Array:
        made = self._member(values.tolist())
        if [a.shape for a in made.arrays()] != self._shapes:
            raise Unlike
        if any(a.shape != b.shape or np.any(a != b) for a, b in zip(made.counts(), self._counts, strict=True)):
            raise Unlike
        return made.image()

    def _member(self, values: list[float]) -> CompiledStart:
        return CompiledStart.of(varied(self._scene, dict(zip(self._axes.paths, values, strict=True))), self._t0)


def _middle(values: Array) -> float:
    """The value in the middle of a range; not 0 or 1, where a part or a factor may be missing."""
    found = np.unique(values)
    plain = found[~np.isin(np.abs(found), (0.0, 1.0))]
    found = plain if plain.size else found
    return float(found[np.argmin(np.abs(found - 0.5 * (values.min() + values.max())))])


def _apart(one: Array, other: Array) -> Truths:
    """(numbers,) whether they differ by more than rounding."""
    return np.abs(one - other) > AGREE * np.maximum(1.0, np.abs(other))
