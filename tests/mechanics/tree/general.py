"""Joint coordinates held to the general form."""

import numpy as np

from ephs.semantics.descriptor import Input
from ephs.solve.instant import instant

__all__ = ["held_to_the_general_form"]


def rising(eq, state, y):
    """Rates of all states where the mechanism is: by extrapolated differences of states along its own motion."""
    rates = eq.rates(0.0, state.q, y)[: eq.nv + eq.n + eq.ns]

    def states(t):
        v, r, heats = np.split(t * rates, [eq.nv, eq.nv + eq.n])
        return eq.states(type(state)(0.0, eq.advance(state.q, v), state.r + r, state.heats + heats, state.books))

    def slope(h):
        ahead, back = states(h), states(-h)
        return {path: (ahead[path] - back[path]) / (2.0 * h) for path in ahead}

    coarse, fine = slope(2e-4), slope(1e-4)
    return {path: (4.0 * fine[path] - coarse[path]) / 3.0 for path in fine}


def held_to_the_general_form(eq, problem, state):
    """Assert that momenta, and what is attached, change as the continuous equations of the flat system say."""
    found = rising(eq, state, eq.vector(state))
    inputs = {port: Input(np.array(one.value), one.effort) for port, one in problem.signals.items()}
    states = eq.states(state)
    whole = instant(problem.descriptor, problem.reference, problem.descriptor.pack(states), inputs)
    condition = np.linalg.cond(eq.mass(state.q, state.r)) if eq.n else 1.0
    attached = {one.path for one in eq.reduced.attaching.network.states}
    for slot in problem.descriptor.states:
        if (slot.quantity.parity > 0 and slot.path not in attached) or not slot.quantity.space.dim:
            continue  # elements follow from rates
        one, other = found[slot.path], whole.rates[slot.path]
        size = max(1.0, float(np.abs(other).max()))
        near = 1e-10 if slot.path in attached else 1e-8  # the latter by differences
        assert np.abs(one - other).max() <= near * condition * size, slot.path
