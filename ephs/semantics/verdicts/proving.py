"""Proofs of structures, cached on disk: SymPy is loaded for formulas without a cached proof."""

from typing import TYPE_CHECKING

import numpy as np

from ephs.semantics.stage.known import known
from ephs.semantics.verdicts.checks import STATEMENTS
from ephs.semantics.verdicts.verdict import Condition

if TYPE_CHECKING:
    from ephs.semantics.primitives import Primitive


def conditions_of(primitive: "Primitive") -> tuple[Condition, ...]:
    """The conditions on a primitive that has a formula, each with its proof or without one.

    Proofs hold for all numbers of the same signs. Those of formulas of this package are kept on disk by formula, ports
    and signs of the parameters; formulas of users are proved anew in each process.
    """
    formula = primitive.formula
    assert formula is not None
    given = dict(primitive.parameters)
    signs = {name: int(np.sign(float(str(given[name])))) for name in formula.parameters}
    ports = (primitive.kind, dict(primitive.interface.items()), primitive.reads, primitive.domain)

    def prove() -> list[list[str]]:
        from ephs.semantics.symbols.proofs import findings_of

        return [list(each) for each in findings_of(primitive, signs)]

    found = {statement: how for statement, how in known(("proofs", ports, formula, signs), prove)}
    found = found or dict.fromkeys(STATEMENTS[primitive.kind], "")
    return tuple(Condition(statement, bool(how), how) for statement, how in found.items())
