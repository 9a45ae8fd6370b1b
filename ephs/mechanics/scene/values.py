"""Numbers brought to their full shape, with the faults that only show in the numbers themselves."""

from typing import Any

import numpy as np

from ephs.mechanics.scene.errors import Fault, fault, shown
from ephs.mechanics.scene.rotations import TOLERANCE as UNIT
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import symmetric_eigenvalues

TOLERANCE = 1e-9


def quaternion(values: list[float] | None, key: str, faults: list[Fault]) -> Array:
    """A unit quaternion; None is the identity. Up to 1e-6 off unit length it is normalised, else it is a fault."""
    if values is None:
        return np.array([1.0, 0.0, 0.0, 0.0])
    q = np.array(values, dtype=np.float64)
    size = float(np.linalg.norm(q))
    if abs(size - 1.0) > UNIT:
        faults.append(fault("quaternion", key, f"{shown(values)} of norm {size:.9g}"))
        return np.array([1.0, 0.0, 0.0, 0.0])
    return q / size


def pose(position: list[float] | None, rotation: list[float] | None, key: str, faults: list[Fault]) -> Array:
    """The pose (7,) of a position and a rotation; None means 0 or the identity."""
    return np.concatenate((quaternion(rotation, f"{key}.rotation", faults), position or [0.0, 0.0, 0.0]))


def freedoms(value: Any, d: int, key: str, faults: list[Fault], *, spread: bool = False, default: float = 0.0) -> Array:
    """One number per degree of freedom, from a number or a list.

    A number stands for each degree of freedom where ``spread`` is set; else only for a single one, apart from 0.
    """
    if value is None:
        return np.full(d, default)
    if isinstance(value, list):
        if len(value) != d:
            faults.append(fault("length", key, shown(value), what=_one_a_freedom(d)))
            return np.zeros(d)
        return np.array(value, dtype=np.float64)
    if d != 1 and not spread and value != 0.0:
        faults.append(fault("length", key, shown(value), what=_one_a_freedom(d)))
    return np.full(d, float(value))


def friction(value: Any, d: int, key: str, faults: list[Fault]) -> Array:
    """The friction matrix (d, d), from a number, one per degree of freedom, or a symmetric matrix."""
    array = np.zeros(0) if value == [] else np.zeros(0) if _ragged(value) else np.array(value, dtype=np.float64)
    if array.ndim == 0:
        matrix = float(array) * np.eye(d)
    elif array.shape == (d,):
        matrix = np.diag(array)
    elif array.shape == (d, d):
        matrix = array
    else:
        faults.append(fault("friction shape", key, shown(value), d=d))
        return np.zeros((d, d))
    scale = float(np.abs(matrix).max(initial=0.0))
    if scale and np.abs(matrix - matrix.T).max() > TOLERANCE * scale:
        faults.append(fault("friction asymmetric", key, shown(value)))
    elif scale and symmetric_eigenvalues(matrix)[0] < -TOLERANCE * scale:
        faults.append(fault("friction sign", key, shown(value)))
    return 0.5 * (matrix + matrix.T)


def _ragged(value: Any) -> bool:
    return isinstance(value, list) and len({len(row) if isinstance(row, list) else -1 for row in value}) > 1


def _one_a_freedom(d: int) -> str:
    few = {0: "no number: this joint has no degree of freedom", 1: "1 number"}
    return few.get(d, f"a list of {d} numbers, one per degree of freedom")
