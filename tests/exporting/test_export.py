"""Exported mechanisms take the steps of the package, bit for bit: as object code, as C text, as WebAssembly."""

import ctypes
import subprocess
import sys

import numpy as np
import pytest
import wasmtime

import ephs
from ephs.exporting.image import image_of
from ephs.exporting.module import exported
from ephs.mechanics.scene.parameters import names, read, varied
from tests.exporting.runs import Run
from tests.mechanics.drawn_scenes import drawn, toml
from tests.scenes import ROOT, shipped
from tests.written import scene_of_text

MAIN = """
#include <stdio.h>
#include <stdlib.h>
#include "{name}.h"
int main(void) {{
  double out[{upper}_OUTPUTS], *in = malloc(({upper}_INPUTS + 1) * sizeof(double));
  void *memory = malloc({upper}_BYTES);
  for (int k = 0; k < {upper}_INPUTS; k++) in[k] = 0.25;
  {name}_start(memory);
  {name}_inputs(memory, in);
  if ({name}_advance(memory, {until}) || {name}_outputs(memory, out)) return 1;
  for (int k = 0; k < {upper}_OUTPUTS; k++) printf("%a\\n", out[k]);
  return 0;
}}
"""


def wanted(solution, name):
    """The number of a solution's last instant that an output names; rotations of joints as a quaternion."""
    kind, of, what, *part = name.replace(".pe.q.", ".").split(".")
    if kind == "bodies":
        return getattr(solution.body(of), what)[-1][("wxyz" if what == "quaternion" else "xyz").index(part[0])]
    joint = solution.joint(of)
    if what == "position":
        return joint.coordinate[-1][3 + "xyz".index(part[0])]
    if what == "quaternion":
        turn = joint.coordinate[-1][:3]
        half = 0.5 * np.linalg.norm(turn)
        return np.array([np.cos(half), *(0.5 * np.sinc(half / np.pi) * turn)])["wxyz".index(part[0])]
    return np.atleast_1d(getattr(joint, what)[-1])[int(part[0]) if part else 0]


def advanced(model, until, **given):
    """The exported model after a time, under inputs where some are given."""
    run = Run(exported(image_of(model, inputs=list(given), until=until), "made"))
    run.call("inputs", None, np.hstack([[], *given.values()]))
    assert run.call("advance", ctypes.c_int64, until) == 0
    return run


def assert_named(outputs, solution, within):
    """All outputs are what their names say; rotations up to the sign of their quaternions."""
    for name, value in outputs.items():
        if name.split(".")[0] not in ("bodies", "joints") or ".link." in name:
            continue
        expected = wanted(solution, name)
        if ".quaternion." in name:
            value, expected = abs(value), abs(expected)
        assert value == pytest.approx(expected, abs=within * (1.0 + abs(expected))), name


def drawn_scene(seed):
    tables = drawn(seed)
    tables.pop("loads", None)
    return scene_of_text(toml(tables))


@pytest.mark.parametrize("seed", range(6))
def test_outputs_are_at_the_start_what_their_names_say(seed):
    model = drawn_scene(seed)
    outputs = {each.name: each.start for each in image_of(model).outputs}
    assert {name.split(".")[0] for name in outputs} >= {"bodies", "joints"}
    solution = ephs.simulate(model, 1e-9, save_at=[0.0], audit="off")
    assert_named(outputs, solution, 1e-12)
    with pytest.raises(AssertionError):  # the control
        assert_named(outputs, ephs.simulate(model, 0.1, audit="off"), 1e-12)


def test_links_that_are_no_body_have_the_name_of_the_joint_that_carries_them():
    found = [each.name for each in image_of(shipped("universal")).outputs]
    assert len(set(found)) == len(found) and "joints.cross.first.link.position.x" in found
    assert {name.split(".")[0] for name in found} == {"bodies", "joints", "energy"}


PUSHED = """
[motors.winding]
joint = "bearing"
constant = 0.5
resistance = 1.0
voltage = 0.2
"""


@pytest.mark.parametrize("path", ["joints.bearing.drive", "motors.winding.voltage"])
def test_parameters_of_what_drives_are_in_the_program(path):
    """And nothing that an input sets is one."""
    model = scene_of_text((ROOT / "scenes/slider-crank.toml").read_text() + PUSHED)
    (number,) = image_of(model, parameters=[path]).dependences
    assert number.constant == pytest.approx(read(model, path), rel=1e-12)
    if path.startswith("joints"):
        with pytest.raises(ephs.ExportError, match=r"joints\.bearing\.drive' belongs to the input 'joints\.bearing'"):
            image_of(model, parameters=[path], inputs=["joints.bearing"])
    else:
        assert image_of(model, parameters=[path], inputs=["joints.bearing"]).dependences


@pytest.mark.parametrize("path", ["bodies.crank.mass", "joints.bearing.friction", "joints.bearing.drive"])
def test_what_depends_on_a_number_is_the_same_beside_stiff_parts(path):
    """Numbers of all units stand in one array: a soft one counts beside those of a stop of 1e14 N/m."""
    text = (ROOT / "scenes/slider-crank.toml").read_text()

    ends = 'bodies = ["ground", "slider"]\nat1 = [0.5, 0.0, 0.0]\nat2 = [0.0, 0.0, 0.0]'

    def moved_numbers(stiffness):
        stop = f"[springs.stop]\n{ends}\nstiffness = {stiffness}\n"
        made = image_of(scene_of_text(text + PUSHED + stop), parameters=[path]).dependences
        return [(each.entry, each.constant, each.terms) for each in made]

    assert moved_numbers(1.0) == moved_numbers(1e14)
    assert moved_numbers(1.0)


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 2, 7])
def test_drawn_scenes_are_exported(seed):
    """With two of their numbers changed."""
    model, run = drawn_scene(seed), {"method": "rk87", "rtol": 1e-9, "atol": 1e-11}
    kinds = {path.split(".")[-1].partition("[")[0]: path for path in names(model) if read(model, path) > 0.0}
    taken = [kinds[kind] for kind in ("drive", "voltage", "mass", "stiffness", "inertia") if kind in kinds]
    values = {path: 1.03 * read(model, path) for path in taken[:2]}
    made = Run(exported(image_of(model, **run, until=0.2, parameters=list(values)), "changed"))
    made.call("parameters", None, np.array(list(values.values())))
    assert made.call("advance", ctypes.c_int64, 0.2) == 0
    assert_named(made.outputs(), ephs.simulate(varied(model, values), 0.2, **run), 1e-6)
    with pytest.raises(AssertionError):  # the control
        assert_named(made.outputs(), ephs.simulate(model, 0.2, **run), 1e-6)


@pytest.mark.parametrize("scene", ["slider-crank", "heavy-top", "four-bar", "chain", "mbs", "motor-four-bar"])
def test_the_steps_are_those_of_the_package(scene):
    model = shipped(scene)
    run = advanced(model, 0.3)
    assert run.call("time", ctypes.c_double) == 0.3
    solution = ephs.simulate(model, 0.3, method="rk87", save_at=[0.3], audit="off")
    for name, value in run.outputs().items():
        if name.endswith("coordinate"):
            assert value == wanted(solution, name), name
        elif ".position." in name:
            np.testing.assert_allclose(value, wanted(solution, name), rtol=1e-13, atol=1e-13)


def test_the_energy_is_that_of_all_storages_but_the_environment():
    model = shipped("motor-four-bar")
    run = advanced(model, 0.3)
    solution = ephs.simulate(model, 0.3, method="rk87", save_at=[0.0, 0.3], audit="off")
    around = sum(
        293.15 * solution[str(path)][-1].item()
        for path in solution.states
        if str(path).endswith(("env.s", "environment.s"))
    )
    assert run.outputs()["energy"] == pytest.approx(solution.energy[-1] - around, rel=1e-12)


def test_forces_from_outside_are_inputs():
    model = shipped("slider-crank")
    run = advanced(model, 0.2, **{"joints.bearing": 0.5})
    pushed = ephs.simulate(model, 0.2, method="rk87", inputs={"joints.bearing": 0.5 - 0.06}, save_at=[0.2])
    free = ephs.simulate(model, 0.2, method="rk87", save_at=[0.2])
    found = run.outputs()["joints.bearing.coordinate"]
    assert found == pytest.approx(pushed.joint("bearing").coordinate[-1], rel=1e-12)
    assert abs(found - free.joint("bearing").coordinate[-1]) > 1e-2


@pytest.mark.parametrize(
    ("name", "joint", "forces"),
    [
        ("heavy-top", "tip", [0.1, -0.2, 0.3]), ("universal", "cross", [0.3, -0.2]),
        ("slider-crank", "big-end", [0.1, 0.2, -0.3]), ("four-bar", "knee", 0.4),
    ],
)  # fmt: skip
def test_a_joint_of_any_number_of_freedoms_is_an_input(name, joint, forces):
    """Cut joints, too; a universal one is two joints with a frame between them."""
    model, given = shipped(name), {f"joints.{joint}": forces}
    run = advanced(model, 0.1, **given)
    moved = ephs.simulate(model, 0.1, method="rk87", inputs={key: np.array(f) for key, f in given.items()})
    free = ephs.simulate(model, 0.1, method="rk87", save_at=[0.1])
    outputs = {key: x for key, x in run.outputs().items() if key.startswith("bodies.")}
    assert_named(outputs, moved, 1e-6)
    with pytest.raises(AssertionError):
        assert_named(outputs, free, 1e-5)


def test_many_short_advances_stay_within_the_tolerance():
    model = shipped("chain")
    made = exported(image_of(model, rtol=1e-10, atol=1e-12), "made")
    short, long = Run(made), Run(made)
    for k in range(1, 51):
        assert short.call("advance", ctypes.c_int64, 0.02 * k) == 0
    assert long.call("advance", ctypes.c_int64, 1.0) == 0
    for name, value in long.outputs().items():
        assert short.outputs()[name] == pytest.approx(value, abs=1e-7)


MASSES = {"bodies.rod.mass": 0.2, "bodies.slider.mass": 0.2, "joints.bearing.friction": 3e-3}


@pytest.mark.parametrize(
    ("values", "near", "step"), [(MASSES, 1e-12, 1e-3), (MASSES, 1e-6, None), ({"world.gravity[2]": -3.0}, 1e-6, None)]
)
def test_parameters_make_the_program_of_the_changed_model(values, near, step):
    """Chosen steps differ where numbers do by rounding, or by the gravity that limits them: within the tolerance."""
    model = shipped("slider-crank")
    made = exported(image_of(model, parameters=list(values), until=0.3, step=step), "made")
    run, plain = Run(made), Run(made)
    run.call("parameters", None, np.array(list(values.values())))
    other = Run(exported(image_of(varied(model, values), until=0.3, step=step), "other"))
    for each in (run, other, plain):
        assert each.call("advance", ctypes.c_int64, 0.3) == 0
    found, expected, unchanged = run.outputs(), other.outputs(), plain.outputs()
    for name, value in found.items():
        assert value == pytest.approx(expected[name], rel=near, abs=near), name
    name = "joints.bearing.coordinate"
    assert abs(unchanged[name] - expected[name]) > 1e-3, "the control"


def test_a_friction_may_become_0():
    """Then the shaft of 150 rad/s keeps its rate; a coefficient of 1 + 2e-16 would make the friction negative."""
    run = Run(exported(image_of(shipped("hot-brake"), parameters=["joints.axle.friction"], until=0.1), "made"))
    run.call("parameters", None, np.zeros(1))
    assert run.call("advance", ctypes.c_int64, 0.1) == 0
    assert run.outputs()["joints.axle.rate"] == pytest.approx(150.0, rel=1e-12)


def test_parameters_that_are_no_polynomial_are_refused():
    model = shipped("slider-crank")
    with pytest.raises(ephs.ExportError, match=r"joints\.wrist\.at"):
        image_of(model, parameters=["bodies.rod.mass", "joints.wrist.at[0]"])


@pytest.fixture(scope="module")
def crank(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crank")
    model = shipped("slider-crank")
    made = ephs.export(model, folder / "crank.c", inputs=["joints.bearing"], until=0.3)
    run = Run(made)
    run.call("inputs", None, np.array([0.25]))
    assert run.call("advance", ctypes.c_int64, 0.3) == 0
    return folder, model, made, np.array(list(run.outputs().values()))


def test_c_text_gives_the_same_bits(crank):
    folder, _, _, expected = crank
    (folder / "main.c").write_text(MAIN.format(name="crank", upper="CRANK", until=0.3))
    program = folder / "program"
    compiler = [sys.executable, "-m", "ziglang", "cc", "-std=c99", "-O1", "-w"]
    subprocess.run([*compiler, folder / "main.c", folder / "crank.c", "-o", program, "-lm"], check=True)
    told = subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()
    np.testing.assert_array_equal([float.fromhex(each) for each in told], expected)


@pytest.mark.parametrize("fault", [{"file": "a.txt"}, {"target": "moon"}, {"inputs": ["joints.no"]}, {"method": "semi"},
                                   {"name": "1 a"}])  # fmt: skip
def test_what_cannot_be_exported_is_refused_by_name(crank, tmp_path, fault):
    given = {"file": "a.o", **fault}
    with pytest.raises(ephs.ExportError) as caught:
        ephs.export(crank[1], tmp_path / given.pop("file"), **given)
    (value,) = fault.values()
    assert str(value if isinstance(value, str) else value[0]) in str(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("option", [{"until": np.nan}, {"until": -1.0}, {"inputs": 3},
                                    {"inputs": ["joints.bearing"] * 2}])  # fmt: skip
def test_options_that_are_none_are_refused_by_name(crank, option):
    ((key, value),) = option.items()
    with pytest.raises(ephs.OptionError) as caught:
        image_of(crank[1], **option)
    assert caught.value.key == key and caught.value.found is value


HARD = """
format = 1
[bodies.ball]
mass = 1.0
inertia = [0.01, 0.01, 0.01]
position = [0.0, 0.0, 0.2]
[joints.rail]
type = "prismatic"
bodies = ["ground", "ball"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
limits = [-0.1, 1.0]
"""


def test_a_mass_of_0_that_would_vary_is_refused_by_name():
    """A body without mass has no inertia that a mass could go with."""
    frame = """
[bodies.frame]
mass = 0.0
inertia = [0.0, 0.0, 0.0]
position = [0.0, 0.0, 0.2]
[joints.weld]
type = "fixed"
bodies = ["ball", "frame"]
at = [0.0, 0.0, 0.2]
"""
    with pytest.raises(ephs.ExportError, match=r"bodies\.frame\.mass"):
        image_of(scene_of_text(HARD + frame), parameters=["bodies.frame.mass"])


def test_a_velocity_that_joints_do_not_admit_is_refused_by_name():
    model = shipped("slider-crank")
    with pytest.raises(ephs.ExportError, match=r"bodies\.slider\.velocity\[1\]: .*contradicts the constraints"):
        image_of(model, parameters=["bodies.slider.velocity[1]"])


def test_hard_stops_are_refused_by_name():
    """And elastic ones are in the program: it stands where a run does."""
    with pytest.raises(ephs.ExportError, match=r"joints\.rail\..*: a hard contact or stop"):
        image_of(scene_of_text(f"{HARD}limit_restitution = 0.5\n"))
    model = scene_of_text(f"{HARD}limit_stiffness = 1e4\n")
    assert_named(advanced(model, 0.3).outputs(), ephs.simulate(model, 0.3, method="rk87"), 1e-6)


def test_webassembly_gives_the_same_bits(crank, tmp_path):
    _, model, made, expected = crank
    ephs.export(model, tmp_path / "crank.wasm", inputs=["joints.bearing"], until=0.3)
    store = wasmtime.Store()
    calls = wasmtime.Instance(store, wasmtime.Module.from_file(store.engine, tmp_path / "crank.wasm"), []).exports(
        store
    )
    memory, base = calls["memory"], calls["__heap_base"].value(store)
    given, out = base + made.bytes, base + made.bytes + 8
    memory.grow(store, 1 + (out + expected.nbytes) // 65536)
    calls["crank_start"](store, base)
    memory.write(store, np.array([0.25]).tobytes(), given)
    calls["crank_inputs"](store, base, given)
    assert calls["crank_advance"](store, base, 0.3) == 0
    assert calls["crank_outputs"](store, base, out) == 0
    np.testing.assert_array_equal(np.frombuffer(memory.read(store, out, out + expected.nbytes)), expected)


CONTROLLED = {
    # two joints by one control, and two controls of one joint, clipped
    "joints": """format = 1
[bodies.arm]
mass = 1.0
inertia = [0.01, 0.02, 0.02]
position = [0.3, 0.0, 0.0]
[bodies.hand]
mass = 0.5
inertia = [0.01, 0.01, 0.01]
position = [0.6, 0.0, 0.0]
[joints.h]
type = "revolute"
bodies = ["ground", "arm"]
axis = [0.0, 1.0, 0.0]
at = [0.0, 0.0, 0.0]
friction = 0.1
drive = 0.2
[joints.k]
type = "revolute"
bodies = ["arm", "hand"]
axis = [0.0, 1.0, 0.0]
at = [0.5, 0.0, 0.0]
[actuators.push]
joints = ["h"]
ratio = -3.0
limits = [0.5, 2.0]
[actuators.both]
joints = ["h", "k"]
ratio = [1.0, -2.0]
limits = [-0.1, 0.1]
""",
}
CONTROLLED["tendon"] = (
    CONTROLLED["joints"].replace('joints = ["h", "k"]\nratio = [1.0, -2.0]', 'tendon = "cable"\nratio = -4.0')
    + '[tendons.cable]\nbodies = ["ground", "arm", "hand"]\n'
    "points = [[0.0, 0.0, 1.0], [0.1, 0.0, 0.1], [0.0, 0.0, 0.05]]\n"
)


@pytest.mark.parametrize("way", CONTROLLED)
@pytest.mark.parametrize("controls", [(1.0, 0.05), (5.0, -7.0), (-3.0, 0.0)])
def test_controls_of_actuators_are_inputs(way, controls):
    model = scene_of_text(CONTROLLED[way])
    inputs = dict(zip(("actuators.push", "actuators.both"), controls, strict=True))
    found = advanced(model, 0.2, **inputs).outputs()
    same = ephs.simulate(model, 0.2, method="rk87", inputs=inputs, save_at=[0.2])
    for joint in ("h", "k"):
        assert found[f"joints.{joint}.rate"] == pytest.approx(same.joint(joint).rate[-1, 0], rel=1e-7)


def test_a_parameter_of_an_actuator_that_is_an_input_is_refused():
    with pytest.raises(ephs.ExportError, match=r"actuators\.push\.ratio"):
        image_of(
            scene_of_text(CONTROLLED["joints"]),
            inputs=["actuators.push"],
            parameters=["actuators.push.ratio"],
            until=0.2,
        )
