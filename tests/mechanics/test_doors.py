"""Functions of models refuse what is neither a scene nor a system, in one sentence."""

import pytest

import ephs
from ephs import library as lib

DOORS = {
    "simulate": lambda model: ephs.simulate(model, 1.0),
    "linearize": ephs.linearize,
    "equilibrium": ephs.equilibrium,
    "dynamics": ephs.dynamics,
    "check_model": ephs.check_model,
    "reduce": ephs.reduce,
    "sweep": lambda model: ephs.sweep(model, {"bodies.rod.mass": [1.0]}, 1.0),
    "sensitivity": lambda model: ephs.sensitivity(model, ["bodies.rod.mass"], 1.0),
    "gradient": lambda model: ephs.gradient(model, ["bodies.rod.mass"], [1.0], {"joints.pin.coordinate": 1.0}),
    "fit": lambda model: ephs.fit(model, {"t": [0.0, 1.0], "joints.pin.coordinate": [0.0, 1.0]}, ["bodies.rod.mass"]),
}


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("model", ["slider-crank.toml", lib.spring(k=1.0), None], ids=["file", "component", "nothing"])
def test_what_is_no_model_is_refused(door, model):
    with pytest.raises(ephs.OptionError, match=r"expected a Scene, as ephs\.load makes it of a file, or a System"):
        DOORS[door](model)
