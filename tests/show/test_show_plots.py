"""Plots and reports: every axis has its unit, names stand beside the data, a page needs no network."""

import base64
import json
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.show import (
    plot_constraints,
    plot_energy,
    plot_entropy,
    plot_exergy,
    plot_exergy_flow,
    plot_motion,
    write_report,
)
from ephs.show.plots.panels import Curve, Panel
from ephs.show.plots.series import ANGLE, motion_lines, thinned, within_a_turn
from ephs.show.plots.signals import MOST, PanelGroup, packed
from tests.numerics import generators, largest
from tests.scenes import shipped
from tests.show.conftest import Altered

PLOTS = (plot_motion, plot_energy, plot_exergy, plot_entropy, plot_constraints)


@pytest.fixture(params=["crank", "circuit"])
def solution(request):
    return request.getfixturevalue(request.param)


@pytest.mark.parametrize("plot", PLOTS)
def test_every_axis_has_a_name_and_a_unit(plot, solution):
    figure = plot(solution)
    assert figure.axes[-1].get_xlabel() == "time [s]"
    for axes in figure.axes:
        assert re.fullmatch(r"[\w ()]+ \[[^\]]+\]", axes.get_ylabel()), axes.get_ylabel()
        assert "SI unit" not in axes.get_ylabel()


@pytest.mark.parametrize("plot", PLOTS)
def test_legends_are_not_over_the_data(plot, solution):
    figure = plot(solution)
    figure.canvas.draw()
    for axes in figure.axes:
        legend = axes.get_legend()
        if legend is not None:
            assert legend.get_window_extent().x0 >= axes.get_window_extent().x1 - 1
            assert legend.get_window_extent().x1 <= figure.bbox.x1 + 1


def test_the_sum_of_the_energy_ledger_is_flat(crank):
    lines = {line.get_label(): line for line in plot_energy(crank).axes[0].get_lines()}
    total = np.asarray(lines["sum less work"].get_ydata())
    scale = max(largest(line.get_ydata()) for line in lines.values())
    assert np.ptp(total) <= 1e-12 * scale


def test_negative_entropy_production_is_marked(circuit):
    bad = circuit.entropy_production.copy()
    bad[100] = -1e-6
    wrong = Altered(circuit, entropy_production=bad)
    labels = [line.get_label() for line in plot_entropy(wrong).axes[1].get_lines()]
    assert "negative" in labels
    assert "negative" not in [line.get_label() for line in plot_entropy(circuit).axes[1].get_lines()]


def test_thinning_keeps_ends_and_extremes():
    t = np.linspace(0.0, 1.0, 100_001)
    values = np.sin(7.0 * t)
    values[31_337] = 5.0
    values[77_777] = -5.0
    few_t, few = thinned(t, values)
    assert len(few) <= 2002 and len(few_t) == len(few)
    assert (few.max(), few.min(), few_t[0], few_t[-1]) == (5.0, -5.0, 0.0, 1.0)
    assert np.all(np.diff(few_t) > 0)


@given(
    length=st.integers(1, 9000),
    rng=generators,
    shorter=st.integers(0, 1),
    count=st.integers(1, 12),
)
@settings(max_examples=30, deadline=None)
def test_packed_signals_are_the_solution(length, rng, shorter, count):
    """Every packed value is a value of the curve at its instant; extremes and ends of each curve are kept."""
    t = np.cumsum(rng.random(length))
    n = max(1, length - shorter)
    curves = tuple(Curve(f"</script>{k}", rng.normal(size=n), "#000000") for k in range(count))
    text = packed(t, [PanelGroup("g", [Panel("x [m]", curves)], shown=True)])
    assert "<" not in text
    (panel,) = json.loads(text)[0]["panels"]
    times = np.frombuffer(base64.b64decode(panel["times"]), "<f8")
    assert len(times) <= 2 * MOST + 2 and (times[0], times[-1]) == (t[len(t) - n], t[-1])
    for curve, found in zip(curves, panel["curves"], strict=True):
        values = np.frombuffer(base64.b64decode(found["values"]), "<f4")
        at = np.searchsorted(t[len(t) - n :], times)
        assert np.array_equal(values, curve.values[at].astype("f4")) and found["name"] == curve.name
        assert values.max() == np.float32(curve.values.max()) and values.min() == np.float32(curve.values.min())


@given(generators, st.floats(0.0, 40.0))
def test_angles_within_a_turn_differ_by_whole_turns_and_lines_end_where_they_jump(rng, speed):
    angles = np.cumsum(rng.uniform(-1.0, 1.0, 200)) + np.linspace(0.0, speed, 200)
    found = within_a_turn(angles)
    there = ~np.isnan(found)
    turns = (angles - found)[there] / (2.0 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
    assert there[0] and largest(found[there]) <= np.pi + 1e-12
    whole = there[1:] & there[:-1]
    np.testing.assert_allclose(np.diff(found)[whole], np.diff(angles)[whole], atol=1e-12)
    jumps = np.diff(np.round(angles / (2.0 * np.pi))) != 0.0
    assert np.array_equal(~there[1:], jumps)


@pytest.mark.parametrize(("until", "round"), [(5.0, True), (0.2, False)])
def test_only_angles_that_go_round_are_drawn_within_a_turn(until, round):
    sol = ephs.simulate(shipped("slider-crank"), until)
    angles = dict(motion_lines(sol)[ANGLE])
    whole = sol.joint("bearing").coordinate[:, 0]
    assert (largest(whole) > 2.0 * np.pi) == round
    np.testing.assert_array_equal(angles["bearing"], within_a_turn(whole) if round else whole)


def test_residuals_of_rounding_are_not_drawn():
    t = np.linspace(0.0, 1.0, 5)
    for size, drawn in ((1e-15, 0), (1e-9, 1)):
        panel = Panel("gap [m]", (Curve("gap", size * t, "#000000"),), residual=True)
        assert len(json.loads(packed(t, [PanelGroup("g", [panel], shown=False)]))) == drawn


def outside_frames(page: str) -> str:
    return re.sub(r'srcdoc="[^"]*"', "", page)


def test_the_report_loads_nothing(solution, tmp_path):
    page = write_report(solution, tmp_path / "new" / "folder").read_text(encoding="utf-8")
    own = re.sub(r'xmlns(:\w+)?="[^"]*"', "", outside_frames(page))
    assert re.findall(r"https?://[^ )\"']*", own) == ["https://github.com/leeoniya/uPlot"]  # the library's own notice
    assert not re.findall(r"@import|<script src|<link (?!rel=\"icon\" href=\"data:)|fetch\(|XMLHttpRequest", own)
    ids = re.findall(r'href="(#[^"]+)"', own)
    assert {f'id="{each[1:]}"' in own for each in ids} <= {True}


def test_the_report_says_what_there_is(crank, tmp_path):
    path = write_report(crank, tmp_path)
    page = path.read_text(encoding="utf-8")
    assert path == tmp_path / "report.html"
    heat = f"{crank.heat[-1]:.4g} J"
    for words in ("<title>slider-crank</title>", "natural", "Heat from friction", heat, "slider", "housing"):
        assert words in page
    pictures = re.findall(r"<svg.*?</svg>", outside_frames(page), flags=re.DOTALL)
    assert len(pictures) == 2 and all(ElementTree.fromstring(picture) is not None for picture in pictures)
    headings = re.findall(r"<h2>(.*?)</h2>", outside_frames(page))
    expected = "Motion, Signals, Balances, Summary, At the end, Schematic, Interconnection pattern"
    assert headings == expected.split(", ")
    assert page.count('<div class="player"') == 1 and "<iframe" not in page


def test_a_system_without_scene_has_no_animation(circuit, tmp_path):
    page = write_report(circuit, tmp_path).read_text(encoding="utf-8")
    assert 'class="player"' not in page and "<h2>Motion</h2>" not in page
    assert write_report(circuit, tmp_path).read_text(encoding="utf-8") == page


def test_names_cannot_break_the_page(circuit, tmp_path):
    rude = Altered(circuit, name="<b>&")
    assert "<title>&lt;b&gt;&amp;</title>" in write_report(rude, tmp_path).read_text(encoding="utf-8")


def test_exergy_flows_from_sources_to_sinks(circuit):
    figure = plot_exergy_flow(circuit)
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert any(text.startswith("osc.pe gives") and "100.0 %" in text for text in texts)
    assert any(text.startswith("mf destroys") for text in texts)


def test_figures_show_themselves_in_notebooks(circuit):
    assert plot_exergy_flow(circuit)._repr_png_().startswith(b"\x89PNG")
    assert plot_energy(circuit)._repr_png_().startswith(b"\x89PNG")
