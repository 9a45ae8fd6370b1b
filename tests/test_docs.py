"""The pages say all public names, and are all reached."""

import importlib
import re
from pathlib import Path

import ephs
from ephs import operad
from tests.scenes import ROOT

DOCS = ROOT / "docs"
ROOMS = {"library", "mechanics", "operad", "quantity", "semantics", "show", "testing"}


def test_the_list_of_names_is_whole():
    listed = set(re.findall(r"^\.\. auto\w+:: ephs\.(\w+)$", (DOCS / "api.md").read_text("utf-8"), re.MULTILINE))
    assert set(ephs.__all__) - ROOMS <= listed
    assert {"library", "show", "testing"} <= listed and "Nesting" in operad.__all__


def there(name):
    """Whether a module has what a name of the list says."""
    parts = name.split(".")
    heads = [k for k in range(len(parts), 0, -1) if (DOCS.parent / Path(*parts[:k])).is_dir()]
    heads = [
        k for k in range(len(parts), 0, -1) if (DOCS.parent / Path(*parts[:k])).with_suffix(".py").is_file()
    ] + heads
    found = importlib.import_module(".".join(parts[: heads[0]]))
    for part in parts[heads[0] :]:
        found = getattr(found, part, None)
    return found is not None


def test_the_names_of_the_list_are_there():
    """A name that is gone ends the making of the pages."""
    names = re.findall(r"^\.\. auto\w+:: ([\w.]+)$", (DOCS / "api.md").read_text("utf-8"), re.MULTILINE)
    assert len(names) > 100
    assert not [name for name in names if not there(name)]
    assert not there("ephs.exporting.image.Nothing")


def test_every_page_is_in_the_contents():
    index = (DOCS / "index.md").read_text("utf-8")
    entries = {line for block in re.findall(r"```\{toctree\}\n(.*?)```", index, re.DOTALL) for line in block.split()}
    assert {page.stem for page in DOCS.glob("*.md")} - {"index"} <= entries


def test_no_page_loads_from_a_network():
    loading = re.compile(r'<(?:script|link|img)[^>]*(?:src|href)="https?:')
    assert not [page.name for page in DOCS.glob("*.md") if loading.search(page.read_text("utf-8"))]


def test_blocks_are_closed():
    """Fences of code come in pairs: one that opens may have a word, one that closes has none."""
    for page in (*DOCS.glob("*.md"), *DOCS.parent.glob("*.md")):
        open_at = 0
        for line in page.read_text("utf-8").splitlines():
            if line.startswith("```"):
                word = line[3:].strip()
                assert not (open_at and word), f"{page.name}: {line} within a block"
                open_at = not open_at
        assert not open_at, page.name


def test_links_have_texts_and_lead_to_pages():
    """Links read in raw Markdown, too: their texts are not left to the builder of the pages."""
    for page in (*DOCS.glob("*.md"), *DOCS.parent.glob("*.md")):
        for words, target in re.findall(r"\[([^\[\]]*)\]\(([^()\s]+)\)", _prose(page)):
            assert words.strip(), f"{page.name}: a link to {target} without a text"
            file, _, part = target.partition("#")
            if ":" in file or file.startswith("_static"):
                continue
            led = page.parent / file if file else page
            assert led.exists(), f"{page.name}: {target}"
            if part and led.suffix == ".md":
                titles = re.findall(r"^#+ (.+)$", _prose(led), re.MULTILINE)
                slugs = {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}
                assert part in slugs or f"({part})=" in _prose(led), f"{page.name}: {target}"


def _prose(page: Path) -> str:
    """The text of a page without its blocks of code."""
    return re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
