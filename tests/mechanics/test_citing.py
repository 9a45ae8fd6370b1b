"""What is cited is what was used, and the entries are there."""

import re
import tomllib
from types import SimpleNamespace

import pytest

import ephs
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.runs.citing import ALWAYS, FORM_SOURCES, METHOD_SOURCES, bibliography
from tests.scenes import ROOT, shipped

SHIPPED = tuple(METHODS)  # before any test registers its own
FILE = ROOT / "ephs" / "mechanics" / "references.bib"


def keys(text: str) -> set[str]:
    return set(re.findall(r"@\w+\{([^,]+),", text))


def run_with(**stats: object) -> SimpleNamespace:
    """A run's statistics, which decide."""
    return SimpleNamespace(stats=stats)


def test_every_entry_of_the_file_is_read():
    text = FILE.read_text(encoding="utf-8")
    assert list(bibliography()) == re.findall(r"^@\w+\{(.*),$", text, re.MULTILINE)
    assert all(entry.count("{") == entry.count("}") for entry in bibliography().values())


def test_every_method_has_its_sources():
    assert set(METHOD_SOURCES) == set(SHIPPED)
    named = {key for table in (METHOD_SOURCES, FORM_SOURCES) for sources in table.values() for key in sources}
    assert named | set(ALWAYS) <= set(bibliography())


@pytest.mark.parametrize("name", METHOD_SOURCES)
def test_a_run_cites_its_method_and_no_other(name):
    others = {key for sources in METHOD_SOURCES.values() for key in sources} - set(METHOD_SOURCES[name])
    found = keys(ephs.cite(run_with(method=name)))
    assert found == {*ALWAYS, *METHOD_SOURCES[name]} and not found & others


def test_a_run_that_changed_its_method_cites_both():
    found = keys(ephs.cite(run_with(method="rk87, radau")))
    assert {*METHOD_SOURCES["rk87"], *METHOD_SOURCES["radau"]} <= found


def test_the_reduced_form_is_cited_where_it_was_solved(tmp_path):
    scene = shipped("mbs")
    for method, reduced in (("rk54", True), ("natural", False)):
        solution = ephs.simulate(scene, 0.01, method=method, step=1e-3)
        solution.save(tmp_path / "run.nc")
        assert ("Featherstone2008" in keys(ephs.cite(solution))) is reduced
        assert ephs.cite(ephs.load_solution(tmp_path / "run.nc")) == ephs.cite(solution)


def test_the_version_is_that_of_the_package():
    with (ROOT / "pyproject.toml").open("rb") as file:
        version = tomllib.load(file)["project"]["version"]
    assert f"version = {{{version}}}" in bibliography()["ephs"]
    assert f"version {version}," in bibliography()["ephs"]


def test_what_pages_cite_is_in_the_file():
    cited = set()
    for page in (ROOT / "docs").glob("*.md"):
        for group in re.findall(r"\{cite:[pt]\}`([^`]+)`", page.read_text(encoding="utf-8")):
            cited |= {key.strip() for key in group.split(",")}
    assert cited <= set(bibliography())
