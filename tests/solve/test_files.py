"""Files of solutions: bit by bit what was saved, whatever was solved."""

import json

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.semantics.spaces import PAIRS, pair
from ephs.solve.result import file, guard
from ephs.solve.result.labels import freedoms, labels_of
from ephs.testing import mechanisms, systems
from tests.numerics import largest
from tests.oscillator import free_oscillator
from tests.processes import printed
from tests.scenes import shipped
from tests.written import scene_of_text

TOTALS = {"kinetic", "potential", "thermal", "environment", "exergy", "entropy", "heat", "work", "supplied", "made"}
TOTALS |= {"least", "storages", "makers", "entropies", "volumes", "momenta", "exergies"}


def same(found: ephs.Solution, expected: ephs.Solution) -> None:
    """Everything that the two solutions hold is equal, bit by bit."""
    one, other = found.to_xarray(), expected.to_xarray()
    assert one.identical(other)
    assert set(one.variables) == set(other.variables)
    for name in one.variables:
        a, b = one[name].values, other[name].values
        assert a.dtype == b.dtype and (a.tobytes() == b.tobytes() if a.dtype != object else np.array_equal(a, b))
    assert found.stats == expected.stats and found.labels == expected.labels
    assert [(e.name, e.t) for e in found.events] == [(e.name, e.t) for e in expected.events]
    for a, b in zip(found.events, expected.events, strict=True):
        assert all(np.array_equal(a.state[path], b.state[path]) for path in b.state)
    assert found.summary() == expected.summary()
    json.dumps(found.summary(), allow_nan=False)


def through_a_file(sol: ephs.Solution, folder, **options) -> ephs.Solution:
    sol.save(folder / "sol.nc", **options)
    return ephs.load_solution(folder / "sol.nc")


@settings(max_examples=25)
@given(mechanisms(), st.booleans(), st.booleans())
def test_mechanisms_come_back_bit_by_bit(tmp_path_factory, scene, pushed, wrenches):
    last = list(scene.bodies)[-1]
    inputs = {f"bodies.{last}": lambda t, state: np.sin(t + state[f"bodies.{last}.pe.q"][4:].sum()) * np.ones(6)}
    event = ephs.Event(lambda t, state: t - 1.5e-5, "late")
    sol = ephs.simulate(scene, 3e-5, step=1e-5, inputs=inputs if pushed else None, events=[event])
    assert len(sol.events) == 1
    same(through_a_file(sol, tmp_path_factory.mktemp("files"), wrenches=wrenches), sol)


def test_circuits_come_back_bit_by_bit(tmp_path, damped):
    falls = ephs.Event(lambda t, state: float(state["osc.pe.q"][0]), "through zero", -1)
    sol = ephs.simulate(damped, 9.0, initial={"osc.pe.q": 1.0}, rtol=1e-4, events=[falls])
    again = through_a_file(sol, tmp_path / "deep")
    same(again, sol)
    assert len(again.events) == 2
    assert [file.name for file in (tmp_path / "deep").iterdir()] == ["sol.nc"]
    same(through_a_file(again, tmp_path), sol)  # without its system it is saved again as it was


def test_a_solution_without_instants_comes_back(tmp_path, damped):
    sol = ephs.simulate(damped, 1.0, step=0.1, save_at=[])
    again = through_a_file(sol, tmp_path)
    assert len(again) == 0 and again["osc.pe.q"].shape == sol["osc.pe.q"].shape


def test_every_variable_has_a_unit_and_every_axis_names():
    sol = ephs.simulate(shipped("slider-crank"), 0.01, step=0.001, inputs={"joints.bearing": np.sin})
    data = sol.to_xarray()
    for name, variable in data.variables.items():
        if variable.dtype != object:
            assert variable.attrs["units"] and variable.attrs["long_name"], name
        assert all(dim in data.coords for dim in variable.dims), name
    crank = data["body_position"].sel(body="crank", axis="z")
    assert np.array_equal(crank, sol.body("crank").position[:, 2])
    assert np.array_equal(data["body_twist"].sel(body="rod", twist="wy"), sol.body("rod").angular_velocity[:, 1])
    assert np.array_equal(data["state:bodies.rod.pe.q"].sel(pose="x"), sol.body("rod").position[:, 0])
    assert np.array_equal(data["coordinate:wrist"].sel(cylindrical="distance"), sol.joint("wrist").coordinate[:, 1])
    assert data["coordinate:wrist"].attrs["units"] == "rad, m" and data["rate:wrist"].attrs["units"] == "rad/s, m/s"
    force = data["joint_wrench"].sel(joint="cylinder", wrench=["fx", "fy", "fz"])
    assert np.array_equal(force, sol.joint("cylinder").wrench[:, 3:])
    assert data["temperature"].sel(node="housing").dims == ("t",)
    assert (data["t"].attrs["units"], data["heat"].attrs["units"]) == ("s", "J")


def test_a_file_that_xarray_writes_again_holds_the_same_solution(tmp_path, damped):
    for model, options in ((damped, {"initial": {"osc.pe.q": 1.0}}), (shipped("slider-crank"), {})):
        sol = ephs.simulate(model, 0.5, rtol=1e-6, **options)
        sol.save(tmp_path / "sol.nc")
        with xr.open_dataset(tmp_path / "sol.nc", engine="h5netcdf") as data:
            dense = {name: {"zlib": True} for name, each in data.variables.items() if each.dtype != object}
            data.to_netcdf(tmp_path / "again.nc", engine="h5netcdf", encoding=dense)
        same(ephs.load_solution(tmp_path / "again.nc"), sol)


def test_reading_loads_none_of_the_packages_for_tables(tmp_path, damped):
    file = tmp_path / "sol.nc"
    ephs.simulate(damped, 0.5, step=0.1, initial={"osc.pe.q": 1.0}, audit="off").save(file)
    heavy = {"xarray", "pandas", "dask"}
    script = f"import sys, ephs; ephs.load_solution({str(file)!r}); print(*{heavy} & {{*sys.modules}})"
    assert printed(script) == "\n"


def test_a_variable_needs_no_name_in_words(tmp_path, driven):
    """Files of other programs may lack it; what it is in is still read, and so are its numbers."""
    sol = ephs.simulate(driven, 0.5, step=0.1, inputs={"p": {"flow": np.sin}}, audit="off")
    read = []
    for kept in (("units", "long_name"), ("units",), ()):
        sol.save(tmp_path / "sol.nc")
        with h5py.File(tmp_path / "sol.nc", "r+") as opened:
            array = next(opened[key] for key in opened if key.startswith("input:"))
            for name in {"units", "long_name"}.difference(kept):
                del array.attrs[name]
        ((_, given),) = ephs.load_solution(tmp_path / "sol.nc").inputs.items()
        read.append((given.units, bool(given.says)))
        assert np.array_equal(given.values, next(iter(sol.inputs.values())).values)
    assert read == [("N", True), ("N", False), ("SI", False)]


def test_packed_numbers_are_refused(tmp_path, damped):
    sol = ephs.simulate(damped, 0.5, step=0.1, initial={"osc.pe.q": 1.0}, audit="off")
    packed = {"state:osc.pe.q": {"dtype": "float64", "scale_factor": 1e-3}}
    sol.to_xarray().to_netcdf(tmp_path / "sol.nc", engine="h5netcdf", encoding=packed)
    with pytest.raises(
        ValueError, match=r"sol\.nc: state:osc\.pe\.q has the attribute scale_factor, expected unpacked"
    ):
        ephs.load_solution(tmp_path / "sol.nc")


def test_files_of_format_2_are_read(tmp_path):
    """They had states without names, no units of states, and events as packed states."""
    scene = shipped("heavy-top")
    event = ephs.Event(lambda t, state: t - 0.015, "late")
    sol = ephs.simulate(scene, 0.03, step=0.01, events=[event], audit="off")  # a coarse step
    data = sol.to_xarray()
    kept = [name for name in data.data_vars if name.startswith("state:") or name.partition(":")[0] in TOTALS]
    old = xr.Dataset(
        {
            name: (("t",) if data[name].ndim == 1 else ("t", f"dim{data[name].shape[1]}"), data[name].values)
            for name in kept
        },
        {"t": data["t"]},
        data.attrs | {"ephs_format": 2},
    )
    stats = dict(sol.stats)
    packed = sol.problem.descriptor.pack(sol.events[0].state).tolist()
    stats["events"] = [{"name": "late", "t": sol.events[0].t, "x": packed}]
    old.attrs["stats"] = json.dumps(stats)
    old.to_netcdf(tmp_path / "old.nc", engine="h5netcdf")
    same(ephs.load_solution(tmp_path / "old.nc"), sol)


FALLING = """
format = 1
name = "falling"
[bodies.box]
mass = 2.0
inertia = [0.1, 0.2, 0.3]
position = [0.0, 0.0, 0.15]
angular_velocity = [1.0, 0.5, 0.0]
[bodies.ball]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.05, 0.0, 1.0]
[surfaces.floor]
body = "ground"
shape = { plane = {} }
[surfaces.box]
body = "box"
shape = { box = [0.2, 0.3, 0.2] }
stiffness = 1e4
[surfaces.ball]
body = "ball"
shape = { sphere = 0.1 }
stiffness = 1e4
"""

RESTING = """
format = 1
name = "resting"
[world]
gravity = [0.0, 0.0, 0.0]
[bodies.stone]
mass = 2.0
inertia = [0.1, 0.2, 0.3]
position = [0.0, 0.0, 2.0]
[surfaces.floor]
body = "ground"
shape = {{ plane = {{}} }}
[surfaces.stone]
body = "stone"
shape = {{ points = {corners} }}
stiffness = 1e4
"""


@pytest.mark.parametrize(
    "options", [{"step": 1e-3}, {"method": "rk54"}, {"method": "semi", "rtol": 1e-3}, {"method": "radau"}]
)
def test_contacts_come_back_bit_by_bit_though_a_file_lacks_what_follows(tmp_path, options):
    """Poses of points follow from those of bodies; ledgers of what is out of reach are zero."""
    sol = ephs.simulate(scene_of_text(FALLING), 0.2, audit="off", **options)
    assert sol.contact("floor_box").gap.min() < 0.0 < sol.contact("floor_ball").gap.min()
    same(through_a_file(sol, tmp_path), sol)
    with xr.open_dataset(tmp_path / "sol.nc", engine="h5netcdf") as data:
        names = {str(name) for name in data.variables}
        rest = data["relative_pose_rest"].values
    assert not [name for name in names if name.startswith("state:contacts") and name.endswith("q_r")]
    assert "storages:contacts.floor_ball.point0.pe" not in names
    assert any(name.startswith("storages:contacts.floor_box.") for name in names)
    assert largest(rest[:, 3:]) <= 1e-9  # what follows up to rounding, and drift of natural steps


def test_a_pose_that_does_not_follow_is_written(tmp_path):
    """It may differ from the bodies' poses by more than a difference can tell, as after a turn."""
    sol = ephs.simulate(scene_of_text(FALLING), 0.01, step=1e-3)
    path = ephs.operad.Path.of("contacts.floor_box.point1.pe.q_r")
    sol.states[path][:] = np.random.default_rng(1).standard_normal(sol[path].shape) * 1e-30
    same(through_a_file(sol, tmp_path), sol)


def test_a_file_is_never_so_dense_that_readers_refuse_it(tmp_path, monkeypatch):
    """Most of the file is zero: many points of a body at rest."""
    corners = np.random.default_rng(2).standard_normal((60, 3))
    corners /= np.linalg.norm(corners, axis=1)[:, None]
    sol = ephs.simulate(scene_of_text(RESTING.format(corners=corners.tolist())), 0.5, step=1e-3, audit="off")
    sizes = []
    for most in (guard.MOST, 2):
        for module in (guard, file):
            monkeypatch.setattr(module, "MOST", most)
        same(through_a_file(sol, tmp_path), sol)
        sizes.append((tmp_path / "sol.nc").stat().st_size)
    assert sizes[0] < 0.5 * sizes[1]


def test_files_of_format_3_are_read(tmp_path):
    """They had everything."""
    sol = ephs.simulate(scene_of_text(FALLING), 0.01, step=1e-3)
    data = sol.to_xarray()
    data.attrs["ephs_format"] = 3
    data.to_netcdf(tmp_path / "old.nc", engine="h5netcdf")
    same(ephs.load_solution(tmp_path / "old.nc"), sol)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda data: data.drop_vars("state:bodies.box.pe.q"), "bodies.box.pe.q"),
        (lambda data: data.isel({"relative pose component": slice(0, 3)}), "has the shape"),
        (
            lambda data: data.assign_coords({"relative pose": [f"a{i}" for i in range(data.sizes["relative pose"])]}),
            "a0",
        ),
        (lambda data: data.assign_coords({"relative pose": np.arange(data.sizes["relative pose"])}), "expected text"),
    ],
)
def test_files_that_lack_what_poses_follow_from_are_refused(tmp_path, change, words):
    ephs.simulate(scene_of_text(FALLING), 0.01, step=1e-3).save(tmp_path / "sol.nc")
    with xr.open_dataset(tmp_path / "sol.nc", engine="h5netcdf") as data:
        change(data.load()).to_netcdf(tmp_path / "less.nc", engine="h5netcdf")
    with pytest.raises(ValueError, match=words):
        ephs.load_solution(tmp_path / "less.nc")


@pytest.mark.parametrize("found", [1, 5, None])
def test_other_formats_are_refused(tmp_path, found):
    data = xr.Dataset({}, {}, {} if found is None else {"ephs_format": found})
    data.to_netcdf(tmp_path / "sol.nc", engine="h5netcdf")
    with pytest.raises(ValueError, match=rf"sol\.nc: ephs_format is {found}, expected one of 2, 3, 4"):
        ephs.load_solution(tmp_path / "sol.nc")


PLAIN = ephs.simulate(free_oscillator(), 0.1, initial={"pe.q": 1.0}, step=0.1)


@pytest.mark.parametrize("kind", [str(name) for name in PLAIN.to_xarray().variables if ":" not in str(name)])
def test_a_quantity_may_have_the_name_of_an_array(kind, tmp_path):
    """An axis of an input is named after its quantity, as of entropy; ledgers and the time have names, too."""
    of = ephs.Quantity(kind, ephs.Space("real", 1, 1), 1)
    fed = ephs.Pattern(junctions={"x": ephs.junction(of, exposed=True)}, boxes={"store": {"x": "x"}})(
        store=ephs.storage({"x": of}, lambda x: np.exp(x))
    )
    sol = ephs.simulate(fed, 0.2, step=0.1, inputs={"x": {"flow": np.cos}})
    again = through_a_file(sol, tmp_path)
    assert np.array_equal(again.port("x").power, sol.port("x").power) and np.array_equal(again.heat, sol.heat)
    assert again.to_xarray()["input:x"].values.tobytes() == sol.inputs[ephs.Path.of("x")].values.tobytes()


@given(systems())
def test_labels_fit_the_states_of_every_system(system):
    for slot in system.descriptor().states:
        labels = labels_of(slot.quantity)
        if labels.dimension:
            assert len(labels.names) == len(set(labels.names)) == len(labels.units)
        else:
            assert slot.quantity.space.size == 1 and len(labels.units) == 1


def test_freedoms_have_the_names_of_the_contract():
    names = {name: freedoms(pair(name)).names for name in PAIRS if "pitch" not in PAIRS[name].parameters}
    assert names["cylindrical"] == ("angle", "distance")
    assert names["planar"] == ("angle", "x", "y")
    assert names["free"] == ("rx", "ry", "rz", "x", "y", "z")
    assert names["fixed"] == ()
    assert all(len(names[name]) == pair(name).dim for name in names)


def test_a_slice_is_the_solution_at_these_instants():
    sol = ephs.simulate(shipped("slider-crank"), 0.05, step=0.001, inputs={"joints.bearing": np.sin})
    few = sol[10::5]
    assert np.array_equal(few.t, sol.t[10::5]) and few.t.size == 9
    assert np.array_equal(few["bodies.rod.pe.q"], sol["bodies.rod.pe.q"][10::5])
    assert np.array_equal(few.exergy, sol.exergy[10::5])
    assert np.allclose(few.joint("wrist").wrench, sol.joint("wrist").wrench[10::5], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ("osc.pe.p", r"osc\.pe\.p: no such state; did you mean osc\.pe\.q"),
        ("osc.q", r"osc\.q.*osc\.pe\.q"),
        ("osc", r"osc: no such state; below it lie osc\.pe\.q, osc\.ke\.p"),
        ("xyz", r"xyz: no such state; the states are osc\.pe\.q"),
    ],
)
def test_what_is_not_there_is_answered_with_what_is_near(damped, asked, words):
    sol = ephs.simulate(damped, 0.1, step=0.1)
    with pytest.raises(KeyError, match=words):
        sol[asked]


def test_outer_ports_carry_in_the_file_what_they_carried(tmp_path):
    inputs = {"bodies.rod": lambda t: np.array([0.0, np.cos(50.0 * t), 0.0, 1.0, 0.0, t])}
    sol = ephs.simulate(shipped("slider-crank"), 0.004, step=0.001, inputs=inputs)
    again = through_a_file(sol, tmp_path)
    for port in ("momenta.rod", "drives.bearing"):
        one, other = again.port(port), sol.port(port)
        assert np.array_equal(one.flow, other.flow) and np.array_equal(one.effort, other.effort)
    assert np.ptp(sol.port("momenta.rod").flow[:, 1]) > 0.0
