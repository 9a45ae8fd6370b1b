"""What notebooks show of a value by itself."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

import ephs
from ephs.show import draw

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def scene():
    return ephs.load(ROOT / "scenes/slider-crank.toml")


@pytest.fixture(scope="module")
def solution(scene):
    return ephs.simulate(scene, 0.05, step=1e-3)


def words_of(markup):
    """All words of a fragment of HTML, which has to be well formed."""
    return " ".join("".join(ET.fromstring(f"<div>{markup}</div>").itertext()).split())


def test_patterns_systems_and_drawings_are_pictures(scene):
    system = scene.system()
    for value in (system.pattern, system, draw(system)):
        assert ET.fromstring(value._repr_svg_()).tag.endswith("svg")


def test_equations_are_formulas(scene):
    equations = scene.system().equations()
    assert equations._repr_latex_().startswith(r"$\displaystyle \begin{aligned}")
    assert equations._repr_latex_().count(r"\\") >= len(equations)


def test_a_scene_shows_its_pattern_and_what_is_in_it(scene):
    said = scene._repr_html_()
    assert "<svg" in said
    for name in (*scene.bodies, *scene.joints, *scene.thermal, *scene.conduction):
        assert name in words_of(said)
    assert "0.8 kg" in words_of(said)


def test_a_solution_shows_its_balances(solution):
    said = words_of(solution._repr_html_())
    for word in ("slider-crank", "51 instants", "natural, 50 steps", f"{solution.energy_error.max():.1e}"):
        assert word in said
    assert f"heat{solution.heat[-1]:.4g} J" in said.replace(" heat ", "heat")


def test_a_ledger_shows_the_cells_that_it_prints(solution):
    books = solution.ledger()
    said, printed = words_of(books._repr_html_()), str(books)
    for name, entry in books.parts.items():
        assert name in said
        for value in entry.changes():
            assert f"{value:.5g}" in said and f"{value:.5g}" in printed


def test_an_empty_solution_shows_itself_too():
    scene = ephs.load(ROOT / "scenes/mbs.toml")
    empty = ephs.simulate(scene, 0.1, step=0.1, save_at=[])
    assert "empty" in words_of(empty._repr_html_())
