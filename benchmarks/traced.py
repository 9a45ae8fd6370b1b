"""What a primitive of one's own costs: from the library, traced from a function, called back in Python."""

import numpy as np

import ephs
from ephs import library as lib
from ephs import quantity as Q
from examples import oscillator

__all__ = ["table"]

STEP, STEPS, SLOW = 0.01, 20_000, 1_000


def friction(p, s):
    """0.1 [[θ, −u], [−u, u²/θ]]."""
    return 0.1 * np.array([[s, -p], [-p, p * p / s]])


def opaque_friction(p, s):
    """The same, in a way that cannot be traced."""
    return friction(float(p), float(s))


def _traced(energy, matrix):
    pe = ephs.storage({"q": Q.displacement}, energy)
    return pe, ephs.irreversible({"p": Q.momentum, "s": Q.entropy}, matrix)


def _cases():
    return {
        "library": (lib.spring(k=1.5), lib.friction(d=0.1)),
        "traced": _traced(lambda q: 0.75 * q * q, friction),
        "called back": _traced(lambda q: 0.75 * float(q) * q, opaque_friction),
    }


def table() -> str:
    """A damped oscillator by the natural method: microseconds a step, relative to the library's."""
    rows: list[tuple[str, float, float]] = []
    for name, (pe, mf) in _cases().items():
        system = oscillator.damped(
            osc=oscillator.oscillator(pe=pe, ke=lib.point_mass(m=1.0), pkc=lib.pkc()), mf=mf, env=lib.environment()
        )
        steps = SLOW if name == "called back" else STEPS
        start = {"osc.pe.q": 1.0}
        ephs.simulate(system, STEP, initial=start, step=STEP)  # compiles
        sol = ephs.simulate(system, STEP * steps, initial=start, step=STEP)
        rows.append((name, 1e6 * sol.stats["integrate_s"] / steps, float(sol.energy_error.max())))
    base = rows[0][1]
    lines = ["| spring and friction | a step [µs] | ratio | energy error |", "| --- | --- | --- | --- |"]
    lines += [f"| {name} | {cost:.3g} | {cost / base:.3g} | {error:.1e} |" for name, cost, error in rows]
    return "\n".join(lines)
