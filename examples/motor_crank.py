"""A motor that drives an engine's crank: a circuit, a magnet, a gear, and the mechanism of scenes/slider-crank.toml.

The mechanism is loaded as a scene and becomes one box of a pattern; its bearing's momentum is the port at which the
gear turns it. Voltage is prescribed at the outer port.

    python examples/motor_crank.py
"""

from pathlib import Path

import ephs
from ephs import Pattern, junction
from ephs import library as lib
from ephs import quantity as Q

VOLTAGE, RESISTANCE, FLUX, GEAR, ROTOR = 12.0, 0.8, 0.08, 0.5, 2.0e-4  # V, Ω, Wb, crank per rotor, kg m²

scene = ephs.load(Path(__file__).parents[1] / "scenes" / "slider-crank.toml")
engine = scene.system(driven=["bearing"])
SHAFT = "drives.bearing"  # the port of the bearing's momentum

circuit = Pattern(
    junctions={
        "q": junction(Q.charge, exposed=True),
        "b": junction(Q.flux_linkage),
        "magnet": junction(Q.flux_linkage),
        "p": junction(Q.angular_momentum, exposed=True),
        "s": junction(Q.entropy),
    },
    boxes={
        "supply": {"q": "q", "b": "b"},
        "coil": {"b": "b"},
        "resistance": {"b": "b", "s": "s"},
        "field": {"b": "magnet"},
        "coupling": {"b": "b", "p": "p", "bs": "~magnet"},  # torque is current times the magnet's flux
        "rotor": {"p": "p"},
        "copper": {"s": "s"},
    },
)
motor = circuit(
    supply=lib.emc(),
    coil=lib.inductor(l=2.0e-3),
    resistance=lib.resistor(r=RESISTANCE),
    field=lib.inductor(l=1.0),
    coupling=lib.mkc(),
    rotor=lib.rotor(j=ROTOR),
    copper=lib.thermal_capacity(capacity=40.0, temperature=293.15),
)

drive = Pattern(
    junctions={
        "q": junction(Q.charge, exposed=True),
        "p": junction(Q.angular_momentum),
        "p_r": junction(engine.interface[SHAFT].quantity),
    },
    boxes={"motor": {"q": "q", "p": "p"}, "gear": {"p": "p", "p_r": "p_r"}, "engine": {SHAFT: "p_r"}},
)
gear = ephs.transformer({"p": Q.angular_momentum, "p_r": engine.interface[SHAFT].quantity}, [[GEAR]], name="gear")
motor_crank = drive(motor=motor, gear=gear, engine=engine)

CRANK = float(scene.bodies["crank"].twist[1])  # rad/s at the start
START = {
    "motor.rotor.p": ROTOR * CRANK / GEAR,
    "motor.field.b": FLUX,
}
INPUTS = {"q": {"effort": VOLTAGE}}


def simulate(until: float = 2.0) -> ephs.Solution:
    """The motion from the scene's initial state, with the voltage switched on at once."""
    return ephs.simulate(motor_crank, until, initial=START, inputs=INPUTS, step=5e-4)


if __name__ == "__main__":
    solution = simulate()
    rotor = solution["motor.rotor.p"] / ROTOR
    print(f"rotor at {solution.t[-1]:g} s: {rotor[-1]:.2f} rad/s, the crank {GEAR * rotor[-1]:.2f} rad/s")
    print(f"the supply gave {solution.work[-1]:.2f} J, {solution.heat[-1]:.2f} J became heat")
    print(f"energy balanced to {solution.energy_error.max():.1e}")
