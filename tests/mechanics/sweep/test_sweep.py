"""A sweep is what its members are alone, whoever runs them, and loses none."""

import json
import os
import signal
from concurrent.futures import CancelledError, Future
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.scene.parameters import names, read, varied
from ephs.mechanics.sweep.axes import Axes
from ephs.mechanics.sweep.ensemble import Ensemble, _Runs
from ephs.mechanics.sweep.outputs import known_outputs, outputs_of
from ephs.semantics.bundles.errors import AssemblyError
from ephs.testing import mechanisms
from tests.numerics import largest
from tests.oscillator import free_oscillator, oscillator
from tests.scenes import ROOT
from tests.typed import typed
from tests.written import scene_of_text

SCENES = ROOT / "scenes"
CHAIN = ROOT / "benchmarks" / "scenes" / "revolute-chain-4.toml"
OSCILLATOR = free_oscillator()
WELDED = """
format = 1
name = "welded"
[bodies.one]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
[bodies.two]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
[joints.pin]
type = "spherical"
bodies = ["ground", "one"]
frame1 = {}
frame2 = { position = [0.0, 0.0, 0.5] }
[joints.weld]
type = "fixed"
bodies = ["one", "two"]
frame1 = { position = [0.0, 0.0, -0.5] }
frame2 = {}
"""
TIMES = np.array([0.0, 0.02, 0.05])


def alone(model, table, where, **options):
    """The member at a place of the table, by `simulate`."""
    paths = {str(name).removeprefix("initial."): name for name in table.coords if "." in str(name)}
    at = table.isel(where)
    return ephs.simulate(
        varied(model, {path: float(at[name]) for path, name in paths.items() if path in names(model)}),
        float(table.t[-1]), save_at=table.t.values, **options,
    )  # fmt: skip


def agree(model, table, places, tolerance=1e-11, **options):
    for where in places:
        sol = alone(model, table, where, **options)
        for output in outputs_of(model, [str(n) for n in table.data_vars if n not in ("status", "steps", "rejected")]):
            found, expected = table[output.name].isel(where).values, np.squeeze(output.read(sol))
            assert largest(found - expected, initial=0.0) <= tolerance * max(1.0, largest(expected)), output


def assert_built(images, members):
    """Members put together are those that are built in full."""
    rows, like = images.of(members)
    assert like.all()
    for values, row in zip(members, rows, strict=True):
        image = images.base.copy()
        image[images.columns] = row
        assert np.allclose(image, images._built(values), rtol=1e-12, atol=1e-12)


# ---- members ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("file", "vary"),
    [
        (CHAIN, {"bodies.rod1.mass": [0.5, 1.0, 2.0], "joints.j0.rate": [0.0, 1.0]}),
        (CHAIN, {"joints.j0.coordinate": np.linspace(-1.0, 1.0, 15), "bodies.rod3.mass": np.linspace(1, 3, 20)}),
        (CHAIN, {"joints.j1.stiffness": [1.0, 3.0], "joints.j1.rest": [0.1, 0.2]}),
        (CHAIN, {"joints.j1.frame2.position[0]": [0.1, 0.2, 0.3], "joints.j0.friction": [0.0, 0.1]}),
        (SCENES / "four-bar.toml", {"bodies.coupler.mass": [0.5, 1.0, 2.0]}),
        (SCENES / "heavy-top.toml", {"joints.tip.coordinate[0]": np.linspace(0.0, 1.0, 15)}),
        (SCENES / "heavy-top.toml", {"world.gravity[2]": [-9.81, -1.62, 0.0, 3.0]}),
    ],
)
def test_members_are_what_simulate_gives(file, vary):
    scene = ephs.load(file)
    table = ephs.sweep(scene, vary, 0.05, save_at=TIMES)
    assert set(table.status.values.ravel()) == {"done"}
    shape = table.status.shape
    ends = [dict(zip(table.status.dims, np.unravel_index(k, shape), strict=True)) for k in (0, table.status.size // 3)]
    agree(scene, table, [*ends, dict(zip(table.status.dims, (n - 1 for n in shape), strict=True))])


@settings(max_examples=12)
@given(scene=mechanisms(max_bodies=2), data=st.data())
def test_members_of_any_mechanism_by_any_number(scene, data):
    known = [path for path in names(scene) if (read(scene, path) and ".mass" in path) or ".friction" in path]
    paths = data.draw(st.lists(st.sampled_from(known), min_size=1, max_size=2, unique=True))
    factors = [1.0, 1.25, 1.5]
    values = {path: [read(scene, path) * f for f in factors] for path in paths}
    table = ephs.sweep(scene, values, 0.02, save_at=[0.0, 0.02], paired=True, rtol=1e-7, atol=1e-7)
    for k in range(3):
        if table.status.values[k] == "done":
            agree(scene, table, [{"member": k}], 1e-9, rtol=1e-7, atol=1e-7)


def test_what_two_paths_change_together_is_built_in_full():
    scene = ephs.load(CHAIN)
    apart = Axes.of({"bodies.rod1.mass": [1.0, 2.0], "bodies.rod2.mass": [1.0, 2.0]}, paired=False)
    # the moment of a mass that begins with the arm 0 is changed by neither alone
    product = Axes.of({"joints.weld.frame1.position[0]": [0.0, 0.2], "bodies.two.mass": [1.0, 2.0]}, paired=False)
    for model, axes in ((scene, apart), (scene_of_text(WELDED), product)):
        ensemble = Ensemble(model, axes, 0.0, 0.1, TIMES, {}, outputs_of(model, None))
        assert_built(ensemble.images, axes.members)


@pytest.mark.parametrize("span", [(1.1, 2.0), (1.1, 1.1001), (0.01, 10.0)])
@pytest.mark.parametrize("path", ["bodies.rod1.mass", "joints.j0.coordinate", "joints.j0.friction"])
def test_three_members_say_what_all_of_a_path_are(path, span):
    scene = ephs.load(CHAIN)
    axes = Axes.of({path: np.linspace(*span, 20)}, paired=False)
    ensemble = Ensemble(scene, axes, 0.0, 0.1, TIMES, {}, outputs_of(scene, None))
    assert ensemble.images._courses  # a start is a number, too
    assert_built(ensemble.images, axes.members[::4])


def test_a_member_unlike_the_others_is_run_on_its_own():
    """Without friction a part is missing, and with it a place in the tables."""
    scene, friction = ephs.load(CHAIN), np.linspace(0.0, 0.5, 20)
    axes = Axes.of({"joints.j0.friction": friction}, paired=False)
    ensemble = Ensemble(scene, axes, 0.0, 0.1, TIMES, {}, outputs_of(scene, None))
    assert ensemble.images._courses
    assert ensemble.run(axes.members).done.tolist() == [False, *[True] * 19]
    assert_built(ensemble.images, axes.members[1::4])
    table = ephs.sweep(scene, {"joints.j0.friction": friction}, 0.1, save_at=TIMES, rtol=1e-7, atol=1e-7)
    for k in (0, 1, 19):
        agree(scene, table, [{"joints.j0.friction": k}], 1e-9, rtol=1e-7, atol=1e-7)


def test_members_of_what_is_prescribed_keep_its_longest_step():
    text = (SCENES / "slider-crank.toml").read_text().replace("drive = 0.06", "motion = { rate = 10.0 }")
    scene = scene_of_text(text)
    for options in ({}, {"method": "rk54", "step": 0.002}):
        vary = {"joints.bearing.friction": [0.001, 0.004], "bodies.rod.mass": [0.15, 0.3]}
        table = ephs.sweep(scene, vary, 0.05, save_at=TIMES, outputs=["work", "heat"], **options)
        agree(scene, table, [dict(zip(table.status.dims, (1, 1), strict=True))], 1e-9, **options)


def test_careful_steps_of_a_member_have_its_own_numbers():
    """Where constraints nearly repeat each other dense sweeps take over, which read other tables than the engine."""
    scene = ephs.load(SCENES / "four-bar.toml")
    axes = Axes.of({"bodies.coupler.mass": [0.5, 1.0, 2.0]}, paired=False)
    ensemble = Ensemble(scene, axes, 0.0, 0.1, TIMES, {}, outputs_of(scene, ["heat"]))
    runs = _Runs(ensemble)
    equations, start = runs._made.equations, runs._made.start
    rows, _ = ensemble.images.of(axes.members)
    for (mass,), row in zip(axes.members[::-1], rows[::-1], strict=True):
        runs._fill(row)
        alone = ephs.dynamics(varied(scene, {"bodies.coupler.mass": mass}))
        assert largest(equations.mass(start.q, start.r) - alone.mass_matrix(alone.state0)) <= 1e-13


def test_a_system_of_no_bodies_by_its_closed_form():
    stiffness = [1.0, 4.0, 9.0]
    table = ephs.sweep(OSCILLATOR, {"pe.k": stiffness}, 1.0, save_at=[0.0, 0.5, 1.0], method="natural4", step=0.01)
    assert float(largest(table["pe.q"])) == 0.0  # it starts at rest
    table = ephs.sweep(
        OSCILLATOR, {"pe.k": stiffness}, 1.0, save_at=[0.0, 0.5, 1.0], method="radau", rtol=1e-10, atol=1e-10,
        outputs=["pe.q", "energy"],
    )  # fmt: skip
    assert table["energy"].attrs["units"] == "J" and table["pe.q"].dims == ("pe.k", "t")


def test_initial_values_of_a_system_are_varied_by_the_paths_of_its_states():
    """A free oscillator from rest: q = a cos ωt, and twice that from twice the start."""
    table = ephs.sweep(OSCILLATOR, {"pe.q": [0.5, 1.0], "pe.k": [1.0, 4.0]}, 1.0, save_at=[0.0, 0.5, 1.0], rtol=1e-9)
    amplitudes, stiffness = table["initial.pe.q"].values, table["pe.k"].values
    expected = amplitudes[:, None, None] * np.cos(
        np.sqrt(stiffness / read(OSCILLATOR, "ke.m"))[:, None] * table.t.values
    )
    assert largest(table["pe.q"].values - expected) <= 1e-7


@pytest.mark.parametrize("method", ["natural", "variational", "radau", "auto"])
def test_every_kind_of_method_and_of_output(method):
    scene = ephs.load(SCENES / "slider-crank.toml")
    options = {"method": method} | ({"step": 0.005} if method in ("natural", "variational") else {})
    kept = [out.name for out in outputs_of(scene, None)] + [
        "bodies.crank.position", "bodies.crank.quaternion", "energy", "entropy", "constraint_error",
    ]  # fmt: skip
    mass = read(scene, "bodies.crank.mass")
    table = ephs.sweep(scene, {"bodies.crank.mass": [mass, 1.5 * mass]}, 0.05, save_at=TIMES, outputs=kept, **options)
    agree(scene, table, [{"bodies.crank.mass": 1}], 1e-9, **options)
    assert list(table["quaternion"].values) == ["qw", "qx", "qy", "qz"] and table["axis"].size == 3
    assert table["joints.wrist.coordinate"].attrs["units"] == "rad, m"


# ---- nothing is lost -------------------------------------------------------------------------------------------------


def test_threads_change_no_bit():
    scene = ephs.load(CHAIN)
    vary = {"joints.j0.rate": np.linspace(0.0, 1.0, 40), "bodies.rod1.mass": [1.0, 2.0]}
    tables = [ephs.sweep(scene, vary, 0.2, save_at=[0.2], workers=n).drop_attrs() for n in (1, 2, 5)]
    assert tables[0].identical(tables[1]) and tables[0].identical(tables[2])


def test_members_that_fail_are_kept_with_their_reasons():
    scene = ephs.load(CHAIN)
    table = ephs.sweep(scene, {"bodies.rod1.mass": [1.0, -1.0, 2.0, 3.0]}, 0.1, save_at=[0.1])
    assert table.attrs["failed"] == 1 and "expected a number ≥ 0" in str(table.status.values[1])
    assert np.isnan(table["joints.j0.coordinate"].values[1]).all()
    assert np.isfinite(table["joints.j0.coordinate"].values[[0, 2, 3]]).all()
    few = ephs.sweep(scene, {"joints.j0.rate": [0.0, 1.0, 2.0]}, 1.0, save_at=[1.0], max_steps=2)
    none = ephs.sweep(scene, {"bodies.rod1.mass": [-1.0, -2.0]}, 0.1, save_at=[0.1], outputs=["bodies.rod1.position"])
    assert none["bodies.rod1.position"].shape == (2, 1, 3) and list(none["axis"].values) == ["x", "y", "z"]
    assert few.attrs["failed"] == 3 and "more steps than are allowed" in str(few.status.values[0])


def test_an_interruption_keeps_what_was_run():
    def stop(done, members, failed):
        raise KeyboardInterrupt

    with pytest.raises(ephs.SweepInterrupted) as caught:
        ephs.sweep(
            ephs.load(CHAIN), {"joints.j0.rate": np.linspace(0, 1, 64)}, 0.1, save_at=[0.1], workers=1, progress=stop
        )
    status = caught.value.partial.status.values
    assert {"done", "not run"} == set(status)
    done = status == "done"
    assert np.isfinite(caught.value.partial["joints.j0.coordinate"].values[done]).all()


@pytest.mark.filterwarnings("ignore")  # of the cluster, whose worker goes
def test_a_cluster_gives_the_same_and_a_worker_that_dies_loses_nothing():
    from distributed import Client, LocalCluster

    scene = ephs.load(CHAIN)
    vary = {"joints.j0.rate": np.linspace(0.0, 1.0, 30), "bodies.rod1.mass": [1.0, 2.0]}
    expected = ephs.sweep(scene, vary, 0.2, save_at=[0.2]).drop_attrs()
    killed: list[int] = []
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1") as cluster,
        Client(cluster) as client,
    ):

        def kill(done, members, failed):
            if not killed and done >= members // 3:
                killed.append(next(iter(client.run(os.getpid).values())))
                os.kill(killed[0], signal.SIGKILL)

        found = ephs.sweep(scene, vary, 0.2, save_at=[0.2], client=client, progress=kill).drop_attrs()
    assert killed and found.identical(expected)


class Forgetful:
    """Stands for a cluster that loses every other result of its first round, with what all batches share."""

    def __init__(self):
        self.rounds = self.asked = 0

    def nthreads(self):
        return {"a worker": 1}

    def scatter(self, job, broadcast):
        self.rounds += 1
        return job

    def submit(self, function, job, part, **_):
        self.asked += 1
        made = Future()
        if self.rounds == 1 and self.asked % 2:
            made.set_exception(CancelledError())
        else:
            made.set_result(function(job, part))
        return made

    def cancel(self, futures):
        assert not futures


def test_what_a_cluster_forgets_is_asked_for_again(monkeypatch):
    monkeypatch.setattr("distributed.as_completed", list)
    scene, client = ephs.load(CHAIN), Forgetful()
    vary = {"joints.j0.rate": np.linspace(0.0, 1.0, 12)}
    found = ephs.sweep(scene, vary, 0.1, save_at=[0.1], client=client)
    assert found.drop_attrs().identical(ephs.sweep(scene, vary, 0.1, save_at=[0.1]).drop_attrs())
    assert client.rounds == 2


# ---- what is asked for -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("vary", "more", "says"),
    [
        ({}, {}, "a path and its values"),
        ({"bodies.rod1.mass": [1.0, np.nan]}, {}, "one finite number or a list of them"),
        ({"bodies.rod1.mass": "heavy"}, {}, "one finite number or a list of them"),
        ({"bodies.rod1.mass": [1.0], "bodies.rod2.mass": [1.0, 2.0]}, {"paired": True}, "equally many values"),
        ({"bodies.rod1.mass": [1.0]}, {"outputs": ["enrgy"]}, 'did you mean "energy"'),
        ({"bodies.rod1.mass": [1.0]}, {"stepp": 0.1}, "no such option"),
        ({"bodies.rod1.mass": [1.0]}, {"save_at": [2.0]}, "save_at"),
        ({"bodies.rod1.mass": [1.0]}, {"save_at": []}, "at least one time"),
        ({"bodies.rod1.mass": [1.0]}, {"t0": 0.1}, "until is 0.1, expected a finite time other"),
        ({"bodies.rod1.mass": [1.0]}, {"outputs": "heat"}, "as a list"),
        ({"bodies.rod1.mass": [1.0]}, {"outputs": [None]}, "the name of an output"),
        ({1: [1.0]}, {}, "a path and its values"),
        ({"bodies.rod1.mass": [True, False]}, {}, "one finite number or a list of them"),
        ({"bodies.rod1.mass": ["1", "2"]}, {}, "one finite number or a list of them"),
        ({"bodies.rod1.mass": [1.0]}, {"outputs": 3}, "as a list"),
        ({"bodies.rod1.mass": [1.0]}, {"client": "here"}, "client is 'here'"),
        ({"bodies.rod1.mass": [1.0]}, {"progress": "loud"}, "progress is 'loud'"),
        ({"bodies.rod1.mass": [1.0]}, {"inputs": "strong"}, "inputs is 'strong'"),
        *(({"bodies.rod1.mass": [1.0]}, {"workers": n}, "workers.*a whole number > 0") for n in (0, -1, 1.5, "2")),
    ],
)
def test_wrong_questions_are_refused(vary, more, says):
    with pytest.raises(ephs.OptionError, match=says):
        ephs.sweep(ephs.load(CHAIN), vary, 0.1, **more)


@pytest.mark.parametrize(
    ("inputs", "says"),
    [
        ({"joints.j9": 1.0}, "joints.j9: no such outer power port.*did you mean"),
        ({"joints.j0": "hard"}, "joints.j0: the input is 'hard'"),
        ({"joints.j0": [1.0, 2.0]}, "joints.j0: the input is .*1 finite number"),
        ({"joints.j0": lambda t: [t, t]}, "joints.j0.*2 numbers where 1 are wanted"),
    ],
)
def test_inputs_that_no_member_has_are_refused_before_the_first_one(inputs, says):
    ran = []
    with pytest.raises((ephs.SimulationError, AssemblyError), match=says):
        ephs.sweep(
            ephs.load(CHAIN), {"bodies.rod1.mass": [1.0]}, 0.1, inputs=inputs, progress=lambda *done: ran.append(done)
        )
    assert not ran


def test_open_ports_want_their_inputs_before_the_first_member():
    with pytest.raises(AssemblyError, match="p"):
        ephs.sweep(oscillator(), {"pe.k": [1.0]}, 0.1)
    found = ephs.sweep(oscillator(), {"pe.k": [1.0]}, 0.1, inputs={"p": {"effort": lambda t, state: 0.0}})
    assert set(found["status"].values) == {"done"}


@pytest.mark.parametrize("paired", [False, True])
def test_what_is_varied_at_the_start_is_read_at_any_time(paired):
    """Each number at the start that is an output, too, by the same name."""
    scene = ephs.load(SCENES / "hot-brake.toml")
    both = sorted({*names(scene)} & known_outputs(scene).keys())
    assert {path.partition(".")[0] for path in both} == {"joints", "thermal"}
    for path in both:
        values = [read(scene, path), read(scene, path) + 1.0]
        table = ephs.sweep(scene, {path: values}, 0.01, outputs=[path], paired=paired)
        assert table[f"initial.{path}"].values.tolist() == values
        np.testing.assert_allclose(table[path].values[:, 0], values, rtol=1e-12)


def test_an_unknown_path_names_the_nearest():
    with pytest.raises(ephs.SceneError, match=r"bodies\.rod1\.mass"):
        ephs.sweep(ephs.load(CHAIN), {"bodies.rod1.mas": [1.0]}, 0.1)


def test_the_command_writes_a_table(tmp_path, capsys):
    import xarray as xr

    words = f"sweep {CHAIN} --vary bodies.rod1.mass=1:2:3 --vary joints.j0.rate=0,1 --until 0.1"
    assert typed(f"{words} -o {tmp_path} --output-of energy --instants 4") == 0
    assert "6 members, 0 failed" in capsys.readouterr().out
    with xr.open_dataset(tmp_path / "sweep.nc", engine="h5netcdf") as table:
        assert dict(table.sizes) == {"bodies.rod1.mass": 3, "initial.joints.j0.rate": 2, "t": 5}
        assert table["bodies.rod1.mass"].values.tolist() == [1.0, 1.5, 2.0]
    assert typed(f"sweep {CHAIN} --vary bodies.rod1.mass=-1,1 --until 0.1 -o {tmp_path}") == 3


@pytest.mark.parametrize("entry", ["bodies.rod1.mass", "bodies.rod1.mass=1:2", "=1", "bodies.rod1.mass=1:2:0", "a=x"])
def test_the_command_says_how_to_vary(entry, tmp_path, capsys):
    assert typed(f"sweep {CHAIN} --vary {entry} --until 0.1 -o {tmp_path}") == 2
    assert "expected PATH=FROM:TO:COUNT" in capsys.readouterr().err


def test_the_command_refuses_values_of_a_path_that_are_given_twice(tmp_path, capsys):
    words = f"sweep {CHAIN} --vary bodies.rod1.mass=1 --vary bodies.rod1.mass=2 --until 1"
    assert typed(f"{words} -o {tmp_path}") == 2
    assert "bodies.rod1.mass: found twice" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "value"),
    [
        *product(["--until", "--rtol", "--atol", "--step"], ["0", "-1", "inf", "nan"]),
        *product(["--instants", "--workers"], ["0", "-1"]),
    ],
)
def test_the_command_refuses_what_is_not_positive(option, value, tmp_path, capsys):
    until = "" if option == "--until" else "--until 1"
    assert typed(f"sweep {CHAIN} --vary bodies.rod1.mass=1,2 -o {tmp_path} {until} {option} {value}") == 2
    said = capsys.readouterr().err
    assert all(word in said for word in (option, f"found {value}", "positive finite")), said


def test_the_command_passes_a_form_on(tmp_path):
    import xarray as xr

    words = f"sweep {CHAIN} --vary bodies.rod1.mass=1,2 --until 0.1 --instants 2"
    forms = ("paper", "reduced")
    steps = "--method natural --step 0.05 --output-of joints.j0.coordinate"
    tables = []
    for form in forms:
        assert typed(f"{words} {steps} --form {form} -o {tmp_path / form}") == 0
        with xr.open_dataset(tmp_path / form / "sweep.nc", engine="h5netcdf") as table:
            tables.append(table["joints.j0.coordinate"].values)
    np.testing.assert_allclose(tables[0], tables[1], rtol=1e-10)


def test_a_job_travels_as_a_value():
    import pickle

    from ephs.mechanics.sweep.job import Job

    scene = ephs.load(CHAIN)
    axes = Axes.of({"joints.j0.rate": [0.0, 1.0, 2.0]}, paired=False)
    job = Job(Job.document(scene), axes, 0.0, 0.1, np.array([0.1]), {}, outputs_of(scene, None), "a")
    again = pickle.loads(pickle.dumps(job))
    assert json.dumps(again.run(np.arange(3)).status) == json.dumps(job.run(np.arange(3)).status)
