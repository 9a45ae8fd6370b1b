"""Constant Dirac structures f = L e + Cᵀ λ, 0 = C e, decided.

A float is a rational number, so a condition holds of the numbers as given, or it does not. What fails may hold of the
decimals as they are written (0.1 + 0.2 − 0.3), or up to the rounding of each single number; then it is proved, too. A
defect within the rounding of other numbers *of the same units*, as products of matrices leave it, is neither proved nor
refuted: the verdict is "searched". Anything larger is refuted, however large the numbers beside it are. One case is
left to `checks`, whose tolerance is that of the whole structure: time reversal where rows of C mix parities.
"""

from typing import TYPE_CHECKING

import numpy as np

from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.meaning.components import constant_relation
from ephs.semantics.meaning.fields import ROUNDED, Rational
from ephs.semantics.spaces.rank import TINY
from ephs.semantics.verdicts.checks import FLAGS, STATEMENTS
from ephs.semantics.verdicts.claims import Claim, of_formulas
from ephs.semantics.verdicts.replay import READINGS, replayed
from ephs.semantics.verdicts.trials import Trial
from ephs.semantics.verdicts.verdict import Condition, Evidence

if TYPE_CHECKING:
    from ephs.semantics.primitives.primitives import Reversible

BESIDE = 8.0 * ROUNDED
"""Rounding that products of matrices leave, relative to the largest number of the same units."""
OF_UNITS = "up to the rounding of numbers of the same units"


def decided(reversible: "Reversible") -> tuple[Condition, ...]:
    """The conditions on a reversible primitive that reads no state.

    Raises
    ------
    StructureError
        One is refuted, with the entry that does.
    """
    skew, constraint = (np.asarray(matrix, dtype=float) for matrix in reversible.structure({}))
    claim = numbers_of(reversible)
    isotropic, conserved, mirrored, _ = STATEMENTS["reversible"]
    evidence: dict[str, Evidence] = {}
    forms: list[Evidence] = [("rounding",), *(("expansion", words) for words in reversed(list(READINGS)))]
    for form in forms:
        evidence |= dict.fromkeys(replayed(claim, dict.fromkeys(STATEMENTS["reversible"], form)), form)
    found = {statement: Condition(statement, True, how) for statement, how in evidence.items()}
    if isotropic not in found:
        beside = BESIDE * _beside(reversible, skew)
        found[isotropic] = _searched(reversible, isotropic, "isotropy", skew + skew.T, np.maximum(beside, beside.T))
    if conserved not in found:
        found[conserved] = _conservation(reversible, conserved, skew, constraint)
    if mirrored not in found and not reversible.external_field:
        found[mirrored] = _parity(reversible, mirrored, skew, constraint)
    return tuple(found[statement] for statement in STATEMENTS["reversible"] if statement in found)


def numbers_of(reversible: "Reversible") -> Claim:
    """What is claimed of a structure that reads no state: of its numbers."""
    return of_formulas(reversible, tuple(float(x) for matrix in reversible.structure({}) for x in np.ravel(matrix)))


def _conservation(reversible: "Reversible", statement: str, skew: Array, constraint: Array) -> Condition:
    """L w = 0 and C w = 0 of the amounts w of each charge, row by row."""
    of_rows = np.broadcast_to(np.abs(constraint).max(axis=1, keepdims=True, initial=0.0), constraint.shape)
    rows, largest = np.concatenate([skew, constraint]), np.concatenate([_beside(reversible, skew), of_rows])
    off = 0.0
    for kind in reversible.bundle.charges:
        amounts = reversible.bundle.indicator(kind)
        defect = rows @ amounts
        parts = np.abs(defect) / np.maximum(BESIDE * (largest @ np.abs(amounts)), TINY)
        if parts.max() > 1.0:
            worst = int(np.argmax(parts))
            raise _refuted(reversible, "conservation", float(defect[worst]), (worst,), quantity=kind)
        off = max(off, float(np.abs(defect).max()))
    return _off(statement, off)


def _parity(reversible: "Reversible", statement: str, skew: Array, constraint: Array) -> Condition:
    """(f, e) ∈ D ⇔ (−ϵf, ϵe) ∈ D, where single entries do not say it: as relations over ℚ, if rows mix parities."""
    parity = reversible.bundle.parity()
    if all(len(set(parity[row != 0.0])) <= 1 for row in constraint):
        alike = np.where(np.multiply.outer(parity, parity) > 0.0, skew, 0.0)
        return _searched(reversible, statement, "parity", alike, BESIDE * _beside(reversible, skew))
    mirrored = -parity[:, None] * skew * parity, constraint * parity
    for words, read in READINGS.items():
        one, other = (
            constant_relation(Rational(read), reversible.bundle, *each) for each in ((skew, constraint), mirrored)
        )
        if one.same(other):
            return Condition(statement, True, ("relations", words))
    return Condition(statement, False, ("off", "both sides are equal up to the rounding of the whole structure"))


def _beside(reversible: "Reversible", matrix: Array) -> Array:
    """(n, n) the largest entry between ports of the same units, for each."""
    units = [quantity.unit for _, where, quantity in reversible.bundle.items() for _ in range(where.start, where.stop)]
    kinds = np.unique(units, return_inverse=True)[1] if units else np.zeros(0, dtype=int)
    largest = np.zeros((kinds.max(initial=-1) + 1,) * 2)
    np.maximum.at(largest, (kinds[:, None], kinds), np.abs(matrix))
    return largest[kinds[:, None], kinds]


def _searched(reversible: "Reversible", statement: str, kind: str, defect: Array, allowed: Array) -> Condition:
    """A condition whose defect is rounding beside numbers of the same units.

    Raises
    ------
    StructureError
        An entry of the defect is larger than is ``allowed`` there.
    """
    off = np.abs(defect) / np.maximum(allowed, TINY)
    if off.max(initial=0.0) <= 1.0:
        return _off(statement, float(np.abs(defect).max(initial=0.0)))
    entry = tuple(int(i) for i in np.unravel_index(int(np.argmax(off)), off.shape))
    raise _refuted(reversible, kind, float(defect[entry]), entry)


def _off(statement: str, size: float) -> Condition:
    return Condition(statement, False, ("off", f"the numbers are off by {size:.1e}, {OF_UNITS}"))


def _refuted(
    reversible: "Reversible", kind: str, found: float, entry: tuple[int, ...], **facts: object
) -> StructureError:
    witness = Trial({}, np.zeros(reversible.bundle.size), Reference()).witness(reversible, entry, found)
    facts = {"flag": FLAGS["reversible"], **facts} if kind == "parity" else facts
    return StructureError(kind, reversible.name, found=found, entry=entry, witness=witness, **facts)
