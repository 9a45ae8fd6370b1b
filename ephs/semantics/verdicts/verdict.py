"""Verdict on a primitive's structure: each condition is proved, or was searched for counterexamples in vain.

A structure with a counterexample is refused: `StructureError`, with the smallest one found as its ``witness``.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, TypeAlias, cast, final

if TYPE_CHECKING:
    from ephs.semantics.primitives.primitives import Primitive


Evidence: TypeAlias = "tuple[Any, ...]"
"""A word of `FORMS`, and what belongs to it: texts, numbers, terms, and tuples of them."""
FORMS: Mapping[str, str] = {
    "expansion": "both sides expand to the same, of the numbers {0}",
    "signs": "by the signs of the parts of a formula that expands to the same",
    "squares": "a sum of squares with factors ≥ 0",
    "rounding": "decided up to the rounding of each number",
    "relations": "both are one relation over ℚ, of the numbers {0}",
    "stated": "as whoever made it states, by construction: {0}",
    "seen": "that of the process it is made of, seen through e' = T e",
    "both": "as of both parts that it is made of",
    "open": "not proved",
    "searched": "none of {0} states and efforts contradicts it",
    "off": "{0}",
}
"""Words of evidence, and what they say; ``replay`` checks the first ones."""
OPEN: Evidence = ("open",)


@final
@dataclass(frozen=True, slots=True)
class Condition:
    """A condition on a structure.

    Parameters
    ----------
    statement
        What holds, e.g. ``"L + Lᵀ = 0"``.
    proved
        For all states and efforts; else no counterexample was found.
    how
        Evidence: what proves it, or where it was looked for.
    """

    statement: str
    proved: bool
    how: Evidence

    def __str__(self) -> str:
        word, *data = self.how
        return f"{self.statement}: {'proved' if self.proved else 'searched'}, {FORMS[word].format(*data)}"


def plain(value: object) -> Any:
    """Evidence as part of a document: lists in place of tuples."""
    return [plain(each) for each in cast("tuple[object, ...]", value)] if isinstance(value, tuple) else value


def as_evidence(value: object) -> Any:
    """The inverse of `plain`."""
    return tuple(map(as_evidence, cast("list[object]", value))) if isinstance(value, list | tuple) else value


@final
class StructureVerdict(str):
    """``"proved"`` where all conditions are, else ``"searched"``; with the conditions.

    Parameters
    ----------
    conditions
        What was shown, and how.
    """

    __slots__ = ("conditions",)

    conditions: tuple[Condition, ...]

    def __new__(cls, conditions: Iterable[Condition]) -> "StructureVerdict":
        found = tuple(conditions)
        self = super().__new__(cls, "proved" if all(each.proved for each in found) else "searched")
        self.conditions = found
        return self

    def __reduce__(self) -> tuple[type["StructureVerdict"], tuple[tuple[Condition, ...]]]:
        return StructureVerdict, (self.conditions,)

    @property
    def open(self) -> tuple[Condition, ...]:
        """The conditions that are not proved."""
        return tuple(each for each in self.conditions if not each.proved)

    @property
    def text(self) -> str:
        """The verdict with a line for each condition."""
        return "\n".join([str(self), *(f"  {each}" for each in self.conditions)])


def proved(how: str, *statements: str) -> tuple[Condition, ...]:
    """Conditions that hold by construction, as whoever made the structure states."""
    return tuple(Condition(statement, True, ("stated", how)) for statement in statements)


def stated(statement: str, holds: bool, why: str) -> Condition:
    """A condition that holds by construction, or is open."""
    return Condition(statement, holds, ("stated", why) if holds else OPEN)


def examine(primitive: "Primitive") -> StructureVerdict:
    """Prove the conditions on a primitive; search for counterexamples of the others.

    Raises
    ------
    StructureError
        There is a counterexample.
    """
    from ephs.semantics.verdicts.search import COUNT, search

    conditions = _asked(primitive, _proofs(primitive))
    if all(each.proved for each in conditions):
        return StructureVerdict(conditions)
    tried = search(primitive, COUNT)
    return StructureVerdict(
        each if each.proved or each.how != OPEN else Condition(each.statement, False, ("searched", tried))
        for each in conditions
    )


_OF_LIBRARY: Final[dict[object, "tuple[Condition, ...]"]] = {}
"""Conditions on trusted primitives, by ports, formula and signs of parameters: those of all numbers of these signs."""


def _asked(primitive: "Primitive", conditions: tuple[Condition, ...]) -> tuple[Condition, ...]:
    """The conditions without that on parity where the primitive is one-sided, or in a reversed field."""
    from ephs.semantics.verdicts.checks import MIRRORED

    free = (primitive.kind == "irreversible" and primitive.one_sided) or (
        primitive.kind == "reversible" and primitive.external_field
    )
    return tuple(each for each in conditions if not free or each.statement != MIRRORED[primitive.kind])


def _proofs(primitive: "Primitive") -> tuple[Condition, ...]:
    """Each condition with its proof, or without one."""
    if primitive.kind == "environment":
        return proved("by definition of the reference environment", "H = 0 and e = 0")
    if primitive.proof is not None:
        return primitive.proof()
    formula = primitive.formula
    if formula is not None and formula.parameters and primitive.trusted:
        from ephs.semantics.verdicts.proving import signs_of

        signs = tuple(signs_of(primitive).items())
        ports = (primitive.kind, tuple(primitive.interface.items()), primitive.reads, primitive.domain)
        key = (ports, formula.function, formula.gradient, signs)
        if key not in _OF_LIBRARY:
            _OF_LIBRARY[key] = _shown(primitive)
        return _OF_LIBRARY[key]
    return _shown(primitive)


def _shown(primitive: "Primitive") -> tuple[Condition, ...]:
    """Conditions, proved of the formula after it was compared with the function."""
    from ephs.semantics.verdicts.checks import STATEMENTS
    from ephs.semantics.verdicts.search import simplest

    if primitive.formula is not None:
        from ephs.semantics.verdicts.recorded import require_steady

        require_steady(primitive)
    simplest(primitive)  # what fails here needs no symbols
    if primitive.kind == "reversible" and not primitive.reads:
        from ephs.semantics.verdicts.constant import decided

        return decided(primitive)
    if primitive.formula is None:
        return tuple(Condition(statement, False, OPEN) for statement in STATEMENTS[primitive.kind])
    from ephs.semantics.verdicts.proving import conditions_of
    from ephs.semantics.verdicts.recorded import require_recorded

    gaps = require_recorded(primitive)
    return (*conditions_of(primitive), *gaps)
