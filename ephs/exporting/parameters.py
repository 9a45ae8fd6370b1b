"""Numbers of an exported mechanism as functions of parameters of its model: polynomials of degree two, checked."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, final

import numpy as np

from ephs.exporting.errors import ExportError
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError
from ephs.solve.posing.errors import SolveError

NEAR = 0.25
"""Relative displacement of a parameter, of 1 where it is 0: above rounding and within ranges."""
EXACT = 1e-12
"""Largest error of a polynomial, relative to an array's largest number: rounding of some hundred operations."""
ROUNDED = 1e-15
"""Relative error of a coefficient that is rounding of a difference."""
Key = tuple[int, ...]


@final
@dataclass(frozen=True, slots=True)
class ParameterPolynomial:
    """A number of an array as a polynomial in the parameters' changes d, or as its reciprocal.

    Attributes
    ----------
    array, entry
        Number of the array, and place in it.
    constant
        The polynomial at the start.
    terms
        Coefficients by the parameters whose changes they multiply: (i,) for d_i, (i, j) for d_i d_j.
    reciprocal
        Whether the number is 1 over the polynomial, as an inverse mass is.
    """

    array: int
    entry: int
    constant: float
    terms: Mapping[Key, float]
    reciprocal: bool


def dependence(
    start: Mapping[str, float], arrays: Callable[[Mapping[str, float]], Sequence[Array]]
) -> list[ParameterPolynomial]:
    """Return the numbers that depend on parameters.

    Parameters
    ----------
    start
        The parameters at the start, by name.
    arrays
        The arrays that determine a run, at values of the parameters.

    Raises
    ------
    ExportError
        The arrays change their sizes, or some number is neither such a polynomial nor a reciprocal of one.
    """
    names, first = list(start), np.array(list(start.values()))
    moves = NEAR * np.where(first == 0.0, 1.0, np.abs(first))
    sizes = [each.size for each in arrays(start)]

    def numbers_at(shares: Array) -> Array:
        try:
            found = arrays(dict(zip(names, (first + shares * moves).tolist(), strict=True)))
        except StructureError as error:
            raise ExportError("structure", found=", ".join(names)) from error
        except SolveError as error:
            raise ExportError("start", found=", ".join(names), why=error.outcome.value) from error
        if [each.size for each in found] != sizes:
            raise ExportError("structure", found=", ".join(names))
        return np.concatenate([np.zeros(0), *(each.ravel() for each in found)])

    unit, rng = np.eye(len(names)), np.random.default_rng(1)
    pairs = list(combinations(range(len(names)), 2))
    base = numbers_at(0.0 * first)
    fitted = [*unit, *-unit, *(unit[i] + unit[j] for i, j in pairs)]
    held = [*(0.6 * unit), *rng.uniform(-1.0, 1.0, (2, len(names)))]
    seen, tried = np.array([numbers_at(shares) for shares in fitted]), np.array([numbers_at(shares) for shares in held])
    every = np.vstack([base, seen, tried])
    own, apart = np.abs(every).max(axis=0), np.abs(every - base)
    moving = np.flatnonzero(apart.max(axis=0) > EXACT * own).tolist()
    by_each = apart[1 : 1 + len(names)] > EXACT * own
    fits = {place: _either(base[place], seen[:, place], tried[:, place], held, pairs, own[place]) for place in moving}
    # what fits none may be rounding of larger numbers: of those that the same parameters move, and of no others
    fitted_size = np.array([[0.0 if fits[k] is None else own[k] for k in moving]]) * by_each[:, moving]
    out: list[ParameterPolynomial] = []
    of_array = np.repeat(np.arange(len(sizes)), sizes)
    inside = np.concatenate([np.zeros(0, dtype=int), *(np.arange(size) for size in sizes)])
    for place, fit in fits.items():
        if fit is None:
            movers = by_each[:, place] | ~by_each[:, place].any()
            scale = float(fitted_size[movers].max())
            fit = _either(base[place], seen[:, place], tried[:, place], held, pairs, scale)
        if fit is None:
            raise ExportError("polynomial", found=names[int(np.argmax(apart[1 : 1 + len(names), place]))])
        constant, terms, reciprocal = fit
        own_terms = {key: _short(value / np.prod(moves[list(key)])) for key, value in terms.items() if value}
        if own_terms:
            out.append(ParameterPolynomial(int(of_array[place]), int(inside[place]), constant, own_terms, reciprocal))
    return out


def _short(value: np.floating[Any]) -> float:
    """The number of few digits that a coefficient is but for rounding: with 1 + 2e-16, a friction of 0 is negative."""
    near = float(f"{value:.12g}")
    return near if abs(value - near) <= ROUNDED * abs(value) else float(value)


def _either(
    base: float, seen: Array, tried: Array, held: Sequence[Array], pairs: Sequence[tuple[int, int]], scale: float
) -> tuple[float, dict[Key, float], bool] | None:
    """Constant and coefficients of a polynomial, or (True) of the reciprocal of one; None where it is neither."""
    terms = _fit((base, seen, tried), held, pairs, scale)
    if terms is not None:
        return float(base), terms, False
    if min(abs(base), np.abs(seen).min(), np.abs(tried).min()) > 0.0:
        terms = _fit((1.0 / base, 1.0 / seen, 1.0 / tried), held, pairs, 1.0 / abs(base))
    return None if terms is None else (1.0 / base, terms, True)


def _fit(
    samples: tuple[float, Array, Array], held: Sequence[Array], pairs: Sequence[tuple[int, int]], scale: float
) -> dict[Key, float] | None:
    """Coefficients of a polynomial through samples at ±1 and at pairs of 1, None if it misses other samples."""
    base, seen, tried = samples
    count = (len(seen) - len(pairs)) // 2
    terms: dict[Key, float] = {}
    for i in range(count):
        more, less = seen[i], seen[count + i]
        terms[i,], terms[i, i] = 0.5 * (more - less), 0.5 * (more + less) - base
    for k, (i, j) in enumerate(pairs):
        terms[i, j] = seen[2 * count + k] - base - terms[i,] - terms[i, i] - terms[j,] - terms[j, j]
    terms = {key: value for key, value in terms.items() if abs(value) > EXACT * scale}
    found = [base + sum(value * np.prod(shares[list(key)]) for key, value in terms.items()) for shares in held]
    missed = np.abs(np.array(found) - tried).max()
    return terms if missed <= len(found) * EXACT * max(scale, np.abs(tried).max()) else None
