"""Constant Dirac structures f = L e + Cᵀ λ, 0 = C e, decided.

A float is a rational number, so a condition holds of the numbers as given, or it does not. What fails may hold of the
decimals as they are written (0.1 + 0.2 − 0.3), or up to the rounding of each single number; then it is proved, too. A
defect within the rounding of other numbers *of the same units*, as products of matrices leave it, is neither proved nor
refuted: the verdict is "searched". Anything larger is refuted, however large the numbers beside it are. One case is
left to `checks`, whose tolerance is that of the whole structure: time reversal where rows of C mix parities.
"""

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from ephs.semantics.bundle import Array, Reference
from ephs.semantics.errors import StructureError
from ephs.semantics.meaning.components import process
from ephs.semantics.meaning.fields import ROUNDED, Rational, as_written
from ephs.semantics.meaning.linear import LinearRelation
from ephs.semantics.spaces.rank import TINY
from ephs.semantics.verdicts.checks import FLAGS, STATEMENTS
from ephs.semantics.verdicts.trials import Trial
from ephs.semantics.verdicts.verdict import Condition

if TYPE_CHECKING:
    from ephs.semantics.primitives import Reversible

BESIDE = 8.0 * ROUNDED
"""Rounding that products of matrices leave, relative to the largest number of the same units."""
READINGS: Mapping[str, Callable[[float], Fraction]] = {
    "as given": Fraction,
    "as written in decimals": as_written,
}
"""Rational number of a float, by the name of the reading; the first one is exact."""
OF_UNITS = "up to the rounding of numbers of the same units"


def decided(reversible: "Reversible") -> tuple[Condition, ...]:
    """The conditions on a reversible primitive that reads no state.

    Raises
    ------
    StructureError
        One is refuted, with the entry that does.
    """
    skew, constraint = (np.asarray(matrix, dtype=float) for matrix in reversible.structure({}))
    isotropic, conserved, mirrored, turned = STATEMENTS["reversible"]
    return (
        _isotropy(reversible, isotropic, skew),
        _conservation(reversible, conserved, skew, constraint),
        *(() if reversible.reversed_field else (_parity(reversible, mirrored, skew, constraint),)),
        Condition(turned, True, "no rotation is read"),
    )


def _isotropy(reversible: "Reversible", statement: str, skew: Array) -> Condition:
    """L + Lᵀ = 0, entry by entry; as it is of two numbers each, decimals say the same as the numbers given."""
    defect = np.abs(skew + skew.T)
    if not defect.any():
        return _proved(statement, "as given")
    own = ROUNDED * np.maximum(np.abs(skew), np.abs(skew.T))
    np.fill_diagonal(own, 0.0)
    if np.all(defect <= own):
        return _proved(statement, "up to the rounding of each number")
    beside = BESIDE * _beside(reversible, skew)
    return _searched(reversible, statement, "isotropy", skew + skew.T, np.maximum(beside, beside.T))


def _conservation(reversible: "Reversible", statement: str, skew: Array, constraint: Array) -> Condition:
    """L w = 0 and C w = 0 of the amounts w of each charge, row by row."""
    how: list[str] = []
    of_rows = np.broadcast_to(np.abs(constraint).max(axis=1, keepdims=True, initial=0.0), constraint.shape)
    proved, largest = True, np.concatenate([_beside(reversible, skew), of_rows])
    for kind in reversible.bundle.charges:
        amounts = reversible.bundle.indicator(kind)
        rows = np.concatenate([skew, constraint])
        reading = next(
            (words for words, read in READINGS.items() if all(not _dot(row, amounts, read) for row in rows)), None
        )
        defect, own = rows @ amounts, ROUNDED * (np.abs(rows) @ np.abs(amounts))
        if reading is None and not np.all(np.abs(defect) <= own):
            off = np.abs(defect) / np.maximum(BESIDE * (largest @ np.abs(amounts)), TINY)
            if off.max() > 1.0:
                worst = int(np.argmax(off))
                raise _refuted(reversible, "conservation", float(defect[worst]), (worst,), quantity=kind)
            proved, reading = False, OF_UNITS
        how.append(f"{kind} {reading or 'up to the rounding of each number'}")
    return Condition(statement, proved, "decided: " + ", ".join(how) if how else "it has no port with a charge")


def _parity(reversible: "Reversible", statement: str, skew: Array, constraint: Array) -> Condition:
    """(f, e) ∈ D ⇔ (−ϵf, ϵe) ∈ D: by single entries where each row of C is of one parity, else as relations over ℚ."""
    parity = reversible.bundle.parity()
    alike = np.where(np.multiply.outer(parity, parity) > 0.0, skew, 0.0)
    pure = all(len(set(parity[row != 0.0])) <= 1 for row in constraint)
    if pure and not alike.any():
        return _proved(statement, "as given")
    mirrored = -parity[:, None] * skew * parity, constraint * parity
    for words, read in READINGS.items():
        one, other = (
            _without_multipliers(process(Rational(read), reversible.bundle, *each))
            for each in ((skew, constraint), mirrored)
        )
        if one.same(other):
            return _proved(statement, words)
    if pure:
        return _searched(reversible, statement, "parity", alike, BESIDE * _beside(reversible, skew))
    return Condition(statement, False, "both sides are equal up to the rounding of the whole structure")


def _without_multipliers(relation: LinearRelation) -> LinearRelation:
    """Equations in f and e alone."""
    return relation.onto(variable for variable in relation.variables if variable.role == "outer")


def _dot(row: Array, amounts: Array, read: Callable[[float], Fraction]) -> Fraction:
    pairs: Iterable[tuple[float, float]] = zip(row.tolist(), amounts.tolist(), strict=True)
    return sum((read(a) * read(b) for a, b in pairs if a and b), Fraction(0))


def _beside(reversible: "Reversible", matrix: Array) -> Array:
    """(n, n) the largest entry between ports of the same units, for each."""
    units = [quantity.unit for _, where, quantity in reversible.bundle.items() for _ in range(where.start, where.stop)]
    kinds = np.unique(units, return_inverse=True)[1] if units else np.zeros(0, dtype=int)
    largest = np.zeros((kinds.max(initial=-1) + 1,) * 2)
    np.maximum.at(largest, (kinds[:, None], kinds), np.abs(matrix))
    return largest[kinds[:, None], kinds]


def _proved(statement: str, words: str) -> Condition:
    return Condition(statement, True, f"decided: it holds of the numbers {words}")


def _searched(reversible: "Reversible", statement: str, kind: str, defect: Array, allowed: Array) -> Condition:
    """A condition whose defect is rounding beside numbers of the same units.

    Raises
    ------
    StructureError
        An entry of the defect is larger than is ``allowed`` there.
    """
    off = np.abs(defect) / np.maximum(allowed, TINY)
    if off.max(initial=0.0) <= 1.0:
        return Condition(statement, False, f"the numbers are off by {np.abs(defect).max():.1e}, {OF_UNITS}")
    entry = tuple(int(i) for i in np.unravel_index(int(np.argmax(off)), off.shape))
    raise _refuted(reversible, kind, float(defect[entry]), entry)


def _refuted(
    reversible: "Reversible", kind: str, found: float, entry: tuple[int, ...], **facts: object
) -> StructureError:
    witness = Trial({}, np.zeros(reversible.bundle.size), Reference()).witness(reversible, entry, found)
    facts = {"flag": FLAGS["reversible"], **facts} if kind == "parity" else facts
    return StructureError(kind, reversible.name, found=found, entry=entry, witness=witness, **facts)
