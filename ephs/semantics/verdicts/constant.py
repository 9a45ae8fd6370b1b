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
from ephs.semantics.meaning.components import constant_relation, largest
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
EVALUATED = 64.0 * BESIDE
"""The same of functions of states, which may be some hundred operations deep."""
NOWHERE = Trial({}, np.zeros(0), Reference())
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
        found[isotropic] = _off(isotropic, _isotropy(reversible, skew))
    if conserved not in found:
        found[conserved] = _off(conserved, _conservation(reversible, skew, constraint))
    if mirrored not in found and not reversible.external_field:
        found[mirrored] = _parity(reversible, mirrored, skew, constraint)
    return tuple(found[statement] for statement in STATEMENTS["reversible"] if statement in found)


def require_by_units(reversible: "Reversible", trial: Trial) -> None:
    """Check a structure at a state beside numbers of the same units, which others of other units are not.

    Raises
    ------
    StructureError
        An entry is off by more than evaluations are rounded by.
    """
    skew, constraint = reversible.structure(trial.states)
    if not (np.all(np.isfinite(skew)) and np.all(np.isfinite(constraint))):
        return
    _isotropy(reversible, skew, trial)
    _conservation(reversible, skew, constraint, trial)
    if not constraint.size and not reversible.external_field:
        signs, interface = reversible.bundle.parity(), reversible.interface
        there, _ = reversible.structure({p: interface[p].quantity.parity * x for p, x in trial.states.items()})
        if np.all(np.isfinite(there)):
            _defect(reversible, "parity", there + signs[:, None] * skew * signs, _beside(reversible, skew), trial)


def numbers_of(reversible: "Reversible") -> Claim:
    """What is claimed of a structure that reads no state: of its numbers."""
    return of_formulas(reversible, tuple(float(x) for matrix in reversible.structure({}) for x in np.ravel(matrix)))


def _isotropy(reversible: "Reversible", skew: Array, trial: Trial = NOWHERE) -> float:
    """The largest entry of L + Lᵀ, which is rounding."""
    beside = _beside(reversible, skew)
    return _defect(reversible, "isotropy", skew + skew.T, np.maximum(beside, beside.T), trial)


def _conservation(reversible: "Reversible", skew: Array, constraint: Array, trial: Trial = NOWHERE) -> float:
    """The largest entry of L w and C w, which is rounding, of the amounts w of each charge."""
    rows = np.concatenate([skew, constraint])
    around = np.concatenate([_beside(reversible, skew), largest(reversible.bundle, constraint.T).T])
    amounts = {kind: reversible.bundle.indicator(kind) for kind in reversible.bundle.charges}
    found = [
        _defect(reversible, "conservation", rows @ each, around @ np.abs(each), trial, quantity=kind)
        for kind, each in amounts.items()
    ]
    return max(found, default=0.0)


def _parity(reversible: "Reversible", statement: str, skew: Array, constraint: Array) -> Condition:
    """(f, e) ∈ D ⇔ (−ϵf, ϵe) ∈ D, where single entries do not say it: as relations over ℚ, if rows mix parities."""
    parity = reversible.bundle.parity()
    if all(len(set(parity[row != 0.0])) <= 1 for row in constraint):
        alike = np.where(np.multiply.outer(parity, parity) > 0.0, skew, 0.0)
        return _off(statement, _defect(reversible, "parity", alike, _beside(reversible, skew), NOWHERE))
    mirrored = -parity[:, None] * skew * parity, constraint * parity
    for words, read in READINGS.items():
        one, other = (
            constant_relation(Rational(read), reversible.bundle, *each) for each in ((skew, constraint), mirrored)
        )
        if one.same(other):
            return Condition(statement, True, ("relations", words))
    return Condition(statement, False, ("off", "both sides are equal up to the rounding of the whole structure"))


def _beside(reversible: "Reversible", matrix: Array) -> Array:
    """(n, n) the largest entry between coordinates of the same units, for each."""
    bundle = reversible.bundle
    return largest(bundle, largest(bundle, matrix).T).T


def _defect(reversible: "Reversible", kind: str, defect: Array, beside: Array, trial: Trial, **facts: object) -> float:
    """The largest entry of a defect that is rounding beside numbers of the same units.

    Raises
    ------
    StructureError
        An entry is larger than that.
    """
    part = BESIDE if trial is NOWHERE else EVALUATED
    off = np.abs(defect) / np.maximum(part * beside, TINY)
    if off.max(initial=0.0) <= 1.0:
        return float(np.abs(defect).max(initial=0.0))
    entry = tuple(int(i) for i in np.unravel_index(int(np.argmax(off)), off.shape))
    found = float(defect[entry])
    facts = {"flag": FLAGS["reversible"], **facts} if kind == "parity" else facts
    witness = trial.witness(reversible, entry, found)
    raise StructureError(kind, reversible.name, found=found, entry=entry, witness=witness, **facts)


def _off(statement: str, size: float) -> Condition:
    return Condition(statement, False, ("off", f"the numbers are off by {size:.1e}, {OF_UNITS}"))
