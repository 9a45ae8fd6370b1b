"""Elements that users register behave as built-in ones: reading, documents, parameters, units, parts, runs."""

import json
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import ephs
from ephs import quantity as Q
from ephs.mechanics import Element, key, register_element, rule
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.build import initial_state
from ephs.mechanics.scene.custom import ElementError
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from ephs.mechanics.scene.own_units import mobility_of
from ephs.mechanics.scene.parameters import names, read, varied
from ephs.mechanics.scene.reference import scene_tables
from ephs.mechanics.scene.registry import REGISTERED
from ephs.mechanics.scene.rescaled import rescaled
from ephs.mechanics.scene.schema import json_schema
from ephs.mechanics.scene.soundness import check_scene
from ephs.mechanics.scene.state import lost_states
from ephs.show.motions.lines import lines_of
from ephs.solve.equations.mobility import Mobility
from tests.mechanics.own_elements import Pump, Push
from tests.scenes import ROOT
from tests.solve.dense import dense_mobility

PAGE = ROOT / "docs" / "elements.md"
CELLS = re.findall(r"```\{code-cell\} ipython3\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
FALL = "format = 1\n[world]\ngravity = [0.0, 0.0, -9.81]\n[bodies.ball]\nmass = 2.0\ninertia = [0.1, 0.1, 0.1]\n"
GOOD = {"body": "ball", "coefficient": 0.5, "slow": 0.01, "heat": "box"}


@pytest.fixture(autouse=True)
def page(tmp_path_factory):
    """The classes of the page, registered for one test."""
    before, out = dict(REGISTERED), {}
    folder = tmp_path_factory.mktemp("page")
    for cell in CELLS:
        classes = re.search(r"^@register_element\n(?:.*\n)*?(?=\n\n\(folder)", cell, re.MULTILINE)
        imports = cell.partition("\n\n\n@register_element")[0] if "import" in cell else ""
        if classes:
            exec(imports.replace('sys.path.insert(0, "..")', "") + "\n" + classes[0], out)
    yield out | {"folder": folder}
    REGISTERED.clear()
    REGISTERED.update(before)


def toml(value):
    return json.dumps(value)


def table(section, name, keys):
    return f"[{section}.{name}]\n" + "".join(f"{key} = {toml(value)}\n" for key, value in keys.items())


def rod_between(at1, at2):
    """The table of a rod from the ground to the ball."""
    return table("rods", "r", {"bodies": ["ground", "ball"], "at1": at1, "at2": at2})


def loaded(folder, text, name="scene.toml"):
    file = Path(folder) / name
    file.write_text(text, encoding="utf-8")
    return ephs.load(file)


def faults(folder, text):
    with pytest.raises(ephs.SceneError) as caught:
        loaded(folder, text)
    return {fault.key: fault for fault in caught.value.faults}


BOX = "[thermal.box]\ncapacity = 50.0\ntemperature = 300.0\n"


def dragged(folder, **changes):
    return loaded(folder, FALL + BOX + table("drags", "air", GOOD | changes))


SLIDER = """format = 1
[bodies.cart]
mass = 2.0
inertia = [1.0, 1.0, 1.0]
[joints.rail]
type = "prismatic"
bodies = ["ground", "cart"]
at = [0.0, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
"""


def pushed(folder, **keys):
    return loaded(folder, SLIDER + table("pushes", "s", {"joint": "rail", "stiffness": 8.0, "stretch": 0.5} | keys))


BREAKS = {
    "body": [("bal", '"ground" or a body', 'did you mean "ball"?'), (3, "a text in quotes", "correct the value")],
    "coefficient": [
        (-1.0, "a number not below 0", "correct the value"),
        ("1", "a number", "correct the value"),
        (1e60, "a number of at most 1e+50 in size", "check the unit"),
        (True, "a number", "correct the value"),
    ],
    "slow": [(0.0, "a number above 0", "correct the value"), ([1.0], "a number", "correct the value")],
    "heat": [("bx", '"environment" or a [thermal] name', 'did you mean "box"?')],
}


@pytest.mark.parametrize("key", GOOD)
def test_each_key_that_is_broken_is_refused_by_its_path(key, tmp_path):
    for value, expected, advice in BREAKS[key]:
        found = faults(tmp_path, FALL + BOX + table("drags", "air", GOOD | {key: value}))
        assert list(found) == [f"drags.air.{key}"]
        assert (found[f"drags.air.{key}"].expected, found[f"drags.air.{key}"].advice) == (expected, advice)


def test_all_faults_come_at_once_with_those_of_built_in_elements(tmp_path):
    text = FALL.replace("mass = 2.0", "mass = -2.0") + table("drags", "air", {"body": "bal", "coeficient": 1.0})
    text += table("rods", "r", {"bodies": ["ball", "ball"], "at1": [0.0, 0.0], "at2": [0.0, 0.0, 0.0]})
    found = faults(tmp_path, text)
    assert set(found) == {"bodies.ball.mass", "drags.air.body", "drags.air.coeficient", "rods.r.at1", "rods.r.bodies"}
    assert found["drags.air.coeficient"].advice == 'did you mean "coefficient"?'
    assert found["rods.r.bodies"].expected == "two different bodies"


def test_missing_keys_and_tables_that_are_none_are_said(tmp_path):
    assert faults(tmp_path, FALL + "[drags.air]\n")["drags.air.coefficient"].expected == "c = ½ ρ c_w A, kg/m"
    assert faults(tmp_path, FALL.replace("format = 1\n", "format = 1\ndrags = 3\n"))["drags.NAME"].expected == "a table"
    assert faults(tmp_path, FALL + "[drag.air]\n")["drag"].advice == 'did you mean "drags"?'


def test_a_section_that_nobody_registered_is_an_unknown_key(tmp_path):
    REGISTERED.pop("drags")
    found = faults(tmp_path, FALL + "[drags.air]\n")["drags"]
    assert found.found == "an unknown key" and "rods" in found.expected


def test_rules_of_places_are_asked_once_bodies_are_there(tmp_path):
    rod = rod_between([0.0, 0.0, 1.0], [0.0, 0.0, 1.0])
    found = faults(tmp_path, FALL + rod)
    assert found["rods.r.at2"].expected == "a point apart from at1"


numbers = st.floats(0.01, 9.0)
drawn = st.fixed_dictionaries(
    {"stiffness": numbers},
    optional={
        "stretch": st.floats(-1.0, 1.0),
        "way": st.lists(numbers, min_size=2, max_size=2),
        "ratio": numbers,
        "turns": st.integers(1, 5),
        "open": st.booleans(),
    },
)


def test_documents_with_broken_elements_or_unknown_sections_are_refused(tmp_path):
    text = scene_to_text(dragged(tmp_path))
    for old, new, said in (
        ('"slow": 0.01', '"slow": -1.0', "slow"),
        ('"coefficient"', '"coeficient"', "coefficient"),
        ('"drags"', '"dregs"', "not registered"),
    ):
        with pytest.raises(ValueError, match=said):
            scene_from_text(text.replace(old, new))
    with pytest.raises(ValueError, match="no body nobody"):
        check_scene(scene_from_text(text.replace('"body": "ball"', '"body": "nobody"')))


@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(drawn, numbers, st.sampled_from(["stiffness", "stretch", "ratio"]))
def test_a_parameter_is_what_the_file_would_say(tmp_path, keys, value, key):
    register_element(Push)
    scene, path = pushed(tmp_path, **{"ratio": 1.0} | keys), f"pushes.s.{key}"
    assert path in names(scene) and "pushes.s.way[1]" in names(scene)
    assert read(scene, path) == getattr(scene.elements["pushes"]["s"], key)
    assert varied(scene, {path: value}).elements == pushed(tmp_path, **{"ratio": 1.0} | keys | {key: value}).elements
    wrong = {"stiffness": -value, "stretch": 10.0 + value, "ratio": 0.0}[key]
    with pytest.raises(ephs.SceneError) as said:
        pushed(tmp_path, **keys | {key: wrong})
    with pytest.raises(ephs.SceneError) as caught:
        varied(scene, {path: wrong})
    assert caught.value.faults == said.value.faults


def test_entries_of_vectors_are_parameters(tmp_path):
    rod = rod_between([0.0, 0.0, 1.0], [0.0, 0.0, 0.1])
    scene = loaded(tmp_path, FALL + rod)
    assert read(scene, "rods.r.at1[2]") == 1.0
    assert varied(scene, {"rods.r.at1[2]": 2.0}).elements["rods"]["r"].at1 == [0.0, 0.0, 2.0]


def test_the_schema_and_the_page_of_keys_have_it():
    assert "drags" in json_schema()["properties"]
    tables = scene_tables()
    assert "| `coefficient` | number ≥ 0 | required | c = ½ ρ c_w A, kg/m |" in tables["[drags.NAME]"]
    assert "| `slow` | number > 0 | `0.001` |" in tables["[drags.NAME]"]
    assert "| `bodies` | 2 texts | required |" in tables["[rods.NAME]"]


def test_drag_falls_as_the_closed_form(tmp_path):
    scene = loaded(tmp_path, FALL + table("drags", "air", {"body": "ball", "coefficient": 0.5, "slow": 1e-6}))
    last = np.sqrt(2.0 * 9.81 / 0.5)
    for options in ({"method": "rk54", "rtol": 1e-9}, {"method": "natural4", "step": 0.01}, {"method": "radau"}):
        sol = ephs.simulate(scene, 2.0, **options)
        assert sol.body("ball").velocity[:, 2] == pytest.approx(-last * np.tanh(9.81 / last * sol.t), abs=2e-5)
        assert sol.heat[-1] > 1.0


def test_a_rod_keeps_its_length_and_swings_as_a_pendulum(tmp_path):
    rod = rod_between([0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    text = FALL + "position = [0.6, 0.0, -0.8]\n"
    swing = ephs.simulate(loaded(tmp_path, text + rod), 1.0, step=0.01)
    joint = '[joints.j]\ntype = "spherical"\nbodies = ["ground", "bob"]\nat = [0.0, 0.0, 0.0]\naxis = [0.0, 1.0, 0.0]\n'
    point = text.replace("ball", "bob").replace("inertia = [0.1, 0.1, 0.1]", "inertia = [1e-9, 1e-9, 1e-9]")
    pendulum = ephs.simulate(loaded(tmp_path, point + joint), 1.0, method="rk87", rtol=1e-9)
    assert np.linalg.norm(swing.body("ball").position, axis=1) == pytest.approx(1.0, abs=1e-13)
    assert swing.body("ball").position[-1] == pytest.approx(pendulum.body("bob").position[-1], abs=2e-3)
    assert ephs.simulate(loaded(tmp_path, text + rod), 0.1).audit.passed
    with pytest.raises(ephs.OptionError, match=r"rods\.r\.line\.segment1\.st holds a rate"):
        ephs.simulate(loaded(tmp_path, text + rod), 0.1, method="rk54")


def test_a_rod_takes_one_freedom_and_a_tendon_none(tmp_path):
    rod = {"bodies": ["ground", "ball"], "at1": [0.0, 0.0, 1.0], "at2": [0.0, 0.1, 0.0]}
    cord = {"bodies": ["ground", "ball"], "points": [[0.0, 0.0, 1.0], [0.0, 0.1, 0.0]]}
    for section, keys, count in (("rods", rod, 5), ("tendons", cord, 6)):
        problem = problem_of_scene(loaded(tmp_path, FALL + table(section, "r", keys)))
        x = problem.descriptor.pack(problem.initial)
        assert mobility_of(problem) == dense_mobility(problem.descriptor, x) == Mobility(count, 0)


def test_a_part_does_as_its_elements_do_flat(tmp_path):
    rod = rod_between([0.1, 0.0, 0.0], [0.0, 0.1, 0.0])
    text = FALL + "position = [0.6, 0.0, -0.8]\n" + BOX + table("drags", "air", GOOD) + rod
    flat = loaded(tmp_path, text, "part.toml")
    place = 'format = 1\n[parts.left]\nuse = "part.toml"\nposition = [1.0, 2.0, 0.5]\n'
    place += "rotation = { axis = [0.0, 0.0, 1.0], angle_deg = 90.0 }\n"
    nested = loaded(
        tmp_path, place + table("drags", "more", GOOD | {"body": "left.ball", "heat": "left.box", "coefficient": 0.0})
    )
    assert [(s, n, each.body) for s, n, each in nested.all_elements() if s == "drags"] == [
        ("drags", "more", "left.ball"), ("drags", "left.air", "left.ball"),
    ]  # fmt: skip
    assert read(nested, "drags.left.air.coefficient") == 0.5
    one, other = (ephs.simulate(scene, 0.5, step=0.01) for scene in (flat, nested))
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) @ one.body("ball").position[-1]
    assert other.body("left.ball").position[-1] == pytest.approx(turned + np.array([1.0, 2.0, 0.5]), abs=1e-9)
    again = scene_from_text(scene_to_text(nested))
    assert problem_of_scene(again).initial.keys() == problem_of_scene(nested).initial.keys()
    assert again.system() == nested.system()


def test_an_element_on_a_joint_oscillates_for_all_methods_and_goes_on(tmp_path):
    register_element(Push)
    scene = loaded(tmp_path, SLIDER + table("pushes", "s", {"joint": "rail", "stiffness": 8.0, "stretch": 0.5}))
    for options in ({"method": "rk87", "rtol": 1e-9}, {"method": "natural", "step": 0.002}, {"method": "radau"}):
        sol = ephs.simulate(scene, 1.0, **options)
        assert sol.joint("rail").coordinate[-1, 0] == pytest.approx(0.5 * (np.cos(2.0) - 1.0), abs=1e-4)
    other = SLIDER.replace(
        "[joints.rail]", "[bodies.frame]\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\n[joints.rail]"
    ).replace('"prismatic"', '"spherical"')
    found = faults(tmp_path, other + table("pushes", "s", {"joint": "rail", "stiffness": 8.0, "stretch": 0.5}))
    assert found["pushes.s.joint"].expected == "a joint with one degree of freedom and no prescribed motion"
    found = faults(tmp_path, SLIDER + table("pushes", "s", {"joint": "rial", "stiffness": 8.0, "stretch": 12.0}))
    assert found["pushes.s.joint"].advice == 'did you mean "rail"?'
    assert found["pushes.s.stretch"].found == "the stretch 12"


def test_one_input_drives_two_ports_and_ratios_are_of_each_joint(tmp_path):
    register_element(Pump)
    pump = table("pumps", "p", {"joints": ["rail"], "ratio": 0.5, "pressure": [3.0, 1.0]})
    scene = loaded(tmp_path, SLIDER + pump, "part.toml")
    assert scene.elements["pumps"]["p"].ratio == [0.5]
    assert rescaled(scene, 2.0).elements["pumps"]["p"].ratio == [2.0]
    nested = loaded(tmp_path, 'format = 1\n[parts.left]\nuse = "part.toml"\n')
    for inputs, pressures in (({}, (3.0, 1.0)), ({"pumps.left.p": [6.0, 5.0]}, (6.0, 5.0))):
        sol = ephs.simulate(nested, 1.0, method="rk87", inputs=inputs)
        assert abs(sol.joint("left.rail").rate[-1, 0]) == pytest.approx(0.5 * (pressures[0] - pressures[1]) / 2.0)
        assert sol.heat[-1] == pytest.approx(1e-3 * (pressures[0] - pressures[1]) ** 2)
    found = faults(tmp_path, SLIDER + table("pumps", "p", {"joints": ["rail"] * 3}))["pumps.p"]
    assert (found.found, found.expected) == ("a table", "at most 2 joints")


def malformed():
    class NoSection(Element):
        def build(self, site):
            pass

    class Taken(Element, section="bodies"):
        def build(self, site):
            pass

    class NoBuild(Element, section="unbuilt"):
        size: float = key("size", unit="m")

    class NoKey(Element, section="unkeyed"):
        size: float = 1.0

        def build(self, site):
            pass

    class NoUnit(Element, section="unmeasured"):
        size: float = key("size")

        def build(self, site):
            pass

    with warnings.catch_warnings(action="ignore", category=UserWarning):  # pydantic says that names are shadowed

        class Reserved(Element, section="reserved"):
            name: float = key("size", unit="m")

            def build(self, site):
                pass

    class OddNames(Element, section="odd"):
        part: str = key("part", names="bodys")

        def build(self, site):
            pass

    class OddForm(Element, section="formed"):
        part: dict[str, str] = key("part")

        def build(self, site):
            pass

    class OddRule(Element, section="ruled"):
        size: float = key("size", unit="m")

        @rule("sice", expected="nothing")
        def fits(self):
            return True

        def build(self, site):
            pass

    return {
        NoSection: "section=",
        Taken: "do not have yet",
        NoBuild: r"build\(self, site\)",
        NoKey: "a key made by key",
        NoUnit: "unit= of each number",
        Reserved: "not an attribute",
        OddNames: "names= one of",
        OddForm: "a number, a text",
        OddRule: "a rule of keys of this class",
    }


def test_malformed_classes_are_refused_with_one_error():
    for kind, said in malformed().items():
        with pytest.raises(ElementError, match=said):
            register_element(kind)
    with pytest.raises(ElementError, match="a subclass"):
        register_element(Path)
    with pytest.raises(ElementError, match=r"odd.*known symbols"):
        type("Odd", (Element,), {"__annotations__": {"odd": float}, "odd": key("size", unit="ft")})


def test_a_section_is_registered_once_but_a_class_may_be_defined_again():
    class Drag(Element, section="drags"):
        def build(self, site):
            pass

    with pytest.raises(ElementError, match="do not have yet"):
        register_element(Drag)
    register_element(Push)
    assert register_element(Push) is REGISTERED["pushes"]


def test_only_what_keys_name_is_connected(tmp_path):
    class Sneaky(Element, section="sneaky", said="what names nothing"):
        def build(self, site):
            site.momentum("ball")

    register_element(Sneaky)
    found = faults(tmp_path, FALL + "[sneaky.x]\n")["sneaky.x"]
    assert "the body ball" in found.found and found.expected == "an element that can be built"


def test_a_run_that_cannot_go_on_is_refused(tmp_path):
    register_element(Push)
    with pytest.raises(ephs.SceneError, match=r"pushes\.s: found the state spring\.q .* let continued"):
        odd = pushed(tmp_path, turns=2)
        odd.at(ephs.simulate(odd, 0.5, step=0.01), 0.5)


def test_a_run_goes_on_at_either_quaternion_of_a_pose_and_at_no_other_pose(tmp_path):
    class Placed(Element, section="placed", said="the energy of a pose"):
        def build(self, site):
            start = [0.6, 0.8, 0.0, 0.0, 0.1, 0.2, 0.3]
            body = ephs.storage({"q": Q.pose}, lambda q: 0.5 * (q[4] ** 2 + q[5] ** 2 + q[6] ** 2))
            site.add(body, {"q": site.inner("q", Q.pose)}, "body", initial={"q": start})

    register_element(Placed)
    scene = loaded(tmp_path, FALL + "[placed.x]\n")
    states = initial_state(scene)
    (path,) = (path for path in states if str(path).endswith("placed.x.body.q"))
    turned = np.array([-1.0] * 4 + [1.0] * 3)
    assert not list(lost_states(scene, {**states, path: turned * states[path]}))
    assert list(lost_states(scene, {**states, path: states[path] + 1e-3 * (turned > 0.0)}))
    assert list(lost_states(scene, {**states, path: -turned * states[path]}))


def test_the_page_runs(capsys):
    REGISTERED.clear()
    out = {}
    for cell in CELLS:
        exec(cell, out)
    said = capsys.readouterr().out
    assert "broken.toml: 3 faults" in said and "-6.2642 m/s after 5 s; in the end -6.2642 m/s" in said
    assert float(said.partition("length kept to ")[2].split()[0]) < 1e-13


def test_its_lines_are_drawn_in_parts_too(tmp_path):
    rod = rod_between([0.0, 0.0, 1.0], [0.0, 0.0, 0.1])
    loaded(tmp_path, FALL + rod, "part.toml")
    nested = loaded(tmp_path, 'format = 1\n[parts.left]\nuse = "part.toml"\nposition = [1.0, 0.0, 0.0]\n')
    line = lines_of(nested)["rods.left.r-1"]
    assert (line.body1, line.body2) == ("ground", "left.ball")
    assert line.at1.tolist() == [1.0, 0.0, 1.0] and line.at2.tolist() == [0.0, 0.0, 0.1]
