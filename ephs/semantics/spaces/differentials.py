"""Differentials of exponential maps on arrays, compiled, for calls from Python."""

from functools import cache
from typing import Final

import numpy as np

from ephs.semantics.spaces import codes
from ephs.semantics.spaces.manifold import Array
from ephs.semantics.spaces.staged_groups import STAGED, Differential
from ephs.semantics.spaces.vectors import scale
from ephs.semantics.stage import Entry, Evaluator, Matrix, Program, Vector, matrix, vector

DIMENSIONS: Final = {codes.SO3: 3, codes.SE2: 3, codes.SE3: 6, codes.SO3xR3: 6}
"""Dimensions of the groups that are not abelian."""


def _entry(differential: Differential, d: int) -> Entry:
    def left(on: Evaluator, v: Vector, out: Matrix) -> None:
        for i, row in enumerate(differential(on, scale(-1.0, [v[j] for j in range(d)]))):
            for j, entry in enumerate(row):
                out[i, j] = entry

    return Entry(left, v=vector(d), out=matrix(d))


@cache
def differentials() -> Program:
    """Return the program of the left-trivialised differentials of all groups, and of their inverses."""
    entries = {f"dexp_left_{code}": _entry(STAGED[code].dexp, d) for code, d in DIMENSIONS.items()}
    entries |= {f"dexp_left_inv_{code}": _entry(STAGED[code].dexp_inv, d) for code, d in DIMENSIONS.items()}
    return Program("differentials", **entries)


def dexp_left(code: int, v: Array) -> Array:
    """D, (dim, dim), with x⁻¹dx = D dv for x = x0·exp(v) in the group of a code."""
    return _differential("dexp_left", code, v)


def dexp_left_inv(code: int, v: Array) -> Array:
    """Inverse of `dexp_left`: the change of log(x0⁻¹x) = v that a left-trivialised dx makes."""
    return _differential("dexp_left_inv", code, v)


def _differential(name: str, code: int, v: Array) -> Array:
    out = np.eye(v.size)
    if code != codes.VECTOR:
        differentials().compiled()[f"{name}_{code}"](np.ascontiguousarray(v), out)
    return out
