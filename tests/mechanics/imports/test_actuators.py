"""Actuators and tendons of MJCF, transmissions of URDF: the forces are MuJoCo's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.operad import Path
from tests.mechanics.imports.by_mujoco import assert_accelerates_alike, compiled, forward
from tests.mechanics.imports.models import URDF

BODIES = "".join(
    f'<body name="{name}" pos="0 {k} 0"><joint name="{name}" type="{kind}" axis="0 1 0" ref="{0.1 * k}" '
    f'stiffness="{k}" springref="0.3" damping="0.2"/><geom size="0.1" pos="0.2 0 0.1"/></body>'
    for k, (name, kind) in enumerate((("a", "hinge"), ("b", "hinge"), ("c", "slide"), ("d", "hinge")))
)
DRIVEN = f"""<mujoco><compiler angle="radian" autolimits="true"/><worldbody>{BODIES}
  <body name="e"><freejoint name="e"/><geom size="0.1"/></body></worldbody>
<tendon>
  <fixed name="rope" stiffness="7" damping="0.4" springlength="0.2">
    <joint joint="a" coef="0.5"/><joint joint="b" coef="-2"/></fixed>
  <fixed name="one" stiffness="3" springlength="-0.1"><joint joint="d" coef="1.5"/></fixed>
  <spatial name="cable"><site site="tip"/><site site="top"/></spatial>
</tendon>
<actuator>
  <motor name="motor" joint="a" gear="3 1 0 0 0 2" ctrlrange="-1 0.5"/>
  <position name="servo" joint="b" kp="20" kv="2" gear="2"/>
  <velocity name="speed" joint="c" kv="4"/>
  <general name="affine" joint="d" gainprm="5" biastype="affine" biasprm="1 -6 -0.5"/>
  <cylinder name="piston" joint="c" area="0.3" bias="0 -2 0" timeconst="0.1"/>
  <motor name="pull" tendon="rope" gear="4"/>
  <damper name="brake" joint="a" kv="2" ctrlrange="0 1"/>
  <muscle name="muscle" joint="a" lengthrange="0.1 1"/>
  <motor name="thrust" joint="e" gear="0 0 1 0 0 0"/>
  <motor name="winch" tendon="cable"/>
</actuator></mujoco>"""
CONTROLS = {"motor": 0.9, "servo": 0.4, "speed": -1.3, "affine": 0.7, "piston": 0.0, "pull": 1.1}


def test_forces_of_actuators_and_tendons_are_mujocos(write):
    text = DRIVEN.replace('<body name="e">', '<site name="top"/><body name="e"><site name="tip"/>')
    with pytest.warns(ephs.ModelWarning) as said:
        scene = ephs.load(write(text, "xml"))
    words = str(said[0].message)
    assert "actuators: muscle, brake, thrust, winch" in words  # its sites meet
    assert "activation of: piston" in words
    assert set(scene.actuators) == set(CONTROLS)
    assert_accelerates_alike(compiled(text), scene, np.random.default_rng(3).standard_normal(4), **CONTROLS)


ROPES = """<mujoco><option gravity="0 0 -9.81"/><worldbody><site name="top" pos="0 0 0.9"/>
  <body name="arm" pos="0.1 0 0"><joint name="shoulder" axis="0 1 0.2"/><geom size="0.1" pos="0.3 0 0"/>
    <site name="a" pos="0.4 0.1 0.2"/><site name="b" pos="0.1 0 0.3"/>
    <body name="hand" pos="0.5 0 0"><joint name="elbow" axis="0 1 0"/><geom size="0.1" pos="0.2 0 0.1"/>
      <site name="c" pos="0.2 0 0.3"/></body></body></worldbody>
<tendon>
  <spatial name="stay" stiffness="40" damping="3" springlength="0.3"><site site="top"/><site site="a"/></spatial>
  <spatial name="tackle" stiffness="90" damping="2" springlength="0.6">
    <site site="b"/><site site="a"/><pulley divisor="2"/><site site="a"/><site site="c"/></spatial>
  {more}
</tendon></mujoco>"""
MORE = """<spatial name="hoist" stiffness="5"><site site="top"/><site site="a"/><pulley divisor="2"/>
    <site site="a"/><site site="c"/></spatial>
  <spatial name="round" stiffness="5"><site site="top"/><geom geom="post"/><site site="a"/></spatial>
  <spatial name="slack" springlength="0.1 0.9" stiffness="5"><site site="top"/><site site="c"/></spatial>"""


def test_tendons_between_two_points_are_springs_with_mujocos_forces(write):
    text = ROPES.format(more="")
    scene = ephs.load(write(text, "xml"))
    assert set(scene.springs) == {"stay", "tackle"}
    assert_accelerates_alike(compiled(text), scene, [0.7, -1.1])


def test_other_tendons_through_points_are_said_by_name(write):
    text = ROPES.format(more=MORE).replace("<body name=", '<geom name="post" size="0.05"/><body name=', 1)
    with pytest.warns(ephs.ModelWarning) as said:
        ephs.load(write(text, "xml"))
    assert "tendons: round, hoist" in str(said[0].message)
    assert "slack of: slack" in str(said[0].message)


LONG = """<spatial name="long" stiffness="25" damping="1.5" springlength="{rest}">
    <site site="top"/><site site="b"/><site site="a"/><site site="c"/></spatial>
  <spatial name="back"><site site="top"/><site site="c"/></spatial></tendon>
<actuator><motor name="winch" tendon="long" gear="-3" ctrlrange="-1 2"/>
  <position name="servo" tendon="back" kp="12" kv="0.6" gear="1.5"/>
  <position name="hold" tendon="long" kp="9" kv="0.3" gear="0.5"/>"""


@settings(max_examples=8, deadline=None)
@given(st.lists(st.floats(-1.0, 1.0), min_size=7, max_size=7), st.sampled_from(["0.7", "0 1.4"]))
def test_tendons_over_several_bodies_have_mujocos_length_rate_and_forces(tmp_path_factory, drawn, rest):
    """Accelerations are by ten_J and the forces; a cable that is slack has the force of its damping alone."""
    path = tmp_path_factory.mktemp("model") / "ropes.xml"
    text = ROPES.format(more=LONG.format(rest=rest)).replace("</tendon></mujoco>", "</actuator></mujoco>")
    path.write_text(text)
    scene = ephs.load(path)
    cable = " " in rest
    assert set(scene.tendons) == ({"long", "hold_bias", "back"} | ({"long_damping"} if cable else set()))
    model = compiled(text)
    data = forward(model, drawn[:2], drawn[2:4], drawn[4:])
    there = scene.with_state(
        *(dict(zip(("shoulder", "elbow"), x.tolist(), strict=True)) for x in (data.qpos, data.qvel))
    )
    inputs = {f"actuators.{name}": float(data.ctrl[model.actuator(name).id]) for name in ("winch", "servo", "hold")}
    eq = ReducedEquations(problem_of_scene(there, inputs=inputs), 0.0)
    start = eq.start(0.0)
    rates = eq.rates(0.0, start.q, eq.vector(start))
    found = [rates[eq.nv + int(eq.layout.freedoms[name][0])] for name in ("shoulder", "elbow")]
    assert np.allclose(found, data.qacc, rtol=1e-9, atol=1e-9 * np.abs(data.qacc).max())
    number, tendon = model.tendon("long").id, there.tendons["long"]
    states = eq.states(start)
    at = Path(["tendons", tendon.name, "spring", "q"])
    assert states[at][0] + tendon.inside == pytest.approx(data.ten_length[number], rel=1e-12)
    place = eq.reduced.entropies.index(at)
    moved = eq.rates(0.0, start.q, eq.vector(start))[eq.nv + eq.n + place]
    assert moved == pytest.approx(data.ten_velocity[number], rel=1e-10, abs=1e-12)


def test_a_transmission_is_an_actuator(write):
    motor = "<joint name='shoulder'/><actuator name='drive'><mechanicalReduction>50</mechanicalReduction></actuator>"
    with pytest.warns(ephs.ModelWarning) as said:
        scene = ephs.load(
            write(URDF.replace('<transmission name="motor"/>', f"<transmission name='t'>{motor}</transmission>"))
        )
    assert "transmissions" not in str(said[0].message)
    drive = scene.actuators["drive"]
    assert (drive.joints, drive.ratio, drive.limits) == (["shoulder"], [50.0], [-0.02, 0.02])
    inputs = {"actuators.drive": 0.01}
    sol, same = (ephs.simulate(scene, 0.1, inputs=given, method="rk87") for given in (inputs, {"joints.shoulder": 0.5}))
    assert np.array_equal(sol.joint("shoulder").rate, same.joint("shoulder").rate)
    assert not np.allclose(
        sol.joint("shoulder").rate, ephs.simulate(scene, 0.1, method="rk87").joint("shoulder").rate[-1]
    )


SERVO = """<mujoco><worldbody>
<body name="arm" pos="0 0 1"><joint name="h" axis="0 1 0" damping="0.2"/>
  <inertial pos="0.3 0 0" mass="1" diaginertia="0.001 0.01 0.01"/>
  <body name="hand" pos="0.5 0 0"><joint name="k" axis="0 1 0" damping="0.1"/>
    <inertial pos="0.1 0 0" mass="0.5" diaginertia="0.001 0.01 0.01"/></body></body></worldbody>
<tendon><fixed name="both"><joint joint="h" coef="1"/><joint joint="k" coef="-2"/></fixed></tendon>
<actuator><position name="servo" joint="h" kp="40" kv="4" ctrlrange="-1 1"/>
<motor name="push" joint="h" gear="-3" ctrlrange="0.5 2"/><motor name="pull" tendon="both" gear="0.5"/>
</actuator></mujoco>"""


@settings(max_examples=10)
@given(st.lists(st.floats(-3.0, 3.0), min_size=7, max_size=7))
def test_dynamics_under_controls_are_mujocos(tmp_path_factory, drawn):
    path = tmp_path_factory.mktemp("model") / "servo.xml"
    path.write_text(SERVO)
    controls = dict(zip(("servo", "push", "pull"), drawn[4:], strict=True))
    with pytest.warns(ephs.ModelWarning, match="since its range lacks 0, of: push"):
        scene = ephs.load(path)
    assert_accelerates_alike(compiled(path), scene, drawn[2:4], drawn[:2], **controls)


def test_inputs_of_dynamics_are_numbers(write, quiet):
    with pytest.raises(ephs.OptionError, match=r"actuators\.push.*no time"):
        ephs.dynamics(quiet(write(SERVO, "xml")), inputs={"actuators.push": lambda t, _: t})
