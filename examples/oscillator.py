"""An oscillator, and a damped one, nested: the oscillator without loss is one box of the pattern that adds friction.

Run it with ``python examples/oscillator.py``, or by the command line:

    ephs run examples/oscillator.py:damped_oscillator --until 10 --step 0.01 --initial osc.pe.q=1.0
    ephs run examples/oscillator.py:free_oscillator --until 10 --step 0.01 --initial osc.pe.q=1.0
    ephs draw examples/oscillator.py:damped_oscillator -o oscillator.svg
"""

import ephs
from ephs import Pattern, junction
from ephs import library as lib
from ephs import quantity as Q

# Spring and mass exchange energy through the kinematic coupling pkc; the momentum junction is exposed.
oscillator = Pattern(
    junctions={"q": junction(Q.displacement), "p": junction(Q.momentum, exposed=True)},
    boxes={"pe": {"q": "q"}, "ke": {"p": "p"}, "pkc": {"q": "q", "p": "p"}},
)

# Friction takes momentum and gives entropy to the environment.
damped = Pattern(
    junctions={"p": junction(Q.momentum), "s": junction(Q.entropy)},
    boxes={"osc": {"p": "p"}, "mf": {"p": "p", "s": "s"}, "env": {"s": "s"}},
)

# Without friction nothing else meets the momentum.
closed = Pattern(junctions={"p": junction(Q.momentum)}, boxes={"osc": {"p": "p"}})

free_oscillator = closed(osc=oscillator(pe=lib.spring(k=1.5), ke=lib.point_mass(m=1.0), pkc=lib.pkc()))
damped_oscillator = damped(
    osc=oscillator(pe=lib.spring(k=1.5), ke=lib.point_mass(m=1.0), pkc=lib.pkc()),
    mf=lib.friction(d=0.1),
    env=lib.environment(),
)

if __name__ == "__main__":
    # Filling and flattening commute: the flat system's pattern is the patterns' substitution.
    same = damped_oscillator.flatten().pattern == damped.substitute(osc=oscillator)
    solution = ephs.simulate(damped_oscillator, until=10.0, initial={"osc.pe.q": 1.0, "osc.ke.p": 0.0}, step=0.01)
    energy, exergy, entropy = solution.energy, solution.exergy, solution.entropy
    print(f"flattening is substitution: {same}")
    print(f"displacement at {solution.t[-1]:g} s: {solution['osc.pe.q'][-1]:.6f} m")
    print(f"exergy: {exergy[0]:.6f} J, at the end {exergy[-1]:.6f} J")
    print(f"entropy produced: {entropy[-1] - entropy[0]:.3e} J/K")
    print(f"largest change of energy: {abs(energy - energy[0]).max():.1e} J")
