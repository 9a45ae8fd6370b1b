"""Sheets that touch: rest, a rigid sheet as a body, shares of the stiffness, what would come through, parts, units."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.scene.contacts import contact_points
from ephs.mechanics.scene.parameters import varied
from ephs.mechanics.scene.site import Site
from ephs.mechanics.shapes.gap import ramp
from tests.written import scene_of_text

WEIGHT, STIFFNESS, AREA = 900.0 * 0.02 * 1e-2 * 9.81, 1e3, 0.02
WORLD = "format = 1\n"
CLOTH = """
[shells.cloth]
corners = [[0.0, 0.0, 0.02], [0.2, 0.0, 0.02], [0.2, 0.1, 0.02], [0.0, 0.1, 0.02]]
elements = {elements}
thickness = 1e-2
E = {E}
nu = 0.3
rho = 900.0
damping = 5e-3
spread = true
{more}
[surfaces.skin]
body = "cloth"
stiffness = {stiffness}
loss = 10.0
friction = 0.3
{skin}
"""
FLOOR = '[surfaces.floor]\nbody = "ground"\nshape = { plane = {} }\n'
GIVEN = {"elements": "[2, 1]", "E": "1e5", "more": "", "stiffness": "1e3", "skin": ""}


def cloth(floor=FLOOR, **keys):
    return WORLD + CLOTH.format(**{**GIVEN, **keys}) + floor


def touch(text=None, **keys):
    return scene_of_text(text or cloth(**keys))


def ball(radius, height, at=(0.1, 0.05), more="", mass=3.0):
    return (
        f"[bodies.ball]\nmass = {mass}\ninertia = [1e-2, 1e-2, 1e-2]\nposition = [{at[0]}, {at[1]}, {height}]\n"
        f'[surfaces.ball]\nbody = "ball"\nshape = {{ sphere = {radius} }}\n{more}\n'
    )


HELD = 'edges = ["ground", "ground", "ground", "ground"]'


@pytest.mark.parametrize("method", ["auto", "rk54", "radau", "semi"])
def test_a_sheet_that_falls_comes_to_rest_on_its_weight(method):
    """Critically damped at rest: ¾ α g against √(k/m); what is left after 0.4 s is e⁻²⁰ of a force m g."""
    run = ephs.simulate(touch(), 0.4, method=method, rtol=1e-5)
    contact = run.contact("skin_floor")
    assert contact.force[0] == pytest.approx(np.zeros(3), abs=0.0), "it starts above"
    assert contact.force[-1] == pytest.approx([0.0, 0.0, WEIGHT], abs=1e-4 * WEIGHT)
    assert contact.gap[-1] == pytest.approx(-WEIGHT / STIFFNESS, rel=1e-3)
    assert run.energy_error.max() < 1e-12 and run.stats["least_production"] >= 0.0
    assert np.all(np.diff(run.heat) >= -1e-12 * run.heat[-1]) and run.heat[-1] > 0.0
    assert run.audit.passed


def test_a_pressed_sheet_rests_on_its_weight_and_the_pressure():
    """A node has one junction for both; the pressure acts from above."""
    run = ephs.simulate(touch(more="pressure = -50.0"), 0.4, method="radau", rtol=1e-5)
    assert run.contact("skin_floor").force[-1, 2] == pytest.approx(WEIGHT + 50.0 * AREA, rel=1e-4)


def test_hard_nodes_rest_on_their_weight():
    hard = {"stiffness": "1e3\n#", "skin": "restitution = 0.3"}
    text = cloth(elements="[1, 1]", floor=FLOOR + "restitution = 0.3\n", **hard)
    text = text.replace("stiffness = 1e3\n", "").replace("loss = 10.0\n", "")
    run = ephs.simulate(touch(text), 0.2)
    assert run.contact("skin_floor").force[-1] == pytest.approx([0.0, 0.0, WEIGHT], rel=1e-6, abs=1e-6)
    assert any("strikes" in event.name for event in run.events)
    assert run.energy_error.max() < 1e-12


def test_the_balls_of_a_rigid_sheet_are_those_of_a_rigid_body():
    """One element that falls on a slope and slides, against a body with its mass, inertia and balls; to order 1/E."""
    slope = FLOOR + "rotation = { axis = [0.0, 1.0, 0.0], angle = 0.3 }\nposition = [0.0, 0.0, -0.05]\n"
    text = cloth(elements="[1, 1]", E="STIFF", floor=slope, stiffness="4e3").replace("spread = true", "spread = false")
    shell = touch(text.replace("STIFF", "1e7")).shells["cloth"].shell()
    offsets, mass = shell.points - [0.1, 0.05, 0.02], shell.inertia[:, 3]
    turns = [
        tensor + m * np.diag(at @ at - at * at) for tensor, m, at in zip(shell.tensors(), mass, offsets, strict=True)
    ]
    six = [*np.diag(sum(turns)).tolist(), 0.0, 0.0, 0.0]
    body = f"[bodies.plate]\nmass = {mass.sum()}\ninertia = {six}\nposition = [0.1, 0.05, 0.02]\n"
    for i, at in enumerate(offsets.tolist()):
        body += f'[surfaces.b{i}]\nbody = "plate"\nshape = {{ sphere = 5e-3 }}\nposition = {at}\n'
        body += "stiffness = 1e3\nloss = 10.0\nfriction = 0.3\n"
    pace = {"method": "radau", "rtol": 1e-7, "atol": 1e-9}
    rigid = ephs.simulate(scene_of_text(WORLD + body + slope), 0.15, **pace)
    assert rigid.heat[-1] > 0.01, "it strikes"
    apart = []
    for stiff in ("1e7", "1e8"):
        sheet = ephs.simulate(touch(text.replace("STIFF", stiff)), 0.15, **pace)
        apart.append(np.abs(sheet.shell("cloth").position.mean(axis=1)[-1] - rigid.body("plate").position[-1]).max())
        assert sheet.heat[-1] == pytest.approx(rigid.heat[-1], rel=1e6 / float(stiff))
    assert apart[1] < 0.2 * apart[0], apart


def pressed(scene):
    """Total elastic force at the start, of the gaps and shares of the points of its only contact."""
    (of,) = scene.contacts.values()
    site = Site(scene, of)
    points = contact_points(scene, of)
    places = [site.between(p.bodies[0], p.frames[0], p.bodies[1], p.frames[1]) for p in points]
    return of.stiffness * sum(p.share * ramp(-p.gap.distance(at)) for p, at in zip(points, places, strict=True))


@pytest.mark.parametrize("elements", ["[1, 1]", "[2, 1]", "[3, 4]"])
def test_a_flat_sheet_on_a_plane_has_the_stiffness_of_its_surface_on_any_mesh(elements):
    with pytest.warns(ephs.SceneWarning, match="deep in each other"):
        scene = touch(elements=elements, floor=FLOOR + "position = [0.0, 0.0, 0.018]\n")
    assert pressed(scene) == pytest.approx(STIFFNESS * 3e-3, rel=1e-12)


def test_the_force_of_a_ball_on_a_sheet_converges():
    """To that of a bed of the stiffness k/A: k/A ∫ (r − √(h² + ρ²)) dA of a ball whose centre is at h above nodes."""
    radius, depth, errors = 0.5, 5e-3, []
    height = radius + 5e-3 - depth
    far = np.linspace(0.0, np.sqrt((height + depth) ** 2 - height**2), 2001)
    rings = 2.0 * np.pi * far * (height + depth - np.sqrt(height**2 + far**2))
    bed = STIFFNESS / 0.04 * float(np.trapezoid(rings, far))
    for n in (8, 16, 32):
        text = cloth(elements=f"[{n}, {n}]", floor=ball(radius, 0.02 + height, at=(0.1, 0.1)))
        with pytest.warns(ephs.SceneWarning, match="deep in each other"):
            scene = touch(text.replace("0.1, 0.02]", "0.2, 0.02]"))
        errors.append(abs(pressed(scene) / bed - 1.0))
    assert errors[2] < 0.02 and errors[2] < 0.5 * errors[0], errors


@pytest.mark.parametrize(("radius", "wide"), [(0.136, False), (0.137, True)])
def test_what_could_come_through_between_nodes_is_refused(radius, wide):
    """Squares of 0.1 m: a point is 0.0707 m from a node at most; twice that less the radius of the balls is 0.1364."""
    text = cloth(floor=ball(radius, 0.3))
    if wide:
        scene = touch(text)
        assert len(contact_points(scene, scene.contacts["skin_ball"])) == 6
        return
    with pytest.raises(ephs.SceneError, match=r"found a sphere of half width 0\.136 m, expected one of 0\.1364 m"):
        touch(text)


@pytest.mark.parametrize("stiffness", [10.0, 1e4])
def test_a_ball_that_falls_on_a_held_sheet_does_not_come_through_in_silence(stiffness):
    """Between soft nodes the run ends before its middle may have passed; stiff ones hold it."""
    text = cloth(more=HELD, stiffness=stiffness, floor=ball(0.15, 0.2, at=(0.12, 0.05)) + "friction = 0.3\n")
    if stiffness > 1e3:
        run = ephs.simulate(touch(text), 0.25, method="radau", rtol=1e-4)
        assert run.body("ball").position[:, 2].min() > 0.02 and run.contact("skin_ball").force.any()
        assert run.energy_error.max() < 1e-12 and run.stats["least_production"] >= 0.0
        return
    with pytest.raises(ephs.SimulationError) as error:
        ephs.simulate(touch(text), 0.25, method="radau", rtol=1e-4)
    assert error.value.outcome is ephs.Outcome.DEPTH
    assert str(error.value.path).startswith("contacts.skin_ball.point")


def thrown(step):
    """A small sheet at 10 m/s against a plate of 0.02 m, 0.27 m above it."""
    fast = f"twists = {[[0.0, 0.0, 0.0, 0.0, 0.0, -10.0]] * 4}"
    plate = '[surfaces.plate]\nbody = "ground"\nshape = { box = [1.0, 1.0, 0.02] }\n'
    text = cloth(elements="[1, 1]", E="1e6", stiffness="1e5", more=fast, floor=plate)
    text = text.replace("0.02]", "0.27]").replace("0.2,", "0.01,").replace("0.1,", "0.01,")
    text = text.replace("[1.0, 1.0, 0.27]", "[1.0, 1.0, 0.02]")
    options = {} if step is None else {"step": step}
    return ephs.simulate(touch(text), 0.06, method="rk54" if step is None else "natural", audit="off", **options)


def test_nodes_that_leap_through_a_plate_are_found_and_chosen_steps_meet_it():
    leapt = thrown(0.0097)
    assert leapt.shell("cloth").position[-1, :, 2].max() < -0.1, "the control: it went through"
    (finding,) = [each for each in leapt.audit.findings if "passed" in each.advice]
    assert finding.path == "contacts.skin_plate"
    met = thrown(None)
    assert met.shell("cloth").position[-1, :, 2].min() > 0.0 and met.audit.passed


def test_balls_have_half_the_thickness_of_a_sheet_that_is_varied():
    scene = varied(touch(), {"shells.cloth.thickness": 2e-2})
    point = contact_points(scene, scene.contacts["skin_floor"])[0]
    assert dict(point.gap.numbers)["radius"] == pytest.approx(1e-2)


HUB = "[bodies.hub]\nmass = 0.1\ninertia = [1e-4, 1e-4, 1e-4]\nposition = [-0.02, 0.05, 0.3]\n"
BLOCK = '[surfaces.block]\nbody = "hub"\nshape = { sphere = 0.2 }\n'


@pytest.mark.parametrize("pinned", ["false", "true"])
def test_nodes_on_a_body_touch_all_but_this_body(pinned):
    """Two of six are welded or pinned to it; they touch the floor."""
    joined = f'edges = ["free", "free", "free", "hub"]\npinned = [false, false, false, {pinned}]'
    named = '[contacts.a]\nsurfaces = ["skin", "block"]\n'
    scene = touch(more=joined, floor=HUB + BLOCK + named)
    assert len(contact_points(scene, scene.contacts["a"])) == 4, "of six nodes"
    assert not touch(more=joined, floor=HUB + BLOCK).contacts, "as bodies that a joint connects"
    other = touch(more=joined, floor=HUB + FLOOR)
    assert len(contact_points(other, other.contacts["skin_floor"])) == 6
