"""Numbers brought to their full shape, with the faults that only show in the numbers themselves."""

from typing import Any

import numpy as np

from ephs.mechanics.scene.checked import Checked
from ephs.mechanics.scene.errors import shown
from ephs.mechanics.scene.rotations import TOLERANCE as UNIT
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import symmetric_eigenvalues

TOLERANCE = 1e-9


def quaternion(table: Checked[Any]) -> Array:
    """A unit quaternion; None is the identity. Up to 1e-6 off unit length it is normalised, else it is a fault."""
    values = table.entry.rotation
    q = np.array([1.0, 0.0, 0.0, 0.0] if values is None else values, dtype=np.float64)
    size = float(np.linalg.norm(q))
    if abs(size - 1.0) > UNIT:
        table.fault("quaternion", "rotation", f"{shown(values)} of norm {size:.9g}")
        return np.array([1.0, 0.0, 0.0, 0.0])
    return q / size


def pose(table: Checked[Any]) -> Array:
    """The pose (7,) of a table with a position and a rotation; None means 0 or the identity."""
    return np.concatenate((quaternion(table), table.entry.position or [0.0, 0.0, 0.0]))


def freedoms(table: Checked[Any], key: str, d: int, *, spread: bool = False) -> Array:
    """One number per degree of freedom, from a number or a list at a key.

    A number stands for each degree of freedom where ``spread`` is set; else only for a single one, apart from 0.
    """
    value = getattr(table.entry, key)
    wrong = len(value) != d if isinstance(value, list) else d != 1 and not spread and value != 0.0
    if wrong:
        few = {0: "no number: this joint has no degree of freedom", 1: "1 number"}
        table.fault("length", key, what=few.get(d, f"a list of {d} numbers, one per degree of freedom"))
    if isinstance(value, list):
        return np.zeros(d) if wrong else np.array(value, dtype=np.float64)
    return np.full(d, float(value))


def friction(table: Checked[Any], key: str, d: int) -> Array:
    """The friction matrix (d, d), from a number, one per degree of freedom, or a symmetric matrix at a key."""
    value = getattr(table.entry, key)
    array = np.zeros(0) if value == [] or _ragged(value) else np.array(value, dtype=np.float64)
    if array.ndim == 0:
        matrix = float(array) * np.eye(d)
    elif array.shape == (d,):
        matrix = np.diag(array)
    elif array.shape == (d, d):
        matrix = array
    else:
        table.fault("friction shape", key, d=d)
        return np.zeros((d, d))
    scale = float(np.abs(matrix).max(initial=0.0))
    if scale and np.abs(matrix - matrix.T).max() > TOLERANCE * scale:
        table.fault("friction asymmetric", key)
    elif scale and symmetric_eigenvalues(matrix)[0] < -TOLERANCE * scale:
        table.fault("friction sign", key)
    return 0.5 * (matrix + matrix.T)


def _ragged(value: Any) -> bool:
    return isinstance(value, list) and len({len(row) if isinstance(row, list) else -1 for row in value}) > 1
