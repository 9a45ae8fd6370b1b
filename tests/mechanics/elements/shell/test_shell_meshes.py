"""Sheets of layers and on meshes in scene files: grids and meshes alike, triangles, files, pinned sides, refusals."""

from itertools import pairwise

import meshio
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics import Shell, ShellSection
from ephs.mechanics.elements.shell.mesh import grid, quadrilaterals
from ephs.mechanics.elements.shell.section import Ply
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from tests.mechanics.elements.shell.test_shell import patch_is_exact
from tests.mechanics.elements.shell.test_shell_scenes import SHEET, WORLD, lines_of, sheet
from tests.numerics import generators
from tests.written import scene_of_text

MATERIAL = ("thickness", "E", "nu", "rho")
LAYER = "{thickness = 1e-3, E1 = 3e7, E2 = 1e7, G12 = 4e6, nu12 = 0.3, angle = ANGLE, rho = 900.0}"


def table(*without, **keys):
    return {key: value for key, value in SHEET.items() if key not in without} | keys


def scene(keys):
    return scene_of_text(f"{WORLD}[shells.skin]\n{lines_of(keys)}")


def layered(*angles, **keys):
    layers = ", ".join(LAYER.replace("ANGLE", str(angle)) for angle in angles)
    return scene(table(*MATERIAL, layers=f"[{layers}]", **keys))


def meshed(points, cells, **keys):
    return scene(table("corners", "edges", points=np.asarray(points).tolist(), elements=cells, **keys))


# ---- tables inside ---------------------------------------------------------------------------------------------------

INSIDE = {
    "a grid": (
        table(*MATERIAL, "corners", "elements", grid=f"{{corners = {SHEET['corners']}, elements = [3, 2]}}",
              section="{thickness = 4e-3, E = 2e7, nu = 0.3, rho = 900.0}", edges='{left = "ground"}'),
        table(pinned="[false, false, false, false]"),
    ),
    "joints along sides": (
        table(edges='{bottom = {body = "ground", joint = "revolute"}, top = {body = "ground", joint = "fixed"}}'),
        table(edges='["ground", "free", "ground", "free"]', pinned="[true, false, false, false]"),
    ),
    "layers": (
        table(*MATERIAL, layers="[{thickness = 1e-3, E = [3e7, 1e7], G = 4e6, nu = 0.3, angle_deg = 90, rho = 9e2}]"),
        table(*MATERIAL, layers=f"[{LAYER.replace('ANGLE', str(np.pi / 2.0))}]"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", INSIDE)
def test_tables_inside_a_sheet_say_the_same_as_its_keys(name):
    inside, level = (scene(keys).shells["skin"] for keys in INSIDE[name])
    assert inside.model_dump() == level.model_dump()


def test_what_is_no_table_inside_a_sheet_is_refused_by_its_key():
    for keys, key in (
        ({"grid": "{corners = 1, sides = 2}"}, "grid"), ({"section": "{E = 1.0, G = 2.0}"}, "section"),
        ({"grid": "{elements = [3, 2]}"}, "grid"), ({"edges": '{north = "ground"}'}, "edges"),
        ({"edges": '{left = {body = "ground", joint = "screw"}}'}, "edges"),
    ):  # fmt: skip
        with pytest.raises(ephs.SceneError, match=rf"shells\.skin\.{key}: found "):
            scene(table(**keys))


# ---- layers ----------------------------------------------------------------------------------------------------------


def test_one_layer_of_one_material_is_this_material():
    nu, young = 0.3, 2e7
    one = f"{{thickness = 4e-3, E1 = {young}, E2 = {young}, G12 = {0.5 * young / (1 + nu)}, nu12 = {nu}, rho = 900.0}}"
    made = scene(table(*MATERIAL, layers=f"[{one}]")).shells["skin"].shell()
    assert np.array_equal(made.matrix, sheet().shells["skin"].shell().matrix)


@settings(max_examples=5)
@given(st.lists(st.floats(-1.5, 1.5), min_size=1, max_size=3), st.floats(-3.0, 3.0))
def test_fibres_turn_with_the_direction_from_which_their_angles_count(angles, turn):
    """Of a flat sheet: angles that count from a turned direction are as much smaller."""
    flat = "[[0.0, 0.0, 0.0], [0.6, 0.0, 0.0], [0.6, 0.4, 0.0], [0.0, 0.4, 0.0]]"
    one = layered(*angles, corners=flat, along="[1.0, 0.0, 0.0]").shells["skin"].shell()
    other = layered(*(a - turn for a in angles), corners=flat, along=f"[{np.cos(turn)}, {np.sin(turn)}, 0.0]")
    poses = one.poses + 1e-3 * np.sin(np.arange(7.0 * len(one.points))).reshape(-1, 7) * [0, 0, 0, 0, 1, 1, 1]
    energies = [shell.energy(poses) for shell in (one, other.shells["skin"].shell())]
    assert energies[0] == pytest.approx(energies[1], rel=1e-9)
    assert one.section.plane == pytest.approx(
        ShellSection.laminate([Ply(1e-3, 3e7, 1e7, 4e6, 0.3, a, 900.0) for a in angles]).plane, rel=1e-15
    )


# ---- meshes ----------------------------------------------------------------------------------------------------------


def grid_of_sheet():
    points, where, cells = grid(lambda u, v: (0.6 * u, 0.4 * v, 0.1 * u), (3, 2))
    return points, np.flatnonzero(where[:, 0] == 0.0).tolist(), cells.tolist()


def test_a_mesh_of_the_points_of_a_grid_is_this_grid():
    points, held, cells = grid_of_sheet()
    one = meshed(points, cells, sides=[held], edges='["ground"]').shells["skin"]
    other = sheet().shells["skin"]
    assert one.welds() == other.welds() and np.array_equal(one.mesh().cells, other.mesh().cells)
    assert one.shell().matrix == pytest.approx(other.shell().matrix, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("ending", ["msh", "vtk", "obj", "off"])
def test_a_mesh_file_is_its_points_and_elements(tmp_path, ending):
    points, held, cells = grid_of_sheet()
    beside = [*points.tolist(), [9.0, 9.0, 9.0]]  # a point of no element
    blocks = [("quad", cells)]
    groups = [np.ones(len(cells), dtype=int)]
    if ending == "msh":
        blocks.append(("line", [[*pair] for pair in pairwise(held)]))
        groups.append(np.full(len(held) - 1, 7))
    if ending == "off":  # triangles alone
        blocks = [("triangle", [[c[i] for i in t] for c in cells for t in ((0, 1, 2), (0, 2, 3))])]
    data = {"gmsh:physical": groups, "gmsh:geometrical": groups} if ending == "msh" else {}
    mesh = meshio.Mesh(np.array(beside), blocks, cell_data=data, field_data={"hub": np.array([7, 1])} if data else {})
    mesh.write(tmp_path / f"skin.{ending}", **({"file_format": "gmsh22"} if data else {}))
    side = '["hub"]' if ending == "msh" else f"[{held}]"
    keys = table("corners", "elements", file=f'"skin.{ending}"', sides=side, edges='["ground"]')
    (tmp_path / "scene.toml").write_text(f"{WORLD}[shells.skin]\n{lines_of(keys)}")
    read = ephs.load(tmp_path / "scene.toml")
    (tmp_path / f"skin.{ending}").unlink()  # all that is needed is in the scene
    again = scene_from_text(scene_to_text(read)).shells["skin"]
    nodes = sorted(again.welds()["ground"])
    if ending == "off":
        assert len(again.mesh().cells) == 3 * 2 * len(cells)
        assert [node for node in nodes if node < len(points)] == held and len(nodes) == 2 * len(held) - 1
        assert not again.mesh().points[nodes, 0].any()
    else:
        assert again.mesh().cells.tolist() == cells and nodes == held
    assert again.mesh().points[: len(points)] == pytest.approx(points, abs=1e-12)


def test_a_mesh_file_outside_or_of_another_kind_is_refused(tmp_path):
    (tmp_path / "inside").mkdir()
    (tmp_path / "skin.obj").write_text("v 0 0 0\n")
    for name, text, words in (
        ("../skin.obj", "", "in the scene's folder"),
        ("none.obj", None, "does not exist"),
        ("skin.stp", "", "end in .msh"),
        ("empty.obj", "v 0 0 0\n", "without quadrilaterals"),
        ("broken.msh", "no mesh", "cannot be read"),
        ("far.obj", "v 0 0 0\nf 1 2 3\n", "not there"),
    ):
        if text is not None and not name.startswith(".."):
            (tmp_path / "inside" / name).write_text(text)
        keys = table("corners", "elements", "edges", file=f'"{name}"')
        (tmp_path / "inside" / "scene.toml").write_text(f"{WORLD}[shells.skin]\n{lines_of(keys)}")
        with pytest.raises(ephs.SceneError, match=words) as error:
            ephs.load(tmp_path / "inside" / "scene.toml")
        (fault,) = error.value.faults
        assert fault.key == "shells.skin.file"


@settings(max_examples=6)
@given(generators, st.sampled_from(["membrane", "bending"]))
def test_constant_strains_are_exact_on_meshes_with_triangles(rng, kind):
    """Patch tests: half of the elements of a distorted square are two triangles each."""
    points, where, quads = grid(lambda u, v: (u, v, 0.0), (3, 3))
    inner = ((where > 0.0) & (where < 1.0)).all(axis=1)
    points[inner, :2] += rng.uniform(-0.08, 0.08, (inner.sum(), 2))
    cells = [t for k, c in enumerate(quads.tolist()) for t in ([c] if k % 2 else [c[:3], [c[0], *c[2:]]])]
    whole, elements, _ = quadrilaterals(points, cells)
    shell = Shell.of(whole, elements, ShellSection.isotropic(0.05, 1e3, 0.3))
    rim = ((whole[:, :2] <= 1e-12) | (whole[:, :2] >= 1.0 - 1e-12)).any(axis=1)
    patch_is_exact(shell, rim, kind)


def test_new_points_are_of_a_side_on_the_border_or_on_a_line_through_the_mesh():
    """A square of four triangles about its middle, clamped around: no other edges are; a line across is a side, too."""
    points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 0.0]]
    two = [[0, 1, 2], [0, 2, 3]]
    around = meshed(points[:4], two, sides=[[0, 1, 2, 3]], edges='["ground"]').shells["skin"]
    places = around.mesh().points[around.welds()["ground"]]
    assert len(places) == 8 and not ((places > 0.0) & (places < 1.0))[:, :2].all(axis=1).any()
    four = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    across = meshed(points, four, sides=[[0, 4, 2]], edges='["ground"]').shells["skin"]
    places = across.mesh().points[across.welds()["ground"]]
    assert len(places) == 5 and np.array_equal(places[:, 0], places[:, 1])


# ---- pinned sides ----------------------------------------------------------------------------------------------------


def test_a_pinned_strip_has_the_frequency_of_a_hinged_beam_and_a_welded_one_that_of_a_clamped_one():
    """ω L² √(ρA/EI) is π² or 22.373: less than 3 % off with eight elements, whose error is of order 2."""
    keys = table("damping", corners="[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.05, 0.0], [0.0, 0.05, 0.0]]",
                 elements="[8, 1]", thickness="1e-2", E="1.2e7", nu="0.0", rho="1.0",
                 edges='["free", "ground", "free", "ground"]')  # fmt: skip
    bare = WORLD.replace("-9.81", "0.0").replace("1.0,", "0.0,")
    for pinned, expected in (("[false, true, false, true]", np.pi**2), ("[]", 22.3733)):
        found = ephs.linearize(
            scene_of_text(f"{bare}[shells.strip]\n{lines_of(keys | {'pinned': pinned})}")
        ).eigenvalues.imag
        lowest = np.sort(np.abs(found[np.abs(found) > 1e-3]))[0] / np.sqrt(1.2e7 * 1e-4 / 12.0)
        assert lowest == pytest.approx(expected, rel=0.03)
