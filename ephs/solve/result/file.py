"""Solutions as netCDF files."""

import json
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from pathlib import Path as File
from typing import Any

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.solve.auditing.findings import Audit
from ephs.solve.posing.problem import Problem
from ephs.solve.result.dataset import FORMAT, TIME, Content, DatasetVariable, content
from ephs.solve.result.durable import durable
from ephs.solve.result.guard import MOST, name_for_file, name_from_file
from ephs.solve.result.labels import OWN, labels_of
from ephs.solve.result.ledger import Ledgers
from ephs.solve.result.omitted import AXES, REST, restored, shortened, with_zeros
from ephs.solve.result.solution import Solution

READ = (2, 3, FORMAT)
Inputs = Mapping[Path, Array]


def save(solution: Solution, path: File, *, wrenches: bool) -> None:
    """Write a solution; an older file of that name stays whole until the new one is."""

    found = shortened(solution, content(solution, wrenches=wrenches))
    with durable(path) as temporary:
        _write(found, temporary, "gzip")
        if sum(variable.values.nbytes for variable in found.variables.values()) > MOST / 2 * temporary.stat().st_size:
            _write(found, temporary, None)  # readers refuse what grows beyond measure


def _write(found: Content, path: File, compression: str | None) -> None:
    import h5netcdf
    import h5py

    text = h5py.string_dtype()
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"t": found.t.size, **{name_for_file(axis): len(names) for axis, names in found.axes.items()}}
        for axis, names in found.axes.items():
            file.create_variable(name_for_file(axis), (name_for_file(axis),), data=np.array(names, object), dtype=text)
        file.create_variable("t", ("t",), data=found.t).attrs.update(TIME)
        for name, variable in found.variables.items():
            dimensions = tuple(map(name_for_file, variable.dimensions))
            values, options = np.asarray(variable.values), {}
            if name == REST and compression is not None:
                options = {"compression": compression, "compression_opts": 1, "shuffle": True}
            written = file.create_variable(name_for_file(name), dimensions, data=values, dtype=values.dtype, **options)
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
    import h5py

    file = File(path)
    if not file.exists():
        raise FileNotFoundError(f"{file}: no such file")
    try:
        with h5py.File(file, "r") as opened:
            attributes = {key: _plain(value) for key, value in opened.attrs.items()}
            found = attributes.get("ephs_format")
            if found not in READ:
                raise ValueError(f"{file}: ephs_format is {found}, expected one of {', '.join(map(str, READ))}")
            groups = _groups(file, opened)
            t, rest = _values(opened["t"]), _rest(file, opened)
    except OSError as error:
        raise ValueError(f"{file}: not a netCDF file ({error})") from error
    states, inputs = groups.get("state", {}), groups.get("input", {})
    model, temperature = attributes["model"], float(attributes["reference_temperature"])
    problem = problem_of(model, t, {path: given.values for path, given in inputs.items()}) if model else None
    if problem is not None:
        labels = {slot.path: labels_of(slot.quantity) for slot in problem.descriptor.states}
    else:
        labels = {path: each.labels for path, each in states.items()}
    known, books = {path: each.values for path, each in states.items()}, _ledgers(groups, temperature)
    short = Solution(attributes["name"], t, known, lambda: books, {}, problem, labels, inputs)
    if problem is not None and problem.motion is not None:
        if rest:
            try:
                known = restored(known, rest, problem.motion(short).contact_poses())
            except KeyError as error:
                raise ValueError(f"{file}: {REST} or a state is of another model: {error.args[0]}") from error
        known = {slot.path: known[slot.path] for slot in problem.descriptor.states if slot.path in known}
        books = with_zeros(books, problem, t.size)
    elif problem is not None and t.size:  # a mechanism is read as it was solved: by its first instant
        problem = replace(problem, initial=short.state_at(0))
    stats = _stats(json.loads(attributes["stats"]), problem)
    found = Audit.of_record(stats.pop("audit", Audit().record()))
    return Solution(attributes["name"], t, known, lambda: books, stats, problem, labels, inputs, lambda: found)


def _rest(file: File, opened: Any) -> dict[Path, Array]:
    """Differences between relative poses and those computed from the bodies, by path."""
    if REST not in opened:
        return {}
    array = opened[REST]
    if array.ndim != 3 or array.shape[:2] != (opened["t"].size, len(AXES)) or not len(array.dims[2]):
        raise ValueError(f"{file}: {REST} has the shape {array.shape}, expected instants, {len(AXES)}, and named poses")
    names, values = array.dims[2][0], _values(array)
    if names.dtype.kind != "O":
        raise ValueError(f"{file}: {REST} has poses named by {names.dtype}, expected text")
    return {Path.of(path): values[:, :, i] for i, path in enumerate(map(str, names.asstr()[...]))}


def _groups(file: File, opened: Any) -> dict[str, dict[Path, DatasetVariable]]:
    """States, inputs and ledgers of a file by group and path; derived variables are not read."""
    known = {"state", "input", *(field.name for field in fields(Ledgers))}
    groups: dict[str, dict[Path, DatasetVariable]] = {}
    for key in opened:
        group, _, rest = name_from_file(key).partition(":")
        if group in known:
            groups.setdefault(group, {})[Path.of(rest) if rest else Path()] = _stored(file, key, opened[key])
    return groups


def _stored(file: File, key: str, array: Any) -> DatasetVariable:
    """A variable of a file."""
    units, says = (str(_plain(array.attrs.get(name, other))) for name, other in (("units", OWN), ("long_name", "")))
    if packed := {"scale_factor", "add_offset"}.intersection(array.attrs):
        raise ValueError(f"{file}: {name_from_file(key)} has the attribute {min(packed)}, expected unpacked numbers")
    if array.ndim == 1:
        return DatasetVariable(_values(array), units, says)
    scale = array.dims[1][0]
    text = scale.dtype.kind == "O"
    names = tuple(map(str, scale.asstr()[...] if text else range(array.shape[1])))
    return DatasetVariable(_values(array), units, says, ((name_from_file(str(scale.name).lstrip("/")), names),))


def _values(array: Any) -> Array:
    return np.asarray(array[...])


def _plain(value: Any) -> Any:
    """An attribute as a number or text; some writers store arrays of one entry, and bytes."""
    single = value.reshape(-1)[0] if isinstance(value, np.ndarray) and value.size == 1 else value
    return single.decode() if isinstance(single, bytes) else single


def _ledgers(groups: Mapping[str, Mapping[Path, DatasetVariable]], temperature: float) -> Ledgers:
    """Ledgers by path are groups; a single ledger has its name alone."""
    totals: dict[str, Any] = {}
    for field in fields(Ledgers):
        found = groups.get(field.name, {})
        whole = found.get(Path())
        totals[field.name] = {path: each.values for path, each in found.items()} if whole is None else whole.values
    return Ledgers(**{**totals, "temperature": temperature})


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
