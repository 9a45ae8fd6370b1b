"""Conduction: processes between temperatures whose powers are linear in these, decided by expansion over ℚ."""

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.derive.recording import Untraceable
from ephs.semantics.symbols.terms import TermMatrix
from ephs.semantics.verdicts.claims import claim_of
from ephs.semantics.verdicts.proving import signs_of
from ephs.semantics.verdicts.replay import Replay
from ephs.semantics.verdicts.sums import Unexpandable

if TYPE_CHECKING:
    from ephs.semantics.primitives.primitives import Irreversible, Primitive

FORMULAS = 256
"""Formulas whose matrices are remembered."""


def conductances(primitive: "Primitive") -> Array | None:
    """(n, n) K in W/K of the powers θ ∘ f = K θ in W that a process takes at the absolute temperatures θ of its ports.

    None where its formula does not say so: it has none, other ports, states, a domain, or powers that are not linear.
    """
    if primitive.kind != "irreversible" or primitive.formula is None or primitive.reads or primitive.domain:
        return None
    written = _written(_Process(primitive))
    given = dict(primitive.parameters)
    numbers = {name: given[name] for name in primitive.formula.parameters}
    return None if written is None else np.array(written(**numbers), dtype=float)


class _Process:
    """A process, equal to all that differ in parameters of the same signs only."""

    __slots__ = ("_key", "primitive")

    def __init__(self, primitive: "Irreversible") -> None:
        self.primitive = primitive
        self._key = primitive.formula, tuple(primitive.interface.items()), tuple(signs_of(primitive).items())

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Process) and self._key == other._key


@lru_cache(FORMULAS)
def _written(process: _Process) -> TermMatrix | None:
    """The matrix as a function of the parameters."""
    try:
        rows = Replay(claim_of(process.primitive, signs_of(process.primitive))).conductances()
    except (Untraceable, Unexpandable):
        return None
    return None if rows is None else TermMatrix(tuple(map(tuple, rows)))
