"""The gallery: each system loads, passes its checks, keeps both laws, and shows what it is there for."""

import sys
from functools import cache
from importlib import import_module
from xml.etree import ElementTree

import numpy as np
import pytest

import ephs
from ephs.mechanics.runs.check import check_model
from tests.numerics import largest
from tests.scenes import ROOT

sys.path.insert(0, str(ROOT))

from examples.gallery import UNTIL, entries

ENTRIES = entries()
FACTS = {}


def fact(name):
    """A fact of the system of this name, given its motion."""

    def kept(law):
        FACTS[name] = law
        return law

    return kept


@cache
def motion(name):
    return ENTRIES[name].run(UNTIL)


@pytest.mark.parametrize("name", ENTRIES)
def test_it_passes_every_check(name):
    report = check_model(ENTRIES[name].model(), ENTRIES[name].start)
    assert report.ok, report


@pytest.mark.parametrize("name", ENTRIES)
def test_energy_is_balanced_joints_stay_closed_and_entropy_never_falls(name):
    sol = motion(name)
    assert sol.t[-1] == UNTIL
    assert sol.energy_error.max() < 1e-12  # the sum of a thousand steps, each to Newton's stagnation
    assert sol.constraint_error.max() < 1e-12
    assert sol.entropy_production.min() >= 0.0
    assert np.diff(sol.entropy).min() >= -4.0 * np.finfo(float).eps * largest(sol.entropy)


@pytest.mark.parametrize("name", ENTRIES)
def test_its_fact(name):
    FACTS[name](motion(name))


@pytest.mark.parametrize("name", ENTRIES)
def test_its_source_is_there(name):
    file, _, model = ENTRIES[name].source.partition(":")
    text = (ROOT / file).read_text(encoding="utf-8")
    assert (f"{model} = " in text) if model else text.startswith(("# ", "<?xml"))


def test_the_snapping_roof_turns_over_in_colours_that_a_bar_explains(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    picture = ElementTree.fromstring(import_module("gallery_views").snapping())
    faces = [element for element in picture if element.tag.endswith("polygon")]
    moves = [{each.attrib["attributeName"]: each.attrib["values"].split(";") for each in face} for face in faces]
    assert len(faces) == 4 * 4 * 4 and all({"points", "fill"} <= move.keys() for move in moves)
    assert all(move["points"][0] == move["points"][-1] for move in moves), "there and back"
    words = [element.text for element in picture if element.tag.endswith("text")]
    assert words[0] == "strain energy 0" and words[1].endswith(" J/m²")


def turned(sol, body):
    """(n, 3) the spatial angular momentum of a body about its centre of mass."""
    part = sol.scene.bodies[body]
    spin = sol.body(body).angular_velocity @ part.inertia.T
    return np.einsum("nij,nj->ni", sol.body(body).rotation, spin)


@fact("oscillator")
def _swings_as_a_cosine(sol):
    assert sol["osc.pe.q"] == pytest.approx(np.cos(np.sqrt(1.5) * sol.t), abs=1e-4)
    assert sol.heat[-1] == 0.0


@fact("damped oscillator")
def _exergy_lost_is_entropy_made(sol):
    lost = sol.exergy[0] - sol.exergy
    assert lost == pytest.approx(293.15 * (sol.entropy - sol.entropy[0]), abs=1e-13)
    assert (np.diff(lost) >= 0.0).all() and lost[-1] > 0.1


@fact("body")
def _flies_along_a_parabola(sol):
    t = sol.t[:, None]
    parabola = t * [2.0, 0.0, 9.0] + 0.5 * t**2 * [0.0, 0.0, -9.81]
    assert sol.body("stone").position == pytest.approx(parabola, abs=3e-4)  # to second order
    momentum = turned(sol, "stone")
    assert largest(momentum - momentum[0]) < 1e-4 * np.linalg.norm(momentum[0])  # of second order


@fact("two bodies and a joint")
def _both_turn_more_and_more_as_one(sol):
    momentum = sum(sol.scene.bodies[name].mass * sol.body(name).velocity for name in ("b1", "b2"))
    assert largest(momentum - momentum[0]) < 1e-4
    rate = np.linalg.norm(sol.joint("j").rate, axis=1)
    assert rate[-1] < 0.3 * rate[0]
    assert sol.kinetic[0] - sol.kinetic[-1] == pytest.approx(sol.heat[-1], rel=1e-10)


@fact("Dzhanibekov body")
def _the_middle_axis_flips(sol):
    axis = sol.body("nut").rotation[:, :, 1]  # of the middle moment, in the world
    along = axis @ (turned(sol, "nut")[0] / np.linalg.norm(turned(sol, "nut")[0]))
    assert along[0] > 0.99 and along.min() < -0.99
    assert (np.diff(np.sign(along)) != 0).sum() >= 2


@fact("heavy top")
def _its_spin_stays_and_it_comes_up_again(sol):
    spin = sol.body("top").angular_velocity[:, 1]
    assert spin == pytest.approx(150.0, rel=1e-9)
    at, velocity = sol.body("top").position, sol.body("top").velocity
    assert np.linalg.norm(at, axis=1) == pytest.approx(1.0, abs=1e-12)
    upright = turned(sol, "top")[:, 2] + sol.scene.bodies["top"].mass * np.cross(at, velocity)[:, 2]
    assert upright == pytest.approx(upright[0], rel=1e-2)  # to second order
    low = int((at[:, 2] < -0.9).argmax())
    assert low > 0 and at[low:, 2].max() > -0.1  # it dives, and comes up again


@fact("four-bar")
def _the_crank_turns_round_and_the_rocker_swings(sol):
    summary = sol.summary()
    assert (summary["mobility"], summary["redundant_constraints"]) == (1, 3)
    assert np.ptp(sol.joint("main").coordinate) > 2.0 * np.pi
    assert np.ptp(sol.joint("pivot").coordinate) < np.pi


@fact("slider-crank")
def _friction_warms_the_housing(sol):
    assert sol.thermal("housing").temperature[-1] > 293.15 + 0.05
    assert np.ptp(sol.body("slider").position[:, 0]) == pytest.approx(0.08, abs=1e-3)  # twice the crank
    stored = sol.kinetic[-1] + sol.potential[-1] - sol.kinetic[0] - sol.potential[0]
    assert sol.work[-1] == pytest.approx(sol.heat[-1] + stored, rel=1e-11)


@fact("N-four-bar")
def _it_passes_all_bars_in_line(sol):
    assert sol.summary()["mobility"] == 1
    assert len(sol.scene.joints) * 5 - 6 * len(sol.scene.bodies) + 1 == 6  # constraints that repeat others
    for name in ("foot0", "foot2"):
        angle = sol.joint(name).coordinate[:, 0]
        assert angle.min() < 0.1 and angle.max() > 0.75 * np.pi  # in line at a quarter turn
    for name in ("coupler0", "coupler1"):
        assert largest(sol.body(name).rotation[:, 2, 0]) < 1e-9  # a parallelogram on both sides of it


@fact("Bricard")
def _it_moves_though_the_count_says_no(sol):
    scene = sol.scene
    assert 6 * len(scene.bodies) - 5 * len(scene.joints) == 0
    summary = sol.summary()
    assert (summary["mobility"], summary["redundant_constraints"]) == (1, 1)
    assert np.ptp(sol.joint("h1").coordinate) > 3.0


@fact("screw press")
def _the_platen_follows_the_screw(sol):
    pitch = sol.scene.joints["nut"].pitch
    travel = sol.body("platen").position[0, 2] - sol.body("platen").position[:, 2]
    assert travel == pytest.approx(pitch * sol.joint("nut").coordinate[:, 0], abs=1e-12)
    assert travel[-1] > 0.02
    assert sol.thermal("nut").temperature[-1] > 293.15


@fact("Cardan shaft")
def _the_driven_shaft_follows_by_the_tangent(sol):
    first, second = sol.joint("input").coordinate[:, 0], sol.joint("output").coordinate[:, 0]
    bend = np.cos(np.radians(35.0))
    assert np.sin(second) * np.cos(first) == pytest.approx(bend * np.sin(first) * np.cos(second), abs=1e-11)
    ratio = sol.joint("output").rate[:, 0] / sol.joint("input").rate[:, 0]
    assert (ratio.min(), ratio.max()) == pytest.approx((bend, 1.0 / bend), rel=1e-3)


@fact("robot arm")
def _the_torques_of_inverse_dynamics_hold_it(sol):
    assert sol.summary()["mobility"] == 6
    assert np.ptp(sol.body("flange").position[:, 2]) > 0.3  # let go, it falls
    still = sol.scene.with_state(rates={"waist": 0.0})
    model = ephs.dynamics(still)
    hinges = [name for name, joint in still.joints.items() if joint.kind == "revolute"]
    torques = model.inverse_dynamics(model.state0, dict.fromkeys(hinges, 0.0))
    held = ephs.simulate(still, 1.0, step=0.01, inputs={f"joints.{name}": torques[name] for name in hinges})
    assert np.ptp(held.body("flange").position, axis=0) == pytest.approx(0.0, abs=1e-9)


@fact("biped")
def _its_brackets_keep_the_attitude_of_the_pelvis(sol):
    summary = sol.summary()
    assert (summary["mobility"], summary["redundant_constraints"]) == (3, 9)
    assert len(dict(sol.scene.all_joints())) - len(dict(sol.scene.all_bodies())) == 3  # loops
    knee = sol.body("left.bracket").rotation
    assert np.einsum("nij,nik->njk", sol.body("pelvis").rotation, knee) == pytest.approx(
        np.broadcast_to(sol.body("pelvis").rotation[0].T @ knee[0], knee.shape), abs=1e-9
    )
    assert np.ptp(sol.body("pelvis").position[:, 2]) > 0.02


@fact("motor and crank")
def _the_crank_turns_at_the_geared_speed(sol):
    from examples.motor_crank import FLUX, GEAR, RESISTANCE, ROTOR, VOLTAGE, scene

    rotor = sol["motor.rotor.p"] / ROTOR
    crank = sol["engine.bodies.crank.ke.p"][:, 1] / scene.bodies["crank"].inertia[1, 1]
    assert crank == pytest.approx(GEAR * rotor, rel=1e-3, abs=0.05)  # nodal momenta, to second order
    assert rotor[-1] < VOLTAGE / FLUX  # below the speed at which the voltage is balanced
    current = sol["motor.coil.b"] / 2.0e-3
    copper = np.trapezoid(RESISTANCE * current**2, sol.t)
    made = sol.ledger("motor.resistance").made[-1]
    assert made * 293.15 == pytest.approx(copper, rel=0.05)
    assert sol.work[-1] > sol.heat[-1] > 0.0


@fact("gas engine")
def _volume_is_exchanged_and_exergy_destroyed(sol):
    total = sol["above.v"] + sol["below.v"]
    assert total == pytest.approx(total[0], rel=1e-14)
    assert (np.diff(sol.exergy) < 0.0).all()
    slider = sol["engine.bodies.slider.pe.q"][:, 4]
    assert sol["above.v"] - sol["above.v"][0] == pytest.approx(2.0e-3 * (slider[0] - slider), abs=1e-12)
    assert np.ptp(slider) > 0.03


@fact("two gases")
def _the_piston_swings_towards_one_pressure(sol):
    assert sol["gas1.v"] + sol["gas2.v"] == pytest.approx(1.0, rel=1e-13)
    assert sol["gas1.v"][-1] > sol["gas1.v"][0]
    assert sol.entropy[-1] > sol.entropy[0]


@fact("hot brake")
def _motion_becomes_heat(sol):
    assert sol.kinetic[0] == pytest.approx(9000.0)
    assert sol.kinetic[-1] < 0.01 * sol.kinetic[0]
    assert sol.heat[-1] == pytest.approx(sol.kinetic[0] - sol.kinetic[-1], rel=1e-12)
    disc, calliper = (sol.thermal(name).temperature for name in ("disc", "calliper"))
    assert disc.max() > 320.0 and disc.argmax() < len(disc) - 1  # it is hottest before all is over
    assert calliper[-1] > calliper[0]
