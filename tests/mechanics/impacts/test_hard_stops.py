"""Hard stops of joints: bounces in closed form, beside friction, in loops, in islands with contacts."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.elements.joints import joint
from ephs.mechanics.shapes.impact import Impact
from ephs.mechanics.shapes.law import ConstitutiveLaw
from ephs.semantics.bundles.errors import StructureError
from tests.mechanics.impacts.test_hard_contact import G, run
from tests.written import scene_of_text

HEAD = 'format = 1\nname = "stops"\n[world]\ngravity = [0.0, 0.0, {gravity}]\n'
BODY = """
[bodies.{name}]
mass = 2.0
inertia = [8e-3, 8e-3, 8e-3]
position = {position}
"""
SLIDE = """
[joints.slide]
type = "prismatic"
bodies = ["ground", "block"]
frame1 = {{}}
frame2 = {{}}
coordinate = {coordinate}
rate = {rate}
{keys}
"""
HINGE = """
[joints.{name}]
type = "revolute"
bodies = {bodies}
at = {at}
axis = [0.0, 1.0, 0.0]
{keys}
"""


def scene_of(*parts, gravity=0.0):
    return scene_of_text(HEAD.format(gravity=-gravity) + "".join(parts))


def sliding(keys, *, coordinate=0.0, rate=0.0, gravity=0.0):
    block = BODY.format(name="block", position=[0.0, 0.0, coordinate])
    return scene_of(block, SLIDE.format(coordinate=coordinate, rate=rate, keys=keys), gravity=gravity)


@pytest.mark.parametrize(("method", "step"), [("rk54", 2.0**-5), ("rk87", None)])
def test_what_falls_on_a_stop_rests_after_the_last_bounce(method, step):
    """Infinitely many bounces end at √(2H/g)(1 + e)/(1 − e), and all of the energy is heat."""
    fall, e = 0.2, 0.5
    scene = sliding(f"limits = [{-fall}, nan]\nlimit_restitution = {e}", gravity=G)
    last = np.sqrt(2.0 * fall / G) * (1.0 + e) / (1.0 - e)
    sol = run(scene, 1.2 * last, method, step, save_at=[0.9 * last, last, 1.2 * last])
    assert sol.heat[0] < 2.0 * G * fall * (1.0 - 1e-5)
    assert sol.heat[1:] == pytest.approx(2.0 * G * fall, abs=1e-9)
    assert sol.joint("slide").coordinate[1:, 0] == pytest.approx(-fall, abs=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("e", [0.0, 0.4, 1.0])
def test_a_bounce_off_a_stop_beside_viscous_friction(e, side):
    """A block that slides loses v = c x/m of its speed on a way x, and 1 − e of what is left at the stop."""
    way, damping, speed = 0.1, 3.0, 1.0
    limits = f"limits = [{-way}, {way}]\nlimit_restitution = {e}\nfriction = {damping}"
    sol = run(sliding(limits, rate=side * speed), 0.2, rtol=1e-10, atol=1e-13)
    before = speed - damping * way / 2.0
    rest = 0.2 + 2.0 / damping * np.log(1.0 - damping * way / (2.0 * speed))
    assert sol.joint("slide").rate[-1, 0] == pytest.approx(-side * e * before * np.exp(-damping * rest / 2.0), abs=1e-9)
    assert sol.heat[-1] == pytest.approx(1.0 - sol.joint("slide").rate[-1, 0] ** 2, abs=1e-9)


def test_a_block_goes_to_and_fro_between_two_stops():
    """With e = 1 for ever: after 4 ways and a quarter it is where a quarter of a way takes it."""
    scene = sliding("limits = [-0.1, 0.1]\nlimit_restitution = 1.0", rate=2.0)
    sol = run(scene, 0.425, "rk54", 2.0**-6)
    assert sol.joint("slide").coordinate[-1, 0] == pytest.approx(0.05, abs=1e-9)
    assert [event.name for event in sol.events] == ["joints.slide strikes"] * 4
    assert [event.t for event in sol.events] == pytest.approx([0.05, 0.15, 0.25, 0.35], abs=1e-9)
    assert abs(sol.heat[-1]) <= 1e-12


def parallelogram(stopped):
    """Two cranks that hang from the ground and a coupler between them: all four joints turn by one angle."""
    keys = "limits = [-0.2, nan]\nlimit_restitution = 0.6\n"
    signs = {"first": "", "second": "", "third": "", "fourth": ""} | {stopped: keys}
    parts = [
        BODY.format(name=name, position=at)
        for name, at in (("left", [0.0, 0.0, -0.5]), ("right", [2.0, 0.0, -0.5]), ("coupler", [1.0, 0.0, -1.0]))
    ]
    joints = [
        ("first", ["ground", "left"], [0.0, 0.0, 0.0]), ("second", ["ground", "right"], [2.0, 0.0, 0.0]),
        ("third", ["coupler", "left"], [0.0, 0.0, -1.0]), ("fourth", ["coupler", "right"], [2.0, 0.0, -1.0]),
    ]  # fmt: skip
    hinges = [
        HINGE.format(name=name, bodies=str(on).replace("'", '"'), at=at, keys=signs[name]) for name, on, at in joints
    ]
    scene = scene_of(*parts, *hinges, gravity=G)
    return scene.with_state({"first": 0.5}, {"first": 0.0}, adjust=True)


def test_a_stop_acts_in_whichever_joint_of_a_loop_it_is():
    ends = [
        run(parallelogram(stopped), 1.0, rtol=1e-9, atol=1e-11).joint("first").coordinate[-1, 0]
        for stopped in ("first", "second", "third", "fourth")
    ]
    assert ends == pytest.approx([ends[0]] * 4, abs=1e-7)
    assert ends[0] >= -0.2


def test_a_stop_and_a_contact_are_one_island():
    """A ball that strikes a block at rest on its stop with e = 1 comes back as from a wall; with e = 0 all is heat."""
    surface = '[surfaces.{name}]\nbody = "{name}"\nshape = {{ {shape} }}\nrestitution = {e}\n'
    for e in (1.0, 0.0):
        parts = [
            BODY.format(name="block", position=[0.0, 0.0, 0.0]),
            BODY.format(name="ball", position=[0.0, 0.0, 0.3]) + "velocity = [0.0, 0.0, -1.0]\n",
            SLIDE.format(coordinate=0.0, rate=0.0, keys=f"limits = [0.0, nan]\nlimit_restitution = {e}"),
            *(surface.format(name=name, shape="sphere = 0.1", e=e) for name in ("block", "ball")),
        ]
        sol = run(scene_of(*parts), 0.2, "rk54", 2.0**-5)
        assert sol.body("ball").velocity[-1, 2] == pytest.approx(e, abs=1e-12)
        assert sol.body("block").velocity[-1, 2] == pytest.approx(0.0, abs=1e-12)
        assert sol.heat[-1] == pytest.approx(1.0 - e, abs=1e-12)


def test_a_joint_in_python_takes_hard_stops():
    made = joint("revolute", limits=[-1.0, 1.0], stop=Impact(0.5))
    assert made != joint("revolute", limits=[-1.0, 1.0], stop=Impact(0.6))
    with pytest.raises(StructureError, match="limits of a joint with 3 degrees of freedom"):
        joint("spherical", limits=[-1.0, 1.0], stop=Impact(0.5))


@pytest.mark.parametrize(
    ("law", "key", "values"),
    [
        (Impact, "restitution", (-0.1, 1.1, np.nan)), (Impact, "tangential", (-0.1, 1.1, np.nan)),
        (Impact, "friction", (-0.1, np.inf, np.nan)), (ConstitutiveLaw, "stiffness", (0.0, -1.0, np.inf, np.nan)),
        (ConstitutiveLaw, "exponent", (0.9, np.inf)), (ConstitutiveLaw, "slip", (0.0, -1.0, np.inf)),
        *((ConstitutiveLaw, key, (-0.1, np.inf, np.nan)) for key in ("loss", "friction", "rolling", "spinning")),
    ],
)  # fmt: skip
def test_numbers_that_laws_of_contact_cannot_have_are_refused(law, key, values):
    for value in values:
        with pytest.raises(StructureError, match=f"parameter {key} is"):
            law(**({"stiffness": 1.0} if law is ConstitutiveLaw else {}) | {key: value})


def test_joints_carry_what_hard_contacts_and_stops_press():
    """A bar on a hinge and on the floor presses each with half of its weight; a block on its stop that with all."""
    bar = BODY.format(name="bar", position=[0.5, 0.0, 0.0])
    surface = '[surfaces.{name}]\nbody = "{body}"\nshape = {{ {shape} }}\nposition = {at}\nrestitution = 0.0\n'
    scene = scene_of(
        bar,
        HINGE.format(name="hinge", bodies='["ground", "bar"]', at=[0.0, 0.0, 0.0], keys=""),
        surface.format(name="tip", body="bar", shape="sphere = 0.05", at=[0.5, 0.0, 0.0]),
        surface.format(name="floor", body="ground", shape="plane = {}", at=[0.0, 0.0, -0.05]),
        '[contacts.tip]\nsurfaces = ["tip", "floor"]\n',
        gravity=G,
    )
    sol = ephs.simulate(
        scene, 0.1, method="rk54", step=2.0**-5, audit="off"
    )  # nothing moves: no energy to compare with
    assert sol.contact("tip").force[-1] == pytest.approx([0.0, 0.0, G], abs=1e-6)
    assert np.linalg.norm(sol.joint("hinge").wrench[-1][3:]) == pytest.approx(G, abs=1e-6)
    stopped = sliding("limits = [0.0, nan]\nlimit_restitution = 0.0", gravity=G)
    wrench = run(stopped, 0.1, "rk54", 2.0**-5).joint("slide").wrench[-1]
    assert wrench == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.0, 2.0 * G], abs=1e-5)


SPRUNG = """
[bodies.light]
mass = {mass}
inertia = [{mass}, {mass}, {mass}]
[bodies.heavy]
mass = 1.0
inertia = [0.004, 0.004, 0.004]
position = [0.0, 0.0, {at}]
[joints.light]
type = "prismatic"
bodies = ["ground", "light"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
stiffness = {stiffness}
friction = {friction}
[joints.heavy]
type = "prismatic"
bodies = {bodies}
at = [0.0, 0.0, {at}]
axis = [0.0, 0.0, 1.0]
rate = -1.0
"""
STOPPED = "limits = [-0.1, nan]\nlimit_restitution = 0.0\n"
MET = """
[surfaces.light]
body = "light"
shape = { plane = {} }
restitution = 0.0
[surfaces.heavy]
body = "heavy"
shape = { sphere = 0.1 }
restitution = 0.0
[contacts.blow]
surfaces = ["light", "heavy"]
"""


@pytest.mark.parametrize(
    ("met", "method", "most", "mass", "stiffness"),
    [
        ("stop", "rk87", 25, 1e-3, 2000.0), ("stop", "rk87", 25, 1e-5, 2000.0), ("stop", "rk87", 25, 1e-3, 0.0),
        ("stop", "radau", 80, 1e-3, 2000.0),
        ("contact", "rk87", 25, 1e-3, 2000.0),
    ],
)  # fmt: skip
def test_a_light_body_with_much_friction_rests_on_a_heavy_one(met, method, most, mass, stiffness):
    """After the blow both move as one oscillator: (m₁ + m₂) ẍ + c ẋ + k x = 0. Steps follow that, not the light body's
    own c/m₁, which is up to 10⁵ times faster."""
    friction, way, until = 20.0, 0.1, 0.15
    bodies = '["light", "heavy"]' if met == "stop" else '["ground", "heavy"]'
    text = SPRUNG.format(mass=mass, at=2.0 * way, stiffness=stiffness, friction=friction, bodies=bodies)
    sol = run(scene_of(text + (STOPPED if met == "stop" else MET)), until, method, max_steps=most)
    m = 1.0 + mass
    roots = np.roots([m, friction, stiffness]).astype(complex)
    parts = np.linalg.solve(np.vander(roots, increasing=True).T, [0.0, -1.0 / m])
    at = parts @ np.exp(roots * (until - way))
    assert sol.joint("light").coordinate[-1, 0] == pytest.approx(at.real, abs=1e-6)
    assert sol.stats["steps"] + sol.stats["rejected"] <= most


def test_a_step_that_is_rejected_ends_where_its_error_shows():
    """A rebound leaves a light body in stiff flight; no part of such a step is taken after its error is known."""
    scene = scene_of(SPRUNG.format(
            mass=1e-3, at=0.2, stiffness=2000.0, friction=20.0,
            bodies='["light", "heavy"]',
        ) + "limits = [-0.1, nan]\nlimit_restitution = 0.5\n",
    )  # fmt: skip
    sol = run(scene, 0.11)
    assert sol.stats["parts"] <= 300
