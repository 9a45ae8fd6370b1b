"""Steps that keep the balance of energy, one by one: the account of a run, and the correction of a step's end.

The energy that is not heat is what it was at the start, and the work, less the heat, by compensated sums
over the run: see `ephs.solve.march.account`.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.march.account import WORTH
from ephs.solve.march.noted import Noted
from ephs.solve.march.records import Status
from ephs.solve.posing.errors import OptionError, nearest_of
from ephs.solve.running.snapshot import Snapshot

if TYPE_CHECKING:
    from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState

OWN = 4
"""Numbers of an account before the momenta that steps keep."""
KEEP = ("energy", "energy and momenta")
"""Quantities that every step keeps to rounding."""


@final
class Accounts:
    """The accounts of one mechanism's runs.

    Attributes
    ----------
    kept
        Whether steps are corrected.
    followed
        Whether steps go on from what is corrected: else the balance is kept at single states only, to the tolerance.
    noted
        What corrections put into the states that were kept.
    """

    def __init__(self, equations: "ReducedEquations") -> None:
        self._equations, self.kept, self.followed, self.noted = equations, False, True, Noted()

    def keep(self, what: str, also: tuple[str, ...] = ()) -> None:
        """Keep what is asked for: one of `KEEP`, or of what the method keeps by itself.

        Raises
        ------
        OptionError
            It is none of these.
        """
        if what not in (known := (*also, *KEEP)):
            raise OptionError("options['keep']", what, " or ".join(map(repr, known)) + nearest_of(what, known))
        if what == KEEP[1]:
            self._equations.keep_momenta()

    @property
    def own(self) -> int:
        """Numbers of an account before what rounding left of sums."""
        return OWN + self._equations.engine.momenta

    def opened(self, state: "ReducedState") -> "ReducedState":
        """The state with an account, which begins here unless it has one."""
        if state.account.size:
            return state
        eq = self._equations
        held = np.nan if eq.led.counting else float(eq.engine.energy(state.q, state.r, state.heats)[:2].sum())
        account = np.zeros(self.own + eq.ns + state.totals.size)
        account[0] = held + state.totals[0] - state.totals[1]
        account[OWN : self.own] = eq.engine.measure(state.q, state.r)
        return replace(state, account=account)

    def booked(
        self, start: "ReducedState", tableau: Mapping[str, Any], k: Array, h: float, y1: Array, *, part: bool = False,
        damped: Array | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """The end y1 of a step with rates k with heats and totals, and the account with what rounding left of them.

        Parameters
        ----------
        part
            Whether it is a part of a step: its sums lie between those in the engine's ``totals``.
        damped
            Elements at the end, where energy that the step misses becomes heat.

        Raises
        ------
        SolveError
            A component lost entropy in the step, or more heat was carried away than there is.
        """
        eq, start = self._equations, self.opened(start)
        carry, anchor = start.account[self.own :], float(start.account[0])
        given = tableau, k, h, eq.vector(start), y1, carry
        status, y, carry = eq.engine.sum(*given, anchor=anchor, part=part, damped=damped)
        eq.refuse(status, eq.engine.failed)
        return y, np.concatenate([start.account[: self.own], carry])

    def summed(
        self, start: "ReducedState", end: "ReducedState", tableau: Mapping[str, Any], k: Array, h: float, *,
        part: bool = False, damped: bool = False,
    ) -> "ReducedState":  # fmt: skip
        """The end of a step, whose loops are closed, with heats and totals and its account; see `booked`.

        Work that its totals have beyond those of the start, as of motions that it follows, is added to that of rates.
        """
        eq = self._equations
        at = eq.nv + eq.n
        k[:, at + eq.ns + 1] += (end.totals[1] - start.totals[1]) / h
        y, account = self.booked(start, tableau, k, h, eq.vector(end), part=part, damped=end.q if damped else None)
        return replace(end, heats=y[at : at + eq.ns], totals=y[at + eq.ns :], account=account)

    def corrected(
        self, start: "ReducedState", end: "ReducedState", h: float, allowed: Array, *, chosen: bool,
        alone: bool = False, share: float = WORTH,
    ) -> tuple["ReducedState", float]:  # fmt: skip
        """The end of a step of h seconds moved to the energy that is left to it, and the step's error by that.

        Heats, totals and sums of the end are taken, and its loops closed. Where constraints nearly repeat each other
        and motions are prescribed, what is missing is left to the steps that follow.

        Parameters
        ----------
        allowed
            (counted,) what errors of increments and rates may be.
        chosen
            Whether steps are chosen: then it is moved by no more than `ephs.solve.march.account.MOST` of these.
        alone
            Whether rates alone are moved, as of methods that do not resolve fast modes.
        share
            Share of the correction that counts as an error.

        Raises
        ------
        SolveError
            A component cannot be evaluated there.
        """
        eq, start, self.kept = self._equations, self.opened(start), True
        carry = (end if end.account.size else start).account[self.own :]
        if eq.careful and eq.driven.size:
            return replace(end, account=np.concatenate([start.account[: self.own], carry])), 0.0
        own, every = start.account[: self.own], np.full(allowed.size, np.inf)
        given = own, eq.vector(start), eq.vector(end), end.q
        found = eq.engine.correct(*given, every if eq.careful else allowed, h, chosen=chosen, alone=alone, share=share)
        if found[0] == Status.DEPENDENT:  # rates alone
            found = eq.engine.correct(*given, every, h, chosen=chosen, alone=alone, share=share)
        status, q, y, account, error = found
        eq.refuse(status, eq.engine.failed)
        end = replace(end, account=np.concatenate([account, carry]))
        if account[2] == start.account[2] and self.own == OWN:
            return end, error
        r, heats = np.split(y[eq.nv : eq.nv + eq.n + eq.ns], [eq.n])
        return replace(end, q=q, r=r, heats=heats), error

    def snapshot(self) -> Snapshot:
        """Notes of the run, for a journal."""
        return {"kept": self.kept, **self.noted.snapshot()}

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        self.kept = snapshot["kept"]
        self.noted.restore(snapshot)

    def stats(self) -> dict[str, Any]:
        """Statistics of corrected steps: by how much the balance would be missed without corrections."""
        if not (self.kept and self.followed) or self._equations.led.counting:
            return {}
        momenta = int(np.any(self._equations.engine.tables["bases"].reshape(-1, 6, 6), axis=1).sum())
        return self.noted.stats() | ({"momenta": momenta} if self.own > OWN else {})
