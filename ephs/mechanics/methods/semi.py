"""Semi-implicit steps: losses are taken implicitly, with resistances of explicit stages; all else explicitly.

SSP3(4,3,3) of Pareschi and Russo, J. Sci. Comput. 25 (2005) 129-155, of order 3: its explicit part preserves strong
stability, its implicit one is L-stable. No weight is negative, so that no step loses entropy, whatever its length.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final, final

import numpy as np

from ephs.mechanics.methods.explicit import Explicit, Tableau
from ephs.mechanics.methods.tableaux import arrays
from ephs.mechanics.road.pack import PackedLink
from ephs.mechanics.tree.engine.drags import chains, frictions, memory_of
from ephs.mechanics.tree.engine.engine import Engine
from ephs.mechanics.tree.engine.links import links_of
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.mechanics.tree.equations.stages import evaluated
from ephs.mechanics.tree.finding.mechanism import Reduced
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.derive.irreversible import IrreversibleStep
from ephs.semantics.derive.relations import onsager
from ephs.semantics.stage.calling import Bound
from ephs.semantics.systems.kept import once
from ephs.solve.march.lagged import AHEAD
from ephs.solve.march.records import MarchControl, Status
from ephs.solve.running.control import Control

NAME: Final = "semi"
ORDER: Final = 3
FREEDOMS: Final = 1000
"""Degrees of freedom up to which the memory of a matrix is little."""
WORK: Final = 2000.0
"""Squared width of rows of the mass matrix up to which its factors cost less than some evaluations."""
FINE, SEVERE = 1e-4, 5.0
"""The rtol from which on, downwards, estimates count so many times: errors of the many steps of a low order add up,
those of a tumbling body to some thousand tolerances."""
ALPHA: Final = (9.0 - 57.0**0.5) / 6.0
"""Diagonal of the implicit coefficients, which makes them L-stable."""
_LAST = 1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0
ARRAYS: Final = arrays(
    # After a first stage without weight that is never evaluated; the first two have the state of the step's start.
    np.array([
        [0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.25, 0.25, 0.0], [0.0, 0.0, *_LAST],
    ]),
    np.array([-_LAST[1], 0.0, _LAST[0] - 0.5, _LAST[1] - 0.5, _LAST[2], _LAST[1]]),
)  # fmt: skip
"""The explicit coefficients as `ephs.solve.march.Tableau`; the estimate is by weights of order 2, (0, ½, ½, 0), and by
what the stage ahead, with its weight, misses of what acts at the end (`ephs.solve.march.lagged.AHEAD`)."""
SCHEME: Final = np.array([
    [0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, ALPHA, 0.0, 0.0, 0.0],
    [0.0, -ALPHA, ALPHA, 0.0, 0.0],
    [0.0, 0.0, 1.0 - ALPHA, ALPHA, 0.0],
    [0.0, 0.25 * ALPHA, 0.25 - 0.5 * ALPHA, 0.25 - 0.75 * ALPHA, ALPHA],
])  # fmt: skip
"""The implicit coefficients."""
AGAIN: Final = np.array([0, 1, 1, 0, 0])
"""1 where a stage has the explicit state of the one before: the first one is the step's start."""
TABLEAU: Final = Tableau(NAME, ORDER, ARRAYS, ARRAYS["a"][:-1].sum(axis=1), float(ORDER))
"""The explicit coefficients, with the nodes at which inputs are taken."""


@final
class Semi:
    """Memory of semi-implicit steps of one mechanism.

    Attributes
    ----------
    onsager
        Addresses of the programs of M/θ₀ of the components of friction, by their numbers.
    """

    def __init__(self, equations: ReducedEquations) -> None:
        self._equations = equations
        self.onsager = once(equations.reduced, "programs of friction", lambda: _programs(equations))
        self._made: tuple[Engine, dict[str, Any]] | None = None
        self._stage: tuple[Engine, Bound] | None = None
        coordinates, size = equations.engine.sizes
        self._base, self._q, self._steering = np.zeros(coordinates), np.zeros(coordinates), MarchControl.table(1)
        self._start, self._y, self._k = np.zeros(size), np.zeros(size), np.zeros((len(ARRAYS["a"]), size))

    @property
    def memory(self) -> dict[str, Any]:
        """Memory of the stages, by the names of `ephs.mechanics.tree.engine.drags.Drags`."""
        engine = self._equations.engine  # which a start may make anew
        if self._made is None or self._made[0] is not engine:
            eq = self._equations
            rows, parts = len(engine.array("value")), _parts(eq.reduced)
            sizes = engine.tables, parts, engine.sizes[1], rows, eq.driven.tolist()
            self._made = engine, memory_of(*sizes, pushed=eq.given.pushed) | {"scheme": SCHEME, "again": AGAIN}
        return self._made[1]

    def _bound_stage(self) -> Bound:
        """One stage by the present engine."""
        engine = self._equations.engine
        if self._stage is None or self._stage[0] is not engine:
            given = ARRAYS, self._steering, self._base, self._start, self._k, self.memory, self._y, self._q
            self._stage = engine, engine.lagged("stage", self.onsager, *given, 0, 0.0)
        return self._stage[1]

    def stages(
        self, state: ReducedState, scheme: Mapping[str, Array], c: Array, h: float, y0: Array, k: Array, y1: Array
    ) -> Array:
        """The rates k at the stages of a step, each under the inputs at its node, and y at its end into y1.

        Returns y at the last stage. Stages are explicit where constraints nearly repeat each other; else the last row
        of k is that of the stage ahead, until there is one of `ahead`. See `ReducedEquations.stages`.
        """
        eq, stage, before = self._equations, self._bound_stage(), y0

        def rates_at(part: float, y: Array) -> Array:
            return eq.rates(state.t + part * h, state.q, y)

        self._base[:], self._start[:] = state.q, y0
        for i, (node, again) in enumerate([*zip(c, AGAIN, strict=True), (1.0, 1)]):
            before, anew = self._y.copy(), not again
            if anew and not eq.constant:
                y = y0 + h * (scheme["a"][i, :i] @ self._k[:i])
                v, r, heats, _ = np.split(y, np.cumsum([eq.nv, eq.n, eq.ns]))
                eq.load(state.t + (0.0 if eq.held else float(node) * h), eq.advance(state.q, v), r, heats)
            eq.evaluations += anew
            status = int(stage(i, h))
            if status == Status.DEPENDENT:
                before, y1[:] = evaluated(rates_at, scheme["a"], c, h, y0, k)
                k[0] = k[AHEAD]
                return before
            eq.refuse(status, eq.engine.failed)
        k[:], y1[:] = self._k, self._y
        return before

    def ahead(self, end: ReducedState, t: float) -> Array | None:
        """The rates without losses at the end of a step, under the inputs at a time; None where constraints nearly
        repeat each other.
        """
        eq, stage = self._equations, self._bound_stage()
        self._base[:], self._start[:] = end.q, eq.vector(end)
        eq.load(t, end.q, end.r, end.heats)
        eq.evaluations += 1
        if (status := int(stage(0, 0.0))) != Status.DEPENDENT:
            eq.refuse(status, eq.engine.failed)
            return self.memory["seen"].copy()
        return None


def semi_implicit(equations: ReducedEquations, control: Control) -> Explicit:
    """The method on one mechanism."""
    tableau = TABLEAU
    if control.rtol.value <= FINE:
        tableau = replace(TABLEAU, arrays={**ARRAYS, "error": SEVERE * ARRAYS["error"]})
    return Explicit(equations, control, tableau, lagged=Semi(equations))


def cheap(equations: ReducedEquations) -> bool:
    """Whether the masses of a tree are factorised in little time, and no contact is hard."""
    reach = chains(_parts(equations.reduced))["reach"]
    narrow = reach.size <= FREEDOMS and np.sum((np.arange(reach.size) - reach) ** 2.0) <= WORK * reach.size
    return bool(narrow) and equations.problem.descriptor.strikes is None


def _parts(reduced: Reduced) -> Sequence[PackedLink]:
    """The links, found once: of their joints alone, which stay where numbers of tables are overwritten."""
    return once(reduced, "links", lambda: links_of(reduced).parts)


def _programs(equations: ReducedEquations) -> dict[int, int]:
    """Addresses of M/θ₀ of the components of friction, by their numbers."""
    out: dict[int, int] = {}
    for number in frictions(equations.engine.tables).tolist():
        kernel = equations.problem.descriptor.components[number].primitive.kernel
        assert kernel is not None
        assert isinstance(kernel.relation, IrreversibleStep)
        out[number] = onsager(kernel.relation).compiled()["value"].address
    return out
