"""Joint coordinates held to the relations of the flat system."""

import numpy as np

from tests.mechanics.methods.systems import oracle_of
from tests.numerics import largest

__all__ = ["held_to_the_general_form"]


def rising(eq, state, y):
    """Rates of all states where the mechanism is: by extrapolated differences of states along its own motion."""
    rates = eq.rates(0.0, state.q, y)[: eq.nv + eq.n + eq.ns]

    def states(t):
        v, r, heats = np.split(t * rates, [eq.nv, eq.nv + eq.n])
        return eq.states(type(state)(0.0, eq.advance(state.q, v), state.r + r, state.heats + heats, state.totals))

    def slope(h):
        ahead, back = states(h), states(-h)
        return {path: (ahead[path] - back[path]) / (2.0 * h) for path in ahead}

    coarse, fine = slope(2e-4), slope(1e-4)
    return {path: (4.0 * fine[path] - coarse[path]) / 3.0 for path in fine}


def held_to_the_general_form(eq, problem, state):
    """Assert that momenta, and what is attached, change as the oracle of the flat system says."""
    found, states = rising(eq, state, eq.vector(state)), eq.states(state)
    rates = oracle_of(problem).rates(states)
    condition = np.linalg.cond(eq.mass(state.q, state.r)) if eq.n else 1.0
    attached = {one.path for one in eq.reduced.attaching.network.states} | set(eq.reduced.entropies)
    for slot in problem.descriptor.states:
        if (slot.quantity.parity > 0 and slot.path not in attached) or not slot.quantity.space.dim:
            continue  # elements follow from rates
        one, other = found[slot.path], rates[slot.path]
        size = max(1.0, float(largest(other)))
        assert largest(one - other) <= 1e-10 * condition * size, slot.path
