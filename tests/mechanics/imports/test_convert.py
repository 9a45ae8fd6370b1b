"""A model and the scene file made of it load to the same scene; numbers are exact, meshes are found."""

import tomllib
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.imports import convert
from ephs.mechanics.imports.convert import toml_text
from ephs.mechanics.scene.document import scene_to_text
from tests.mechanics.imports.models import URDF
from tests.typed import typed

GYMNASIUM = Path(find_spec("gymnasium").submodule_search_locations[0]) / "envs/mujoco/assets"
pytestmark = pytest.mark.filterwarnings("ignore::ephs.ModelWarning", "ignore::ephs.SceneWarning")


def same(first, second):
    """Whether two scenes are the same but for the files that they came from."""
    return scene_to_text(replace(first, source=None)) == scene_to_text(replace(second, source=None))


@pytest.mark.parametrize("base", ["fixed", "free"])
def test_a_converted_model_is_the_same_scene(base, model, tmp_path):
    convert(model, tmp_path / "scene.toml", base=base)
    assert same(ephs.load(model, base=base), ephs.load(tmp_path / "scene.toml"))


@pytest.mark.parametrize("contact", [False, True])
@pytest.mark.parametrize("model", sorted(GYMNASIUM.glob("*.xml")), ids=lambda path: path.stem)
def test_a_converted_robot_is_the_same_scene(model, contact, tmp_path):
    convert(model, tmp_path / "scene.toml", contact=contact)
    assert same(ephs.load(model, contact=contact), ephs.load(tmp_path / "scene.toml"))


MESH = (
    "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s\n"
)


def test_meshes_are_found_from_another_folder(write, tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/part.stl").write_text(MESH)
    visual = '<visual><geometry><mesh filename="package://robot/meshes/part.stl" scale="2 2 2"/></geometry></visual>'
    model = write(f'<robot name="r"><link name="a">{visual}</link></robot>')
    assert typed(f"convert {model} -o {tmp_path / 'far/away.toml'}") == 0
    assert typed(f"convert {model} -o {tmp_path / 'beside.toml'}") == 0
    for scene, place in (
        (ephs.load(model), "meshes/part.stl"),
        (ephs.load(tmp_path / "beside.toml"), "meshes/part.stl"),
        (ephs.load(tmp_path / "far/away.toml"), "far/away-meshes/part.stl"),  # scenes read nothing outside their folder
    ):
        (shape,) = scene.body("a").shapes
        assert Path(shape["mesh"]).resolve() == (tmp_path / place).resolve()
        assert Path(shape["mesh"]).read_text() == MESH and shape["scale"] == [2.0, 2.0, 2.0]


def test_the_command_says_what_is_left_out_once(write, tmp_path, capsys):
    model = write(URDF)
    assert typed(f"convert {model} -o {tmp_path / 'arm.toml'} --base free") == 0
    done = capsys.readouterr()
    assert done.out.strip() == str(tmp_path / "arm.toml")
    assert done.err.count("limits of: shoulder, rail") == 1
    assert typed(f"reduce {tmp_path / 'arm.toml'}") == 0
    assert capsys.readouterr().err == ""
    assert typed(f"reduce {model}") == 0
    assert capsys.readouterr().err.count("limits of: shoulder, rail") == 1


@pytest.mark.parametrize(("model", "scene"), [("a.toml", "b.toml"), ("a.urdf", "b.txt")])
def test_endings_are_checked(model, scene, tmp_path):
    (tmp_path / model).write_text(URDF)
    with pytest.raises(ephs.SceneError, match="expected a file that ends in"):
        convert(tmp_path / model, tmp_path / scene)


numbers = st.floats(allow_nan=False, allow_infinity=False)
entries = st.dictionaries(
    st.text(),
    st.booleans()
    | numbers
    | st.text()
    | st.lists(numbers)
    | st.lists(st.fixed_dictionaries({"sphere": numbers}), min_size=1, max_size=2),
)


@settings(max_examples=30)
@given(st.dictionaries(st.text(), st.dictionaries(st.text(), entries, min_size=1, max_size=3), min_size=1, max_size=3))
def test_text_keeps_every_table(tables):
    assert tomllib.loads(toml_text(tables)) == tables


@pytest.mark.filterwarnings("ignore::ephs.ModelWarning")
@pytest.mark.parametrize("name", ["half_cheetah", "hopper", "walker2d"])
def test_a_robot_that_falls_freely_from_rest_runs(name):
    """Its joints rub at rates that are all rounding: no step may take that for an equation without solution."""
    sol = ephs.simulate(ephs.load(GYMNASIUM / f"{name}.xml"), 0.02, method="natural", step=1e-3)
    assert sol.stats["cut_steps"] == 0 and sol.constraint_error.max() <= 1e-13


@pytest.mark.parametrize("name", ["swimmer", "inverted_pendulum", "hopper"])
def test_a_robot_at_rest_passes_its_check(name, capsys):
    """Where nothing moves, and all energies are zero but for rounding, no law fails for that."""
    assert typed(f"check {GYMNASIUM / f'{name}.xml'}") == 0
