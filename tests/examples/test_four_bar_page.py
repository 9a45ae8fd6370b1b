"""The page with sliders: what it plays are motions of a four-bar, and it needs no network."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def written():
    patch = pytest.MonkeyPatch()
    patch.syspath_prepend(str(ROOT / "docs"))
    import four_bar_page

    ends = {
        path: (words, unit, values[[0, -1]], more) for path, (words, unit, values, more) in four_bar_page.VARIED.items()
    }
    patch.setattr(four_bar_page, "VARIED", ends)
    patch.setattr(four_bar_page, "INSTANTS", 40)
    text = four_bar_page.whole()
    patch.undo()
    sys.modules.pop("four_bar_page", None)
    return text


def test_the_bars_keep_the_lengths_that_the_sliders_say(written):
    data = json.loads(re.search(r"const data = (\{.*?\});\n", written, re.DOTALL).group(1))
    couplers, supports, torques = (slider["values"] for slider in data["sliders"])
    points = np.array(data["points"]).reshape(len(couplers), len(supports), len(torques), 41, 2, 2) / 1000.0
    pin, knee = points[..., 0, :], points[..., 1, :]
    assert np.linalg.norm(pin, axis=-1) == pytest.approx(0.3, abs=2e-3)
    for k, length in enumerate(couplers):
        assert np.linalg.norm(knee[k] - pin[k], axis=-1) == pytest.approx(length, abs=2e-3)
    for k, distance in enumerate(supports):
        assert np.linalg.norm(knee[:, k] - [distance, 0.0], axis=-1) == pytest.approx(0.7, abs=2e-3)
    rates = np.array(data["rate"]).reshape(*points.shape[:4])
    assert (rates[:, :, -1].mean(axis=-1) > rates[:, :, 0].mean(axis=-1)).all()  # more torque, more speed
    assert (np.diff(np.array(data["heat"]), axis=1) >= 0.0).all()


def test_it_needs_no_network(written):
    assert set(re.findall(r"\w+://[^\"' ]+", written)) == {"http://www.w3.org/2000/svg"}
    assert not re.search(r"<(link|img|iframe)|\bsrc=|\bfetch\(|import\(", written)
