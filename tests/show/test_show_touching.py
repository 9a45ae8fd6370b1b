"""Contacts in reports: what a page says of each is what the solution's totals say."""

import re

import numpy as np
import pytest

import ephs
from ephs.show.plots.touching import contact_panels, contact_table
from ephs.show.report import write_report

SCENE = """
format = 1
name = "balls"
[bodies.left]
mass = 1.0
inertia = [4e-3, 4e-3, 4e-3]
position = [0.0, 0.0, 0.15]
velocity = [1.0, 0.0, 0.0]
[bodies.right]
mass = 1.0
inertia = [4e-3, 4e-3, 4e-3]
position = [5.0, 0.0, 0.15]
[surfaces.left]
body = "left"
shape = { sphere = 0.1 }
[surfaces.right]
body = "right"
shape = { sphere = 0.1 }
[surfaces.floor]
body = "ground"
shape = { plane = {} }
"""
LAWS = {"elastic": "stiffness = 1e5\nloss = 0.2\nfriction = 0.5\n", "hard": "restitution = 0.4\nfriction = 0.5\n"}


@pytest.fixture(params=LAWS)
def sol(request, tmp_path):
    file = tmp_path / "balls.toml"
    file.write_text(SCENE.replace(" }\n", " }\n" + LAWS[request.param]), encoding="utf-8")
    return ephs.simulate(ephs.load(file), 0.2, rtol=1e-4)


def test_the_table_has_each_contact_that_touched(sol):
    table = contact_table(sol)
    rows = dict(re.findall(r"<tr><th>(\w+)</th>(<td>.*?)</tr>", table))
    assert sorted(rows) == ["left_floor", "right_floor"]
    assert "1 other pairs never touched" in table
    for name, cells in rows.items():
        *_, most, last, destroyed = map(float, re.findall(r"<td>(.*?)</td>", cells))
        book = sol.ledger(f"contacts.{name}")
        assert destroyed == pytest.approx(book.destroyed[-1], rel=1e-3)
        assert [most, last] == pytest.approx([book.exergy.max(), book.exergy[-1]], rel=1e-3)
    assert sum(sol.ledger(f"contacts.{name}").destroyed[-1] for name in rows) == pytest.approx(sol.heat[-1], rel=1e-9)


def test_panels_have_gaps_and_books_of_all(sol):
    panels = {panel.title: {curve.name: curve.values for curve in panel.curves} for panel in contact_panels(sol)}
    assert set(panels) == {"gap [m]", "force [N]", "slip [m/s]", "energy of contacts [J]", "exergy destroyed [J]"}
    for name, gap in panels["gap [m]"].items():
        assert np.array_equal(gap, sol.contact(name).gap)


def test_the_page_shows_them(sol, tmp_path):
    page = write_report(sol, tmp_path / "page").read_text(encoding="utf-8")
    assert "<h2>Contacts</h2>" in page
    assert '"name":"Contacts"' in page


def test_a_scene_without_contacts_says_nothing_of_them():
    sol = ephs.simulate(ephs.load("scenes/chain.toml"), 0.01)
    assert contact_table(sol) == ""
    assert contact_panels(sol) == []
