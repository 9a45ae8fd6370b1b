"""Verdict on a primitive's structure: each condition is proved, or was searched for counterexamples in vain.

A structure with a counterexample is refused: `StructureError`, with the smallest one found as its ``witness``.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

if TYPE_CHECKING:
    from ephs.semantics.primitives import Primitive


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
        By which argument, or where it was looked for.
    """

    statement: str
    proved: bool
    how: str

    def __str__(self) -> str:
        return f"{self.statement}: {'proved' if self.proved else 'searched'}, {self.how}"


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
    """Conditions with a common proof."""
    return tuple(Condition(statement, True, how) for statement in statements)


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
    how = f"none of {tried} states and efforts contradicts it"
    return StructureVerdict(
        each if each.proved else Condition(each.statement, False, each.how or how) for each in conditions
    )


def _asked(primitive: "Primitive", conditions: tuple[Condition, ...]) -> tuple[Condition, ...]:
    """The conditions without that on parity where the primitive is one-sided, or in a reversed field."""
    from ephs.semantics.verdicts.checks import MIRRORED

    free = (primitive.kind == "irreversible" and primitive.one_sided) or (
        primitive.kind == "reversible" and primitive.reversed_field
    )
    return tuple(each for each in conditions if not free or each.statement != MIRRORED[primitive.kind])


def _proofs(primitive: "Primitive") -> tuple[Condition, ...]:
    """Each condition with its proof, or without one."""
    from ephs.semantics.verdicts.checks import STATEMENTS
    from ephs.semantics.verdicts.search import simplest

    if primitive.kind == "environment":
        return proved("by definition of the reference environment", "H = 0 and e = 0")
    if primitive.proof is not None:
        return primitive.proof()
    if primitive.formula is not None:
        from ephs.semantics.verdicts.recorded import require_steady

        require_steady(primitive)
    simplest(primitive)  # what fails here needs no symbols
    if primitive.kind == "reversible" and not primitive.reads:
        from ephs.semantics.verdicts.constant import decided

        return decided(primitive)
    if primitive.formula is None:
        return tuple(Condition(statement, False, "") for statement in STATEMENTS[primitive.kind])
    from ephs.semantics.verdicts.proving import conditions_of
    from ephs.semantics.verdicts.recorded import require_recorded

    gaps = require_recorded(primitive)
    return (*conditions_of(primitive), *gaps)
