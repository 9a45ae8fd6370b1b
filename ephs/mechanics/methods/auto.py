"""Automatic choice of the method: one without damping until stability limits the steps, then radau.

Where surfaces may touch, the choice depends on the tolerance. Coarse tolerances have semi-implicit steps, since losses
alone limit explicit steps there. At finer tolerances the methods compete (`ephs.mechanics.methods.contest`), since a
contact is stiff only while it is closed.

Stiffness is what Hairer and Wanner test in DOPRI5 and DOP853: the last two stages of a step show how fast its fastest
mode is, and a step that this holds at the limit of stability again and again serves stability, not accuracy.
"""

from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.methods.contest import Contest
from ephs.mechanics.methods.explicit import Explicit, tableau
from ephs.mechanics.methods.marching import FAILING, LAGGED
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.methods.rounding import LOOKED, held_by_rounding
from ephs.mechanics.methods.semi import NAME as SEMI
from ephs.mechanics.methods.semi import cheap, semi_implicit
from ephs.mechanics.methods.stages import costs, scheme_of
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.semantics.stage import PLAIN
from ephs.solve.march.control import PATIENCE, held_back
from ephs.solve.march.records import MarchControl
from ephs.solve.posing.errors import SolveError
from ephs.solve.running.control import Control
from ephs.solve.running.loop import FINAL
from ephs.solve.running.snapshot import Snapshot
from ephs.solve.running.stepping import Attempt, Leg, Span

if TYPE_CHECKING:
    from ephs.mechanics.methods.radau import Implicit

LIMITS = {"rk54": 3.25, "rk87": 6.1}
"""h·|λ| at the limit of stability."""
TRIAL = 400
"""Steps of rk54 between surfaces that may touch, after which others are tried: a stop at slip 0 hides its stiffness."""
ITERATIONS, MATRICES = 4, 32
"""Iterations that a step of radau takes, about, and what its derivatives cost."""
BEGINS = {"semi": 6000, "radau": 18000}
"""Evaluations of a single freedom that take as long as it takes to prepare the first steps of a method, about."""
CHANGE = 600
"""Evaluations of a single freedom that take as long as it takes to go to another method and back, about."""
LOOSE = 1e-2
"""Tolerances above this are for radau where surfaces may touch: explicit steps may gain more than is mended."""
COARSE = 3e-4
"""Tolerances above this are for semi-implicit steps where surfaces may touch, where these serve."""
HALFWAY = 5e-5
"""Tolerances above this have a contest that semi-implicit steps begin, those below it one that explicit steps begin."""
DIGITS = 1e-5
"""Tolerances below this are for order 8."""


@final
class Auto(ReducedMethod):
    """rk54 or rk87 by the tolerance, and radau from where the problem shows itself stiff; a contest among surfaces."""

    name = "auto"

    def __init__(self, equations: ReducedEquations, control: Control) -> None:
        super().__init__(equations, control)
        name = "rk87" if control.rtol.value < DIGITS else "rk54"
        self._explicit, self._limit = Explicit(equations, control, tableau(name)), LIMITS[name]
        self._methods: dict[str, Explicit | Implicit] = {name: self._explicit}
        self._active: Explicit | Implicit = self._explicit
        self._contest: Contest | None = None
        self._nearness, self._failures = MarchControl.table(1), 0
        self._nearness[0].limit = self._limit
        self.counts: dict[str, Any] = {"switches": []}
        touches = _touches(equations)
        serves = touches and cheap(equations)
        if serves and control.rtol.value > COARSE:
            self._take(SEMI)
        elif touches:
            self._compete(serves)
        else:
            self._take(name)
        self.name = self.counts["chosen"] = self._active.name

    def _compete(self, serves: bool) -> None:
        """Begin a contest of the explicit method, semi-implicit steps, where these serve, and radau; or radau alone."""
        if self.control.rtol.value > LOOSE:
            self._take("radau")
            return
        stages, n = self._explicit.method.c.size, self.equations.n
        count = scheme_of(self.equations, self.control).nodes.size
        factors, solutions = costs(n, count)
        prices = {self._explicit.name: stages}
        if serves:
            prices[SEMI] = LAGGED + 3
        prices["radau"] = ITERATIONS * (count + solutions) + factors + MATRICES
        first = SEMI if serves and self.control.rtol.value > HALFWAY else self._explicit.name
        self._take(self._explicit.name)  # for single steps
        self._names = sorted(prices, key=lambda name: name != first)
        starts = [BEGINS.get(name, 0) / max(n, 1) for name in self._names]
        wakes = {"rk54": TRIAL * stages, SEMI: 0.0}.get(first, np.inf)
        self._contest = Contest([prices[name] for name in self._names], starts, CHANGE / max(n, 1), wakes)

    def _take(self, name: str) -> None:
        """Let a method take the steps that follow."""
        if name not in self._methods:
            self._methods[name] = semi_implicit(self.equations, self.control) if name == SEMI else self._implicit()
        active = self._active = self._methods[name]
        self.exponent, self.share, self.hold = active.exponent, active.share, active.hold

    def _implicit(self) -> "Implicit":
        from ephs.mechanics.methods.radau import Implicit  # with derivatives, which explicit runs do not need

        known = dict(self.counts)
        made = Implicit(self.equations, self.control, self.counts)
        self.counts |= known  # of the part of a run that is resumed
        return made

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        self._forward(h >= 0.0)
        if self._active is not self._explicit:
            return self._active.step(state, h)
        try:
            found = self._explicit.step(state, h)
        except SolveError as error:
            self._failures += 1
            if self._failures > PATIENCE and error.outcome not in FINAL:
                self._switch(state.t, h, FAILING)
            raise
        if found.error <= 1.0:
            near: Any = self._nearness[0]
            self._failures = 0
            near.stiff, near.steps = self._explicit.stiffness, near.steps + 1
            told = None
            if near.steps % LOOKED == 0 and self.control.step is None:
                told = held_by_rounding(self._explicit, found.end, abs(h), near.span, near.span / abs(h))
            if told or held_back(PLAIN, near):
                self._switch(found.end.t, h, told or f"h·|λ| = {near.stiff:.1f} holds its steps")
        return found

    def tried(self, state: ReducedState, h: float, *, part: bool) -> Attempt[ReducedState]:
        """A step, or a part of one, of the method whose steps are taken."""
        return self._active.tried(state, h, part=part)

    def many(self, span: Span[ReducedState]) -> Leg[ReducedState] | None:
        """Explicit steps, many in one compiled call, until stiffness is detected; then implicit ones while they pay."""
        self._forward(span.until >= span.t0)
        self._nearness[0].span = abs(span.until - span.t0)
        contest = self._contest
        if contest is not None:
            self._take(self._names[contest.at])
            if not self.counts["switches"]:
                self.name = self.counts["chosen"] = self._names[contest.home]
        left = self._switch if contest is None else self._moved
        if not isinstance(self._active, Explicit):
            return self._active.many(span, contest, left)
        limit = self._limit if self._active is self._explicit else np.inf if contest is not None else 0.0
        return self._active.many(span, limit, left, contest)

    def _forward(self, forward: bool) -> None:
        """Take no semi-implicit steps backward in time: losses gain energy then, which implicit steps do not see."""
        if forward or not _touches(self.equations):
            return
        if self._contest is not None and SEMI in self._names:
            self._contest.without(self._names.index(SEMI))
        elif self._active.name == SEMI:
            self._compete(serves=False)
            self.name = self.counts["chosen"] = self._active.name

    def _moved(self, t: float, h: float, reason: str) -> None:
        """Write down which method won the contest."""
        assert self._contest is not None
        name = self._names[self._contest.home]
        self.name = ", ".join(dict.fromkeys([*self.name.split(", "), name]))
        self.counts["switches"].append({"t": float(t), "to": name, "step": float(h), "reason": reason})

    def stats(self) -> dict[str, Any]:
        """Counts, for the solution's statistics; among them that of tries in a contest."""
        return super().stats() | ({} if self._contest is None else {"tries": self._contest.tries})

    def _switch(self, t: float, h: float, reason: str) -> None:
        """Go on with radau."""
        self._contest = None
        self._take("radau")
        self.name = f"{self._explicit.name}, radau"
        self.counts["switches"].append({"t": float(t), "to": "radau", "step": float(h), "reason": reason})

    def taken(self, state: ReducedState) -> Snapshot:
        """Memory of its methods, and what their choice depends on."""
        near: Any = self._nearness[0]
        return {
            "methods": {name: method.snapshot(state) for name, method in self._methods.items()},
            "nearness": [int(near.held), int(near.free), int(near.steps), self._failures],
            "contest": None if self._contest is None else self._contest.snapshot(),
            "active": self._active.name,
            "name": self.name,
        }

    def take(self, own: Snapshot, state: ReducedState) -> None:
        """Restore from a value of `taken`."""
        for name, found in own["methods"].items():
            self._take(name)
            self._active.restore(found, state)
        if own["contest"] is None:
            self._contest = None
        elif self._contest is not None:
            self._contest.restore(own["contest"])
        self._take(own["active"])
        near: Any = self._nearness[0]
        near.held, near.free, near.steps, self._failures = own["nearness"]
        self.name = own["name"]


def _touches(equations: ReducedEquations) -> bool:
    """Whether surfaces of a tree may touch, and implicit steps are taken many in one compiled call."""
    compiled = equations.constant and not (equations.engine.looped or equations.reduced.attaching.network.attached)
    return compiled and bool(equations.reduced.tables.support.any())
