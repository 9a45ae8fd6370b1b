"""Flow, effort and power at an outer port, by the continuous relations at each kept instant."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import listed
from ephs.solve.equations.instant import InstantRates, instant
from ephs.solve.posing.motion_law import MotionLaw
from ephs.solve.posing.problem import Signal, State

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

START, HALVINGS = 1e-3, 40
"""First step of the differences of a prescribed effort, as a fraction of the run's span, and how often it is halved."""
SURE, DOUBTED = 1e-9, 1e-6
"""Error of such a derivative at which it is taken, and above which there is none where rounding allows no less; parts
of it, or of the effort over the span."""
PASSES, SETTLED = 30, 1e-9
"""Passes for the derivatives of efforts that read states, until they change by no more than this, relative."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class PortMotion:
    """An outer port over a run.

    Parameters
    ----------
    flow, effort
        (n, d) each, the flow into the system, the effort relative to the reference environment. A flow is NaN where it
        depends on the derivative of a prescribed effort that has none.
    intensive
        (d,) what turns the effort into the energy effort: θ₀ at entropy ports, −π₀ at volume ports, μ₀ of species.
    """

    flow: Array
    effort: Array
    intensive: Array

    @property
    def power(self) -> Array:
        """(n,) energy supplied through the port in W."""
        return np.einsum("nd,nd->n", self.effort + self.intensive, self.flow)

    @property
    def exergetic_power(self) -> Array:
        """(n,) exergy supplied through the port in W."""
        return np.einsum("nd,nd->n", self.effort, self.flow)


def port_motion(solution: "Solution", path: Path) -> PortMotion:
    """Flow and effort at an outer port of a solution's system."""
    problem = solution.problem
    if problem is None:
        raise TypeError("a solution that was read from a file without its system has no ports")
    d = problem.descriptor
    slots = {slot.path: slot for slot in d.outer}
    if path not in slots:
        raise KeyError(f"{path}: no such outer power port; the ports are {listed(path, slots)}")
    slot, n = slots[path], len(solution)
    flow, effort = np.zeros((n, slot.quantity.space.dim)), np.zeros((n, slot.quantity.space.dim))
    for i in range(n):
        now = rates_at(solution, i, solution.state_at(i) if solution.linked is None else solution.linked.state(i))
        flow[i], effort[i] = now.flows[path], now.efforts[slot.efforts]
    return PortMotion(flow, effort, problem.reference.intensive(slot.quantity))


def rates_at(solution: "Solution", i: int, state: State) -> InstantRates:
    """Rates, efforts, multipliers and flows at the i-th instant of a solution with its problem, in a state.

    Where the function that prescribes an effort has no derivative, the numbers that depend on this are NaN.
    """
    problem = solution.problem
    assert problem is not None
    d, t = problem.descriptor, float(solution.t[i])
    x, inputs = d.pack(state), problem.inputs(t, state)
    ends = float(solution.t[0]), float(solution.t[-1])
    led = {port: signal for port, signal in problem.signals.items() if signal.effort and not signal.constant}
    rising = {port: _risen(signal, t, ends, lambda _: state) for port, signal in led.items()}
    found = instant(d, problem.reference, x, inputs, rising)
    following = {port: signal for port, signal in led.items() if not (signal.timed or signal.held)}
    for _ in range(PASSES if following else 0):  # they read states, whose rates depend on their derivatives
        rates, before = np.concatenate([found.rates[slot.path] for slot in d.states]), rising

        def along(time: float, rates: Array = rates) -> State:
            return d.unpack(d.advance(x, time * rates))

        rising = rising | {port: _risen(signal, t, ends, along) for port, signal in following.items()}
        found = instant(d, problem.reference, x, inputs, rising)
        if all(np.allclose(rising[port], before[port], SETTLED, 0.0, equal_nan=True) for port in following):
            return found
    unsettled = {port: np.full_like(rising[port], np.nan) for port in following}
    return instant(d, problem.reference, x, inputs, rising | unsettled) if unsettled else found


def _risen(signal: Signal, t: float, ends: tuple[float, float], along: Callable[[float], State]) -> Array:
    """(dim,) derivative by time of a signal; ``along`` gives the states some time later. NaN where there is none."""
    if isinstance(signal.value, MotionLaw):
        return np.array([signal.value.acceleration(t)])
    here = signal.at(t, along(0.0))
    if signal.held:
        return np.zeros_like(here)
    first, last = sorted(ends)
    unit = last - first or 1.0

    from scipy.differentiate import jacobian

    def later(times: Array) -> Array:
        values = [signal.at(t + time, along(time)) for time in times.ravel().tolist()]
        return np.array(values).T.reshape(here.size, *times.shape[1:])

    least = float(np.abs(here).max()) / unit
    allowed = {"atol": SURE * least, "rtol": SURE}
    way = int(t - START * unit < first) - int(t + START * unit > last)
    found = jacobian(
        later, np.zeros(1), initial_step=START * unit, maxiter=HALVINGS, step_direction=way, tolerances=allowed
    )
    sure = found.error <= DOUBTED * np.maximum(np.abs(found.df), least)
    return np.where(sure, found.df, np.nan)[:, 0]
