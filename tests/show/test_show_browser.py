"""Pages as a browser shows them that has no network: something is seen, it moves, and nothing is asked for."""

import time

import numpy as np
import pytest

import ephs
from ephs.show import animate, write_report
from tests.show.browser import Tab, opened

LOCAL = ("file:", "data:", "blob:", "about:")


@pytest.fixture(scope="module")
def crank() -> ephs.Solution:
    return ephs.simulate(ephs.load("scenes/slider-crank.toml"), 2.0, step=5e-3)


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
        if (np.abs(second - first).max(axis=2) > 0.1).sum() > 200:
            break
    return first, second


@pytest.mark.parametrize("options", [{}, {"wrenches": True, "heat": True}], ids=["plain", "loaded"])
def test_the_mechanism_is_seen_and_moves_without_a_network(crank, tmp_path, options):
    page = animate(crank, tmp_path / "film.html", duration=3.0, **options)
    with opened(tmp_path / "film.html") as tab:
        first, second = watched(tab)
        assert (np.abs(second - first).max(axis=2) > 0.1).sum() > 200  # the bodies moved
        assert [url for url in tab.requests if not url.startswith(LOCAL)] == []
        assert tab.complaints == []
        legend = tab.evaluate("(document.querySelector('#legend') || {innerText: ''}).innerText")
    assert ("force on body 2" in legend) == ("K" in legend) == bool(options)
    assert ('id="legend"' in page.html) == bool(options)


def test_the_report_plays_without_a_network(crank, tmp_path):
    with opened(write_report(crank, tmp_path)) as tab:
        tab.evaluate("document.querySelector('iframe').scrollIntoView()")
        tab.until("document.querySelector('iframe').contentDocument.querySelector('canvas') !== null")
        assert [url for url in tab.requests if not url.startswith(LOCAL)] == []
        assert tab.complaints == []


def test_a_page_that_asks_for_more_is_caught(tmp_path):
    """The watch itself works: it sees a request that leaves the page."""
    page = tmp_path / "asks.html"
    page.write_text('<body><img src="https://example.org/picture.png"></body>')
    with opened(page) as tab:
        tab.until("document.readyState === 'complete'")
        tab.picture()
        assert any(url.startswith("https://example.org") for url in tab.requests)
