"""Hot gas that pushes a piston that turns a crank: gases, heat and rigid bodies in one pattern.

The mechanism of scenes/slider-crank.toml is one box; the momentum of its cylinder joint is the port at which the piston
meets it. Hot gas above the piston expands, air in the crankcase below is compressed, heat goes through the head, and
friction warms the housing. The crank swings to and fro on the two cushions, ever less.

    python examples/gas_engine.py
"""

from math import log
from pathlib import Path

import ephs
from ephs import Pattern, Reference, junction
from ephs import library as lib
from ephs import quantity as Q

AREA = 2.0e-3  # m², of the piston
HOT = 700.0  # K, of the gas above the piston
HEAD, CRANKCASE = 1.2e-4, 2.9e-4  # m³, volumes at the start
C = 2.5  # of a diatomic gas: its energy is 5/2 π v
REFERENCE = Reference()

scene = ephs.load(Path(__file__).parents[1] / "scenes" / "slider-crank.toml")
engine = scene.system(driven=["cylinder"])
SLIDING, TURNING = "drives.cylinder", "drives.bearing"


def air(volume: float) -> tuple[object, float]:
    """Air in a volume at the surroundings' state, where its entropy is 0; and its heat capacity in J/K."""
    energy = C * REFERENCE.pressure * volume
    capacity = energy / REFERENCE.temperature
    return lib.ideal_gas(c1=energy, c2=capacity, v0=volume, c=C), capacity


above, capacity = air(HEAD)
below, _ = air(CRANKCASE)
cylinder = Pattern(
    junctions={
        "v1": junction(Q.volume),
        "v2": junction(Q.volume),
        "s1": junction(Q.entropy),
        "s2": junction(Q.entropy),
        "s": junction(Q.entropy),
        "p": junction(Q.momentum),
        "p_r": junction(engine.interface[SLIDING].quantity),
        "shaft": junction(engine.interface[TURNING].quantity, exposed=True),  # for a load
    },
    boxes={
        "above": {"v": "v1", "s": "s1"},
        "below": {"v": "v2", "s": "s2"},
        "piston": {"v1": "v2", "v2": "v1", "p": "p"},  # sliding outwards takes from what is above
        "rod": {"p": "p", "p_r": "p_r"},
        "engine": {SLIDING: "p_r", TURNING: "shaft"},
        "head": {"s1": "s1", "s2": "s"},
        "sump": {"s1": "s2", "s2": "s"},
        "wall": {"s": "s"},
    },
)
gas_engine = cylinder(
    above=above,
    below=below,
    piston=lib.piston(a=AREA),
    rod=ephs.transformer({"p": Q.momentum, "p_r": engine.interface[SLIDING].quantity}, [[1.0]], name="rod"),
    engine=engine,
    head=lib.heat_transfer(h=0.02),
    sump=lib.heat_transfer(h=0.02),
    wall=lib.thermal_capacity(capacity=100.0, temperature=REFERENCE.temperature),
)
START = {
    "above.v": HEAD,
    "above.s": capacity * log(HOT / REFERENCE.temperature),
    "below.v": CRANKCASE,
}


def simulate(until: float = 2.0) -> ephs.Solution:
    """The motion from the scene's initial state, without a load."""
    return ephs.simulate(gas_engine, until, initial=START, inputs={"shaft": {"flow": 0.0}}, step=2.5e-4)


if __name__ == "__main__":
    solution = simulate()
    exergy, entropy = solution.exergy, solution.entropy
    print(
        f"volume above the piston: {1e6 * solution['above.v'].min():.1f} to {1e6 * solution['above.v'].max():.1f} cm³"
    )
    print(
        f"exergy falls from {exergy[0]:.3f} to {exergy[-1]:.3f} J, entropy grows by {entropy[-1] - entropy[0]:.4f} J/K"
    )
    print(f"energy balanced to {solution.energy_error.max():.1e}")
