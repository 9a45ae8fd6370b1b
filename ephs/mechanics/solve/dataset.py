"""Solutions as labelled arrays: named dimensions, names of components, units."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.solve.labels import Labels, power_labels
from ephs.mechanics.solve.ledger import Ledgers
from ephs.mechanics.solve.problem import Problem, State
from ephs.operad import Path
from ephs.semantics.bundle import Array

if TYPE_CHECKING:
    import xarray as xr

    from ephs.mechanics.solve.solution import Solution

__all__ = ["FORMAT", "Variable", "dataset", "sampled_inputs"]

FORMAT = 3
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
    "entropies": ("J/K", "entropy"),
    "volumes": ("m³", "volume"),
    "momenta": ("N s", "momentum"),
    "exergies": ("J", "exergy"),
}


@final
@dataclass(frozen=True, slots=True, eq=False)
class Variable:
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

    @classmethod
    def of(cls, values: Array, labels: Labels, says: str) -> "Variable":
        """Of a state's values."""
        axes = ((labels.dimension, labels.names),) if values.ndim > 1 else ()
        return cls(values, labels.unit, says, axes)


def dataset(solution: "Solution", *, wrenches: bool = True) -> "xr.Dataset":
    """States under ``state:PATH``, ledgers under their names, inputs under ``input:PORT``, and what is derived."""
    import xarray as xr

    variables = dict(_variables(solution))
    if solution.motion is not None:
        variables |= solution.motion.variables(wrenches=wrenches)
    coordinates: dict[str, Any] = {"t": ("t", solution.t, {"units": "s", "long_name": "time"})}
    entries: dict[str, Any] = {}
    for name, variable in variables.items():
        coordinates |= {axis: (axis, np.array(names, dtype=object)) for axis, names in variable.axes}
        attributes = {"units": variable.units, "long_name": variable.says}
        entries[name] = (("t", *[axis for axis, _ in variable.axes]), variable.values, attributes)
    attributes = {
        "ephs_format": FORMAT,
        "name": solution.name,
        "reference_temperature": solution.ledgers.temperature,
        "stats": json.dumps(dict(solution.stats)),
        "model": solution.problem.document if solution.problem is not None else "",
    }
    return xr.Dataset(entries, coordinates, attributes)


def _variables(solution: "Solution") -> Iterable[tuple[str, Variable]]:
    for path, values in solution.states.items():
        yield f"state:{path}", Variable.of(values, solution.labels[path], f"state at {path}")
    for name, values in _books(solution.ledgers):
        group, _, path = name.partition(":")
        units, says = _LEDGERS[group]
        yield name, Variable(values, units, f"{says} of {path}" if path else says)
    yield "energy", Variable(solution.energy, "J", "energy of everything")
    yield "energy_error", Variable(solution.energy_error, "1", "relative defect of the energy balance")
    yield "constraint_error", Variable(solution.constraint_error, "m, rad", "largest position residual of a joint")
    yield "velocity_error", Variable(solution.velocity_error, "m/s, rad/s", "largest velocity residual of a joint")
    yield from ((f"input:{path}", variable) for path, variable in solution.inputs.items())


def _books(ledgers: Ledgers) -> Iterable[tuple[str, Array]]:
    for entry in fields(ledgers):
        value = getattr(ledgers, entry.name)
        if isinstance(value, Mapping):
            yield from ((f"{entry.name}:{path}", values) for path, values in value.items())
        elif isinstance(value, np.ndarray):
            yield entry.name, value


def sampled_inputs(problem: Problem, t: Array, state: Callable[[int], State]) -> dict[Path, Variable]:
    """What is prescribed at each outer port, at some instants; ``state(i)`` gives the states that inputs read."""
    out: dict[Path, Variable] = {}
    states = [state(i) for i in range(t.size)] if not problem.constant else [{}] * t.size
    for slot in problem.descriptor.outer:
        if (signal := problem.signals.get(slot.path)) is not None:
            labels = power_labels(slot.quantity, effort=signal.effort)
            rows = [signal.at(float(time), now) for time, now in zip(t, states, strict=True)]
            values = np.array(rows, dtype=float).reshape(t.size, slot.quantity.space.dim)
            out[slot.path] = Variable.of(values, labels, f"{'effort' if signal.effort else 'flow'} at {slot.path}")
    return out
