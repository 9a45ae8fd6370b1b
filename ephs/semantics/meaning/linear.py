"""Linear relations between named variables, over a field.

A relation is a conjunction of equations. `join` is ∧: all at once, where variables of one name are one; `without` is ∃:
some values of the forgotten variables. All that gluing needs is said by these two.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.meaning.elimination import echelon, eliminated, reduced
from ephs.semantics.meaning.fields import Field, Row
from ephs.semantics.meaning.variables import ONE, RelationVariable


@final
@dataclass(frozen=True, slots=True, eq=False)
class LinearRelation:
    """A linear subspace of the functions on its variables; affine in the others where `ONE` is one of them.

    Parameters
    ----------
    equations
        Linear forms that vanish, sparse, in no particular order; none is zero.
    """

    field: Field[Any]
    variables: frozenset[RelationVariable]
    equations: tuple[Row[Any], ...]

    @staticmethod
    def of(
        field: Field[Any], variables: Iterable[RelationVariable], equations: Iterable[Row[Any]] = ()
    ) -> "LinearRelation":
        """The relation of some equations; without any it is everything."""
        return LinearRelation(field, frozenset(variables), tuple(row for row in equations if field.support(row)))

    @staticmethod
    def among(field: Field[Any], equations: Iterable[Row[Any]]) -> "LinearRelation":
        """The relation of some equations between the variables that are in them."""
        rows = list(equations)
        return LinearRelation.of(field, {variable for row in rows for variable in row}, rows)

    def join(self, *others: "LinearRelation") -> "LinearRelation":
        """All at once; variables of one name are one."""
        variables = self.variables.union(*(each.variables for each in others))
        return LinearRelation(self.field, variables, sum((each.equations for each in others), self.equations))

    def without(self, forgotten: Iterable[RelationVariable]) -> "LinearRelation":
        """Some values of the forgotten variables exist."""
        gone = frozenset(forgotten)
        rows = eliminated(self.field, self.equations, gone.__contains__)
        return LinearRelation(self.field, self.variables - gone, tuple(rows))

    def onto(self, kept: Iterable[RelationVariable]) -> "LinearRelation":
        """The projection on some variables."""
        return self.without(self.variables.difference(kept))

    def renamed(self, name: Callable[[RelationVariable], RelationVariable]) -> "LinearRelation":
        """The same with other names, which differ from each other."""
        new = {variable: name(variable) for variable in self.variables}
        rows = tuple({new[variable]: number for variable, number in row.items()} for row in self.equations)
        return LinearRelation(self.field, frozenset(new.values()), rows)

    @property
    def canonical(self) -> tuple[Row[Any], ...]:
        """The equations in reduced form, 1 = 0 alone if it is empty: over ℚ equal relations have equal ones."""
        rows = tuple(reduced(self.field, self.equations, _one_last))
        return rows[-1:] if rows and rows[-1].keys() == {ONE} else rows

    @property
    def dimension(self) -> int:
        """Dimension of the subspace, with that of the constant 1."""
        return len(self.variables) - len(echelon(self.field, self.equations, lambda _: True))

    @property
    def empty(self) -> bool:
        """Whether the constant is 0 in it: nothing satisfies the equations."""
        return bool(eliminated(self.field, self.equations, ONE.__ne__))

    def within(self, other: "LinearRelation") -> bool:
        """Whether it implies all equations of the other one."""
        pivots = echelon(self.field, self.equations, lambda _: True)
        for given in other.equations:
            row = dict(given)
            for variable, pivot in pivots:
                if variable in row:
                    factor = self.field.quotient(row[variable], pivot[variable])
                    self.field.subtract(row, factor, pivot)
                    row.pop(variable, None)
            if self.field.support(row):
                return False
        return True

    def same(self, other: "LinearRelation") -> bool:
        """Whether it is the same relation: exact over ℚ, else to the error bounds. Empty ones are the same."""
        if self.variables != other.variables:
            return False
        return (self.within(other) and other.within(self)) or (self.empty and other.empty)

    def solved(self, last: Iterable[RelationVariable] = ()) -> dict[RelationVariable, Row[Any]]:
        """Each variable as a combination of free ones; the ``last`` ones are left free where they can be."""
        field, late, out = self.field, frozenset(last), dict[RelationVariable, Row[Any]]()
        for variable, row in reversed(echelon(field, self.equations, lambda key: key not in late)):
            combination: Row[Any] = {}
            for key, number in row.items():
                if key != variable:
                    factor = field.quotient(number, row[variable])
                    field.subtract(combination, factor, out.get(key, {key: field.one}))
            out[variable] = {key: number for key, number in combination.items() if field.certain(number)}
        return out | {variable: {variable: field.one} for variable in self.variables - out.keys()}

    def determined(self, given: Iterable[RelationVariable] = ()) -> dict[RelationVariable, Row[Any]]:
        """The variables that the constant and the given ones determine, with how."""
        known = {ONE, *given}
        return {variable: row for variable, row in self.solved(last=known).items() if row.keys() <= known}

    def values(self) -> dict[RelationVariable, float]:
        """The values of the variables that are determined."""
        found = self.determined().items()
        return {variable: self.field.value(row[ONE]) if row else 0.0 for variable, row in found}

    def basis(self) -> list[Row[Any]]:
        """Vectors that span it, one for each free variable."""
        vectors: dict[RelationVariable, Row[Any]] = {}
        for variable, combination in self.solved().items():
            for free, number in combination.items():
                vectors.setdefault(free, {})[variable] = number
        return list(vectors.values())

    def orthogonal(self, partner: Mapping[RelationVariable, tuple[RelationVariable, int]]) -> "LinearRelation":
        """{y : Σ ± y(partner v) x(v) = 0 for all x}, of the form that pairs variables with their partners."""
        rows: list[Row[Any]] = []
        for vector in self.basis():
            row: Row[Any] = {}
            for variable, number in vector.items():
                other, sign = partner[variable]
                self.field.subtract(row, self.field.number(float(-sign)), {other: number})
            rows.append(row)
        return LinearRelation.of(self.field, self.variables, rows)

    def remainder(self, values: Mapping[RelationVariable, float], *, unit: bool = True) -> float:
        """The largest remainder of an equation at values of the variables, zero where missing.

        Parameters
        ----------
        unit
            Whether each equation is brought to length one.
        """
        order = sorted(self.variables | {ONE})
        at = np.array([1.0 if variable == ONE else values.get(variable, 0.0) for variable in order])
        return float(np.abs(self.matrix(order, unit=unit) @ at).max(initial=0.0))

    def matrix(self, order: Sequence[RelationVariable], *, unit: bool = True) -> Array:
        """The equations (m, n) as rows, of length one where ``unit``, in an order of the n variables."""
        place = {variable: i for i, variable in enumerate(order)}
        out = np.zeros((len(self.equations), len(place)))
        for row, terms in zip(out, self.equations, strict=True):
            for variable, number in terms.items():
                row[place[variable]] = self.field.value(number)
        return out / np.linalg.norm(out, axis=1, keepdims=True) if unit else out

    def projector(self, order: Sequence[RelationVariable]) -> Array:
        """The orthogonal projector (n, n) on it, in an order of the n variables."""
        place = {variable: i for i, variable in enumerate(order)}
        span = np.zeros((len(place), self.dimension))
        for column, vector in zip(span.T, self.basis(), strict=True):
            for variable, number in vector.items():
                column[place[variable]] = self.field.value(number)
        orthonormal = np.linalg.qr(span / np.linalg.norm(span, axis=0))[0]
        return orthonormal @ orthonormal.T


def _one_last(variable: RelationVariable) -> tuple[bool, RelationVariable]:
    return variable == ONE, variable
