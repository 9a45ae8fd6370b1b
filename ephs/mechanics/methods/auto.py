"""Automatic choice of the method: one without damping until stability limits the steps, then radau.

Where surfaces may touch and tolerances are coarse, steps are semi-implicit: losses alone limit explicit ones there.

Stiffness is what Hairer and Wanner test in DOPRI5 and DOP853: the last two stages of a step show how fast its fastest
mode is, and a step that this holds at the limit of stability again and again serves stability, not accuracy.
Contacts are stiff for a while: compiled steps of radau end where explicit ones would have cost less. Many bodies, whose
surfaces may touch, try radau when explicit steps have cost as much as a trial does, which grows with the cube of the
freedoms; after a trial in vain, when they have cost twice as much as before.
"""

from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.methods.explicit import Explicit, tableau
from ephs.mechanics.methods.marching import FAILING, WINDOW, Rival
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.methods.semi import cheap, semi_implicit
from ephs.mechanics.methods.stages import costs, scheme_of
from ephs.mechanics.tree.equations.equations import Equations, ReducedState
from ephs.semantics.bundles.bundle import Array
from ephs.solve.control import Control
from ephs.solve.errors import SolveError
from ephs.solve.loop import FINAL
from ephs.solve.march.control import HELD, PATIENCE
from ephs.solve.snapshot import Snapshot
from ephs.solve.stepping import Attempt, Leg, Span

if TYPE_CHECKING:
    from ephs.mechanics.methods.radau import Implicit

LIMITS = {"rk54": 3.25, "rk87": 6.1}
"""h·|λ| at the limit of stability."""
FREEDOMS = 64
"""Degrees of freedom up to which a trial of radau costs little."""
TRIAL = 400
"""Explicit steps between surfaces that may touch, after which radau is tried: a stop at slip 0 hides its stiffness."""
SOLUTIONS = 6
"""Solutions with the factors of a matrix that a step of radau takes, about."""
LOOSE = 1e-2
"""Tolerances above this are for radau where surfaces may touch: explicit steps may gain more than is mended."""
COARSE = 3e-4
"""Tolerances above this are for semi-implicit steps where surfaces may touch, where these serve."""
DIGITS = 1e-5
"""Tolerances below this are for order 8."""


@final
class Auto(ReducedMethod):
    """rk54 or rk87 by the tolerance, and radau from where the problem shows itself stiff."""

    name = "auto"

    def __init__(self, equations: Equations, control: Control) -> None:
        super().__init__(equations, control)
        name = "rk87" if control.rtol.value < DIGITS else "rk54"
        self._explicit, self._limit = Explicit(equations, control, tableau(name)), LIMITS[name]
        self._implicit: Implicit | None = None
        self._begun: Implicit | None = None
        self._held = self._free = self._failures = 0
        self._trial: int | None = None
        self._waits = self._asleep = 0
        self._returns, touches = False, _touches(equations)
        self._semi: Explicit | None = None
        self.stiffness, self.rough = 0.0, tuple[Array, ...]()
        self.name, self.exponent, self.share = name, self._explicit.exponent, self._explicit.share
        self.counts: dict[str, Any] = {"chosen": name, "switches": []}
        if touches and name == "rk54" and control.rtol.value > COARSE and cheap(equations):
            self._semi = semi_implicit(equations, control)
            self.name = self.counts["chosen"] = self._semi.name
            self.exponent, self.share = self._semi.exponent, self._semi.share
        elif touches:
            self._begin()

    def _begin(self) -> None:
        """Begin without semi-implicit steps, as tolerances ask for where surfaces may touch."""
        self._semi = None
        self.exponent, self.share = self._explicit.exponent, self._explicit.share
        self.name = self._explicit.name
        if self.equations.n > FREEDOMS:
            factors, solutions = costs(self.equations.n, scheme_of(self.equations, self.control).nodes.size)
            self._waits = self._asleep = WINDOW * (factors + SOLUTIONS * solutions) // self._explicit.method.c.size
            self._returns = True
        elif self.name == "rk54" and self.control.rtol.value > LOOSE:
            self._go_implicit()
            self.name = "radau"
        elif self.name == "rk54":
            self._trial, self._returns = TRIAL, True
        self.counts["chosen"] = self.name

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        if self._semi is not None and h >= 0.0:
            return self._semi.step(state, h)
        if self._semi is not None:  # losses gain energy backward in time, which implicit steps do not see
            self._begin()
        if self._implicit is not None:
            return self._implicit.step(state, h)
        try:
            found = self._explicit.step(state, h)
        except SolveError as error:
            self._failures += 1
            if self._failures > PATIENCE and error.outcome not in FINAL:
                self._switch(state.t, h, FAILING)
            raise
        if found.error <= 1.0:
            self._failures = 0
            if self._asleep:
                self._asleep -= 1
            elif self._explicit.stiffness > self._limit:
                self._held, self._free = self._held + 1, 0
                if self._held == HELD:
                    self._switch(found.end.t, h, f"h·|λ| = {self._explicit.stiffness:.1f} holds its steps")
            else:
                self._free += 1
                if self._free == 6:
                    self._held = 0
        return found

    def many(self, span: Span[ReducedState]) -> Leg[ReducedState] | None:
        """Explicit steps, many in one compiled call, until stiffness is detected; then implicit ones while they pay."""
        if self._semi is not None and span.until >= span.t0:
            return self._semi.many(span)
        if self._semi is not None:
            self._begin()
        if self._implicit is not None:
            rival = Rival(self._limit, self._explicit.method.c.size, self._return) if self._returns else None
            return self._implicit.many(span, rival)
        if self._asleep:
            return self._explicit.many(span, np.inf, self._wake, self._asleep)
        return self._explicit.many(span, self._limit, self._switch, self._trial)

    def _wake(self, t: float, h: float, reason: str) -> None:
        """Heed stiffness from here on: a trial of radau costs less than the steps so far did."""
        self._asleep = 0
        if reason == FAILING:
            self._switch(t, h, reason)

    def _switch(self, t: float, h: float, reason: str) -> None:
        self._go_implicit()
        self.counts["switches"].append({"t": float(t), "to": "radau", "step": float(h), "reason": reason})

    def _return(self, t: float, h: float, reason: str, vain: bool) -> None:
        self._implicit = None
        if self._trial is not None:
            self._trial = 2 * self._trial if vain else TRIAL
        self._asleep = self._waits = 2 * self._waits if vain else self._waits
        self.exponent, self.share = self._explicit.exponent, self._explicit.share
        name = self._explicit.name
        self.counts["switches"].append({"t": float(t), "to": name, "step": float(h), "reason": reason})

    def _go_implicit(self) -> "Implicit":
        from ephs.mechanics.methods.radau import Implicit  # with derivatives, which explicit runs do not need

        if self._begun is None:
            known = dict(self.counts)
            self._begun = Implicit(self.equations, self.control, self.counts)
            self.counts |= known  # of the part of a run that is resumed
        self._implicit = self._begun
        self.exponent, self.share = self._implicit.exponent, self._implicit.share
        self.name = f"{self._explicit.name}, radau"
        return self._implicit

    def taken(self, state: ReducedState) -> Snapshot:
        """Memory of its present method, and its distance to a switch."""
        return {
            "explicit": self._explicit.taken(state),
            "implicit": self._implicit.snapshot(state) if self._implicit is not None else None,
            "nearness": [self._held, self._free, self._failures, self._trial, self._waits, self._asleep],
            "name": self.name,
            "semi": self._semi is not None,
        }

    def take(self, own: Snapshot, state: ReducedState) -> None:
        """Restore from a value of `taken`."""
        if self._semi is not None and not own["semi"]:
            self._begin()
        self._explicit.take(own["explicit"], state)
        if own["implicit"] is not None:
            self._go_implicit().restore(own["implicit"], state)
        self._held, self._free, self._failures, self._trial, self._waits, self._asleep = own["nearness"]
        self.name = own["name"]


def _touches(equations: Equations) -> bool:
    """Whether surfaces of a tree may touch, and implicit steps are taken many in one compiled call."""
    compiled = equations.constant and not (equations.engine.looped or equations.reduced.attaching.network.attached)
    return compiled and bool(equations.reduced.tables.support.any())
