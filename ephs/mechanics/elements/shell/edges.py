"""Edges of shells as one staged program: logarithms of relative poses, their derivatives, and those of their efforts.

With d = log(a⁻¹b) and the twists u of the sections a, b in their own axes, ḋ = dexp⁻¹(−d) u_b − dexp⁻¹(d) u_a. A stress
n does the work nᵀḋ, so the efforts at the sections are the transposes of these rows times n. Dual numbers over d give
the derivatives of the efforts at constant n.
"""

from functools import cache
from typing import Final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import se3
from ephs.semantics.spaces.vectors import Entries, Rows, apply_transposed, scale
from ephs.semantics.stage import Duals, Entry, Evaluator, Integer, Matrix, Program, Real, matrix

SIZE: Final = 72
"""Numbers of a matrix of an edge, with 6 rows or columns for its logarithm and 12 for the twists of both ends."""


def rates(on: Evaluator, d: Entries) -> Rows:
    """(6, 12) derivative of an edge's logarithm by the twists of its two sections."""
    first, second = se3.dexp_inv(on, d), se3.dexp_inv(on, scale(-1.0, d))
    return [[*scale(-1.0, one), *other] for one, other in zip(first, second, strict=True)]


def _logarithms(on: Evaluator, starts: Matrix, ends: Matrix, logs: Matrix) -> None:
    """Write log(a⁻¹b) of sections (n, 7) at the starts and ends of edges."""

    def each_row(k: Integer) -> None:
        a, b = ([poses[k, i] for i in range(7)] for poses in (starts, ends))
        for i, value in enumerate(se3.increment(on, a, b)):
            logs[k, i] = value

    on.loop(logs.rows, each_row)


def _slopes(on: Evaluator, logs: Matrix, stresses: Matrix, by: Matrix, bends: Matrix) -> None:
    """Write the derivatives (n, 6·12) of logarithms by twists, and those (n, 12·6) of the efforts by logarithms."""
    duals = Duals(on)

    def each_row(k: Integer) -> None:
        d = [logs[k, i] for i in range(6)]
        for i, row in enumerate(rates(on, d)):
            for j, entry in enumerate(row):
                by[k, 12 * i + j] = entry

        def along(way: Integer) -> None:
            moved: list[Real] = [duals.dual(d[i], (on.select(on.same(way, i), 1.0, 0.0),)) for i in range(6)]
            efforts = apply_transposed(rates(duals, moved), [duals.dual(stresses[k, i]) for i in range(6)])
            for j, effort in enumerate(efforts):
                bends[k, 6 * j + way] = duals.dual(effort).slopes[0]

        on.loop(6, along)

    on.loop(logs.rows, each_row)


@cache
def edge_program() -> Program:
    """The program of the edges of all shells."""
    wide = {"logs": matrix(6), "stresses": matrix(6), "by": matrix(SIZE), "bends": matrix(SIZE)}
    return Program(
        "shell_edges",
        logarithms=Entry(_logarithms, starts=matrix(7), ends=matrix(7), logs=matrix(6)),
        slopes=Entry(_slopes, **wide),
    )


def logarithms(starts: Array, ends: Array) -> Array:
    """(n, 6) log(a⁻¹b) of poses (n, 7)."""
    found = np.empty((len(starts), 6))
    edge_program().compiled()["logarithms"](np.ascontiguousarray(starts), np.ascontiguousarray(ends), found)
    return found


def slopes(logs: Array, stresses: Array) -> tuple[Array, Array]:
    """(n, 6, 12) derivatives of logarithms (n, 6) by twists; (n, 12, 6) those of efforts of stresses (n, 6) by logs."""
    by, bends = np.empty((len(logs), SIZE)), np.empty((len(logs), SIZE))
    edge_program().compiled()["slopes"](np.ascontiguousarray(logs), np.ascontiguousarray(stresses), by, bends)
    return by.reshape(-1, 6, 12), bends.reshape(-1, 12, 6)
