"""What notebooks show of a value by itself."""

import xml.etree.ElementTree as ET

import pytest

import ephs
from ephs.show import draw
from ephs.show.notebook import MANY
from ephs.show.shared.palette import RED
from tests.scenes import shipped


@pytest.fixture(scope="module")
def scene():
    return shipped("slider-crank")


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
    totals = solution.ledger()
    said, printed = words_of(totals._repr_html_()), str(totals)
    for name, entry in totals.parts.items():
        assert name in said
        for value in entry.changes():
            assert f"{value:.5g}" in said and f"{value:.5g}" in printed


def test_an_empty_solution_shows_itself_too():
    scene = shipped("mbs")
    empty = ephs.simulate(scene, 0.1, step=0.1, save_at=[])
    assert "empty" in words_of(empty._repr_html_())


def test_solutions_dynamics_and_equilibria_show_their_mechanism(scene, solution):
    values = {
        "Solution of slider-crank": solution,
        "Dynamics of slider-crank": ephs.dynamics(scene),
        "Equilibrium of four-bar": ephs.equilibrium(shipped("four-bar")),
    }
    for title, value in values.items():
        said = value._repr_html_()
        drawing = ET.fromstring(said[said.index("<svg") : said.index("</svg>") + len("</svg>")])
        assert len(list(drawing.iter("{http://www.w3.org/2000/svg}polygon"))) >= 3 and title in words_of(said)


def test_a_mechanism_of_many_bodies_shows_no_schematic():
    said = ephs.dynamics(shipped("chain"))._repr_html_()
    bodies = len(shipped("chain").bodies)
    assert ("<svg" in said) == (bodies <= MANY)


def test_a_linear_system_shows_each_eigenvalue():
    linear = ephs.linearize(shipped("four-bar"))
    said = linear._repr_html_()
    assert said.count("<circle") == len(linear.eigenvalues) and said.count(RED) == int(
        (linear.eigenvalues.real > 0).sum()
    )
    assert "not stable" in words_of(said)


def test_a_check_report_shows_each_check():
    pattern = ephs.Pattern.from_text("q: displacement; p: momentum; a(q=q); b(p=p); c(q=q, p=p)")
    parts = {"a": ephs.library.spring(k=1.0), "b": ephs.library.point_mass(m=1.0), "c": ephs.library.pkc()}
    report = pattern(parts).check()
    said = words_of(report._repr_html_())
    assert "Check: all hold" in said and all(item.name in said and item.detail in said for item in report.items)


def test_motions_show_their_ranges(solution):
    for value, words in ((solution.joint("bearing"), "Motion of joint bearing"), (solution.body("crank"), "velocity")):
        assert words in words_of(value._repr_html_())
    last = solution.joint("bearing").coordinate[-1, 0]
    assert f"{last:.5g}" in words_of(solution.joint("bearing")._repr_html_())
