"""Units of FMI 3.0: valid by FMPy, which simulates them as here; states that are kept and taken back."""

import ctypes
import platform
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

import ephs
from ephs.exporting.fmu import PLATFORMS, export_fmu
from tests.exporting.runs import Run
from tests.scenes import shipped

HERE = fmpy.platform_tuple
GIVEN = {"inputs": ["joints.bearing"], "parameters": ["bodies.rod.mass"]}


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    file = tmp_path_factory.mktemp("unit") / "crank.fmu"
    scene = shipped("slider-crank")
    return file, export_fmu(scene, file, **GIVEN, until=0.5, platforms=[HERE])


@pytest.fixture
def slave(unit, tmp_path):
    file, _ = unit
    description = fmpy.read_model_description(str(file))
    made = FMU3Slave(
        guid=description.guid, unzipDirectory=fmpy.extract(str(file), str(tmp_path)), instanceName="one",
        modelIdentifier=description.coSimulation.modelIdentifier,
    )  # fmt: skip
    made.instantiate()
    yield made, {each.name: each.valueReference for each in description.modelVariables}
    made.freeInstance()


def test_a_unit_is_valid_and_has_what_it_says(unit):
    file, made = unit
    assert validate_fmu(str(file)) == []
    names = [each.name for each in fmpy.read_model_description(str(file)).modelVariables]
    assert names == ["time", *(each.name for each in (*made.inputs, *made.parameters, *made.outputs))]
    with ZipFile(file) as content:
        assert [name for name in content.namelist() if name.startswith("binaries/")] == [
            f"binaries/{HERE}/crank{PLATFORMS[HERE][2]}"
        ]


def test_simulated_elsewhere_it_gives_the_same_bits(unit):
    file, made = unit
    start = {"bodies.rod.mass": 0.2, "joints.bearing": 0.25}
    found = fmpy.simulate_fmu(str(file), stop_time=0.5, output_interval=0.1, start_values=start)[-1]
    run = Run(made)
    run.call("parameters", None, np.array([0.2]))
    for k in range(1, 6):
        run.call("inputs", None, np.array([0.25]))
        assert run.call("advance", ctypes.c_int64, float(found["time"]) if k == 5 else k * 0.1) == 0
    for name, value in run.outputs().items():
        assert found[name] == pytest.approx(value, rel=1e-13, abs=1e-13), name


def test_a_kept_state_goes_on_to_the_same_bits(slave):
    unit, references = slave
    angle = [references["joints.bearing.coordinate"]]
    unit.enterInitializationMode(startTime=1.0)
    unit.exitInitializationMode()
    unit.doStep(1.0, 0.1)
    kept = unit.getFMUState()
    written = unit.serializeFMUState(kept)
    unit.doStep(1.1, 0.2)
    after = unit.getFloat64(angle)
    unit.setFMUState(kept)
    assert unit.getFloat64(angle) != after, "the control"
    unit.doStep(1.1, 0.2)
    assert unit.getFloat64(angle) == after
    taken = unit.deserializeFMUState(written)
    unit.setFMUState(taken)
    unit.doStep(1.1, 0.2)
    assert unit.getFloat64(angle) == after
    for state in (kept, taken):
        unit.freeFMUState(state)


@pytest.mark.parametrize("begun", [False, True])
def test_outputs_before_the_start_are_those_of_the_parameters_that_are_set(slave, begun):
    unit, references = slave
    mass, energy = [references["bodies.rod.mass"]], [references["energy"]]
    if begun:
        unit.enterInitializationMode(startTime=0.0)
    first = unit.getFloat64(energy)
    unit.setFloat64(mass, [0.4])
    there = unit.getFloat64(energy)
    if not begun:
        unit.enterInitializationMode(startTime=0.0)
    unit.exitInitializationMode()
    assert there == unit.getFloat64(energy) != first


def test_parameters_are_fixed_after_the_start(slave):
    unit, references = slave
    unit.enterInitializationMode(startTime=0.0)
    unit.exitInitializationMode()
    with pytest.raises(fmpy.fmi1.FMICallException):
        unit.setFloat64([references["bodies.rod.mass"]], [0.4])
    unit.reset()
    unit.setFloat64([references["bodies.rod.mass"]], [0.4])


@pytest.mark.parametrize(("point", "length"), [(0.1, -0.05), (0.3, 0.1), (0.0, 0.2), (np.nan, 0.1), (0.1, np.nan)])
def test_steps_go_on_from_the_time_reached(slave, point, length):
    unit, references = slave
    unit.enterInitializationMode(startTime=0.0)
    unit.exitInitializationMode()
    unit.doStep(0.0, 0.1)
    with pytest.raises(fmpy.fmi1.FMICallException):
        unit.doStep(point, length)
    unit.doStep(0.1 * (1.0 + 1e-14), 0.1)  # masters add up their steps
    assert unit.getFloat64([references["time"]])[0] == pytest.approx(0.2, rel=1e-13)


def test_outputs_cannot_be_set(slave):
    unit, references = slave
    with pytest.raises(fmpy.fmi1.FMICallException):
        unit.setFloat64([references["energy"]], [1.0])


@pytest.mark.parametrize("fault", [{"file": "a.zip"}, {"platforms": ["moon"]}, {"outputs": ["joints.no"]}])
def test_what_cannot_be_a_unit_is_refused_by_name(tmp_path, fault):
    given = {"file": "a.fmu", **fault}
    scene = shipped("slider-crank")
    (value,) = fault.values()
    with pytest.raises(ephs.ExportError) as caught:
        export_fmu(scene, tmp_path / given.pop("file"), **given)
    assert str(value if isinstance(value, str) else value[0]) in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_this_machine_is_one_that_units_are_made_for():
    assert HERE in PLATFORMS, platform.platform()
