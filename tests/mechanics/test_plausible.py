"""Likely mistakes are said by name, and sound scenes stay quiet."""

import numpy as np
import pytest

import ephs
from benchmarks.hard.case import WEIGHTLESS, read
from benchmarks.hard.loops import stretched
from ephs.mechanics.constraints.holding import ConfiguredMechanism
from ephs.mechanics.constraints.plausible import doubts
from ephs.mechanics.constraints.redundancy import dependences, explain
from ephs.mechanics.runs.system_problem import problem_of_system
from tests.scenes import ROOT

SHIPPED = [*sorted(ROOT.glob("scenes/*.toml")), *sorted(ROOT.glob("examples/*.toml"))]


def body(name, at=(0.0, 0.0, 0.0), mass=1.0, more=""):
    inertia = 0.01 * min(mass, 1.0)
    moments, position = [inertia] * 3, [*map(float, at)]
    return f"[bodies.{name}]\nmass = {mass}\ninertia = {moments}\nposition = {position}\n{more}\n"


def pin(name, one, two, at=(0.0, 0.0, 0.0), more="", kind="revolute"):
    axis = "axis = [0.0, 0.0, 1.0]\n" if kind == "revolute" else ""
    text = f"[joints.{name}]\ntype = '{kind}'\nbodies = ['{one}', '{two}']\nat = {[*map(float, at)]}\n{axis}"
    return f"{text}{more}\n"


def gear(name, joints, *ratios):
    return f"[gears.{name}]\njoints = {list(joints)}\nratio = {list(ratios)}\n"


def wheels(*gears):
    places = {"a": (0.0, 0.0, 0.0), "b": (1.0, 0.0, 0.0)}
    text = "".join(body(name, at) + pin(name, "ground", name, at) for name, at in places.items())
    return read(text + "".join(gears), WEIGHTLESS)


def planets(ring=2.0):
    """A sun, a carrier and a ring about one axis, three planets on the carrier; by radii 1, 0.5 and 2."""
    text = "".join(body(name) + pin(name, "ground", name) for name in ("sun", "carrier", "ring"))
    for k in range(3):
        at = (1.5 * np.cos(2.0 * np.pi * k / 3.0), 1.5 * np.sin(2.0 * np.pi * k / 3.0), 0.0)
        text += body(f"p{k}", at) + pin(f"p{k}", "carrier", f"p{k}", at)
        text += gear(f"inner{k}", (f"p{k}", "sun", "carrier"), -2.0, 2.0)
        outer = 2.0 * (ring if k == 2 else 2.0)
        text += gear(f"outer{k}", (f"p{k}", "ring", "carrier"), outer, -outer)
    return read(text, WEIGHTLESS)


def test_a_gear_that_repeats_others_is_named():
    twice = wheels(gear("g1", "ba", -1.0), gear("g2", "ba", -1.0))
    assert explain(twice) == "1 constraint equation depends on others: g2 repeats g1"
    assert doubts(twice) == () and explain(wheels(gear("g1", "ba", -1.0))) == ""
    assert [(each.joint, each.on) for each in dependences(ConfiguredMechanism.of(planets()))] == [
        (f"outer{k}", ("inner0", "outer0", f"inner{k}")) for k in (1, 2)
    ]
    assert doubts(planets()) == ()
    found = dependences(problem_of_system(planets().system()).constraints())  # the same gears without a scene
    assert [str(each).replace("gears.", "") for each in found] == [
        str(each) for each in dependences(ConfiguredMechanism.of(planets()))
    ]


def test_gears_that_hold_joints_still_are_named():
    first, second = doubts(wheels(gear("g1", "ba", -1.0), gear("g2", "ba", -1.5)))
    assert first.startswith("g1 and g2 contradict each other") and "b and a still" in first
    assert "locked" in second
    assert doubts(wheels(gear("g1", "ba", -1.0))) == ()


def test_a_mechanism_that_cannot_move_is_locked_unless_it_is_driven():
    """Two bars between two pins; a rod and a chain of two that are driven in all they can."""
    (found,) = doubts(read(stretched(0.1)))
    assert "the mechanism is locked" in found and "a, b and c" in found
    held = "motion = { times = [0.0, 1.0], displacements = [0.2, 0.2] }"
    assert doubts(read(body("rod", (0.5, 0.0, 0.0)) + pin("pin", "ground", "rod", more=held))) == ()
    chain = body("arm") + body("b", (3.0, 0.0, 0.0)) + pin("orbit", "ground", "arm", more="motion = { rate = 0.7 }")
    spin = pin("spin", "arm", "b", (3.0, 0.0, 0.0), "motion = { rate = 11.0 }")
    assert doubts(read(f"[assembly]\nadjust = true\n{chain}{spin}")) == ()
    fixed = pin("all", "ground", "rod", kind="fixed")
    assert doubts(read(body("rod", (0.5, 0.0, 0.0)) + fixed)) == ()


@pytest.mark.parametrize(("far", "mass", "named"), [(0.15, 1.0, 0), (9.0, 99.0, 0), (150.0, 1.0, 1), (0.15, 2e3, 1)])
def test_units_that_are_wrong_by_a_thousand_are_named(far, mass, named):
    chain = "".join(body(f"b{k}", (0.3 * k + 0.15, 0.0, 0.0)) for k in range(2)) + body("c", (far, 0.0, 0.0), mass)
    joints = [
        pin(f"j{k}", one, two, (0.3 * k, 0.0, 0.0))
        for k, (one, two) in enumerate((("ground", "b0"), ("b0", "b1"), ("b1", "c")))
    ]
    found = doubts(read(chain + "".join(joints)))
    assert len(found) == named and all("bodies.c" in each for each in found)


def test_a_mesh_that_is_missing_is_named(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text("format = 1\n" + body("a", more='shape = { mesh = "a.stl" }'), encoding="utf-8")
    (found,) = doubts(ephs.load(file))
    assert "a.stl" in found
    (tmp_path / "a.stl").write_bytes(bytes(84))
    assert doubts(ephs.load(file)) == ()


@pytest.mark.parametrize("file", SHIPPED, ids=[file.stem for file in SHIPPED])
def test_shipped_scenes_raise_no_doubts(file):
    assert doubts(ephs.load(file)) == ()


def test_a_massless_rod_between_two_balls_is_refused_by_its_spin():
    text = "[assembly]\nadjust = true\n" + body("rod", (0.5, 0.0, 0.0), 0.0) + body("ball", (1.0, 0.0, 0.0))
    text += pin("top", "ground", "rod", kind="spherical") + pin("end", "rod", "ball", (1.0, 0.0, 0.0), kind="spherical")
    with pytest.raises(ephs.SimulationError, match="spin about its own axis, through top and end; a ball and a univ"):
        ephs.simulate(read(text), 0.1, method="rk87", rtol=1e-6, atol=1e-6)
    held = text.replace("name = 'end'", "").replace("[joints.end]\ntype = 'spherical'", "[joints.end]\ntype = 'fixed'")
    assert "spin" not in explain(read(held))
