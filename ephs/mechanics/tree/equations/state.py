"""State of a mechanism in joint coordinates, and sums since the start."""

from dataclasses import dataclass, field
from typing import Protocol, final

import numpy as np

from ephs.semantics.bundles.bundle import Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class ReducedState:
    """State of a mechanism: joints' elements q, rates r of the tree, heats, and sums since the start.

    Parameters
    ----------
    heats
        Energies in J of what stores entropy, from s = 0; of the environment θ₀ s.
    totals
        Heat and work in J, then the entropy that each component made in J/K.
    memory
        What a method takes along from step to step; none after a start.
    account
        (4 + momenta + heats + totals,) energy in J where nothing is booked, what is missing of it, what corrections put
        in, and the sum of their sizes, see `ephs.solve.march.account.RunAccount`; momenta that steps keep; then what
        rounding left of sums. Empty where a run starts.
    """

    t: float
    q: Array
    r: Array
    heats: Array
    totals: Array
    memory: tuple[Array, ...] = ()
    account: Array = field(default_factory=lambda: np.zeros(0))


class Reactions(Protocol):
    """Forces that act besides, from what the accelerations would be without them: of closed contacts."""

    def __call__(self, t: float, q: Array, r: Array, rates: Array) -> Array:
        """(n,) what they add to the accelerations."""
        ...

    def slopes(self, state: ReducedState, free: Array) -> Array:
        """(n, size) what they add to slopes of the accelerations."""
        ...
