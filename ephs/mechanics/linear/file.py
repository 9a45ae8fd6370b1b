"""Linear systems as files: JSON, NumPy's archives, netCDF."""

import json
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import OptionError

if TYPE_CHECKING:
    from ephs.mechanics.linear.statespace import StateSpace

_AXES = {
    "A": ("state", "state_rate"), "B": ("state", "input"), "C": ("output", "state"), "D": ("output", "input"),
    "J": ("state", "state_rate"), "R": ("state", "state_rate"), "Q": ("state", "state_rate"),
}  # fmt: skip


def save(system: "StateSpace", path: File) -> None:
    """Write a linear system; the file's ending chooses how.

    Raises
    ------
    OptionError
        There is no such format.
    """
    writers = {".json": _json, ".npz": _npz, ".nc": _netcdf}
    if path.suffix not in writers:
        raise OptionError("file", str(path), f"a name that ends in {', '.join(writers)}")
    matrices = {"A": system.A, "B": system.B, "C": system.C, "D": system.D}
    if system.structure is not None:
        matrices |= {"J": system.structure.J, "R": system.structure.R, "Q": system.structure.Q}
    path.parent.mkdir(parents=True, exist_ok=True)
    writers[path.suffix](system, matrices, path)


def _json(system: "StateSpace", matrices: dict[str, Array], path: File) -> None:
    modes = [
        {
            "eigenvalue": [mode.eigenvalue.real, mode.eigenvalue.imag],
            "frequency": mode.frequency,
            "damping": None if np.isnan(mode.damping) else mode.damping,
            "shape": {name: [value.real.tolist(), value.imag.tolist()] for name, value in mode.shape.items()},
        }
        for mode in system.modes
    ]
    document: dict[str, Any] = {
        "name": system.name,
        "states": system.states,
        "inputs": system.inputs,
        "outputs": system.outputs,
        **{key: matrix.tolist() for key, matrix in matrices.items()},
        "reason": system.reason,
        "modes": modes,
        "about": {key: value.tolist() for key, value in system.about.items()},
    }
    path.write_text(json.dumps(document, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _npz(system: "StateSpace", matrices: dict[str, Array], path: File) -> None:
    names: dict[str, Any] = {"states": system.states, "inputs": system.inputs, "outputs": system.outputs}
    arrays: dict[str, Any] = {key: np.array(value, dtype=np.str_) for key, value in names.items()}
    np.savez(path, **matrices, **arrays, eigenvalues=system.eigenvalues)


def _netcdf(system: "StateSpace", matrices: dict[str, Array], path: File) -> None:
    import xarray

    values = system.eigenvalues
    data = xarray.Dataset(
        {key: (_AXES[key], matrix) for key, matrix in matrices.items()}
        | {"eigenvalue_real": ("eigenvalue", values.real), "eigenvalue_imag": ("eigenvalue", values.imag)},
        coords={
            "state": list(system.states),
            "state_rate": list(system.states),
            "input": np.array(system.inputs, dtype=np.str_),
            "output": np.array(system.outputs, dtype=np.str_),
        },
        attrs={"name": system.name, "reason": system.reason},
    )
    data.to_netcdf(path, engine="h5netcdf")
