"""One problem and its neighbours in the parameters: how a model's tables and initial values change with them.

Tables of a model are polynomials of low degree in each of its parameters, whose derivative follows from values exactly:
of degree six and less by the stencils here, to rounding. Initial values that close loops are smooth: there the
next term is below rounding at these steps.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.runs.signals import check_mappings
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.scene.errors import SceneError
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.parameters import read, varied
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.derive.relations import entry_of
from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.semantics.stage import Program
from ephs.semantics.stage.errors import StageError
from ephs.semantics.systems.system import System
from ephs.solve.posing.errors import OptionError, failing_at
from ephs.solve.posing.problem import Problem

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Stencil = tuple[tuple[int, float], ...]
"""Multiples of a step, and their weights in a first derivative."""
CENTRAL: Stencil = ((-3, -1 / 60), (-2, 0.15), (-1, -0.75), (1, 0.75), (2, -0.15), (3, 1 / 60))
OUTER: Stencil = ((-3, -1 / 6), (3, 1 / 6))
STRAIGHT: Stencil = ((-1, -0.5), (1, 0.5))
FORWARD: Stencil = ((0, -2.45), (1, 6.0), (2, -7.5), (3, 20 / 3), (4, -3.75), (5, 1.2), (6, -1 / 6))
RELATIVE = 2.0**-8
"""A neighbour's distance, relative to the parameter, or absolute where that is zero."""
WIDE = 2.0**-4
"""The same for numbers in which equations in joint coordinates are linear: the farther, the less rounding."""
LINEAR = (
    "mass", "inertia", "friction", "stiffness", "damping", "conductance", "drive", "rest", "gravity", "rate",
    "velocity",
)  # fmt: skip
SIGNED = ("position", "at", "at1", "at2", "coordinate", "rate", "rest", "drive", "gravity", "velocity")
OMITTED = ("friction", "stiffness", "damping", "conductance", "rest")
NEXT_TO_NOTHING = 1e-200
"""Replacement of zeros of these: models omit what they scale or shift, and neighbours would be others."""
LEAST = 0.1
"""Least magnitudes for numbers of a scene with either sign, in m, rad, s, N: near zero their own size is no scale."""


@contextmanager
def differentiated(parameters: Sequence[str], t: float) -> Iterator[None]:
    """Refuse derivatives that are too long to be compiled, and report failures at the start as those of a run.

    Raises
    ------
    OptionError
        They are too long.
    SimulationError
        A model has no such start.
    """
    try:
        with failing_at(t):
            yield
    except StageError as error:
        if error.fault != "endless":
            raise
        raise OptionError("parameters", parameters, "those of a model whose derivatives are shorter; "
                          "rods that expand have them at order 2, and ephs.sweep takes all") from error  # fmt: skip


def check_paths(paths: Sequence[str]) -> None:
    """Refuse what is no list of paths.

    Raises
    ------
    OptionError
        It says so.
    """
    several = isinstance(paths, Sequence) and not isinstance(paths, str) and all(isinstance(p, str) for p in paths)
    if not several or not paths or len(set(paths)) < len(paths):
        raise OptionError("parameters", paths, "one path or several, each once, as a list")


def difference(function: Callable[[float], Array], stencil: Stencil, step: float) -> Array:
    """The derivative of a function at 0, by its values at multiples of a step."""
    return np.asarray(sum(weight * function(k * step) for k, weight in stencil) / step, dtype=float)


@final
@dataclass(frozen=True, slots=True)
class Parameter:
    """A number of a model, or an initial value.

    Parameters
    ----------
    path, value
        Where it is, and what it is.
    step, stencil
        The distance of neighbours, and where they are for derivatives of what is read from motions.
    tables
        Where they are for derivatives of the equations' tables and of initial values.
    """

    path: str
    value: float
    step: float
    stencil: Stencil
    tables: Stencil


@final
class ParameterFamily:
    """A model with its initial state and options, and its variants with other parameters.

    Parameters
    ----------
    joints
        The model is a scene whose motion is computed in joint coordinates.

    Attributes
    ----------
    parameters
        What is varied.
    problem
        The model's own.
    """

    def __init__(
        self,
        model: System | Scene,
        paths: Sequence[str],
        initial: "Mapping[str, ArrayLike] | None",
        inputs: Mapping[str, Any] | None,
        reference: Reference | None,
        *,
        joints: bool = False,
    ) -> None:
        check_paths(paths)
        check_mappings(initial=initial, inputs=inputs)
        self.model, self._reference, self._joints = model, reference, joints
        self._initial, self._inputs = dict(initial or {}), dict(inputs or {})
        if isinstance(model, Scene):
            for path in paths:  # a drive with rate zero has no port
                joint = path.removeprefix("joints.").rpartition(".drive")[0]
                if path.startswith("joints.") and joint and f"joints.{joint}" not in self._inputs:
                    self._inputs[f"joints.{joint}"] = np.zeros(model.joint(joint).dim)
        self._neighbours: dict[tuple[str, float], Problem] = {}
        self._replaced: dict[str, float] = {}
        self.problem = self._made({})
        if (path := self.problem.descriptor.strikes) is not None:
            raise OptionError("model", str(path), "a contact with a stiffness: impulses have no derivative")
        self._states = {str(slot.path): slot for slot in self.problem.descriptor.states}
        for path in paths:
            value = self._read(path)
            if _is_omitted(path) and not value:
                self._replaced[path] = NEXT_TO_NOTHING
            elif abs(value) == 1.0:  # equations may have a product less
                near = float(np.nextafter(value, 2.0 * value))
                if not _alike(self.problem.descriptor, self._made({path: near}).descriptor):
                    self._replaced[path] = near
        if self._replaced:
            self.problem = self._made({})
        self.parameters = tuple(self._parameter(path) for path in paths)

    def at(self, number: int, offset: float) -> Problem:
        """The problem with one parameter elsewhere by an offset in its own unit."""
        parameter = self.parameters[number]
        return self._beside(parameter.path, parameter.value, offset)

    def _beside(self, path: str, value: float, offset: float) -> Problem:
        if (path, offset) not in self._neighbours:
            self._neighbours[path, offset] = self._made({path: value + offset}) if offset else self.problem
        return self._neighbours[path, offset]

    def _parameter(self, path: str) -> Parameter:
        value = self._read(path)
        signed = isinstance(self.model, Scene) and path.partition("[")[0].endswith(SIGNED)
        linear = self._joints and path.partition("[")[0].endswith(LINEAR)
        step = (WIDE if linear else RELATIVE) * max(abs(value) or 1.0, LEAST if signed else 0.0)
        if self._joints and value > 0.0 and path.partition("[")[0].endswith(("mass", "inertia")):
            return Parameter(path, value, step, CENTRAL, STRAIGHT)  # neighbours are models, too
        reason: Exception | None = None
        for stencil in (CENTRAL, FORWARD):
            try:
                tables = STRAIGHT if linear and stencil is CENTRAL else stencil
                beside = [self._beside(path, value, k * step) for k, _ in (tables[0], tables[-1])]
            except (SceneError, StructureError) as error:
                reason = error
                continue
            if not all(_alike(self.problem.descriptor, other.descriptor) for other in beside):
                expected = "a number that leaves equations as they are: no pitch, no 0 that simplifies them"
                raise OptionError("parameters", path, expected)
            return Parameter(path, value, step, stencil, tables)
        raise OptionError("parameters", path, f"a number that may change: {reason}") from reason

    def _read(self, path: str) -> float:
        if isinstance(self.model, System):
            stem, entry = _entry(path)
            if stem in self._states:
                values = self.problem.initial[Path.of(stem)]
                if entry >= values.size or (entry < 0 and values.size != 1):
                    raise OptionError("parameters", path, f"an entry of {values.size} numbers")
                if self._states[stem].quantity.space.size != self._states[stem].quantity.space.dim:
                    raise OptionError("parameters", path, "a state on a vector space")
                return float(values[max(entry, 0)])
        return read(self.model, path)

    def _made(self, values: Mapping[str, float]) -> Problem:
        values = {**self._replaced, **values}
        if isinstance(self.model, Scene):
            scene = varied(self.model, values, strict=False) if values else self.model
            return problem_of_scene(scene, self._initial or None, self._inputs)
        numbers, initial = dict(values), dict(self._initial)
        for path in [p for p in values if _entry(p)[0] in getattr(self, "_states", {})]:
            stem, entry = _entry(path)
            state = np.array(self.problem.initial[Path.of(stem)])
            state[max(entry, 0)] = numbers.pop(path)
            initial[stem] = state
        system = varied(self.model, numbers) if numbers else self.model
        return problem_of_system(system, initial, self._inputs, self._reference)


def relation_of(descriptor: Descriptor, number: int, *, derivatives: bool = False) -> tuple[Program, str]:
    """The program of a component's relation, with the derivatives that it writes or without, and its entry.

    Raises
    ------
    OptionError
        It is a Python function that is called back.
    """
    slot = descriptor.components[number]
    if slot.primitive.kernel is None:
        raise OptionError("model", str(slot.path), "relations that can be recorded: this one is called back in Python")
    return entry_of(slot.primitive.kernel.relation, derivatives=derivatives)


def _alike(one: Descriptor, other: Descriptor) -> bool:
    """Whether all components have the same relations but for numbers in tables."""
    pairs = zip(one.components, other.components, strict=False)  # where some appear or vanish, states differ
    for kernel, beside in ((a.primitive.kernel, b.primitive.kernel) for a, b in pairs):
        if kernel is not None and beside is not None and kernel.relation != beside.relation:
            texts = (entry_of(each.relation, derivatives=False)[0].text(blocks=False) for each in (kernel, beside))
            if next(texts) != next(texts):
                return False
    return True


def _is_omitted(path: str) -> bool:
    """Whether a model omits a number at a path where it is zero; a gear without stiffness is rigid."""
    key = path.rpartition(".")[2].partition("[")[0]
    return key in OMITTED and not (key == "stiffness" and path.startswith("gears."))


def _entry(path: str) -> tuple[str, int]:
    """A path and the entry that its brackets choose, −1 where it has none."""
    stem, bracket, entry = path.partition("[")
    return stem, int(entry[:-1]) if bracket and entry[:-1].isdigit() else -1


def same_shape(one: Array, other: Array, path: str) -> None:
    """Refuse a neighbour that is built differently.

    Raises
    ------
    OptionError
        Its states are others: the parameter makes parts appear or vanish.
    """
    if one.shape != other.shape:
        raise OptionError("parameters", path, "a number that leaves the model's structure as it is; start it off zero")
