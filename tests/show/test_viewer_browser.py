"""A mechanism posed by sliders, as a browser shows it."""

import json

import numpy as np
import pytest

from tests.show.browser import opened
from tests.show.test_viewer import serving

HERE = "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1"


def test_the_page_moves_the_mechanism(tmp_path):
    blank = tmp_path / "blank.html"
    blank.write_text("<!DOCTYPE html>", encoding="utf-8")
    with serving("four-bar") as (posed, port), opened(blank, HERE) as tab:
        tab.call("Page.navigate", url=f"http://127.0.0.1:{port}/")
        tab.until("document.body && document.body.dataset.ready === 'yes'")
        first = tab.pixels()
        tab.evaluate(
            "(() => { const s = document.querySelector('#sliders input[name=main]'); s.value = 0.9;"
            " s.dispatchEvent(new Event('input')); })()"
        )
        tab.until("document.body.dataset.posed !== undefined")
        posing = json.loads(tab.evaluate("document.body.dataset.posed"))
        second = tab.pixels()
        assert tab.complaints == []
    assert posing["main"] == [pytest.approx(0.9)]
    assert posing["pivot"] == pytest.approx(posed.scene.joint("pivot").coordinate.tolist())
    assert (np.abs(second - first).max(axis=2) > 0.1).sum() > 200
