"""Each number of a format either changes the scene, or is named, or concerns solvers and pictures alone.

A line of the files in `lost` sets one number of a model that holds one of each element, at a place of its text. It is
used, where it gives another scene; or the words of its note follow, or nothing where it has no effect on motion.
"""

import re
import sys
from collections import Counter
from pathlib import Path

import pytest

import ephs
from ephs.mechanics.imports import file_element, mjcf_keys
from ephs.mechanics.imports.read import read_model

FOLDER = Path(__file__).parent / "lost"
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


SDF = """<sdf version="1.7"><world name="w"><gravity>0 0 -9.81</gravity>{world}<model name="floor"><static>1</static>
<link name="l"><collision name="c"><geometry><plane/></geometry></collision></link></model>
<model name="m"><pose>0 0 2 0 0 0</pose>{model}<link name="b"><inertial><mass>1</mass>{inertial}</inertial>
<collision name="c"><geometry><sphere><radius>1</radius></sphere></geometry>{collision}</collision>{link}</link>
<joint name="j" type="revolute"><parent>world</parent><child>b</child>{joint}<axis><xyz>0 1 0</xyz>
<limit><lower>-1</lower><upper>1</upper>{limit}</limit><dynamics>{dynamics}</dynamics>{axis}</axis></joint></model>
</world></sdf>"""


MJCF = """<mujoco><compiler autolimits="true" angle="radian"/><option {option}>{flags}</option><worldbody>
<geom name="floor" type="plane" size="1 1 1"/><body name="b" pos="0 0 3" {body}>
<joint name="j" type="slide" axis="0 0 1" range="-1 1" frictionloss="0.1" damping="1" {joint}/>
<geom name="g" size="1" {geom}/><site name="s"/></body>
<body name="c" pos="9 0 3"><freejoint name="f"/><geom name="h" size="1" contype="2" conaffinity="2"/></body></worldbody>
<contact><pair name="p" geom1="floor" geom2="h" {pair}/></contact>
<equality><joint name="e" joint1="j" active="false" {equality}/></equality>
<tendon><fixed name="t" {tendon}><joint joint="j" coef="1"/></fixed></tendon>
<actuator><general name="a" joint="j" ctrlrange="-1 1" {actuator}/></actuator></mujoco>"""
MODELS = {"urdf": URDF, "sdf": SDF, "xml": MJCF}


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


def rows():
    """Format, place, text and what becomes of it, of files with a line for each under a heading."""
    for suffix in MODELS:
        for part in (FOLDER / f"{suffix}.txt").read_text(encoding="utf-8").removeprefix("= ").split("\n= "):
            place, *lines = part.split("\n")
            yield from ((suffix, place, *line.split(" => ")) for line in lines if line)


@pytest.mark.parametrize(
    ("suffix", "place", "row", "found"),
    [pytest.param(*row, marks=[pytest.mark.long] * (row[0] == "xml")) for row in rows()],
)
def test_each_number_of_a_format_is_used_or_named_or_of_no_effect(suffix, place, row, found, tmp_path):
    text = MODELS[suffix]
    plain, already = told(tmp_path, blank(text), suffix)
    tables, said = told(tmp_path, given(text, place, row), suffix)
    if found == "used":
        assert repr(tables) != repr(plain)
    elif found == "nothing":
        assert repr(tables) == repr(plain) and said == already
    else:
        assert re.search(f"not modelled: {found}", said), said


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


WHOLE = """<mujoco><compiler autolimits="true" angle="radian"/><option gravity="0 0 -1" wind="1 0 0">
<flag energy="enable" fwdinv="enable"/></option><worldbody>
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
