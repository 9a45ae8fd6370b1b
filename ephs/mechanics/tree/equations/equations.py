"""A mechanism in joint coordinates: its equations of motion, the closing of its loops, and the paper's states.

What every method on the reduced form shares. A step moves q = q⁰·exp(v): the increments v and all else live in vector
spaces, v̇ = dexp⁻¹(v) r.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, final

import numpy as np

from ephs.mechanics.tree.engine.build import engine_of
from ephs.mechanics.tree.equations.accounts import Accounts
from ephs.mechanics.tree.equations.booking import Booking
from ephs.mechanics.tree.equations.dense import Dense, require_determined, unmoved
from ephs.mechanics.tree.equations.given import Given
from ephs.mechanics.tree.equations.heat import heats_of
from ephs.mechanics.tree.equations.led import Led
from ephs.mechanics.tree.equations.paper import PaperStates
from ephs.mechanics.tree.equations.prescribed import Prescribed
from ephs.mechanics.tree.equations.reading import JointStates
from ephs.mechanics.tree.equations.stages import evaluated
from ephs.mechanics.tree.equations.state import Reactions, ReducedState
from ephs.mechanics.tree.finding.layout import Layout
from ephs.mechanics.tree.finding.mechanism import reduce_system
from ephs.mechanics.tree.finding.naming import tolerances, within
from ephs.mechanics.tree.sweeps.acting import TOTALS
from ephs.operad.collector import paused_collector
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.codes import VECTOR
from ephs.semantics.spaces.rank import SPARSE, TINY
from ephs.solve.equations.model import model_of
from ephs.solve.march.records import Status
from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.posing.problem import NO_STATE, Problem
from ephs.solve.running.control import Tolerance
from ephs.solve.running.stepping import Row

__all__ = ["ReducedEquations", "ReducedState"]

PUSHED = 1e-9
"""Size of a push below which no degree of freedom is left that it could move."""
ASIDE = 0.1
"""Displacement, in rad or m, that finds the constraints which repeat others in every configuration."""


@final
class ReducedEquations:
    """The reduced form of one problem. It keeps scratch memory: use one for each thread.

    With ``pushed`` forces may be put into ``drive`` at every joint, not only where the problem has an input. With
    ``apart`` each body is a link of the engine.

    Attributes
    ----------
    summed
        Number of totals.
    careful
        Whether the loops were closed last at constraints that nearly repeat each other.
    """

    @paused_collector()
    def __init__(self, problem: Problem, t0: float, *, pushed: bool = False, apart: bool = False) -> None:
        self.problem, self._apart = problem, apart
        self.model = model = model_of(problem, t0, matrix=False)
        self.reduced = reduced = reduce_system(problem, model)
        self._dense: Dense | None = None
        t, joints = reduced.tables, range(len(reduced.joints))
        self.careful = self._factored = False
        self._closed_at = np.zeros(0), np.zeros(0)
        self.nv, self.n, self.ns = int(t.dim[: len(joints)].sum()), reduced.freedoms, len(reduced.entropies)
        self.summed = TOTALS + len(reduced.made)
        self.size = self.nv + self.n + self.ns + self.summed
        self.prescribed = Prescribed(reduced)
        groups = [i for i in joints if t.code[i] != VECTOR]
        self.curved = np.array([int(t.r_at[i]) + j for i in groups for j in range(int(t.dim[i]))], dtype=int)
        self._owner = np.repeat(np.arange(reduced.links), t.dim[: reduced.links])
        self.counted = np.r_[np.arange(self.n), self.nv : self.nv + self.n + self.ns]
        self.heats = heats_of(reduced, model.reference.temperature)
        self.led = Led(
            problem,
            frozenset(reduced.entropies[: self.ns - len(reduced.attaching.network.states)]),
            moved=self.prescribed.freedoms.size > 0,
        )
        self.scal = model.scal(0.0)
        self.given = Given(problem, reduced, self.nv, self.prescribed)
        self.drive, self.wrench = self.given.drive, self.given.wrench
        self.constant, self.held = problem.constant, problem.held and not problem.constant
        self.steady, self.timed = self.constant or self.held, problem.timed
        self._paper, self.layout = PaperStates(reduced, problem), Layout.of(reduced)
        self.booking, self.accounts, self.evaluations = Booking(self, self._paper), Accounts(self), 0
        self.driven = self.prescribed.freedoms
        self._momenta = False
        self.holding: Reactions | None = None
        self._acted = self.given.acted(set(joints) if pushed else set())
        self._build(None)

    def _build(self, kept: "list[Array] | None") -> None:
        """The engine, with all rows of the cut joints or those that are kept."""
        self.engine = engine_of(
            self.reduced, self.drive, self.wrench, self.scal, self.given.supply, self.prescribed.lead,
            self._acted, kept, apart=self._apart, momenta=self._momenta,
        )  # fmt: skip

    def keep_momenta(self) -> None:
        """Make steps keep momenta where nothing holds the mechanism."""
        self._momenta = True
        self._build(None)

    # ---- the equations -----------------------------------------------------------------------------------------

    def advance(self, q: Array, v: Array) -> Array:
        """q·exp(v), joint by joint."""
        return self.engine.advance(q, v)

    def rates(self, t: float, base: Array, y: Array) -> Array:
        """ẏ of y = (v, r, heats, totals), of the totals those of `TOTALS` and flows, at q = base·exp(v).

        Raises
        ------
        SolveError
            A component cannot be evaluated there, or the mass matrix is singular.
        """
        nv, n, ns = self.nv, self.n, self.ns
        self.evaluations += 1
        self._factored = False
        if self.timed and not self.constant:
            self.given.place(t, NO_STATE)
        elif not self.constant:
            v, r, heats, totals = np.split(y, [nv, nv + n, nv + n + ns])
            self.given.place(t, self.states(ReducedState(t, self.advance(base, v), r, heats, totals)))
        q, out = self.unheld(base, y)
        if self.holding is not None:
            out[nv : nv + n] += self.holding(t, q, y[nv : nv + n], out[nv : nv + n])
        return out

    def accelerations(self, state: ReducedState) -> Array:
        """(n,) of the tree's degrees of freedom at a state."""
        require_determined(self.reduced)
        return self.rates(state.t, state.q, self.vector(state))[self.nv : self.nv + self.n]

    def unheld(self, base: Array, y: Array) -> tuple[Array, Array]:
        """The elements base·exp(v), and `rates` under the inputs at hand, where no contacts are held."""
        status, q, out = self.engine.rates(base, y)
        component = self.engine.failed
        if status == Status.DEPENDENT:
            status, component = self.dense.rates(q, y, self.given, self.heats, out)
            self.engine.velocities(y, y[self.nv : self.nv + self.n], out)
        self.refuse(status, component)
        return q, out

    def stages(
        self, state: ReducedState, scheme: Mapping[str, Array], c: Array, h: float, y0: Array, k: Array, y1: Array
    ) -> Array:
        """The rates k (stages + 1, size) at the stages and the end of a step, k[0] known; y at the end into y1.

        Returns y at the last stage. See `Engine.stages`.
        """
        if self.held:
            self.given.place(state.t, NO_STATE)
        if self.steady:
            status, evaluations, before = self.engine.stages(scheme, state.q, y0, h, k, y1)
            self.evaluations += evaluations
            if status != Status.DEPENDENT:
                self.refuse(status, self.engine.failed)
                return before

        def rates_at(part: float, y: Array) -> Array:
            return self.rates(state.t + part * h, state.q, y)

        before, y1[:] = evaluated(rates_at, scheme["a"], c, h, y0, k)
        return before

    def prepare(self, state: ReducedState) -> None:
        """Compile programs that are not in the cache."""
        self.rates(state.t, state.q, self.vector(state))
        self.evaluations = 0

    def refuse(self, status: int, component: int) -> None:
        """Raise the error that a compiled function reported, if any."""
        if status == Status.STILL and not np.all(np.isfinite(self.engine.array("work"))):
            raise SolveError(Outcome.RANGE, "", "the rates of the joints")
        if status == Status.UNSETTLED:
            raise SolveError(Outcome.DIVERGED, "", "the stages of a step")
        if status == Status.STILL:
            raise unmoved(self.reduced, int(component))
        if status == Status.LAWLESS:
            raise SolveError(Outcome.LAWLESS, str(self.model.path_of(int(component))), "")
        if status:
            raise SolveError.of_component(int(status), self.model, int(component))

    def moved(self, q: Array, change: Array) -> Array:
        """q·exp(change), the change given for the tree's joints; cut ones stay."""
        return self.advance(q, np.concatenate([change, np.zeros(self.nv - self.n)]))

    # ---- closing loops -----------------------------------------------------------------------------------------

    def closed(self, state: ReducedState) -> ReducedState:
        """The state with loops closed and rates on the constraints, by the least change in the mass metric.

        Raises
        ------
        SolveError
            The loops do not close near by, or the state has left the range of numbers.
        """
        within(self.reduced, state.q, state.r, state.heats)
        if np.any(state.r[self.driven] != self.prescribed.rates(state.t)):  # all rates give way, in the mass metric
            return self._closed_carefully(state)
        self.careful = False
        if not self.engine.looped:
            return state
        status, q, r = self.engine.close(state.q, state.r)
        if status == Status.OPEN:
            raise self.opened(q, r)
        self.careful = status != 0
        if status != 0:
            return self._closed_carefully(state)
        self._closed_at, self._factored = (q, r), True
        return replace(state, q=q, r=r, memory=())

    def opened(self, q: Array, r: Array) -> SolveError:
        """The loop that stays open most."""
        gaps = self.dense.gaps(q, r)[0]
        return self.dense.opened(gaps, float(np.abs(gaps).max(initial=0.0)))

    def separation(self) -> Array:
        """Squared part of each loop constraint off those before it, relative to the largest constraint, (m,).

        In the mass metric, where loops were closed last; not below what calls for care.
        """
        rows = self.engine.array("value")
        known = self._closed_at[0].size > 0 and not self.careful
        return np.maximum(SPARSE, known * rows[:, 3] / max(rows[:, 2].max(initial=0.0), TINY))

    def _closed_carefully(self, state: ReducedState) -> ReducedState:
        """`closed`, for constraints that nearly repeat each other."""
        self.careful = True
        wanted = self.prescribed.rates(state.t)
        q, r = self.dense.closed(state.q, state.r, wanted, self.moved)
        r[self.driven] = wanted
        return replace(state, q=q, r=r, memory=())

    @property
    def dense(self) -> Dense:
        """Sweeps over dense matrices, made when they are first asked for."""
        if self._dense is None:
            self._dense = Dense(self.reduced, self.scal, self.given.supply, self.prescribed.lead)
        return self._dense

    def refilled(self) -> None:
        """Invalidate results of the tables after a change of their numbers."""
        self._dense, self._closed_at = None, (np.zeros(0), np.zeros(0))

    def mass(self, q: Array, r: Array) -> Array:
        """(n, n) the mass matrix at q."""
        return self.dense.mass(q, r)

    def rows(self) -> Array:
        """(m, n) rows of prescribed joints, then of loops, on the tree's rates, where the mass matrix was made last."""
        return self.dense.rows()

    def gaps(self, q: Array, r: Array) -> tuple[Array, Array]:
        """Position residuals of loops at q, zeros for prescribed joints before them; and the rows (m, n) there."""
        return self.dense.gaps(q, r)

    def fitted(self, q: Array, r: Array) -> Array:
        """q with the cut joints' elements nearest to where their bodies put them."""
        return self.dense.fitted(q, r)

    def load(self, t: float, q: Array, r: Array, heats: Array) -> None:
        """Write inputs at a time and state into ``drive`` and ``wrench``."""
        if self.timed and not self.constant:
            self.given.place(t, NO_STATE)
        elif not self.constant:
            self.given.place(t, self.states(ReducedState(t, q, r, heats, np.zeros(self.summed))))

    # ---- a step ------------------------------------------------------------------------------------------------

    def vector(self, state: ReducedState) -> Array:
        """y at the state: increments zero."""
        return np.concatenate([np.zeros(self.nv), state.r, state.heats, state.totals])

    def state(self, base: ReducedState, y: Array, t: float) -> ReducedState:
        """The state that the vector y means at the end of a step from ``base``; its loops are as they come."""
        return self.ended(base, self.settled(self.vector(base), y), t)

    def ended(self, base: ReducedState, y: Array, t: float) -> ReducedState:
        """The same of a vector whose totals are made up already.

        Prescribed rates differ from integrals of their accelerations by an error of the step, and by rounding: what
        following the laws adds to the energy is work of the motions, no matter of what else moves.
        """
        q, at = self.advance(base.q, y[: self.nv]), self.nv + self.n
        end = ReducedState(t, q, y[self.nv : at], y[at : at + self.ns], y[at + self.ns :], account=base.account)
        if not self.prescribed.changing:
            return end
        followed = self.prescribed.followed(base, end)
        energies = [self.engine.energy(of.q, of.r, of.heats)[:2].sum() for of in (end, followed)]
        totals = followed.totals.copy()
        totals[1] += energies[1] - energies[0]
        return replace(followed, totals=totals)

    def settled(self, y0: Array, y1: Array) -> Array:
        """The end y1 of a step from y0 with what components made in place of what they passed on."""
        return self.engine.book(y0, y1) if self.ns else y1

    def allowed(self, rtol: Tolerance, atol: Tolerance) -> tuple[Array, Array]:
        """rtol and atol of what counts in an error: the tree's increments, its rates, the heats."""
        theta = self.model.reference.temperature
        return tolerances(self.reduced, rtol, 1.0), tolerances(self.reduced, atol, theta)

    def sizes(self, y0: Array, y1: Array) -> Array:
        """Reference of a relative tolerance: for increments 1 rad or m, for rates the joint's as a whole."""
        size = np.maximum(np.abs(y0), np.abs(y1))[self.counted]
        size[: self.n] = 1.0
        rates, most = size[self.n : 2 * self.n], np.zeros(self.reduced.links)
        np.maximum.at(most, self._owner, rates)
        rates[:] = most[self._owner]
        return size

    def along(self, estimate: Array) -> Array:
        """An estimate for (v of the tree, r, s) without its parts across the constraints, where loops were closed last.

        Closing the loops takes those out; near a singular configuration they are most of the estimate.
        """
        if not (self.engine.looped or self.careful):
            return estimate
        if not (self.careful or self._factored):
            self.engine.close(*self._closed_at)
        out = np.array(estimate)
        for part in (slice(0, self.n), slice(self.n, 2 * self.n)):
            if self.careful:
                out[part] += self.dense.back(out[part])
            else:
                out[part] = self.engine.along(self._closed_at[0], out[part])
        return out

    def row(self, state: ReducedState) -> Row:
        """Record of a state."""
        return self.booking.record_of([state], np.array([state.t]), np.zeros(1)).rows[0]

    def least(self, start: ReducedState, end: ReducedState) -> float:
        """The least entropy that a component made between two states, in J/K."""
        made = end.totals[TOTALS:] - start.totals[TOTALS:]
        return float(made.min()) if made.size else 0.0

    def stats(self) -> dict[str, Any]:
        """Counts, for the solution's statistics."""
        return {
            "form": "reduced",
            "evaluations": self.evaluations,
            "cut_joints": [edge.name for edge in self.reduced.cut],
            "unknowns": self.unknowns,
            "paper_unknowns": self.model.unknowns,
            **self.accounts.stats(),
            **self.led.stats(),
        }

    @property
    def unknowns(self) -> int:
        """Places and rates of the tree's degrees of freedom, and a multiplier for each equation of a loop that is
        kept.
        """
        return 2 * self.n + len(self.engine.closing.row)

    def states(self, state: ReducedState) -> JointStates:
        """All states of the system."""
        return JointStates(self._paper, self.layout, state.q, state.r, self.heats.entropies(state.heats))

    def start(self, t: float, *, determined: bool = True) -> ReducedState:
        """The state that the problem begins with, its loops closed; if it is to be moved from, ``determined``.

        Raises
        ------
        SolveError
            The initial states contradict the joints, or no mass determines the motion of a link without mass.
        """
        if determined:
            require_determined(self.reduced)
        q, r, s = self._paper.initial()
        state = self.closed(ReducedState(t, q, r, self.heats.energies(s), np.zeros(self.summed)))
        self.led.start(lambda: self.row(state).energies)
        state = self.accounts.opened(state)
        self._paper.check(state.q, state.r, self.heats.entropies(state.heats), lambda: self.accelerations(state))
        if self.careful:
            self._without_repeated(state)
        return state

    def _without_repeated(self, state: ReducedState) -> None:
        """Leave out of the engine the rows that others imply, where that is so aside of the initial state, too."""
        push = np.random.default_rng(1).standard_normal(self.n)
        push += self.dense.back(push)
        q = self.moved(state.q, ASIDE * push / max(PUSHED, np.abs(push).max()))
        try:
            aside = self._closed_carefully(replace(state, q=q))
        except SolveError:
            return
        self._build(self.dense.independent(aside.q, aside.r))
