"""Pages that simulate, in a browser: a slider that moves gives the motion of a run here with that number."""

import json
from pathlib import Path

import pytest

import ephs
from ephs.mechanics.scene.parameters import varied
from tests.show.browser import opened

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 1.0
READY = "document.body.dataset.ready === 'yes'"
MOVE = """(() => {
  const slider = [...document.querySelectorAll('#sliders input')].find((each) => each.name === %s);
  slider.value = %r;
  slider.dispatchEvent(new Event('input'));
})()"""


def ends(tab):
    told = json.loads(tab.evaluate("document.body.dataset.end"))
    names = tab.evaluate("JSON.stringify(JSON.parse(document.getElementById('live').textContent).curves)")
    return dict(zip((curve["name"] for curve in json.loads(names)), told, strict=True))


@pytest.mark.parametrize("name", ["slider-crank", "four-bar"])
def test_a_slider_gives_the_motion_of_a_run_here(tmp_path, name):
    scene = ephs.load(ROOT / f"scenes/{name}.toml")
    body = list(dict(scene.all_bodies()))[1]
    path, mass = f"bodies.{body}.mass", 1.7 * dict(scene.all_bodies())[body].mass
    page = ephs.live_page(scene, parameters=[path], until=SECONDS).save(tmp_path / "live.html")
    with opened(page) as tab:
        tab.until(READY)
        before = ends(tab)
        tab.evaluate(MOVE % (json.dumps(path), mass))
        tab.until(
            f"document.body.dataset.end !== {json.dumps(json.dumps(list(before.values()), separators=(',', ':')))}"
        )
        after = ends(tab)
        assert tab.complaints == []
        assert [url for url in tab.requests if not url.startswith(("file:", "data:"))] == []
    for found, model in ((before, scene), (after, varied(scene, {path: mass}))):
        run = ephs.simulate(model, SECONDS, method="rk87", rtol=1e-9)
        for curve, value in found.items():
            if curve.endswith("coordinate"):
                assert value == pytest.approx(run.joint(curve.split(".")[1]).coordinate[-1].item(), abs=1e-5)
