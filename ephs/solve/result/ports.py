"""Flow, effort and power at an outer port, by the continuous relations at each kept instant."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import listed
from ephs.solve.equations.instant import instant
from ephs.solve.posing.problem import Signal

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

DELTA = 1e-5
"""Time for differencing prescribed efforts, as a fraction of the run's span."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class PortMotion:
    """An outer port over a run.

    Parameters
    ----------
    flow, effort
        (n, d) each, the flow into the system, the effort relative to the reference environment.
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
    step = DELTA * float(solution.t[-1] - solution.t[0]) if n > 1 else DELTA
    for i, t in enumerate(solution.t):
        state = solution.state_at(i) if solution.linked is None else solution.linked.state(i)
        inputs = problem.inputs(float(t), state)
        rising = {
            port: _slope(signal, float(t), step, state) for port, signal in problem.signals.items() if signal.effort
        }
        now = instant(d, problem.reference, d.pack(state), inputs, rising)
        flow[i], effort[i] = now.flows[path], now.efforts[slot.efforts]
    return PortMotion(flow, effort, problem.reference.intensive(slot.quantity))


def _slope(signal: Signal, t: float, step: float, state: dict[Path, Array]) -> Array:
    if signal.constant:
        return np.zeros_like(signal.at(t, state))
    return (signal.at(t + step, state) - signal.at(t - step, state)) / (2.0 * step)
