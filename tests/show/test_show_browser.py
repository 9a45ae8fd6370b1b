"""Pages as a browser shows them that has no network: something is seen, it moves, and nothing is asked for."""

import json
import time

import numpy as np
import pytest

import ephs
from ephs.show import animate, write_report
from tests.numerics import largest
from tests.scenes import shipped
from tests.show.browser import Tab, opened

LOCAL = ("file:", "data:", "blob:", "about:")


@pytest.fixture(scope="module")
def crank() -> ephs.Solution:
    return ephs.simulate(shipped("slider-crank"), 2.0, step=5e-3)


def drawn(pixels: np.ndarray) -> np.ndarray:
    """Where there is colour: bodies, arrows, joints; not the floor, the shadow, the time bar and its frame."""
    return np.ptp(pixels, axis=2) > 0.12


def watched(tab: Tab) -> tuple[np.ndarray, np.ndarray]:
    """Two looks at the mechanism, once there is one, some frames apart."""
    tab.until("document.querySelector('canvas') !== null")
    tab.evaluate("document.querySelectorAll('[role=alert]').forEach(each => each.remove())")
    end = time.monotonic() + 60.0
    while drawn(first := tab.pixels()[:-80, 320:]).sum() < 500:
        if time.monotonic() > end:
            raise TimeoutError("nothing was drawn")
    for _ in range(50):
        second = tab.pixels()[:-80, 320:]
        if (largest(second - first, axis=2) > 0.1).sum() > 200:
            break
    return first, second


@pytest.mark.parametrize("options", [{}, {"wrenches": True, "colour": "temperature"}], ids=["plain", "loaded"])
def test_the_mechanism_is_seen_and_moves_without_a_network(crank, tmp_path, options):
    page = animate(crank, tmp_path / "film.html", duration=3.0, **options)
    with opened(tmp_path / "film.html") as tab:
        first, second = watched(tab)
        assert (largest(second - first, axis=2) > 0.1).sum() > 200  # the bodies moved
        assert [url for url in tab.requests if not url.startswith(LOCAL)] == []
        assert tab.complaints == []
        legend = tab.evaluate("(document.querySelector('#legend') || {innerText: ''}).innerText")
    assert ("force on body 2" in legend) == ("K" in legend) == bool(options)
    assert ('id="legend"' in page.html) == bool(options)


def test_the_report_plays_without_a_network(crank, tmp_path):
    with opened(write_report(crank, tmp_path)) as tab:
        tab.until("document.querySelector('.player canvas') !== null")
        first = tab.evaluate("document.querySelector('.player output').textContent")
        tab.until(f"document.querySelector('.player output').textContent !== {json.dumps(first)}")
        seen = tab.pixels()
        assert drawn(seen).sum() > 2000
        assert [url for url in tab.requests if not url.startswith(LOCAL)] == []
        assert tab.complaints == []


def looks(tab: Tab) -> str:
    return tab.evaluate("document.querySelector('.player canvas').toDataURL()")


def test_the_player_is_steered(crank, tmp_path):
    with opened(write_report(crank, tmp_path)) as tab:
        tab.until("document.querySelector('.player canvas') !== null")
        tab.evaluate("document.querySelector('.player button').click()")  # pause
        slider, clock = (
            "document.querySelector('.player input[type=range]')",
            "document.querySelector('.player output')",
        )
        tab.evaluate(f"{slider}.value = 30; {slider}.dispatchEvent(new Event('input'))")
        assert tab.evaluate(f"{clock}.textContent") == "1.000 s"
        still = looks(tab)
        for name in ("names", "traces", "follow"):
            tick = f"[...document.querySelectorAll('.player label')].find(each => each.textContent === '{name}')"
            tab.evaluate(f"{tick}.querySelector('input').click()")
            assert looks(tab) != still
            tab.evaluate(f"{tick}.querySelector('input').click()")
            assert looks(tab) == still
        canvas = "document.querySelector('.player canvas')"
        press = "new KeyboardEvent('keydown', {key: 'ArrowRight'})"
        tab.evaluate(f"{canvas}.dispatchEvent({press})")
        assert tab.evaluate(f"{clock}.textContent") == "1.033 s"
        tab.evaluate("document.dispatchEvent(new CustomEvent('seek', {detail: 1.0}))")  # as a click on a plot does
        assert looks(tab) == still
        assert tab.complaints == []


def test_without_webgl_the_page_is_flat(crank, tmp_path):
    animate(crank, tmp_path / "film.html", wrenches=True)
    with opened(tmp_path / "film.html", "--disable-3d-apis") as tab:
        tab.until("document.querySelector('.player canvas') !== null")
        assert drawn(tab.pixels()).sum() > 2000


def test_plots_are_picked_zoomed_and_follow_the_motion(crank, tmp_path):
    with opened(write_report(crank, tmp_path)) as tab:
        tab.until("document.querySelectorAll('#plots canvas').length > 2")
        count = "document.querySelectorAll('#plots figure').length"
        legend = "[...document.querySelectorAll('#plots .u-label')].map(each => each.textContent).join()"
        before = tab.evaluate(count)
        # values of the animation's time stand in the legends, rounding as zero
        values = "[...document.querySelectorAll('#plots .u-value')].map(each => each.textContent)"
        tab.until(f"{values}.every(each => each !== '')")
        assert not [value for value in tab.evaluate(values) if "e\u22121" in value]
        assert "least production" not in tab.evaluate(legend)
        pick = "[...document.querySelectorAll('#picker label')].find(each => each.textContent === 'least production')"
        tab.evaluate(f"{pick}.querySelector('input').click()")
        assert tab.evaluate(count) == before + 1 and "least production" in tab.evaluate(legend)
        tab.evaluate(f"{pick}.querySelector('input').click()")
        assert tab.evaluate(count) == before
        search = "document.getElementById('find')"
        tab.evaluate(f"{search}.value = 'energy kin'; {search}.dispatchEvent(new Event('input'))")
        shown = "[...document.querySelectorAll('#picker label:not([hidden])')].map(each => each.textContent).join()"
        assert tab.evaluate(shown) == "kinetic"
        # a drag over one plot zooms all of them
        tab.evaluate("document.querySelector('#plots figure').scrollIntoView()")
        left, top, width = tab.evaluate(
            "(({left, top, width}) => [left, top, width])(document.querySelector('.u-over').getBoundingClientRect())"
        )
        moves = (("mouseMoved", 0.2, 0), ("mousePressed", 0.2, 1), ("mouseMoved", 0.6, 1), ("mouseReleased", 0.6, 0))
        spans = "uPlot.sync('time').plots.map(({scales}) => scales.x.max - scales.x.min)"
        assert np.allclose(tab.evaluate(spans), 2.0)
        for kind, share, buttons in moves:
            place = {"x": left + share * width, "y": top + 20.0}
            button = "left" if kind != "mouseMoved" or buttons else "none"
            tab.call("Input.dispatchMouseEvent", type=kind, button=button, buttons=buttons, clickCount=1, **place)
            tab.picture()
        tab.until(f"{spans}.every(span => Math.abs(span - 0.8) < 0.05)")
        # the line of the animation's time moves over the plots
        picture = "document.querySelector('#plots canvas').toDataURL()"
        tab.until(f"{picture} !== {json.dumps(tab.evaluate(picture))}")
        assert tab.complaints == []


def test_a_page_that_asks_for_more_is_caught(tmp_path):
    """The watch itself works: it sees a request that leaves the page."""
    page = tmp_path / "asks.html"
    page.write_text('<body><img src="https://example.org/picture.png"></body>')
    with opened(page) as tab:
        tab.until("document.readyState === 'complete'")
        tab.picture()
        assert any(url.startswith("https://example.org") for url in tab.requests)
