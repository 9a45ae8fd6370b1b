"""Misspelled names of all kinds get the nearest one as a suggestion; warnings name the line of the user's call."""

import runpy
import warnings
from pathlib import Path

import pytest

import ephs
from ephs import Pattern
from ephs import library as lib
from ephs import quantity as Q
from ephs.mechanics import joint, rigid_body
from ephs.operad.messages import legible
from tests.scenes import ROOT, shipped
from tests.typed import typed

NONE = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def four_bar():
    return shipped("four-bar")


SLIPS = {
    "library": (lambda: lib.sprng, "'spring'"),
    "quantity": (lambda: Q.displacment, "'displacement'"),
    "package": (lambda: ephs.simulat, "'simulate'"),
    "mechanics": (lambda: ephs.mechanics.universal_jont, "'universal_joint'"),
    "text": (lambda: Pattern.from_text("q: displacment; a(q)"), "'displacement'"),
    "document": (
        lambda: Pattern.from_dict({"format": 1, "junctions": {"q": {"quantity": "displacment"}}, "boxes": {}}),
        "'displacement'",
    ),
    "junction": (lambda: Pattern.from_text("shaft: angle; a(s=shaff)"), "'shaft'"),
    "joint": (lambda: joint("revolut", NONE, NONE), "'revolute'"),
    "joint quantity": (lambda: Q.joint_momentum("sphercal"), "'spherical'"),
    "pose group": (lambda: rigid_body(1.0, (1.0, 1.0, 1.0), group="SE(3"), "'SE3'"),
    "body": (lambda: (model := ephs.dynamics(four_bar())).jacobian(model.state(), "crnk"), "'crank'"),
    "sweep": (lambda: ephs.sweep(four_bar(), {"joints.main.drive": [1.0]}, 0.1, metod="rk54"), "'method'"),
    "port": (lambda: ephs.simulate(four_bar(), 0.01).port("drives.maim"), "'drives.main'"),
    "scene": (lambda: ephs.load("scenes/slider-crnk.toml"), '"scenes/slider-crank.toml"'),
    "folder": (lambda: ephs.load("slider-crank.toml"), '"scenes/slider-crank.toml"'),
    "ending": (lambda: ephs.load("scenes/slider-crank.tml"), '"scenes/slider-crank.toml"'),
    "no ending": (lambda: ephs.load("slider-crank"), '"scenes/slider-crank.toml"'),
    "model": (lambda: ephs.load("examples/amr.urdf"), '"examples/arm.urdf"'),
}


@pytest.mark.parametrize("slip", SLIPS)
def test_a_misspelled_name_gets_the_nearest_one(slip, monkeypatch):
    monkeypatch.chdir(ROOT)
    wrong, right = SLIPS[slip]
    with pytest.raises((AttributeError, KeyError, ValueError)) as found:
        wrong()
    assert f"did you mean {right}?" in str(found.value)


def test_a_name_without_a_neighbour_gets_no_suggestion(tmp_path):
    with pytest.raises(ephs.SceneError, match="check the path"):
        ephs.load(tmp_path / "qqqqqqqqqqqqqqqqqqqqqqq.toml")
    with pytest.raises(AttributeError) as found:
        _ = lib.qqqqq
    assert "did you mean" not in str(found.value)


ODD = """
format = 1
name = "odd"
[bodies.rod]
mass = 1.0
inertia = [1.0, 1.0, 3.0]
"""


def test_warnings_of_files_name_the_line_of_the_call(tmp_path):
    (tmp_path / "odd.toml").write_text(ODD)
    user = tmp_path / "user.py"
    user.write_text("import ephs\n\nscene = ephs.load(FILE, inertia='warn')\n")
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        runpy.run_path(str(user), {"FILE": tmp_path / "odd.toml"})
    assert [(Path(one.filename), one.lineno) for one in heard] == [(user, 3)]
    assert issubclass(heard[0].category, ephs.SceneWarning)


def test_draw_draws_patterns(tmp_path, capsys):
    file = tmp_path / "mine.py"
    lines = ["from ephs import Pattern", "pattern = Pattern.from_text('q: displacement; spring(q); mass(q)')", "n = 3"]
    file.write_text("\n".join(lines))
    picture, same = tmp_path / "pattern.svg", tmp_path / "same.svg"
    assert typed(f"draw {file}:pattern -o {picture}") == 0
    made = Pattern.from_text("q: displacement; spring(q); mass(q)")
    ephs.show.draw(made, same)
    assert picture.read_text() == same.read_text()
    capsys.readouterr()
    for words, said in {
        f"{file}:n -o {picture}": "n is a int, expected a System or a Scene or a Pattern; the file holds pattern",
        f"{file}:patern -o {picture}": 'did you mean "pattern"?',
        f"{file}:pattern --flat -o {picture}": "is a Pattern, expected a System or a Scene",
    }.items():
        assert typed(f"draw {words}") == 2
        assert said in legible(capsys.readouterr().err)
    assert typed(f"info {file}:pattern") == 2
    assert "pattern is a Pattern, expected a System or a Scene" in capsys.readouterr().err
