"""Shells in pictures: faces are where their nodes are, colours are values of their elements, all in one range."""

import json
import re

import numpy as np
import pytest
from PIL import Image

import ephs
from ephs.exporting.image import image_of
from ephs.exporting.module import exported
from ephs.mechanics import Shell, ShellSection
from ephs.mechanics.elements.shell.mesh import grid
from ephs.mechanics.elements.shell.system import shell_system
from ephs.mechanics.motion.inside import Inside
from ephs.show import ShowError, write_report, write_video
from ephs.show.motions.overlays import Tones, tint
from ephs.show.motions.sheets import sheets_of
from ephs.show.motions.sketch import sketch
from ephs.show.motions.solids import solids_of
from ephs.show.motions.stage import stage_of
from tests.written import scene_of_text

EPS = float(np.finfo(float).eps)
UNTIL = 0.02
FLAP = """
format = 1
[bodies.hub]
mass = 0.2
inertia = [2e-4, 2e-4, 2e-4]
position = [0.1, 0.1, 0.0]
shape = { box = [0.02, 0.2, 0.02] }
[joints.hinge]
type = "revolute"
bodies = ["ground", "hub"]
at = [0.1, 0.1, 0.0]
axis = [0.0, 1.0, 0.0]
[thermal.skin]
capacity = 2.0
temperature = 300.0
[shells.skin]
corners = [[0.1, 0.0, 0.0], [0.4, 0.0, 0.0], [0.4, 0.2, 0.0], [0.1, 0.2, 0.0]]
elements = [2, 1]
thickness = 0.02
E = 1e5
rho = 900.0
damping = 1e-3
heat = "skin"
edges = ["free", "free", "free", "hub"]
"""
TIMES = np.linspace(0.0, UNTIL, 5)


@pytest.fixture(scope="module")
def flap() -> ephs.Solution:
    return ephs.simulate(scene_of_text(FLAP), UNTIL, method="rk54", rtol=1e-4, save_at=TIMES)


@pytest.fixture(scope="module")
def strip() -> ephs.Solution:
    """A sheet made by hand, clamped at one side, one box of a pattern."""
    points, where, cells = grid(lambda u, v: (0.4 * u, 0.2 * v, 0.05 * u * u), (2, 1))
    shell = Shell.of(points, cells, ShellSection.isotropic(0.02, E=1e5, nu=0.3, rho=1000.0))
    held = np.flatnonzero(where[:, 0] == 0.0).tolist()
    system = ephs.Pattern(junctions={}, boxes={"strip": {}})(
        strip=shell_system(shell, gravity=(0.0, 0.0, -9.81), held=held)
    )
    return ephs.simulate(system, UNTIL, method="rk54", rtol=1e-4, save_at=TIMES)


def stage(sol, colour=None):
    return stage_of(sol, colour=colour, fps=4.0 / UNTIL, duration=None)  # a frame at each instant


@pytest.mark.parametrize(("run", "name"), [("flap", "skin"), ("strip", "strip")])
def test_faces_are_where_the_nodes_are_at_every_instant(run, name, request):
    sol = request.getfixturevalue(run)
    shown, motion = stage(sol), sol.shell(name)
    sheet = shown.sheets[name]
    corners = sheet.places(shown.frames.poses)
    size = np.abs(corners).max()
    assert np.abs(corners[:, sheet.cells] - motion.position[:, motion.cells]).max() <= 16 * EPS * size
    assert np.abs(corners[-1] - corners[0]).max() > 1e-4, "it moves"
    assert len(sheet.ends) == 6 and len(sheet.nodes) == 4, "neighbours share corners; those held are no bodies"


def test_a_shell_made_by_hand_has_the_energy_of_its_storages(strip):
    stored = [strip.ledgers.storages[ephs.Path.of(f"strip.element{e}.pe")] for e in range(2)]
    motion = strip.shell("strip")
    assert np.array_equal(motion.energy, np.transpose(stored)) and motion.energy[-1].min() > 0.0
    assert np.isnan(motion.membrane).all()
    with pytest.raises(KeyError, match="strip"):
        strip.shell("stripe")
    with pytest.raises(ShowError, match="found no moment"):
        stage(strip, "moment")


def test_nodes_are_not_drawn_as_bodies(flap):
    assert set(solids_of(flap.outline)) == {"hub"}
    assert set(solids_of(flap.scene)) == {"hub"}, "the scene at rest, where nodes are no bodies"
    at_rest = sheets_of(flap.scene)["skin"].places({"hub": np.asarray(flap.scene.body("hub").pose)})
    assert np.abs(at_rest - flap.shell("skin").position[0]).max() <= 16 * EPS


@pytest.mark.parametrize(
    ("colour", "unit"), [("energy", "J/m²"), ("moment", "N"), ("membrane", "N/m"), ("shear", "N/m")]
)
def test_colours_are_values_of_elements(flap, colour, unit):
    (shown,) = stage(flap, colour).shades
    motion, found = flap.shell("skin"), shown.faces["skin"]
    if colour == "energy":
        wanted = motion.energy / (0.15 * 0.2)  # of a flat sheet in two elements
    elif colour == "shear":
        wanted = np.hypot(*np.moveaxis(motion.shear, 2, 0))
    else:
        one, two, twist = np.moveaxis(getattr(motion, colour), 2, 0)
        wanted = np.array(
            [np.linalg.norm([[a, c], [c, b]]) for a, b, c in zip(one.flat, two.flat, twist.flat, strict=True)]
        )
        wanted = wanted.reshape(one.shape)
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12 * wanted.max())
    assert shown.high == pytest.approx(wanted.max()) and shown.unit == unit and shown.low == 0.0
    tones = Tones((shown,), int(found.max(axis=1).argmax())).faces("skin")
    assert tint(1.0) in tones and len(set(tones)) == 2, "the largest value has the end of the bar"


def test_the_temperature_of_the_node_that_a_shell_warms_is_its_colour(flap):
    (shown,) = stage(flap, "temperature").shades
    assert np.array_equal(shown.faces["skin"], np.repeat(shown.values["skin"][:, None], 2, axis=1))
    assert shown.values["skin"][-1] > 300.0


def test_faces_in_a_schematic_hide_what_is_behind_and_have_their_colours(flap):
    """Each quadrilateral is one polygon; without colours it is a tone of the shell's own."""
    shown = stage(flap, "energy")
    poses = {name: rows[-1] for name, rows in shown.frames.poses.items()}
    plain, coloured = (sketch(flap.outline, poses, None, 1.0, tones) for tones in (None, Tones(shown.shades, -1)))

    def faces(made):
        return [mark for mark in made.marks if mark.fill is not None and len(mark.points) == 4 and mark.width == 0.5]

    assert len(faces(plain)) == len(faces(coloured)) == 2
    assert len({tuple(mark.fill) for mark in faces(coloured)}) == 2
    brightest = max(faces(coloured), key=lambda mark: float(np.sum(mark.fill)))
    (shades,) = shown.shades
    largest = np.array(tint(float(shades.shares(shades.faces["skin"][-1]).max()))) / 255.0
    assert (brightest.fill <= largest + EPS).all() and (brightest.fill >= 0.85 * largest - EPS).all()


def test_pages_have_a_bar_with_unit_and_range(flap, tmp_path):
    page, report = flap.animate(colour="moment").html, write_report(flap, tmp_path).read_text(encoding="utf-8")
    (shown,) = stage(flap, "moment").shades
    legend = page.partition('<div id="legend"')[2].partition("</div>")[0]
    assert "moment of shells 0 N" in legend and f"{shown.high:.3g} N" in legend
    assert '"shell":"skin"' in page and '"said":"temperature"' in report
    assert 'id="legend"' not in flap.animate().html
    assert len(re.findall(r'"faces":\[\[\d+,\d+,\d+,\d+\],\[\d+,\d+,\d+,\d+\]\],"shell":"skin"', page)) == 1


def test_a_video_in_colour_has_a_bar_below_and_other_colours_than_a_plain_one(flap, tmp_path):
    seen = {}
    for colour in (None, "energy"):
        file = tmp_path / f"{colour}.gif"
        write_video(flap, file, colour=colour, fps=4.0, duration=0.5)
        with Image.open(file) as picture:
            picture.seek(picture.n_frames - 1)
            seen[colour] = np.asarray(picture.convert("RGB"), dtype=float)
    bar = [tint(k / 8.0) for k in range(9)]
    near = {colour: [np.abs(pixels - each).max(axis=2) < 24.0 for each in bar] for colour, pixels in seen.items()}
    assert min(at.sum() for at in near["energy"]) > 20, "all colours of the bar"
    assert min(at.sum() for at in near[None]) == 0
    below = int(0.85 * len(seen["energy"]))
    assert all(at[below:].any() for at in near["energy"])


def test_a_shell_inside_of_a_larger_system_is_drawn(flap):
    system = flap.scene.system()
    whole = ephs.Pattern(junctions={}, boxes={"flap": {}})(flap=system)
    sol = ephs.simulate(whole, UNTIL, method="rk54", rtol=1e-4, save_at=TIMES)
    part = Inside(sol, "flap", flap.scene)
    (shown,) = stage(part, "energy").shades
    assert shown.faces["skin"][-1] == pytest.approx(stage(flap, "energy").shades[0].faces["skin"][-1], rel=1e-3)


def test_a_page_that_simulates_knows_where_poses_of_nodes_are():
    """It is told where the module writes the pose of each body that it draws, shells' nodes among them."""
    loose = scene_of_text(FLAP.replace("damping = 1e-3\n", ""))
    page = ephs.live_page(loose, parameters=["bodies.hub.mass"], until=UNTIL).html
    told = json.loads(re.findall(r'<script type="application/json" id="live">(.*?)</script>', page, re.DOTALL)[0])
    places = {
        each.name: each.place for each in exported(image_of(loose, parameters=["bodies.hub.mass"]), "live").outputs
    }
    boxes = ["bodies.hub", *(f"shells.skin.node{i}" for i in (2, 3, 4, 5))]
    assert told["poses"] == [places[f"{box}.quaternion.w"] for box in boxes]
