"""Solutions: the motion of a system with its ledgers."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, replace
from functools import cached_property
from pathlib import Path as File
from typing import TYPE_CHECKING, Any, final, overload

import numpy as np

from ephs.operad import ROOT, Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.systems.system import System
from ephs.solve.auditing.findings import Audit
from ephs.solve.posing.events import Crossing
from ephs.solve.posing.problem import MechanicalMotion, Outlined, Problem
from ephs.solve.result.dataset import DatasetVariable, sampled_inputs
from ephs.solve.result.entries import LedgerEntry, entry_of
from ephs.solve.result.labels import Labels
from ephs.solve.result.ledger import Ledgers
from ephs.solve.result.states import near_states

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from ephs.show import Page
    from ephs.solve.result.ports import PortMotion


@final
class Solution:
    """The motion of a system.

    Parameters
    ----------
    name
        The system's or scene's name.
    t
        (n,) times in s.
    states
        Path of each storage port -> (n,) of scalars, (n, 7) of poses (quaternion, position), (n, 6) of body momenta,
        (n, d) coordinates of relative poses.
    ledgers
        Makes or reads the energies, heat, work and entropies.
    stats
        Counts and times of the run.
    problem
        The solved problem; None if a file could not store it.
    labels
        Names and units of the components of each state.
    inputs
        Prescribed values at outer ports, for solutions from files; None if the problem has them.
    audited
        Makes or reads the audit of the run; None without one.
    """

    def __init__(
        self,
        name: str,
        t: Array,
        states: Mapping[Path, Array],
        ledgers: Callable[[], Ledgers],
        stats: Mapping[str, Any],
        problem: Problem | None,
        labels: Mapping[Path, Labels],
        inputs: Mapping[Path, DatasetVariable] | None = None,
        audited: Callable[[], Audit] | None = None,
    ) -> None:
        self.name, self.t, self.states, self._ledgers = name, t, states, ledgers
        self.stats, self.problem, self.labels, self._inputs = stats, problem, labels, inputs
        self._audited = audited

    @overload
    def __getitem__(self, path: str | Path) -> Array: ...
    @overload
    def __getitem__(self, path: slice) -> "Solution": ...

    def __getitem__(self, path: str | Path | slice) -> "Array | Solution":
        """The state at a port of a storage component; of a slice, the solution at these of its instants.

        Raises
        ------
        KeyError
            No such state; the message tells those that are near, or lie below, or all.
        """
        if isinstance(path, slice):
            return self._at(path)
        key = Path.of(path)
        if key not in self.states:
            raise KeyError(f"{path}: no such state; {near_states(key, list(self.states))}")
        return self.states[key]

    def _at(self, where: slice) -> "Solution":
        totals: dict[str, Any] = {}
        for field in fields(self.ledgers):
            book = getattr(self.ledgers, field.name)
            if isinstance(book, Mapping):
                totals[field.name] = {path: values[where] for path, values in book.items()}
            elif isinstance(book, np.ndarray):
                totals[field.name] = book[where]
        inputs = {path: replace(given, values=given.values[where]) for path, given in self.inputs.items()}
        states = {path: values[where] for path, values in self.states.items()}
        ledgers = replace(self.ledgers, **totals)
        data = self.stats, self.problem, self.labels, inputs, self._audited
        return Solution(self.name, self.t[where], states, lambda: ledgers, *data)

    def __len__(self) -> int:
        return int(self.t.size)

    def __contains__(self, path: str | Path) -> bool:
        """Whether there is a state at this path."""
        return path in self.states or str(path) in map(str, self.states)

    def __iter__(self) -> Iterator[Path]:
        return iter(self.states)

    def __repr__(self) -> str:
        span = f"{self.t[0]:g} … {self.t[-1]:g} s, {len(self)} instants" if len(self) else "empty"
        return f"Solution of {self.name}: {span}, {len(self.states)} states"

    def _repr_html_(self) -> str:  # pyright: ignore[reportUnusedFunction] - notebooks call it
        from ephs.show.notebook import solution_html

        return solution_html(self)

    @property
    def events(self) -> tuple[Crossing, ...]:
        """The events in order of time: name, time in s, states."""
        return tuple(map(Crossing.of_record, self.stats.get("events", ())))

    @cached_property
    def ledgers(self) -> Ledgers:
        """Energies, heat, work and entropies."""
        return self._ledgers()

    @cached_property
    def audit(self) -> Audit:
        """Findings of the audit; empty for a solution without one."""
        return Audit() if self._audited is None else self._audited()

    @cached_property
    def inputs(self) -> Mapping[Path, DatasetVariable]:
        """Prescribed values at each outer port, with names and units: ``.values`` (n, d)."""
        if self._inputs is not None or self.problem is None:
            return self._inputs or {}
        return sampled_inputs(self.problem, self.t, self.state_at if self.linked is None else self.linked.state)

    @property
    def energy(self) -> Array:
        """(n,) energy of the whole system in J, environment included."""
        return self.ledgers.energy

    @property
    def exergy(self) -> Array:
        """(n,) exergy of the storages in J."""
        return self.ledgers.exergy

    @property
    def entropy(self) -> Array:
        """(n,) entropy of the whole system in J/K, environment included."""
        return self.ledgers.entropy

    @property
    def heat(self) -> Array:
        """(n,) heat of friction and damping since the start, in J."""
        return self.ledgers.heat

    @property
    def work(self) -> Array:
        """(n,) energy supplied through outer ports since the start, in J."""
        return self.ledgers.work

    @property
    def kinetic(self) -> Array:
        """(n,) energy in J of the storages that hold momenta, or fluxes other than those of permanent magnets."""
        return self.ledgers.kinetic

    @property
    def potential(self) -> Array:
        """(n,) energy in J of the storages that hold neither momenta nor entropies, and of permanent magnets."""
        return self.ledgers.potential

    @cached_property
    def energy_error(self) -> Array:
        """(n,) defect of the energy balance, relative to the largest ``K + |V − V₀| + |heat| + |work|`` of the run."""
        return self.ledgers.defect(mechanical=self.problem is not None and self.problem.mechanical)

    @property
    def entropy_production(self) -> Array:
        """(n,) least entropy production of an irreversible component in the step before, in J/K."""
        return self.ledgers.least

    @cached_property
    def constraint_error(self) -> Array:
        """(n,) largest position residual of any joint, in m or rad; zero for systems without joints."""
        return np.zeros(len(self)) if self.linked is None else self.linked.constraint_error()

    @cached_property
    def velocity_error(self) -> Array:
        """(n,) largest residual of the reported velocities, in m/s or rad/s; zero for systems without joints."""
        return np.zeros(len(self)) if self.linked is None else self.linked.velocity_error()

    @property
    def system(self) -> System | None:
        """The system, None where a file could not hold it."""
        return None if self.problem is None else self.problem.system

    @property
    def scene(self) -> Any:
        """The scene, None for a system that is not one."""
        return None if self.problem is None else self.problem.scene

    @cached_property
    def motion(self) -> MechanicalMotion | None:
        """The motion in the terms of mechanics, None for a system that is not a scene."""
        return None if self.problem is None or self.problem.motion is None else self.problem.motion(self)

    def body(self, name: str) -> Any:
        """The motion of a body: position, quaternion, rotation, velocity, angular_velocity.

        Bodies and joints of a system that is not a scene are known by the paths of their boxes.

        Raises
        ------
        TypeError
            There are no bodies.
        """
        return (self.linked or self._moving("bodies")).body(name)

    def joint(self, name: str) -> Any:
        """The motion of a joint: coordinate, rate, wrench."""
        return (self.linked or self._moving("joints")).joint(name)

    @cached_property
    def linked(self) -> Outlined | None:
        """The motion of bodies and joints, of a scene or of a system that has them; None where there are none."""
        if self.motion is not None:
            return self.motion
        return None if self.problem is None or self.problem.linked is None else self.problem.linked(self)

    @cached_property
    def outline(self) -> Any:
        """Bodies and joints to be drawn: the scene, or those of a system as one; None where there are none."""
        return None if self.linked is None else self.linked.outline()

    def temperature(self, path: str | Path) -> Array:
        """(n,) temperature in K of a storage of heat, by the path of its box or of its entropy; of an environment θ₀.

        Raises
        ------
        KeyError
            No storage with one entropy lies there; the message lists those that there are.
        """
        from ephs.solve.result.temperatures import temperature_at

        return temperature_at(self, Path.of(path))

    @property
    def freedoms(self) -> Mapping[str, Labels]:
        """Names and units of the coordinates of each joint, by its name, or in a system by the path of its box."""
        return {} if self.linked is None else self.linked.freedoms

    def thermal(self, name: str) -> Any:
        """The temperature of a thermal node."""
        return self._moving("thermal nodes").thermal(name)

    def marker(self, name: str) -> Any:
        """The motion of a marker: position and velocity in the world."""
        return self._moving("markers").marker(name)

    def contact(self, name: str) -> Any:
        """The motion of a contact: gap, force, slip and heat."""
        return self._moving("contacts").contact(name)

    def beam(self, name: str) -> Any:
        """The motion of a beam: nodes, strains, forces, moments and energy."""
        return self._moving("beams").beam(name)

    def shell(self, name: str) -> Any:
        """The motion of a shell: nodes, energy, and of scenes membrane and transverse forces and moments."""
        return (self.linked or self._moving("shells")).shell(name)

    def point(self, body: str, xyz: "ArrayLike") -> Array:
        """(n, 3) world position of a point of the body's frame."""
        motion = self.body(body)
        return motion.position + motion.rotation @ np.asarray(xyz, dtype=float)

    def ledger(self, path: str | Path = ROOT) -> LedgerEntry:
        """The ledger of a component, a subsystem, or everything; ``.parts`` are the ledgers one level below.

        Raises
        ------
        KeyError
            No storage and no irreversible component lies there.
        """
        found = entry_of(self.ledgers, Path.of(path))
        if found is None:
            known = ", ".join(map(str, {**self.ledgers.storages, **self.ledgers.makers}))
            raise KeyError(f"{path}: no storage and no irreversible component there; those that keep one are {known}")
        return found

    def state_at(self, i: int) -> dict[Path, Array]:
        """The states at the i-th instant, as they are stored: relative poses as elements of their group."""
        slots = () if self.problem is None else self.problem.descriptor.states
        return {slot.path: slot.element(np.atleast_1d(self.states[slot.path][i])) for slot in slots}

    def port(self, path: str | Path) -> "PortMotion":
        """Flow, effort and power at an outer power port, by the continuous relations at each instant.

        Raises
        ------
        KeyError
            There is no such port; the message lists those that there are.
        """
        from ephs.solve.result.ports import port_motion

        return port_motion(self, Path.of(path))

    def summary(self) -> dict[str, Any]:
        """The values of ``summary.json``."""
        from ephs.solve.result.summary import summary_of

        return summary_of(self)

    def to_xarray(self, *, wrenches: bool = True) -> "xr.Dataset":
        """States, ledgers, inputs and what is derived from them, over ``t``, with names and units of all components.

        States are under ``state:PATH``, ledgers under their names, inputs under ``input:PORT``; of a scene there are
        ``body_position``, ``body_quaternion``, ``body_velocity``, ``body_twist``, ``coordinate:JOINT``, ``rate:JOINT``,
        ``joint_wrench``, ``temperature``, ``marker_position`` and ``marker_velocity``.

        Parameters
        ----------
        wrenches
            Whether the joints' wrenches are among them: they take longest.
        """
        from ephs.solve.result.dataset import dataset

        return dataset(self, wrenches=wrenches)

    def save(self, path: str | File, *, wrenches: bool = False) -> None:
        """Write a netCDF file, which `load_solution` reads back bit by bit and xarray opens.

        Parameters
        ----------
        wrenches
            Whether the joints' wrenches are written for other readers; `load_solution` finds them again by itself.
        """
        from ephs.solve.result.file import save

        save(self, File(path), wrenches=wrenches)

    def plot(self, kind: str = "motion", *arguments: Any, **options: Any) -> "Figure":
        """A matplotlib figure that shows itself in notebooks: of the motion, or of another `kind`.

        Kinds are motion, signals, phase, energy, exergy, entropy, flow, constraints, wrenches and mechanism; the
        functions of `ephs.show` with these names, as ``plot_phase``, document their options:
        ``sol.plot("signals", "joints.bearing.rate", "energy")``.

        Raises
        ------
        ShowError
            There is no such kind, or this solution has nothing of it.
        """
        from ephs.show import plot

        return plot(self, kind, *arguments, **options)

    def animate(self, path: str | File | None = None, **options: Any) -> "Page":
        """One self-contained HTML page with the moving mechanism, which shows itself in notebooks.

        Parameters
        ----------
        path
            Where to write the page, if anywhere.
        options
            Those of `ephs.show.animate`: ``wrenches=True`` draws joint forces and moments as arrows,
            ``colour="temperature"`` or ``"energy"`` colours parts, ``fps`` and ``duration`` say how it plays.
        """
        from ephs.show import animate

        return animate(self, path, **options)

    def _moving(self, what: str) -> MechanicalMotion:
        if self.motion is None:
            read = "states are read as sol['path'], temperatures as sol.temperature('path')"
            raise TypeError(f"{self.name} is not a scene, it has no {what}; {read}")
        return self.motion
