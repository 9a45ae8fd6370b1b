"""Each number of a format either changes the scene, or is named, or concerns solvers and pictures alone.

A row sets one number of a model that holds one of each element. `USED` rows give another scene; others the words of the
note, or none where the number has no effect on motion. SDF's notes begin with the path, where they begin with "of".
"""

import re
import sys
from collections import Counter

import pytest

import ephs
from ephs.mechanics.imports import file_element, mjcf_keys
from ephs.mechanics.imports.read import read_model

USED, SILENT = object(), None
URDF = """<robot name="r"><link name="a"/>
<link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/>{inertial}</inertial>
  <collision><geometry><sphere radius="1"/></geometry>{collision}</collision>{link}</link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" {limit}/>{joint}</joint>{robot}</robot>"""


def transmission(interface, more=""):
    """A transmission whose joint has an interface."""
    said = f"<hardwareInterface>{interface}</hardwareInterface>" if interface else ""
    joint = f'<joint name="j">{said}{more}</joint>'
    return f'<transmission name="t"><type>Simple</type>{joint}<actuator name="m"/></transmission>'


URDF_ROWS = [
    ("link", '<contact><lateral_friction value="0.3"/></contact>', USED),
    ("link", '<contact><rolling_friction value="0.3"/></contact>', USED),
    ("link", '<contact><spinning_friction value="0.3"/></contact>', USED),
    ("link", '<contact><stiffness value="3e3"/></contact>', USED),
    ("link", '<contact><damping value="3"/></contact>', "contact/damping of links: b"),
    ("link", '<contact><restitution value="0.3"/></contact>', "contact/restitution of links: b"),
    ("link", '<contact><restitution value="0.0"/></contact>', SILENT),
    ("link", '<contact><contact_erp value="0.3"/></contact>', "contact/contact_erp of links: b"),
    ("link", "<self_collision_checking/>", "self_collision_checking of links: b"),
    ("inertial", '<density value="3"/>', "inertial/density of links: b"),
    ("collision", "<verbose/>", "verbose of collisions: b"),
    ("collision", '<origin xyz="0 0 1"/>', USED),
    ("collision", '<material name="red"/>', SILENT),
    ("limit", 'velocity="3"', "limit/velocity of joints: j"),
    ("limit", 'effort="3"', "limits of effort of: j"),
    ("limit", 'effort="1.79769e+308"', SILENT),
    ("limit", 'acceleration="3"', "limit/acceleration of joints: j"),
    ("joint", '<dynamics damping="3"/>', USED),
    ("joint", '<dynamics friction="3"/>', USED),
    ("joint", '<dynamics stiffness="3"/>', "dynamics/stiffness of joints: j"),
    ("joint", '<safety_controller k_velocity="3"/>', "safety_controller of joints: j"),
    ("joint", '<calibration rising="3"/>', "calibration of joints: j"),
    ("robot", '<gazebo reference="b"><mu1>0.3</mu1></gazebo>', USED),
    ("robot", '<gazebo reference="b"><mu1 value="0.3"/><mu2 value="0.3"/></gazebo>', USED),
    ("robot", '<gazebo reference="b"><mu1>0.3</mu1><mu2>0.2</mu2></gazebo>', "mu2 of links: b"),
    ("robot", '<gazebo reference="b"><mu2>0.2</mu2></gazebo>', "mu2 of links: b"),
    ("robot", '<gazebo reference="b"><kp>1e4</kp></gazebo>', USED),
    ("robot", '<gazebo reference="b"><kp>1e13</kp></gazebo>', r"rigid contacts \(kp\) of: b"),
    ("robot", '<gazebo reference="b"><kd>1e4</kd></gazebo>', "kd of links: b"),
    ("robot", '<gazebo reference="b"><fdir1>1 0 0</fdir1></gazebo>', "fdir1 of links: b"),
    ("robot", '<gazebo reference="b"><minDepth>1e-3</minDepth></gazebo>', "minDepth of links: b"),
    ("robot", '<gazebo reference="b"><maxVel>1</maxVel></gazebo>', "maxVel of links: b"),
    ("robot", '<gazebo reference="b"><selfCollide>true</selfCollide></gazebo>', "selfCollide of links: b"),
    ("robot", '<gazebo reference="b"><selfCollide>false</selfCollide></gazebo>', SILENT),
    ("robot", '<gazebo reference="b"><turnGravityOff>true</turnGravityOff></gazebo>', "turnGravityOff of links: b"),
    ("robot", '<gazebo reference="b"><gravity>false</gravity></gazebo>', "gravity of links: b"),
    ("robot", '<gazebo reference="b"><dampingFactor>0.1</dampingFactor></gazebo>', "dampingFactor of links: b"),
    (
        "robot",
        '<gazebo reference="b"><velocity_decay><linear>1</linear></velocity_decay></gazebo>',
        "velocity_decay/linear of links: b",
    ),
    ("robot", '<gazebo reference="b"><collision><surface/></collision></gazebo>', "collision of links: b"),
    ("robot", '<gazebo reference="b"><material>Gazebo/Red</material></gazebo>', SILENT),
    ("robot", '<gazebo reference="b"><sensor name="s"/></gazebo>', "sensors: b"),
    ("robot", '<gazebo reference="j"><springStiffness>3</springStiffness></gazebo>', USED),
    ("robot", '<gazebo reference="j"><stopErp>0.1</stopErp></gazebo>', "stopErp of joints: j"),
    ("robot", '<gazebo reference="j"><provideFeedback>true</provideFeedback></gazebo>', SILENT),
    ("robot", '<gazebo><plugin name="p" filename="f"/></gazebo>', "plugins: r"),
    ("inertial", '<origin quat_xyzw="1 0 0 1" xyz="0 0 1"/>', USED),
    ("inertial", '<origin xyz="0 0 1" rot="1 0 0"/>', "inertial/origin/rot of links: b"),
    ("inertial", "<mass value='3'/>", "inertial/mass of links: b"),
    ("robot", transmission("EffortJointInterface"), USED),
    ("robot", transmission("hardware_interface/EffortJointInterface"), USED),
    ("robot", transmission("PositionJointInterface"), "transmissions whose interface is no effort: t"),
    ("robot", transmission("VelocityJointInterface"), "transmissions whose interface is no effort: t"),
    ("robot", transmission("", "<offset>3</offset>"), "joint/offset of transmissions: t"),
    ("robot", '<ros2_control name="c"/>', "ros2_control of robots: r"),
    ("robot", '<material name="red"/>', SILENT),
]
SDF = """<sdf version="1.7"><world name="w"><gravity>0 0 -9.81</gravity>{world}<model name="floor"><static>1</static>
<link name="l"><collision name="c"><geometry><plane/></geometry></collision></link></model>
<model name="m"><pose>0 0 2 0 0 0</pose>{model}<link name="b"><inertial><mass>1</mass>{inertial}</inertial>
<collision name="c"><geometry><sphere><radius>1</radius></sphere></geometry>{collision}</collision>{link}</link>
<joint name="j" type="revolute"><parent>world</parent><child>b</child>{joint}<axis><xyz>0 1 0</xyz>
<limit><lower>-1</lower><upper>1</upper>{limit}</limit><dynamics>{dynamics}</dynamics>{axis}</axis></joint></model>
</world></sdf>"""


def nested(path, value):
    """Elements within each other with a value."""
    first, _, rest = path.partition("/")
    return f"<{first}>{nested(rest, value) if rest else value}</{first}>"


SDF_ROWS = [
    ("link", "velocity_decay/linear", "0.1", "of links: b"),
    ("link", "velocity_decay/linear", "0.0", SILENT),
    ("link", "velocity_decay/angular", "0.1", "of links: b"),
    ("link", "gravity", "0", "of links: b"),
    ("link", "gravity", "true", SILENT),
    ("link", "kinematic", "1", "of links: b"),
    ("link", "self_collide", "1", "of links: b"),
    ("link", "enable_wind", "1", "of links: b"),
    ("link", "must_be_base_link", "1", SILENT),
    ("link", "sleep", "1", "of links: b"),
    ("inertial", "fluid_added_mass/xx", "1", "inertial/fluid_added_mass of links: b"),
    ("inertial", "density", "1", "inertial/density of links: b"),
    ("inertial", "pose", "0 0 1 0 0 0", USED),
    ("collision", "surface/friction/ode/mu", "0.3", USED),
    ("collision", "surface/friction/ode/mu2", "0.3", "of collisions: b_c"),
    ("collision", "surface/friction/ode/mu2", "1", SILENT),
    ("collision", "surface/friction/ode/fdir1", "1 0 0", "of collisions: b_c"),
    ("collision", "surface/friction/ode/slip1", "1", "of collisions: b_c"),
    ("collision", "surface/friction/ode/slip2", "1", "of collisions: b_c"),
    ("collision", "surface/friction/bullet/friction", "0.3", "of collisions: b_c"),
    ("collision", "surface/friction/bullet/rolling_friction", "0.3", "of collisions: b_c"),
    ("collision", "surface/friction/torsional/patch_radius", "0.3", "of collisions: b_c"),
    ("collision", "surface/friction/torsional/surface_radius", "0.3", "of collisions: b_c"),
    ("collision", "surface/bounce/restitution_coefficient", "0.3", "of collisions: b_c"),
    ("collision", "surface/bounce/threshold", "0.3", SILENT),
    ("collision", "surface/soft_contact/dart/stiffness", "0.3", "surface/soft_contact of collisions: b_c"),
    ("collision", "surface/contact/ode/kp", "1e4", USED),
    ("collision", "surface/contact/ode/kp", "1e12", r"rigid contacts \(kp\) of: b_c"),
    ("collision", "surface/contact/ode/kd", "10", "of collisions: b_c"),
    ("collision", "surface/contact/ode/soft_cfm", "0.1", "of collisions: b_c"),
    ("collision", "surface/contact/ode/soft_erp", "0.1", "of collisions: b_c"),
    ("collision", "surface/contact/ode/soft_erp", "0.2", SILENT),
    ("collision", "surface/contact/ode/max_vel", "0.1", "of collisions: b_c"),
    ("collision", "surface/contact/ode/min_depth", "0.1", "of collisions: b_c"),
    ("collision", "surface/contact/bullet/kp", "1e4", "of collisions: b_c"),
    ("collision", "surface/contact/elastic_modulus", "1e9", "of collisions: b_c"),
    ("collision", "surface/contact/poissons_ratio", "0.1", "of collisions: b_c"),
    ("collision", "surface/contact/collide_bitmask", "0", USED),
    ("collision", "surface/contact/collide_bitmask", "0x0", USED),
    ("collision", "surface/contact/collide_bitmask", "1", "of collisions: b_c"),
    ("collision", "surface/contact/collide_bitmask", "65535", SILENT),
    ("collision", "surface/contact/collide_bitmask", "0xFFFF", SILENT),
    ("collision", "surface/contact/category_bitmask", "1", "of collisions: b_c"),
    ("collision", "surface/contact/collide_without_contact", "true", USED),
    ("collision", "max_contacts", "3", "of collisions: b_c"),
    ("collision", "laser_retro", "3", SILENT),
    ("collision", "drake:proximity_properties", "3", "of collisions: b_c"),
    ("joint", "physics/ode/erp", "0.3", "of joints: j"),
    ("joint", "physics/ode/limit/cfm", "0.3", "of joints: j"),
    ("joint", "physics/ode/limit/cfm", "0", SILENT),
    ("joint", "physics/ode/provide_feedback", "1", SILENT),
    ("joint", "axis2/xyz", "0 0 1", "axis2 of joints: j"),
    ("axis", "initial_position", "0.3", "axis/initial_position of joints: j"),
    ("axis", "mimic/multiplier", "0.3", "axis/mimic of joints: j"),
    ("limit", "effort", "5", "axis/limit/effort of joints: j"),
    ("limit", "effort", "-1", SILENT),
    ("limit", "velocity", "5", "axis/limit/velocity of joints: j"),
    ("limit", "velocity", "1e16", SILENT),
    ("limit", "stiffness", "1e5", "axis/limit/stiffness of joints: j"),
    ("limit", "dissipation", "2", "axis/limit/dissipation of joints: j"),
    ("dynamics", "damping", "5", USED),
    ("dynamics", "friction", "5", USED),
    ("dynamics", "spring_stiffness", "5", USED),
    ("dynamics", "viscosity", "5", "axis/dynamics/viscosity of joints: j"),
    ("model", "self_collide", "1", USED),
    ("model", "allow_auto_disable", "1", SILENT),
    ("model", "enable_wind", "1", "of models: m"),
    ("model", "gripper/grasp_check", "1", "grippers: gripper"),
    ("world", "wind/linear_velocity", "1 0 0", "of worlds: w"),
    ("world", "wind/linear_velocity", "0 0 0", SILENT),
    ("world", "physics/max_step_size", "1", SILENT),
    ("world", "physics/ode/constraints/cfm", "0.1", "of worlds: w"),
    ("world", "physics/ode/constraints/contact_surface_layer", "0.1", "of worlds: w"),
    ("world", "physics/simbody/contact/stiffness", "1", "physics/simbody/contact of worlds: w"),
    ("world", "population/model_count", "3", "population of worlds: w"),
    ("world", "plugin", "3", "plugins: plugin"),
]
MJCF = """<mujoco><compiler autolimits="true" angle="radian"/><option {option}>{flags}</option><worldbody>
<geom name="floor" type="plane" size="1 1 1"/><body name="b" pos="0 0 3" {body}>
<joint name="j" type="slide" axis="0 0 1" range="-1 1" frictionloss="0.1" damping="1" {joint}/>
<geom name="g" size="1" {geom}/><site name="s"/></body>
<body name="c" pos="9 0 3"><freejoint name="f"/><geom name="h" size="1" contype="2" conaffinity="2"/></body></worldbody>
<contact><pair name="p" geom1="floor" geom2="h" {pair}/></contact>
<equality><joint name="e" joint1="j" active="false" {equality}/></equality>
<tendon><fixed name="t" {tendon}><joint joint="j" coef="1"/></fixed></tendon>
<actuator><general name="a" joint="j" ctrlrange="-1 1" {actuator}/></actuator></mujoco>"""
MJCF_ROWS = [
    ("option", 'gravity="0 0 -1"', USED),
    ("option", 'density="1"', "options: density"),
    ("option", 'viscosity="1"', "options: viscosity"),
    ("option", 'wind="1 0 0"', "options: wind"),
    ("option", 'impratio="3"', "options: impratio"),
    ("option", 'timestep="3"', SILENT),
    ("option", 'cone="elliptic"', SILENT),
    ("option", 'actuatorgroupdisable="0"', "disabled actuators: a"),
    ("flags", '<flag gravity="disable"/>', USED),
    ("flags", '<flag frictionloss="disable"/>', USED),
    ("flags", '<flag limit="disable"/>', USED),
    ("flags", '<flag contact="disable"/>', USED),
    ("flags", '<flag constraint="disable"/>', USED),
    ("flags", '<flag damper="disable"/>', USED),
    ("flags", '<flag clampctrl="disable"/>', USED),
    ("flags", '<flag actuation="disable"/>', "disabled actuators: a"),
    ("flags", '<flag override="enable"/>', "options: override"),
    ("flags", '<flag warmstart="disable"/>', SILENT),
    ("body", 'gravcomp="0.5"', "gravcomp of bodies: b"),
    ("joint", 'stiffness="3"', USED),
    ("joint", 'stiffness="3 1"', "stiffness that is not linear of: j"),
    ("joint", 'stiffness="3" springref="1"', USED),
    ("joint", 'springdamper="1 1"', USED),
    ("joint", 'armature="1"', USED),
    ("joint", 'ref="0.5"', USED),
    ("joint", 'margin="1"', "margin of joints: j"),
    ("joint", 'solreflimit="0.1 1"', USED),
    ("joint", 'solreflimit="0.1 1" limited="false"', USED),
    ("joint", 'solimplimit="0.1"', "solimplimit of joints: j"),
    ("joint", 'solreffriction="0.1 1"', "solreffriction of joints: j"),
    ("joint", 'solimpfriction="0.1"', "solimpfriction of joints: j"),
    ("joint", 'actuatorfrcrange="-1 1"', "actuatorfrcrange of joints: j"),
    ("joint", 'actuatorfrcrange="-1 1" actuatorfrclimited="false"', SILENT),
    ("joint", 'actuatorgravcomp="true"', "actuatorgravcomp of joints: j"),
    ("joint", 'group="1"', SILENT),
    ("geom", 'friction="2"', USED),
    ("geom", 'condim="6"', USED),
    ("geom", 'solref="0.1 1"', USED),
    ("geom", 'contype="0" conaffinity="0"', USED),
    ("geom", 'margin="0.1"', "margin of geoms: g"),
    ("geom", 'gap="0.1"', "gap of geoms: g"),
    ("geom", 'solimp="0.1"', "solimp of geoms: g"),
    ("geom", 'rgba="1 0 0 1"', SILENT),
    ("pair", 'friction="0.3 0.3"', USED),
    ("pair", 'friction="0.3 0.4"', "friction that depends on the direction, of: floor and h"),
    ("pair", 'margin="0.1"', "margin of pairs: floor and h"),
    ("pair", 'gap="0.1"', "gap of pairs: floor and h"),
    ("pair", 'solimp="0.1"', "solimp of pairs: floor and h"),
    ("pair", 'solreffriction="0.1 1"', "solreffriction of pairs: floor and h"),
    ("equality", 'polycoef="1"', "inactive equality constraints: e"),
    ("tendon", 'stiffness="3"', USED),
    ("tendon", 'damping="3"', USED),
    ("tendon", 'range="-3 3"', "range of tendons: t"),
    ("tendon", 'frictionloss="3"', "frictionloss of tendons: t"),
    ("tendon", 'armature="3"', "armature of tendons: t"),
    ("tendon", 'actuatorfrcrange="-1 1"', "actuatorfrcrange of tendons: t"),
    ("actuator", 'gear="3"', USED),
    ("actuator", 'gainprm="3"', USED),
    ("actuator", 'biastype="affine" biasprm="0 -3 -1"', USED),
    ("actuator", 'forcerange="-3 3"', "forcerange of actuators: a"),
    ("actuator", 'dyntype="filter" dynprm="3"', "activation of: a"),
    ("actuator", 'damping="3"', "damping of actuators: a"),
    ("actuator", 'armature="3"', "armature of actuators: a"),
    ("actuator", 'delay="0.1" nsample="3"', "delay of actuators: a"),
]  # fmt: skip


def blank(text):
    """The model with none of the numbers."""
    return text.format(**dict.fromkeys(re.findall(r"\{(\w+)\}", text), ""))


def given(text, place, row):
    return text.format(**dict.fromkeys(re.findall(r"\{(\w+)\}", text), "") | {place: row})


def told(folder, text, suffix):
    """The tables of a model, and what is left out of them."""
    file = folder / f"model.{suffix}"
    file.write_text(text, encoding="utf-8")
    faults, left = [], []
    tables = read_model(file, "fixed", faults, left, contact=True)
    assert not faults
    return tables, "\n".join(left)


def check(folder, suffix, text, place, row, found):
    plain, already = told(folder, blank(text), suffix)
    tables, said = told(folder, given(text, place, row), suffix)
    if found is USED:
        assert repr(tables) != repr(plain)
    elif found is SILENT:
        assert repr(tables) == repr(plain) and said == already
    else:
        assert re.search(f"not modelled: {found}", said), said


@pytest.mark.parametrize(("place", "row", "found"), URDF_ROWS)
def test_numbers_of_a_urdf(place, row, found, tmp_path):
    check(tmp_path, "urdf", URDF, place, row, found)


@pytest.mark.parametrize(("place", "path", "value", "found"), SDF_ROWS)
def test_numbers_of_an_sdf(place, path, value, found, tmp_path):
    if isinstance(found, str) and found.startswith("of "):
        found = f"{path} {found}"
    check(tmp_path, "sdf", SDF, place, nested(path, value), found)


@pytest.mark.parametrize(("place", "row", "found"), MJCF_ROWS)
def test_numbers_of_an_mjcf(place, row, found, tmp_path):
    pytest.importorskip("mujoco")
    check(tmp_path, "xml", MJCF, place, row, found)


def test_a_long_list_is_short_in_the_message_and_whole_in_the_warning(tmp_path):
    links = "".join(f'<link name="l{i}"><lamp/></link>' for i in range(30))
    joints = "".join(
        f'<joint name="j{i}" type="fixed"><parent link="l{i}"/><child link="l{i + 1}"/></joint>' for i in range(29)
    )
    file = tmp_path / "row.urdf"
    file.write_text(f'<robot name="row">{links}{joints}</robot>', encoding="utf-8")
    with pytest.warns(ephs.ModelWarning) as said:
        ephs.load(file)
    (warning,) = (each.message for each in said)
    assert str(warning).endswith("lamp of links: l0, l1, l2, l3, l4, l5, l6, l7, l8, l9, and 20 more")
    assert warning.lines == ("not modelled: lamp of links: " + ", ".join(f"l{i}" for i in range(30)),)


# what the reader of a format takes from a file that says all that it can say: nothing is left over
FULL = {
    "urdf": URDF.format(
        inertial='<origin xyz="0 0 1" rpy="1 0 0"/>',
        collision='<origin xyz="0 0 1" rpy="0 1 0"/>',
        link='<contact><lateral_friction value="0.3"/></contact>',
        limit='effort="3"',
        joint='<origin xyz="0 0 1" quat_xyzw="1 0 0 1"/><dynamics damping="1" friction="1"/>',
        robot='<link name="c"/><joint name="k" type="prismatic"><parent link="b"/><child link="c"/>'
        '<axis xyz="1 0 0"/><mimic joint="j" multiplier="2" offset="1"/></joint>'
        + transmission("EffortJointInterface", "<mechanicalReduction>3</mechanicalReduction>")
        + '<gazebo reference="b"><mu1>0.3</mu1><kp>1e4</kp></gazebo>'
        '<gazebo reference="j"><springStiffness>3</springStiffness><springReference>1</springReference></gazebo>',
    ),
    "sdf": SDF.format(
        world='<joint name="x" type="fixed"><parent>world</parent><child>m::n::d</child></joint>',
        model='<frame name="f" attached_to="b"><pose relative_to="__model__" degrees="1">0 0 0 30 0 0</pose></frame>'
        '<self_collide>1</self_collide><model name="n" placement_frame="d" canonical_link="d"><pose>0 1 0 0 0 0</pose>'
        '<link name="d"><inertial><mass>1</mass></inertial></link></model>'
        '<joint name="s" type="screw"><parent>b</parent><child>n</child>'
        "<screw_thread_pitch>2</screw_thread_pitch></joint>",
        inertial="<pose>0 0 1 0 0 0</pose><inertia><ixx>2</ixx><ixy>0.1</ixy></inertia>",
        collision="<pose>0 0 1 0 0 0</pose><surface><contact><ode><kp>1e4</kp></ode></contact>"
        "<friction><ode><mu>0.3</mu></ode></friction></surface>",
        link='<pose relative_to="f">0 0 1 0 0 0</pose>',
        joint='<pose relative_to="b">0 0 1 0 0 0</pose>',
        axis='<xyz expressed_in="f">0 1 0</xyz>',
        dynamics="<damping>1</damping><friction>1</friction><spring_stiffness>1</spring_stiffness>"
        "<spring_reference>1</spring_reference>",
        limit="",
    ).replace("<axis><xyz>0 1 0</xyz>", "<axis>"),
}


@pytest.mark.parametrize("suffix", FULL)
def test_a_file_that_is_read_whole_leaves_nothing(suffix, tmp_path):
    assert told(tmp_path, FULL[suffix], suffix)[1] in ("", "not modelled: contacts between the links of: r")


def test_a_read_that_is_deleted_in_the_source_is_told(monkeypatch, tmp_path):
    """Each line of the readers that reads what no other line reads, is made to read nothing: the list grows, or the
    file is refused."""
    gone: list[tuple[str, int]] = []
    reads: dict[tuple[str, int], set[str]] = {}

    def recorded(word, original):
        def read(self, *of):
            frame = sys._getframe(1)
            while frame.f_code.co_filename in (file_element.__file__, __file__):
                frame = frame.f_back
            line = frame.f_code.co_filename, frame.f_lineno
            if line in gone:
                return [] if word == "findall" else None
            found = original(self, *of)
            if found not in (None, []):
                reads.setdefault(line, set()).add(f"{self.tag} {self._attributes} {of}")
            return found

        return read

    for word in ("get", "find", "findall"):
        monkeypatch.setattr(file_element.FileElement, word, recorded(word, getattr(file_element.FileElement, word)))
    monkeypatch.setattr(
        file_element.FileElement, "text", property(recorded("text", file_element.FileElement.text.fget))
    )
    for suffix, text in FULL.items():
        reads.clear()
        before = told(tmp_path, text, suffix)[1]
        counts = Counter(key for keys in reads.values() for key in keys)
        own = [line for line, keys in reads.items() if any(counts[key] == 1 for key in keys)]
        assert len(own) > 20
        for line in own:
            gone[:] = [line]
            try:
                after = told(tmp_path, text, suffix)[1]
            except Exception:  # refused, or a reader that cannot go on
                continue
            finally:
                gone.clear()
            assert len(after) > len(before), line


WHOLE = """<mujoco><compiler autolimits="true" angle="radian"/><option gravity="0 0 -1"/><worldbody>
<geom name="floor" type="plane" size="1 1 1"/><body name="b" pos="0 0 3" quat="1 1 0 0">
<inertial pos="1 0 0" quat="1 0 1 0" mass="2" diaginertia="1 2 2.5"/>
<joint name="j" pos="0 0 1" axis="0 1 0" range="-1 1" frictionloss="0.1" damping="1" ref="0.5" stiffness="3"
  springref="1" armature="1" solreflimit="0.1 1"/>
<geom name="g" type="box" pos="0 0 1" quat="1 1 0 0" size="1 1 1" friction="2" condim="6" solref="0.1 1" solmix="2"
  priority="1" contype="3" conaffinity="3"/></body>
<body name="c" pos="9 0 3"><joint name="f" type="slide" axis="1 0 0"/>
<geom name="h" size="1" contype="0" conaffinity="0"/></body></worldbody>
<contact><pair name="p" geom1="floor" geom2="h" condim="4" friction="0.3 0.3" solref="0.1 1"/></contact>
<equality><weld name="e" body1="b" body2="c" anchor="1 0 0" torquescale="0"/>
<joint name="r" joint1="j" joint2="f" polycoef="0 2 0 0 0"/></equality>
<tendon><fixed name="t" stiffness="1" damping="1" springlength="1"><joint joint="j" coef="1"/></fixed></tendon>
<actuator><position name="a" joint="j" kp="3" kv="1" gear="3" ctrlrange="-1 1"/></actuator></mujoco>"""
ATTRIBUTES = {
    "bodies": "pos quat mass inertia ipos iquat",
    "joints": "pos axis range frictionloss damping ref stiffness springref armature solreflimit type",
    "geoms": "type pos quat size friction condim solref solmix priority contype conaffinity",
    "pairs": "geomname1 geomname2 condim friction solref",
    "tendons": "stiffness damping springlength",
    "actuators": "target gear gainprm biasprm biastype ctrlrange",
    "equalities": "type torquescale data name1 name2",
}


def test_an_mjcf_read_whole_leaves_nothing_and_a_read_that_is_deleted_is_told(monkeypatch, tmp_path):
    """Each array of the compiled model in turn is read without a record of it: what is read there alone is named."""
    fields, gone = dict[str, None](), [""]
    original = mjcf_keys.Compiled.__getattr__

    def read(self, field):
        fields[field] = None
        return getattr(self.raw, field) if field == gone[0] else original(self, field)

    monkeypatch.setattr(mjcf_keys.Compiled, "__getattr__", read)
    plain = told(tmp_path, WHOLE, "xml")[1]
    assert plain == "not modelled: softness of equality constraints: e, r"
    found = list[str]()
    for field in list(fields):
        gone[0] = field
        found += told(tmp_path, WHOLE, "xml")[1].splitlines()
    said = {line.removeprefix("not modelled: ").partition(":")[0] for line in found}
    expected = {f"{word} of {kind}" for kind, words in ATTRIBUTES.items() for word in words.split()}
    assert expected <= said, expected - said
