"""Arrows and warmth: forces point as they act, colours follow temperatures, meshes are those of the file."""

import html
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs.show import Page, ShowError, animate
from ephs.show.motions.motion import between_instants, film, nearest
from ephs.show.motions.overlays import Tones, loads_of, shades_of, tint
from ephs.show.motions.solids import Solid, box, cylinder, solid_of, sphere
from ephs.show.motions.stage import stage_of
from tests.scenes import shipped

BENT = """
format = 1
[beams.rod]
from = [0.0, 0.0, 0.0]
to = [0.6, 0.0, 0.0]
up = [0.0, 0.0, 1.0]
elements = 6
section = { rectangle = [0.02, 0.004], E = 2e9, nu = 0.3, rho = 2000.0 }
damping = 5e-3
ends = ["ground", "free"]
"""

PARTS = st.floats(0.05, 3.0)
HANGING = """
format = 1
name = "lamp"
[bodies.lamp]
mass = 2.0
inertia = [0.1, 0.1, 0.1]
position = [0.0, 0.0, -0.5]
rotation = [0.6, 0.0, 0.8, 0.0]
SHAPE
[joints.hook]
type = "spherical"
bodies = ["ground", "lamp"]
at = [0.0, 0.0, 0.0]
friction = 0.1
heat = "hook"
[thermal.hook]
capacity = 10.0
temperature = 310.0
[conduction.air]
between = ["hook", "environment"]
conductance = 3.0
"""


def lamp(folder, shape: str = "") -> ephs.Solution:
    (folder / "lamp.toml").write_text(HANGING.replace("SHAPE", shape))
    return ephs.simulate(ephs.load(folder / "lamp.toml"), 1.0, step=0.02)


def volume(solid: Solid) -> float:
    a, b, c = (solid.vertices[solid.triangles[:, k]] for k in range(3))
    return float(np.einsum("ni,ni->", a, np.cross(b, c))) / 6.0


def test_the_hook_holds_the_lamp_up(tmp_path):
    """Whatever the lamp's axes are, the force on it points up and is its weight; a ball joint holds no moment."""
    sol = lamp(tmp_path)
    frames = film(sol, ["lamp"], 30.0, None)
    loads = loads_of(sol, frames, dict(sol.scene.all_joints()))
    (force,) = loads.arrows
    assert np.allclose(force.vectors, [0.0, 0.0, 2.0 * 9.81], atol=1e-9)
    assert np.allclose(force.places, 0.0, atol=1e-9) and force.kind == "force"
    assert force.largest == pytest.approx(19.62) and loads.loose == ()


SLED = """
format = 1
name = "sled"
[bodies.sled]
mass = 2.0
inertia = [0.1, 0.1, 0.1]
position = [0.0, 0.0, 0.0999]
velocity = [0.5, 0.0, 0.0]
[surfaces.sled]
body = "sled"
shape = { box = [0.4, 0.2, 0.2] }
stiffness = 5e4
loss = 1.0
friction = 0.5
[surfaces.floor]
body = "ground"
shape = { plane = {} }
"""


def test_contacts_push_where_they_touch_and_show_that_they_slip(tmp_path):
    """A sled slides, then stands: its weight is held under its middle, in one colour and then in another."""
    (tmp_path / "sled.toml").write_text(SLED)
    sol = ephs.simulate(ephs.load(tmp_path / "sled.toml"), 1.0, rtol=1e-6)
    frames = film(sol, ["sled"], 30.0, None)
    arrows = {each.kind: each for each in loads_of(sol, frames, {}).arrows}
    assert arrows.keys() == {"contact", "slip"} and arrows["contact"].largest == arrows["slip"].largest
    sliding, still = arrows["slip"].vectors[1, 0], arrows["contact"].vectors[-1, 0]
    assert sliding[0] == pytest.approx(-0.5 * sliding[2], rel=1e-3)
    assert np.allclose(still, [0.0, 0.0, 2.0 * 9.81], atol=1e-2)
    assert not arrows["contact"].vectors[1].any() and not arrows["slip"].vectors[-1].any()
    place, middle = arrows["contact"].places[-1, 0], frames.poses["sled"][-1, 4:]
    assert np.allclose(place[:2], middle[:2], atol=1e-3) and place[2] == pytest.approx(0.0, abs=1e-3)
    assert "contact force where it slips" in legend(animate(sol, wrenches=True))


@given(st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array))
def test_sticks_reach_what_the_body_does_not(point):
    solid = Solid(*box(np.array([1.0, 2.0, 3.0])), "box")
    stick = solid.stick(point)
    outside = np.maximum(np.abs(point) - np.array([0.5, 1.0, 1.5]), 0.0)
    assert (stick is None) == (np.linalg.norm(outside) <= 0.02 * solid.reach)
    if stick is not None:
        assert np.array_equal(stick[1], point) and np.linalg.norm(stick[1] - stick[0]) == pytest.approx(
            np.linalg.norm(outside)
        )


def legend(page):
    return page.html.partition('<div id="legend"')[2].partition("</div>")[0]


def test_what_is_indeterminate_has_no_arrow():
    sol = ephs.simulate(shipped("four-bar"), 0.02, step=0.01)
    joints = dict(sol.scene.all_joints())
    loads = loads_of(sol, film(sol, list(sol.scene.bodies), 30.0, None), joints)
    assert set(loads.loose) == set(joints)
    assert all(each.kind == "moment" and np.isfinite(each.vectors).all() for each in loads.arrows)
    assert "indeterminate" in legend(animate(sol, wrenches=True))


def test_glow_follows_the_temperature(tmp_path):
    sol = lamp(tmp_path)
    (heat,) = shades_of(sol, film(sol, ["lamp"], 30.0, None), "temperature")
    shares = heat.shares(heat.values["hook"])
    assert shares[0] == 1.0 and all(np.diff(shares) < 0.0) and heat.values.keys() == {"hook"}
    assert (heat.low, heat.high) == (293.15, 310.0)
    own = (1, 2, 3)
    assert Tones((heat,), 0).of("hook", own) == tint(1.0) and Tones((heat,), 0).of("environment", own) == own
    assert [sum(tint(share)) for share in (0.0, 0.25, 0.5, 0.75, 1.0)] == sorted(
        sum(tint(share)) for share in (0.0, 0.25, 0.5, 0.75, 1.0)
    )
    assert "310.00 K" in legend(animate(sol, colour="temperature"))


@given(PARTS, PARTS, PARTS)
def test_surfaces_are_closed_and_face_outwards(a, b, c):
    for (vertices, faces), expected, within in (
        (box(np.array([a, b, c])), a * b * c, 1e-12),
        (cylinder(a, b), np.pi * a * a * b, 0.02),
        (sphere(a), 4.0 / 3.0 * np.pi * a**3, 0.04),
    ):
        assert volume(Solid(vertices, faces, "box")) == pytest.approx(expected, rel=within)


def test_a_mesh_is_drawn_as_its_file_says(tmp_path):
    vertices, faces = box(np.array([0.1, 0.2, 0.3]))
    corners = vertices[Solid(vertices, faces, "box").triangles]
    data = b"".join(struct.pack("<12fH", *np.zeros(3), *each.ravel(), 0) for each in corners)
    (tmp_path / "part.stl").write_bytes(b"\0" * 80 + struct.pack("<I", len(corners)) + data)
    sol = lamp(tmp_path, 'shape = { mesh = "part.stl" }')
    solid = solid_of(sol.scene.body("lamp"), "lamp")
    assert solid.kind == "mesh" and volume(solid) == pytest.approx(0.006, rel=1e-5)
    assert 'id="legend"' not in animate(sol, tmp_path / "film.html").html


def test_a_missing_mesh_is_replaced_and_the_page_says_so(tmp_path):
    sol = lamp(tmp_path, 'shape = { mesh = "gone.stl" }')
    solid = solid_of(sol.scene.body("lamp"), "lamp")
    assert solid.kind == "stand-in" and "gone.stl cannot be read" in solid.note
    assert "lamp: gone.stl cannot be read" in legend(animate(sol))


@pytest.mark.parametrize("file", ["../part.stl", "/etc/part.stl"])
def test_meshes_outside_of_the_scenes_folder_are_refused(tmp_path, file):
    with pytest.raises(ephs.SceneError, match=r"bodies\.lamp\.shape\.mesh.*in the scene's folder"):
        lamp(tmp_path, f'shape = {{ mesh = "{file}" }}')


def test_notebooks_show_the_page_and_nothing_else(tmp_path):
    """What the recording helper says through rich is not said; the console is as it was before."""
    import rich

    console = rich.get_console()
    with console.capture() as said:
        animate(lamp(tmp_path))
        console.print("after")
    assert said.get().strip() == "after"


def test_a_page_shows_itself_whole(tmp_path):
    page = Page('<p title="a">&amp;</p>', 'of "this"')
    shown = page._repr_html_()
    inside = shown.partition('srcdoc="')[2].rpartition('"></iframe>')[0]
    assert html.unescape(inside) == page.html and 'title="of &quot;this&quot;"' in shown
    assert page.save(tmp_path / "new" / "page.html").read_text(encoding="utf-8") == page.html


@given(st.lists(st.floats(-5.0, 5.0), min_size=2, max_size=9, unique=True), st.booleans(), st.floats(-5.0, 5.0))
def test_the_nearest_instant_is_found_forward_and_backward(times, backward, at):
    t = np.sort(np.array(times))[:: -1 if backward else 1]
    found = nearest(t, np.array([at]))[0]
    assert abs(t[found] - at) == np.abs(t - at).min()
    assert np.array_equal(between_instants(t, t, 2.0 * t), 2.0 * t)


def test_a_run_backward_plays_backward(tmp_path):
    scene = shipped("heavy-top")
    sol = ephs.simulate(scene, -0.2, step=None, rtol=1e-8)
    name = next(iter(scene.bodies))
    frames = film(sol, [name], 30.0, None)
    assert frames.times[0] == 0.0 and frames.times[-1] == -0.2 and frames.pause > 0.0
    assert np.allclose(frames.poses[name][-1, 4:], sol.body(name).position[-1])


def test_strain_energy_is_a_colour(tmp_path):
    """Of elements, and of nodes the mean of those beside them; the report's player says what the colour is."""
    file = tmp_path / "bent.toml"
    file.write_text(BENT, encoding="utf-8")
    sol = ephs.simulate(ephs.load(file), 0.1, method="radau", rtol=1e-4)
    (shown,) = stage_of(sol, colour="energy", fps=20.0, duration=None).shades
    wanted = sol.beam("rod").energy[-1] / 0.1
    np.testing.assert_allclose([shown.values[f"rod-{i + 1}"][-1] for i in range(6)], wanted, rtol=1e-12)
    assert shown.values["rod.1"][-1] == pytest.approx(0.5 * (wanted[0] + wanted[1]))
    assert shown.ends == ("0 J/m", f"{shown.high:.3g} J/m")
    assert f"{shown.high:.3g} J/m" in sol.animate(colour="energy").html
    assert stage_of(sol, fps=20.0, duration=None).shades == ()
    with pytest.raises(ShowError, match=r"'stress'.*temperature, energy, membrane, moment, shear"):
        sol.animate(colour="stress")
    with pytest.raises(ShowError, match="found no moment to show"):
        sol.animate(colour="moment")
