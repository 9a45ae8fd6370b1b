"""Solutions as netCDF files."""

import json
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.solve.problem import Problem
from ephs.solve.result.dataset import FORMAT, TIME, Variable, content
from ephs.solve.result.durable import durable
from ephs.solve.result.guard import name_for_file, named_from_file
from ephs.solve.result.labels import Labels, labels_of
from ephs.solve.result.ledger import Ledgers
from ephs.solve.result.solution import Solution

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["load", "save"]

READ = (2, FORMAT)
Inputs = Mapping[Path, Array]


def save(solution: Solution, path: File, *, wrenches: bool) -> None:
    """Write a solution; an older file of that name stays whole until the new one is."""
    import h5netcdf
    import h5py

    found = content(solution, wrenches=wrenches)
    text = h5py.string_dtype()
    with durable(path) as temporary, h5netcdf.File(temporary, "w") as file:
        file.dimensions = {"t": found.t.size, **{name_for_file(axis): len(names) for axis, names in found.axes.items()}}
        for axis, names in found.axes.items():
            file.create_variable(name_for_file(axis), (name_for_file(axis),), data=np.array(names, object), dtype=text)
        file.create_variable("t", ("t",), data=found.t).attrs.update(TIME)
        for name, variable in found.variables.items():
            dimensions = tuple(map(name_for_file, variable.dimensions))
            values = np.asarray(variable.values)
            written = file.create_variable(name_for_file(name), dimensions, data=values, dtype=values.dtype)
            written.attrs.update(variable.attributes)
        file.attrs.update(found.attributes)


def load(path: str | File, problem_of: Callable[[str, Array, Inputs], Problem]) -> Solution:
    """Read a solution; ``problem_of`` makes the problem from the model's text, the times, and the inputs then.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    ValueError
        The file is not a solution of this program.
    """
    import xarray as xr

    file = File(path)
    if not file.exists():
        raise FileNotFoundError(f"{file}: no such file")
    try:
        with xr.open_dataset(file, engine="h5netcdf") as opened:
            data = named_from_file(opened.load())
    except OSError as error:
        raise ValueError(f"{file}: not a netCDF file ({error})") from error
    found = data.attrs.get("ephs_format")
    if found not in READ:
        raise ValueError(f"{file}: ephs_format is {found}, expected one of {', '.join(map(str, READ))}")
    groups: dict[str, dict[Path, xr.DataArray]] = {}
    for key, variable in data.data_vars.items():
        group, _, rest = str(key).partition(":")
        groups.setdefault(group, {})[Path.of(rest) if rest else Path()] = variable
    states = groups.get("state", {})
    inputs = {path: _variable(variable) for path, variable in groups.get("input", {}).items()}
    t = np.asarray(data["t"].values)
    model = data.attrs["model"]
    problem = problem_of(model, t, {path: given.values for path, given in inputs.items()}) if model else None
    if problem is not None:
        labels = {slot.path: labels_of(slot.quantity) for slot in problem.descriptor.states}
    else:
        labels = {path: _labels(variable) for path, variable in states.items()}
    return Solution(
        data.attrs["name"],
        t,
        {path: variable.values for path, variable in states.items()},
        _ledgers(groups, float(data.attrs["reference_temperature"])),
        _stats(json.loads(data.attrs["stats"]), problem),
        problem,
        labels,
        inputs,
    )


def _ledgers(groups: "Mapping[str, Mapping[Path, xr.DataArray]]", temperature: float) -> Ledgers:
    """Ledgers by path are groups; a single ledger has its name alone."""
    totals: dict[str, Any] = {}
    for field in fields(Ledgers):
        found = groups.get(field.name, {})
        whole = found.get(Path())
        totals[field.name] = {path: each.values for path, each in found.items()} if whole is None else whole.values
    return Ledgers(**{**totals, "temperature": temperature})


def _labels(variable: "xr.DataArray") -> Labels:
    units = str(variable.attrs.get("units", "SI"))
    if variable.ndim == 1:
        return Labels("", (), (units,))
    dimension, size = str(variable.dims[1]), variable.shape[1]
    names = variable.coords[dimension].values.tolist() if dimension in variable.coords else map(str, range(size))
    each = units.split(", ")
    return Labels(dimension, tuple(names), tuple(each if len(each) == size else each * size) or ("1",))


def _variable(variable: "xr.DataArray") -> Variable:
    return Variable.of(variable.values, _labels(variable), str(variable.attrs["long_name"]))


def _stats(stats: dict[str, Any], problem: Problem | None) -> dict[str, Any]:
    """Statistics, with the events of format 2, which are packed states, by path."""
    packed = [event for event in stats.get("events", ()) if "x" in event]
    if not packed:
        return stats
    if problem is None:
        return {**stats, "events": []}
    unpack = problem.descriptor.unpack
    events = [
        {
            "name": event["name"],
            "t": event["t"],
            "state": {str(path): np.atleast_1d(v).tolist() for path, v in unpack(np.array(event["x"])).items()},
        }
        for event in packed
    ]
    return {**stats, "events": events}
