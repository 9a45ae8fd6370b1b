"""Solutions as netCDF files."""

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path as File
from typing import Any

import numpy as np
import xarray as xr

from ephs.mechanics.solve.ledger import Ledgers
from ephs.mechanics.solve.problem import Problem
from ephs.mechanics.solve.solution import Solution
from ephs.operad import Path
from ephs.semantics.bundle import Array

__all__ = ["dataset", "load", "save"]

FORMAT = 2
_BOOKS = ("storages", "makers", "entropies", "volumes", "momenta", "exergies")
_UNITS = {
    "entropy": "J/K",
    "made": "J/K",
    "least": "J/K",
    "makers": "J/K",
    "entropies": "J/K",
    "volumes": "m³",
    "momenta": "N s",
}


def dataset(solution: Solution) -> xr.Dataset:
    """States under ``state:PATH``, ledgers under their names, all over ``t``."""
    variables: dict[str, Any] = {}
    for path, values in solution.states.items():
        dims = ("t",) if values.ndim == 1 else ("t", f"dim{values.shape[1]}")
        variables[f"state:{path}"] = (dims, values)
    for name, values in _ledgers(solution.ledgers):
        variables[name] = (("t",), values, {"units": _UNITS.get(name.split(":")[0], "J")})
    attributes = {
        "ephs_format": FORMAT,
        "name": solution.name,
        "reference_temperature": solution.ledgers.temperature,
        "stats": json.dumps(dict(solution.stats)),
        "model": solution.problem.document if solution.problem is not None else "",
    }
    return xr.Dataset(variables, {"t": ("t", solution.t, {"units": "s"})}, attributes)


def save(solution: Solution, path: File) -> None:
    """Write a solution; an older file of that name stays whole until the new one is."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        dataset(solution).to_netcdf(temporary, engine="h5netcdf")
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def load(path: str | File, problem_of: Callable[[str], Problem]) -> Solution:
    """Read a solution; ``problem_of`` makes the problem from the model's text.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    ValueError
        The file is not a solution of this program.
    """
    file = File(path)
    if not file.exists():
        raise FileNotFoundError(f"{file}: no such file")
    try:
        with xr.open_dataset(file, engine="h5netcdf") as opened:
            data = opened.load()
    except OSError as error:
        raise ValueError(f"{file}: not a netCDF file ({error})") from error
    if data.attrs.get("ephs_format") != FORMAT:
        raise ValueError(f"{file}: ephs_format is {data.attrs.get('ephs_format')!r}, expected {FORMAT}")
    books: dict[str, Any] = {name: {} for name in _BOOKS}
    states: dict[Path, Array] = {}
    plain: dict[str, Any] = {}
    for key, variable in data.data_vars.items():
        group, _, rest = str(key).partition(":")
        if group == "state":
            states[Path.of(rest)] = variable.values
        elif rest:
            books[group][Path.of(rest)] = variable.values
        else:
            plain[group] = variable.values
    model = data.attrs["model"]
    return Solution(
        data.attrs["name"],
        np.asarray(data["t"].values),
        states,
        Ledgers(**plain, **books, temperature=float(data.attrs["reference_temperature"])),
        json.loads(data.attrs["stats"]),
        problem_of(model) if model else None,
    )


def _ledgers(ledgers: Ledgers) -> list[tuple[str, Array]]:
    out: list[tuple[str, Array]] = []
    for field in fields(ledgers):
        value = getattr(ledgers, field.name)
        if isinstance(value, Mapping):
            out += [(f"{field.name}:{path}", values) for path, values in value.items()]
        elif isinstance(value, np.ndarray):
            out.append((field.name, value))
    return out
