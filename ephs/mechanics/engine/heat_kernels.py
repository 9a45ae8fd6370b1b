"""Storages of heat in compiled code: entropies by energies, and the entropy that a step made."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import math

from ephs.semantics.kernel_table import TEMPERATURE
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel


@kernel
def entropies(f, heats, scal, s):
    """Entropies s of energies in J, E = c1 (exp(s/c2) − 1), of the environment θ₀ s; (status, component)."""
    for k in range(f.node.shape[0]):
        if f.node[k] < 0:
            s[k] = heats[k] / scal[1]
            continue
        at = f.parameter_at[f.node[k]]
        share = heats[k] / f.parameters[at + 1]
        if not share > -1.0:
            return TEMPERATURE, f.node[k]
        s[k] = f.parameters[at] * math.log1p(share)
    return 0, 0


@kernel
def heat_rates(f, temperature, scal, rates, made):
    """In place, rates of entropies to those of energies, and entropies made a second to flows: what friction makes,
    what conduction carries from its first to its second end."""
    for k in range(rates.shape[0]):
        rates[k] *= temperature[k] + scal[1]
    for i in range(f.sink.shape[0]):
        made[f.sink[i, 0]] *= temperature[f.sink[i, 1]] + scal[1]
    for i in range(f.conduction.shape[0]):
        one, two = temperature[f.conduction[i, 1]], temperature[f.conduction[i, 2]]
        maker = f.made_at[f.conduction[i, 0]]
        if one == two:
            made[maker] = 0.0
        else:
            made[maker] *= (one + scal[1]) * (two + scal[1]) / (one - two)


@kernel
def count(f, before, after, scal, memory):
    """What components made in a step in place of what they passed on, in ``after`` (heats, heat, work, flows).

    Mean temperatures of the step are ΔE/Δs: so entropies change by what is made. ``before``: (heats, heat, work, made);
    ``memory`` (entropies,)."""
    count = f.node.shape[0]
    at = count + 2
    for k in range(count):
        if f.node[k] < 0:
            memory[k] = 1.0 / scal[1]
            continue
        p = f.parameter_at[f.node[k]]
        held = f.parameters[p + 1] + before[k]
        share = (after[k] - before[k]) / held
        ratio = math.log1p(share) / share if abs(share) > 1e-8 else 1.0 - 0.5 * share
        memory[k] = ratio * f.parameters[p] / held
    for i in range(f.sink.shape[0]):
        maker = at + f.sink[i, 0]
        after[maker] = before[maker] + (after[maker] - before[maker]) * memory[f.sink[i, 1]]
    for i in range(f.conduction.shape[0]):
        maker = at + f.made_at[f.conduction[i, 0]]
        cold = memory[f.conduction[i, 2]] - memory[f.conduction[i, 1]]
        after[maker] = before[maker] + (after[maker] - before[maker]) * cold
