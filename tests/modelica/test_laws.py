"""Components that are taken: their systems say what their equations say, and keep both laws."""

import numpy as np
import pytest

from ephs.modelica.flat import flattened
from tests.modelica.behaviour import drawn, left_over

TAKEN = {
    "Ground": {},
    "Resistor": {"R": 2.5},
    "Resistor, warm": {"R": 2.5, "alpha": 4e-3},
    "Capacitor": {},
    "Charged": {},
    "Initial": {},
    "Warm": {},
    "Inductor": {},
    "Coils": {},
    "Gyrator": {},
    "Transformer": {},
    "Machine": {},
    "Inertia": {},
    "Standing": {},
    "Spring": {},
    "Spring, damped": {"d": 0.6},
    "Gear": {},
    "Rack": {},
    "Differential": {},
    "Voltmeter": {},
    "Ammeter": {},
    "Delayed": {},
    "Capacity": {},
    "Conductor": {},
    "Radiation": {},
    "Thermometer": {},
    "Contact": {},
}


@pytest.mark.parametrize("case", TAKEN)
def test_what_the_system_allows_solves_the_equations_and_keeps_both_laws(parts, case):
    name = f"Parts.{case.split(',')[0]}"
    component, flat = parts.read(name, **TAKEN[case]), flattened(parts.tree, name, TAKEN[case])
    rng = np.random.default_rng(3)
    for _ in range(5):
        out = drawn(component, rng)
        assert left_over(flat, component, out) <= 1e-12
        assert abs(out.power(component.system.interface) - out.stored) <= 1e-14 * out.size()
        assert out.produced >= 0.0
        # the control: values beside these solve no equations
        for values in (out.flows, out.efforts):
            values |= {port: value + 0.1 for port, value in values.items()}
        assert left_over(flat, component, out) > 1e-4
