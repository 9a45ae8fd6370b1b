"""What a scene's elements declare of their numbers and names is all that there is of them."""

import json
from dataclasses import fields, replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from ephs.mechanics.scene.element import HOLDERS, OUTSIDE
from ephs.mechanics.scene.flexible import Strain
from ephs.mechanics.scene.model import ELEMENTS, KINDS, Joint, World
from ephs.mechanics.scene.rescaled import rescaled
from ephs.mechanics.scene.schema import SECTIONS
from ephs.mechanics.scene.soundness import check_scene
from tests.scenes import SCENES

PLAIN = {section: kind for section, kind in ELEMENTS.items() if section not in KINDS}
BESIDE = {Joint: {"coordinate", "limits"}}
EXPONENTS = st.tuples(*[st.integers(-30, 30)] * 3)


def is_number(kind):
    return getattr(kind, "__origin__", kind) is float or "ndarray" in str(kind)


@pytest.mark.parametrize("kind", [*PLAIN.values(), World, Strain], ids=lambda kind: kind.__name__)
def test_every_number_has_a_dimension(kind):
    found = {each.name for each in fields(kind) if is_number(each.type)}
    assert found - BESIDE.get(kind, set()) == set(kind.numbers)


@pytest.mark.parametrize("kind", PLAIN.values(), ids=lambda kind: kind.__name__)
def test_every_reference_says_of_what(kind):
    assert set(kind.names) <= {each.name for each in fields(kind)} - {"name"}
    assert set(kind.names.values()) <= set(OUTSIDE)


def test_every_kind_of_name_leads_to_sections_that_scenes_have():
    assert set(HOLDERS) == set(OUTSIDE)
    assert {section for sections in HOLDERS.values() for section in sections} < set(ELEMENTS)


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_names_that_nothing_has_are_found_in_results(path):
    scene = ephs.load(path)
    check_scene(scene)
    wanted = [("body1", "body"), ("heat", "thermal node")]
    for (name, joint), (key, what) in product(list(scene.joints.items())[:1], wanted):
        wrong = {**scene.joints, name: joint.changed(**{key: "nobody"})}
        with pytest.raises(ValueError, match=f"there is no {what} nobody"):
            check_scene(replace(scene, joints=wrong))


def bounds(schema):
    """Least numbers and whether they are excluded, of all that a key may be."""
    found = [(schema[word], word != "minimum") for word in ("minimum", "exclusiveMinimum") if word in schema]
    inner = [*schema.get("anyOf", ()), *([schema["items"]] if "items" in schema else ())]
    return {*found, *(bound for each in inner for bound in bounds(each))}


@pytest.mark.parametrize("section", PLAIN)
def test_files_and_parameters_have_the_same_ranges(section):
    properties = SECTIONS[section].model_json_schema()["properties"]
    for key, number in ELEMENTS[section].numbers.items():
        if key in properties:
            assert bounds(properties[key]) == ({number.least} - {None}), key


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_units_come_back_to_the_bit(path):
    scene = ephs.load(path)
    before = scene_to_text(scene)

    @settings(max_examples=3, deadline=None)
    @given(exponents=EXPONENTS)
    def law(exponents):
        sizes = [2.0**k for k in exponents]
        there = rescaled(scene, *sizes)
        check_scene(there)
        assert scene_to_text(rescaled(there, *(1.0 / size for size in sizes))) == before
        assert scene_to_text(scene_from_text(before)) == before

    law()


def test_numbers_have_the_units_that_physics_gives_them():
    """Force is mass times acceleration, a moment force times arm, inertia mass times the square of an arm."""
    unit = {
        (section, key): number.unit(3.0, 5.0, 7.0, ())
        for section, kind in ELEMENTS.items()
        for key, number in kind.numbers.items()
        if number.each < 0
    }
    force = 5.0 * 3.0 / 49.0
    expected = {
        ("bodies", "mass"): 5.0, ("bodies", "inertia"): 45.0, ("springs", "stiffness"): force / 3.0,
        ("springs", "damping"): force * 7.0 / 3.0, ("loads", "force"): force, ("loads", "moment"): 3.0 * force,
        ("conduction", "conductance"): 3.0 * force / 7.0, ("motors", "constant"): 21.0 * force,
        ("cylinders", "bulk"): force / 9.0, ("markers", "at"): 3.0,
    }  # fmt: skip
    for key, value in expected.items():
        np.testing.assert_allclose(unit[key], value, rtol=1e-14)
    np.testing.assert_allclose(unit["bodies", "twist"] * 7.0, [1.0] * 3 + [3.0] * 3, rtol=1e-15)


def test_springs_of_older_documents_name_each_end():
    before = scene_to_text(ephs.load(next(path for path in SCENES if path.stem == "screw-press")))
    data = json.loads(before)
    for spring in data["springs"].values():
        spring["body1"], spring["body2"] = spring.pop("bodies")
        for key in ("at1", "at2"):
            spring[key] = {"shape": [3], "values": spring[key]}
    assert data["springs"]
    assert scene_to_text(scene_from_text(json.dumps(data))) == before
