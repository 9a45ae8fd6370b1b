"""Semi-implicit steps of trees: losses are taken implicitly, with resistances of explicit stages; all else explicitly.

SSP3(4,3,3) of Pareschi and Russo, J. Sci. Comput. 25 (2005) 129-155, of order 3: its explicit part preserves strong
stability, its implicit one is L-stable. No weight is negative, so that no step loses entropy, whatever its length.
"""

from collections.abc import Mapping
from typing import Any, Final, final

import numpy as np

from ephs.mechanics.tree.engine.drags import chains, frictions, memory_of
from ephs.mechanics.tree.engine.links import links_of
from ephs.mechanics.tree.equations.equations import Equations
from ephs.mechanics.tree.finding.roles import strikes
from ephs.semantics.derive.irreversible import Irreversible
from ephs.semantics.derive.relations import onsager

NAME: Final = "semi"
EXPONENT: Final = 3.0
"""The power of the step with which the estimate falls."""
FREEDOMS: Final = 1000
"""Degrees of freedom up to which the memory of a matrix is little."""
WORK: Final = 2000.0
"""Squared width of rows of the mass matrix up to which its factors cost less than some evaluations."""
ALPHA: Final = (9.0 - 57.0**0.5) / 6.0
"""Diagonal of the implicit coefficients, which makes them L-stable."""
_LAST = 1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0
ARRAYS: Final[Mapping[str, Any]] = {
    # After a first stage without weight that is never evaluated; the first two have the state of the step's start.
    "a": np.array([
        [0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.25, 0.25, 0.0], [0.0, 0.0, *_LAST],
    ]),
    "guess": np.zeros((0, 5)),
    "error": np.array([0.0, 0.0, _LAST[0] - 0.5, _LAST[1] - 0.5, _LAST[2], 0.0]),
    "coarse": np.zeros(6),
    "eighth": np.zeros(1, dtype=np.int64),
}  # fmt: skip
"""The explicit coefficients as `ephs.solve.march.Tableau`; the estimate is by weights of order 2, (0, ½, ½, 0)."""
SCHEME: Final = np.array([
    [0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, ALPHA, 0.0, 0.0, 0.0],
    [0.0, -ALPHA, ALPHA, 0.0, 0.0],
    [0.0, 0.0, 1.0 - ALPHA, ALPHA, 0.0],
    [0.0, 0.25 * ALPHA, 0.25 - 0.5 * ALPHA, 0.25 - 0.75 * ALPHA, ALPHA],
])  # fmt: skip
"""The implicit coefficients."""
AGAIN: Final = np.array([0, 0, 1, 0, 0])
"""1 where a stage has the explicit state of the one before."""


@final
class Semi:
    """Memory of semi-implicit steps of one tree.

    Attributes
    ----------
    onsager
        Addresses of the programs of M/θ₀ of the components of friction, by their numbers.
    memory
        Of the stages, by the names of `ephs.mechanics.tree.engine.drags.Drags`.
    """

    def __init__(self, equations: Equations) -> None:
        engine, found = equations.engine, _relations(equations)
        self.onsager = {number: onsager(one).compiled()["value"].address for number, one in found.items() if one}
        memory = memory_of(engine.tables, links_of(equations.reduced).parts, engine.sizes[1])
        self.memory: dict[str, Any] = memory | {"scheme": SCHEME, "again": AGAIN}


def serves(equations: Equations) -> bool:
    """Whether the losses of a tree are known, and act by forces, and its masses are factorised in little time."""
    reach = chains(links_of(equations.reduced).parts)["reach"]
    narrow = reach.size <= FREEDOMS and np.sum((np.arange(reach.size) - reach) ** 2.0) <= WORK * reach.size
    known = None not in _relations(equations).values()
    return bool(narrow) and known and strikes(equations.problem.descriptor.components) is None


def _relations(equations: Equations) -> dict[int, Irreversible | None]:
    """Relations of the components of friction, by their numbers; None where one is not in machine code."""
    kernels = {
        number: equations.problem.descriptor.components[number].primitive.kernel
        for number in frictions(equations.engine.tables)
    }
    return {
        number: kernel.relation if kernel is not None and isinstance(kernel.relation, Irreversible) else None
        for number, kernel in kernels.items()
    }
