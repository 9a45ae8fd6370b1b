"""What a primitive of one's own costs: from the library, recorded from a function, called back in Python."""

from time import process_time

import numpy as np

import ephs
from ephs import library as lib
from ephs import quantity as Q
from ephs.semantics.descriptor.kernel_table import address_of
from examples import oscillator

__all__ = ["table"]

STEP, STEPS, SLOW = 0.01, 20_000, 1_000


def friction(p, s):
    """0.1 [[θ, −u], [−u, u²/θ]]."""
    return 0.1 * np.array([[s, -p], [-p, p * p / s]])


def opaque_friction(p, s):
    """The same, in a way that cannot be recorded."""
    return friction(float(p), float(s))


def _made(energy, matrix):
    pe = ephs.storage({"q": Q.displacement}, energy)
    return pe, ephs.irreversible({"p": Q.momentum, "s": Q.entropy}, matrix)


def _cases():
    return {
        "library": lambda: (lib.spring(k=1.5), lib.friction(d=0.1)),
        "recorded": lambda: _made(lambda q: 0.75 * q * q, friction),
        "called back": lambda: _made(lambda q: 0.75 * float(q) * q, opaque_friction),
    }


def _prepared(make):
    """Two parts, and the processor time in ms for them and for what a run calls; SymPy and LLVM are loaded before."""
    start = process_time()
    parts = make()
    for part in parts:
        address_of(part, ephs.Reference())
    return parts, 1e3 * (process_time() - start)


def table() -> str:
    """A damped oscillator by the natural method: set-up, microseconds a step, relative to the library's."""
    rows: list[tuple[str, float, float, float]] = []
    _prepared(lambda: _made(lambda q: q**4, lambda p, s: 0.3 * p * p * np.array([[s, -p], [-p, p * p / s]])))
    for name, make in _cases().items():
        (pe, mf), setup = _prepared(make)
        system = oscillator.damped(
            osc=oscillator.oscillator(pe=pe, ke=lib.point_mass(m=1.0), pkc=lib.pkc()), mf=mf, env=lib.environment()
        )
        steps = SLOW if name == "called back" else STEPS
        start = {"osc.pe.q": 1.0}
        ephs.simulate(system, STEP, initial=start, step=STEP)  # compiles
        sol = ephs.simulate(system, STEP * steps, initial=start, step=STEP)
        rows.append((name, setup, 1e6 * sol.stats["integrate_s"] / steps, float(sol.energy_error.max())))
    base = rows[0][2]
    lines = [
        "| spring and friction | set-up [ms] | a step [µs] | ratio | energy error |",
        "| --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {name} | {setup:.3g} | {cost:.3g} | {cost / base:.3g} | {error:.1e} |" for name, setup, cost, error in rows
    ]
    return "\n".join(lines)
