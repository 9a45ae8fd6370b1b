"""Solutions as labelled arrays: named dimensions, names of components, units."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.problem import Problem, State
from ephs.solve.result.labels import Labels, power_labels
from ephs.solve.result.ledger import Ledgers

if TYPE_CHECKING:
    import xarray as xr

    from ephs.solve.result.solution import Solution

FORMAT = 4
_LEDGERS = {
    "kinetic": ("J", "energy of what holds momenta or fluxes"),
    "potential": ("J", "energy of what holds neither momenta nor entropies"),
    "thermal": ("J", "energy of what holds entropies or volumes"),
    "environment": ("J", "energy of the reference environment"),
    "exergy": ("J", "exergy of the storages"),
    "entropy": ("J/K", "entropy, of the environment too"),
    "heat": ("J", "what friction and damping made since the start"),
    "work": ("J", "energy supplied since the start"),
    "supplied": ("J", "exergy supplied since the start"),
    "made": ("J/K", "entropy made since the start"),
    "least": ("J/K", "least entropy production of a component in the step before"),
    "storages": ("J", "energy"),
    "makers": ("J/K", "entropy made since the start"),
    "workers": ("J", "energy supplied over steps since the start"),
    "entropies": ("J/K", "entropy"),
    "volumes": ("m³", "volume"),
    "momenta": ("N s", "momentum"),
    "exergies": ("J", "exergy"),
}
_OF_ALL = {
    "energy": ("J", "energy of everything"),
    "energy_error": ("1", "relative defect of the energy balance"),
    "constraint_error": ("m, rad", "largest position residual of a joint"),
    "velocity_error": ("m/s, rad/s", "largest velocity residual of a joint"),
}


@final
@dataclass(frozen=True, slots=True, eq=False)
class DatasetVariable:
    """An array over time, with what its other axes count.

    Parameters
    ----------
    values
        (n, ...).
    axes
        One for each axis but the first: a name, and the names of its entries.
    units, says
        Its unit, and what it is.
    """

    values: Array
    units: str
    says: str
    axes: tuple[tuple[str, tuple[str, ...]], ...] = field(default=())

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Names of all axes."""
        return ("t", *(axis for axis, _ in self.axes))

    @property
    def attributes(self) -> dict[str, str]:
        """Its unit and meaning under the names of the CF conventions."""
        return {"units": self.units, "long_name": self.says}

    @property
    def labels(self) -> Labels:
        """Names and units of the entries of a state, or of an input."""
        if not self.axes:
            return Labels("", (), (self.units,))
        ((dimension, names), *_), each, size = self.axes, self.units.split(", "), self.values.shape[1]
        return Labels(dimension, names, tuple(each if len(each) == size else each * size) or ("1",))

    @classmethod
    def of(cls, values: Array, labels: Labels, says: str) -> "DatasetVariable":
        """Variable of a state's values; no axis has the name of an array, as that of entropies would."""
        name = labels.dimension
        name += " 1" * (name in {"t", *_LEDGERS, *_OF_ALL})
        axes = ((name, labels.names),) if values.ndim > 1 else ()
        return cls(values, labels.unit, says, axes)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """A solution as arrays over time: variables by name, instants in s, attributes."""

    t: Array
    variables: dict[str, DatasetVariable]
    attributes: dict[str, Any]

    @property
    def axes(self) -> dict[str, tuple[str, ...]]:
        """Names of the entries of each axis but the time."""
        return {axis: names for variable in self.variables.values() for axis, names in variable.axes}


TIME = {"units": "s", "long_name": "time"}
"""Attributes of the instants."""


def content(solution: "Solution", *, wrenches: bool = True) -> Content:
    """States under ``state:PATH``, ledgers under their names, inputs under ``input:PORT``, and derived arrays."""
    variables = dict(_variables(solution))
    if solution.motion is not None:
        variables |= solution.motion.variables(wrenches=wrenches)
    attributes = {
        "ephs_format": FORMAT,
        "name": solution.name,
        "reference_temperature": solution.ledgers.temperature,
        "stats": json.dumps({**solution.stats, "audit": solution.audit.record()}),
        "model": solution.problem.document() if solution.problem is not None else "",
    }
    return Content(solution.t, variables, attributes)


def dataset(solution: "Solution", *, wrenches: bool = True) -> "xr.Dataset":
    """The `content` of a solution as labelled arrays."""
    import xarray as xr

    found = content(solution, wrenches=wrenches)
    coordinates: dict[str, Any] = {"t": ("t", found.t, TIME)}
    coordinates |= {axis: (axis, np.array(names, dtype=object)) for axis, names in found.axes.items()}
    entries = {
        name: (variable.dimensions, variable.values, variable.attributes) for name, variable in found.variables.items()
    }
    return xr.Dataset(entries, coordinates, found.attributes)


def _variables(solution: "Solution") -> Iterable[tuple[str, DatasetVariable]]:
    for path, values in solution.states.items():
        yield f"state:{path}", DatasetVariable.of(values, solution.labels[path], f"state at {path}")
    for name, values in _totals(solution.ledgers):
        group, _, path = name.partition(":")
        units, says = _LEDGERS[group]
        yield name, DatasetVariable(values, units, f"{says} of {path}" if path else says)
    for name, (units, says) in _OF_ALL.items():
        yield name, DatasetVariable(getattr(solution, name), units, says)
    yield from ((f"input:{path}", variable) for path, variable in solution.inputs.items())


def _totals(ledgers: Ledgers) -> Iterable[tuple[str, Array]]:
    for entry in fields(ledgers):
        value = getattr(ledgers, entry.name)
        if isinstance(value, Mapping):
            yield from ((f"{entry.name}:{path}", values) for path, values in value.items())
        elif isinstance(value, np.ndarray):
            yield entry.name, value


def sampled_inputs(problem: Problem, t: Array, state: Callable[[int], State]) -> dict[Path, DatasetVariable]:
    """Prescribed values at each outer port, at some instants; ``state(i)`` gives the states that inputs read."""
    out: dict[Path, DatasetVariable] = {}
    states = [state(i) for i in range(t.size)] if not problem.constant else [{}] * t.size
    for slot in problem.descriptor.outer:
        if (signal := problem.signals.get(slot.path)) is not None:
            labels = power_labels(slot.quantity, effort=signal.effort)
            rows = [signal.at(float(time), now) for time, now in zip(t, states, strict=True)]
            values = np.array(rows, dtype=float).reshape(t.size, slot.quantity.space.dim)
            out[slot.path] = DatasetVariable.of(
                values, labels, f"{'effort' if signal.effort else 'flow'} at {slot.path}"
            )
    return out
