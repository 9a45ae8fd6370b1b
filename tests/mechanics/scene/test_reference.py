"""The reference of scene files says all that the schema says, in the schema's words."""

import re

import pytest

from ephs.mechanics.scene import schema
from ephs.mechanics.scene.reference import TOP, scene_tables
from tests.scene_page import PAGE, written

MODELS = [each for each in vars(schema).values() if isinstance(each, type) and issubclass(each, schema.EntryTable)]


def rows(table: str) -> dict[str, list[str]]:
    lines = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in table.splitlines()[2:]]
    return {line[0].strip(" `"): line[1:] for line in lines}


@pytest.mark.parametrize("model", [each for each in MODELS if not each.__subclasses__()], ids=lambda m: m.__name__)
def test_every_key_of_every_table_is_there_with_its_words(model):
    tables = scene_tables()
    said = model.__doc__.splitlines()[0].strip("`")
    inner = model.__name__.removesuffix("Entry").lower()
    found = rows(tables[TOP if model is schema.scene_file() else said if said.startswith("[") else inner])
    assert list(found) == list(model.model_fields)
    for key, field in model.model_fields.items():
        assert field.description is None or field.description in found[key][2]
        assert (found[key][1] == "required") is field.is_required()


def test_types_are_in_words():
    tables = scene_tables()
    body, joint, world = (rows(tables[f"[{name}]"]) for name in ("bodies.NAME", "joints.NAME", "world"))
    assert body["mass"][0] == "number ≥ 0"
    assert body["inertia"][0] == "3 to 6 numbers"
    assert joint["bodies"][0] == "2 texts"
    assert joint["friction"][:2] == ["number or list of numbers or rows of numbers", "`0.0`"]
    assert joint["frame1"][0] == "table frame" and body["shapes"][0] == "list of table shape"
    assert rows(tables[TOP])["joints"][0] == "tables [joints.NAME]"
    assert world["temperature"][:2] == ["number > 0", "`293.15`"]
    assert not any(
        "{" in cell or "null" in cell for table in tables.values() for row in rows(table).values() for cell in row
    )


def test_the_page_shows_every_table_once_as_the_schema_has_it():
    page = PAGE.read_text(encoding="utf-8")
    shown = re.findall(r"^<!-- table (.+) -->$", page, re.MULTILINE)
    assert sorted(shown) == sorted(scene_tables())
    assert written(page) == page, "run python -m tests.scene_page"
