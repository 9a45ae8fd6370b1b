"""A spring, a mass and a damper, composed by a pattern: a system to change.

    ephs check NAME.py:oscillator
    ephs run NAME.py:oscillator --until 10 --initial spring.q=1.0
    ephs equations NAME.py:oscillator

Units are SI.
"""

from ephs import Pattern, junction
from ephs import library as lib
from ephs import quantity as Q

# The pattern connects ports of boxes at junctions; it does not define the boxes' contents.
pattern = Pattern(
    junctions={"q": junction(Q.displacement), "p": junction(Q.momentum), "s": junction(Q.entropy)},
    boxes={
        "spring": {"q": "q"},
        "mass": {"p": "p"},
        "coupling": {"q": "q", "p": "p"},
        "damper": {"p": "p", "s": "s"},
        "pot": {"s": "s"},
    },
)

# Filling its boxes makes it a system. ephs.library has more to fill them with, and parts of your own
# are made from plain functions: ephs.storage, ephs.gyrator, ephs.transformer, ephs.irreversible.
oscillator = pattern(
    spring=lib.spring(k=1.5),
    mass=lib.point_mass(m=1.0),
    coupling=lib.pkc(),
    damper=lib.friction(d=0.1),
    pot=lib.thermal_capacity(c1=6000.0, c2=20.0),  # E = c1 exp(s/c2): 300 K at s = 0, 20 J/K
)

# From Python, with the state over time as arrays:
#   from NAME import oscillator
#   solution = ephs.simulate(oscillator, until=10.0, initial={"spring.q": 1.0}, step=0.01)
#   solution.t, solution["spring.q"], solution.heat, solution.energy_error.max()
