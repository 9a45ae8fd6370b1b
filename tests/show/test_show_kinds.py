"""Every picture of a solution by its name: units on all axes, lines that are told apart in grey, files for print."""

import re

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb

import ephs
from ephs.show import ShowError, plot, plot_mechanism, plot_motion, plot_phase, plot_wrenches
from ephs.show.kinds import KINDS
from ephs.show.shared.palette import CYCLE, dashes
from tests.oscillator import free_oscillator
from tests.scenes import shipped


@pytest.fixture(scope="module")
def oscillator() -> ephs.Solution:
    return ephs.simulate(free_oscillator(), 6.0, initial={"pe.q": 1.0}, step=0.01)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ending", ["pdf", "svg", "png"])
def test_every_kind_is_drawn_and_fit_for_print(crank, kind, ending, tmp_path):
    before = dict(matplotlib.rcParams)
    figure = crank.plot(kind)
    figure.savefig(tmp_path / f"figure.{ending}")
    assert (tmp_path / f"figure.{ending}").stat().st_size > 2000
    assert figure.get_figwidth() <= 7.2  # the width of a page
    assert dict(matplotlib.rcParams) == before
    assert figure._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize("kind", ["phase", "wrenches"])
def test_every_axis_has_a_unit(crank, kind):
    for axes in crank.plot(kind).axes:
        assert re.search(r"\[[^\]]+\]$", axes.get_ylabel())
        assert not axes.get_xlabel() or re.search(r"\[[^\]]+\]$", axes.get_xlabel())


def test_lines_are_told_apart_without_colour(crank):
    for axes in plot_motion(crank).axes:
        looks = [
            (line.get_linestyle(), round(float(np.dot(to_rgb(line.get_color()), (0.3, 0.59, 0.11))), 2))
            for line in axes.get_lines()
        ]
        assert len(set(looks)) == len(looks)
    assert len({(CYCLE[k % len(CYCLE)], str(dashes(k))) for k in range(35)}) == 35


def test_unknown_kinds_are_answered_with_what_is_near(crank):
    with pytest.raises(ShowError, match=r"found kind 'enrgy', expected one of motion, phase.*did you mean \"energy\""):
        crank.plot("enrgy")
    with pytest.raises(ShowError, match="choose one of these"):
        plot(crank, "zzz")


def test_a_phase_portrait_is_the_orbit(oscillator):
    axes = plot_phase(oscillator).axes[0]
    x, y = axes.get_lines()[0].get_data()
    assert np.allclose(x**2 + y**2, 1.0, atol=1e-3)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("pe.q [m]", "ke.p [kg m/s]")
    turned = plot_phase(oscillator, ("ke.p", "pe.q")).axes[0].get_lines()[0]
    assert np.array_equal(turned.get_xdata(), y)


def test_a_phase_portrait_of_a_joint_and_a_freedom(crank):
    figure = plot_phase(crank, "bearing", "wrist angle")
    assert [axes.get_xlabel() for axes in figure.axes] == ["bearing [rad]", "wrist angle [rad]"]
    assert np.array_equal(figure.axes[0].get_lines()[0].get_ydata(), crank.joint("bearing").rate[:, 0])


def test_lines_end_where_a_rotation_vector_starts_anew(crank):
    lines = {line.get_label(): line.get_ydata() for axes in plot_motion(crank).axes for line in axes.get_lines()}
    turning = np.asarray(lines["big-end ry"], dtype=float)
    assert np.abs(np.diff(crank.joint("big-end").coordinate[:, 1])).max() > np.pi
    assert np.nanmax(np.abs(np.diff(turning))) < 1.0


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (("bering",), "degree of freedom 'bering'.*did you mean \"bearing\""),
        ((("bodies.rod.pe.q", "bodies.rod.ke.p"),), "scalar state 'bodies.rod.pe.q'"),
    ],
)
def test_portraits_of_nothing_are_refused(crank, asked, words):
    with pytest.raises(ShowError, match=words):
        plot_phase(crank, *asked)


def test_wrenches_are_those_of_the_solution(crank):
    figure = plot_wrenches(crank, "cylinder")
    force, moment = figure.axes
    wrench = crank.joint("cylinder").wrench
    for axes, part in ((force, wrench[:, 3:]), (moment, wrench[:, :3])):
        assert all(
            np.array_equal(line.get_ydata(), column) for line, column in zip(axes.get_lines(), part.T, strict=True)
        )
    with pytest.raises(ShowError, match=r"joint 'cylindr'.*did you mean .cylinder."):
        plot_wrenches(crank, "cylindr")


def test_indeterminate_components_are_named():
    sol = ephs.simulate(shipped("four-bar"), 0.05, step=0.01)
    titles = [axes.get_title(loc="right") for axes in plot_wrenches(sol).axes]
    assert titles[:2] == ["z indeterminate", "x, y indeterminate"]


def test_the_mechanism_stands_beside_its_pattern(crank):
    pattern, still = plot_mechanism(crank, at=0.25).axes
    boxes = {text.get_text() for text in pattern.texts}
    names = {name.strip() for text in still.texts for name in text.get_text().split(",")}
    assert {"crank", "rod", "slider", "bearing"} <= boxes & names
    assert pattern.get_position().x1 < still.get_position().x0
    assert any("mm" in name for name in names)


def test_a_scene_is_drawn_as_it_starts(crank):
    stills = [plot_mechanism(of).axes[1] for of in (crank.scene, crank)]
    found = [{name for text in still.texts for name in text.get_text().split(", ")} for still in stills]
    assert found[0] == found[1] and {"crank", "rod", "slider"} < found[0]


def test_stills_outside_of_the_run_and_of_circuits_are_refused(crank, oscillator):
    with pytest.raises(ShowError, match=r"time 9 s, expected one from 0 to 0\.5 s"):
        plot_mechanism(crank, at=9.0)
    for kind, words in (("mechanism", "no mechanism"), ("wrenches", "no joints")):
        with pytest.raises(ShowError, match=words):
            oscillator.plot(kind)
