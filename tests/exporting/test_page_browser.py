"""Pages that simulate, in a browser: a slider that moves gives the motion of a run here with that number."""

import json

import pytest

import ephs
from ephs.mechanics.scene.parameters import varied
from tests.scenes import ROOT, shipped
from tests.show.browser import opened

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


def test_the_page_of_the_documentation_simulates_the_torque_of_its_slider(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    import live_pages

    page, torque = live_pages.four_bar().save(tmp_path / "live.html"), 6.5
    runs = []
    with opened(page) as tab:
        tab.until(READY)
        runs.append(tab.evaluate("document.body.dataset.end"))
        tab.evaluate(MOVE % (json.dumps(live_pages.DRIVEN), torque))
        tab.until(f"document.body.dataset.end !== {json.dumps(runs[0])}")
        found = ends(tab)
        assert tab.complaints == []
        assert [url for url in tab.requests if not url.startswith(("file:", "data:"))] == []
    changed = varied(live_pages.linkage(), {f"{live_pages.DRIVEN}.drive": torque})
    run = ephs.simulate(changed, live_pages.UNTIL, method="rk87", rtol=1e-10)
    angle = run.joint("main").coordinate[-1].item()
    assert found["joints.main.coordinate"] == pytest.approx(angle, abs=1e-4 * abs(angle))


@pytest.mark.parametrize("name", ["slider-crank", "four-bar", "biped"])
def test_a_slider_gives_the_motion_of_a_run_here(tmp_path, name):
    scene = shipped(name)
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
                joint = ".".join(word for word in curve.split(".")[:-1] if word not in ("parts", "joints"))
                assert value == pytest.approx(run.joint(joint).coordinate[-1].item(), abs=1e-5)


def test_legends_have_the_values_at_the_time_of_the_animation(tmp_path):
    scene = shipped("four-bar")
    page = ephs.live_page(scene, until=SECONDS).save(tmp_path / "live.html")
    label = "each.querySelector('.u-label').textContent, each.querySelector('.u-value').textContent"
    legend = f"JSON.stringify([...document.querySelectorAll('#live-plots .u-series')].map(each => [{label}]))"
    time = "document.querySelector('#live-plots .u-value').textContent"
    with opened(page) as tab:
        tab.until(READY)
        if "❚" in tab.evaluate("document.querySelector('.player').innerText"):
            tab.evaluate("document.querySelector('.player button').click()")
        tab.evaluate("document.dispatchEvent(new CustomEvent('seek', { detail: 0.5 }))")
        tab.until(f"{time} === '0.50000 s'")
        found = json.loads(tab.evaluate(legend))
        assert tab.complaints == []
    assert found and not [label for label, value in found if not value or "-" in value]
    run = ephs.simulate(scene, 0.5, method="rk87", rtol=1e-9)
    compared = 0
    for name, value in found:
        if name.endswith("coordinate"):
            joint = ".".join(word for word in name.split(".")[:-1] if word not in ("parts", "joints"))
            assert float(value.replace("\u2212", "-")) == pytest.approx(
                run.joint(joint).coordinate[-1].item(), rel=1e-3
            )
            compared += 1
    assert compared
