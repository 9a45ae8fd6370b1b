"""Problem of a solver: a system, its initial states, inputs at its outer ports, and its surroundings."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Protocol, final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.bundles.errors import AssemblyError
from ephs.semantics.descriptor.descriptor import Descriptor, Input
from ephs.semantics.systems.kept import Kept, once
from ephs.semantics.systems.system import System
from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.posing.motion_law import MotionLaw

if TYPE_CHECKING:
    from ephs.solve.result.dataset import DatasetVariable
    from ephs.solve.result.labels import Labels
    from ephs.solve.result.record import RunRecord
    from ephs.solve.result.solution import Solution

State = Mapping[Path, Array]
NO_STATE: Final[State] = MappingProxyType({})
"""States for inputs that do not read them."""


@final
class States(Mapping[Path, Array]):
    """States by path, as an input's function reads them: ``state["bodies.rod.pe.q"]`` or by `Path`."""

    def __init__(self, states: State) -> None:
        self._states = states

    def __getitem__(self, path: "str | Path") -> Array:
        return self._states[Path.of(path)]

    def __iter__(self) -> Iterator[Path]:
        return iter(self._states)

    def __len__(self) -> int:
        return len(self._states)


@final
@dataclass(frozen=True, slots=True)
class Signal:
    """A prescribed flow (into the system) or effort at an outer port.

    Parameters
    ----------
    value
        (dim,), or a function of the time in s and the states by path that gives it.
    effort
        True where the effort is prescribed.
    name
        What the user calls it; empty where it is made of other signals.
    size
        How many numbers a function has to give; not checked where None.
    held
        Whether the value changes where steps end, and nowhere else: of a sampled input.
    timed
        Whether a function reads the time alone.
    soft
        Whether it turns and grows with the states as slowly as what it moves: matrices of implicit steps may take it
        as it is at the start of a step, which costs iterations alone.
    """

    value: Array | Callable[[float, State], Array]
    effort: bool = False
    name: str = ""
    size: int | None = None
    held: bool = False
    timed: bool = False
    soft: bool = False

    @staticmethod
    def of_motion(law: MotionLaw, name: str = "") -> "Signal":
        """The effort at a port whose motion is prescribed."""
        return Signal(law(0.0) if law.constant else law, True, name, 1, timed=True)

    @property
    def constant(self) -> bool:
        """Whether the value never changes."""
        return not callable(self.value)

    def at(self, t: float, state: State) -> Array:
        """The value at a time and state, (dim,).

        Raises
        ------
        SolveError
            The function raised an exception, or gave something else than so many finite numbers.
        """
        if not callable(self.value):
            return np.atleast_1d(np.asarray(self.value, dtype=float))
        if not self.name:  # from checked signals
            return self.value(t, state)
        try:
            given = self.value(t, state)
            found = np.atleast_1d(np.asarray(given, dtype=float))
        except (SolveError, MemoryError):
            raise
        except Exception as error:
            raise SolveError(Outcome.INPUT, self.name, f"{type(error).__name__}: {error}", error) from error
        if given is None:
            raise SolveError(Outcome.INPUT, self.name, "it returns None, perhaps for want of a return")
        if self.size is not None and found.shape != (self.size,):
            raise SolveError(Outcome.INPUT, self.name, f"{found.size} numbers where {self.size} are wanted")
        if not np.isfinite(found).all():
            raise SolveError(Outcome.INPUT, self.name, f"it is {found.tolist()}")
        return found


class Linked(Protocol):
    """Motion of bodies and joints by name."""

    @property
    def freedoms(self) -> "Mapping[str, Labels]":
        """Names and units of the coordinates of each joint."""
        ...

    def summary(self) -> dict[str, Any]:
        """Additions to the summary."""
        ...

    def body(self, name: str) -> Any:
        """The motion of a body."""
        ...

    def joint(self, name: str) -> Any:
        """The motion of a joint."""
        ...

    def state(self, i: int) -> dict[Path, Array]:
        """The states at the i-th instant, as arguments of the continuous relations."""
        ...

    def constraint_error(self) -> Array:
        """(n,) largest position residual of any joint, in m or rad."""
        ...

    def gaps(self, every: int) -> Mapping[Path, Array]:
        """Per joint the residual of its position at every so many instants, the last one first: rad, or a part of the
        mechanism's length."""
        ...

    def velocity_error(self) -> Array:
        """(n,) largest residual of the reported velocities, in m/s or rad/s."""
        ...

    def length_errors(self) -> Iterable[tuple[Path, int, float]]:
        """Lengths that states integrate: path, instant at which one is farthest from that of its points, difference as
        a part of the mechanism's length."""
        ...

    def leaps(self, h: float) -> Iterable[tuple[Path, int, float]]:
        """Contacts passed in a step of at most h s: path, instant after it, distance of the step in thicknesses."""
        ...


class Outlined(Linked, Protocol):
    """The same of a system."""

    def outline(self) -> Any:
        """Bodies and joints as a scene, to be drawn."""
        ...

    def shell(self, name: str) -> Any:
        """Motion of a shell."""
        ...


class MechanicalMotion(Outlined, Protocol):
    """A motion in terms of mechanics: the solver itself has only states, efforts and flows."""

    def thermal(self, name: str) -> Any:
        """The temperature of a thermal node."""
        ...

    def marker(self, name: str) -> Any:
        """The motion of a marker."""
        ...

    def contact(self, name: str) -> Any:
        """Motion of a contact."""
        ...

    def beam(self, name: str) -> Any:
        """Motion of a beam."""
        ...

    def contact_poses(self) -> Iterable[tuple[Path, Path | None, Array]]:
        """States that follow from others up to rounding: path, a path before with the same rotation, place (n, 3)."""
        ...

    def variables(self, *, wrenches: bool) -> "dict[str, DatasetVariable]":
        """Additions to labelled arrays."""
        ...


@final
@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A system with everything that determines its motion.

    Parameters
    ----------
    name
        For files and titles.
    initial
        Values of all states by path.
    signals
        What is prescribed at the outer ports; each has one.
    motion
        Makes of a solution the motion in the terms of its field; None for a system that is not a scene.
    scene
        The scene that the system was built from, or None.
    constraints
        Makes what its joints hold, as `ephs.mechanics.constraints` has it; None where there are no joints.
    dependences
        Says in words which constraints depend on which: what a run that fails at them tells its user.
    shaky
        Whether the mechanism has velocities, but no finite motion that belongs to them.
    document
        Writes the scene as text, for solution files; empty where there is none.
    shown
        What was computed of this problem, as a record with statistics of the one that it was made from, which
        solutions are of; None where none was.
    linked
        Makes of a solution the motion of its bodies and joints by the paths of their boxes, where no motion does.
    given
        Makes of its states those of the problem that it was made from; None where they are the same.
    view
        Makes of states by path what functions of a user read.
    seconds
        Its unit of time in s.
    length
        Of the mechanism in m, by which errors of positions are measured.
    names
        Box of a body, joint or spring -> its name, where that is not the path itself.
    remarks
        What the statistics of a run say of it: the form of its equations.
    """

    name: str
    system: System
    descriptor: Descriptor
    initial: State
    signals: Mapping[Path, Signal]
    reference: Reference
    motion: Callable[["Solution"], MechanicalMotion] | None = None
    scene: Any = None
    document: Callable[[], str] = str
    constraints: Callable[[], Any] | None = None
    dependences: Callable[[], str] | None = None
    shaky: Callable[[], bool] | None = None
    shown: "Callable[[RunRecord, Mapping[str, Any]], tuple[Problem, RunRecord, Mapping[str, Any]]] | None" = None
    linked: Callable[["Solution"], Outlined] | None = None
    given: Callable[[State], State] | None = None
    view: Callable[[State], Mapping[Path, Array]] = States
    seconds: float = 1.0
    length: float = 1.0
    names: Mapping[Path, str] = field(default_factory=dict)
    remarks: Mapping[str, Any] = field(default_factory=lambda: {"form": "paper"})
    _kept: Kept = field(default_factory=Kept, init=False, repr=False)

    @property
    def point(self) -> Array:
        """(point_size,) the initial states, made once; not to be written to."""

        def packed() -> Array:
            out = self.descriptor.pack(self.initial)
            out.flags.writeable = False
            return out

        return once(self, "point", packed)

    @property
    def mechanical(self) -> bool:
        """Whether bodies move in it."""
        return self.motion is not None or self.linked is not None

    def signal(self, port: Path) -> Signal:
        """What is prescribed at an outer port.

        Raises
        ------
        AssemblyError
            Nothing is.
        """
        if port not in self.signals:
            raise AssemblyError("missing-input", port)
        return self.signals[port]

    def inputs(self, t: float, state: State) -> dict[Path, Input]:
        """The inputs of the descriptor form at a time."""
        return {path: Input(signal.at(t, state), signal.effort) for path, signal in self.signals.items()}

    @property
    def prescribed(self) -> frozenset[Path]:
        """The outer ports whose effort is prescribed."""
        return frozenset(path for path, signal in self.signals.items() if signal.effort)

    @property
    def constant(self) -> bool:
        """Whether no input depends on time or state."""
        return all(signal.constant for signal in self.signals.values())

    @property
    def held(self) -> bool:
        """Whether no input changes within a step."""
        return all(signal.constant or signal.held for signal in self.signals.values())

    @property
    def timed(self) -> bool:
        """Whether inputs depend on the time alone."""
        return all(signal.constant or signal.timed for signal in self.signals.values())

    @property
    def soft(self) -> bool:
        """Whether inputs depend on the time alone, or softly on the states: see `Signal`."""
        return all(signal.constant or signal.timed or signal.soft for signal in self.signals.values())
