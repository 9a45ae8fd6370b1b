"""Write the tables of scene files into their page: `python -m tests.scene_page`."""

import re

from ephs.mechanics.scene.reference import scene_tables
from tests.scenes import ROOT

PAGE = ROOT / "docs" / "scene-file.md"


def written(text: str) -> str:
    """The page with the table of each ``<!-- table NAME -->`` below it, as the schema has it."""
    tables = scene_tables()
    block = re.compile(r"^<!-- table (.+) -->\n(?:\|.*\n)*", re.MULTILINE)
    return block.sub(lambda found: f"<!-- table {found[1]} -->\n{tables[found[1]]}\n", text)


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
