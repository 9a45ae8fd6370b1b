"""Every kind of bad input is refused by name: the key, what was found, what was expected and what to do, to the letter.

In ``refused/*.txt`` a line = begins a scene: its text, or the name of a shipped one. Changes of it follow, after empty
lines: its lines - become lines +, which go to its end where they replace none, and lines > are what is said.
"""

import re
from pathlib import Path

import pytest

import ephs
from tests.scenes import ROOT
from tests.written import scene_of_text

FILES = sorted((Path(__file__).parent / "refused").glob("*.txt"))


def changed(text, case):
    """The text with the changes of a case."""
    for hunk in re.findall(r"^((?:- .*\n)*)((?:\+ .*\n)*)", case, re.MULTILINE):
        old, new = (re.sub(r"^. ", "", lines, flags=re.MULTILINE) for lines in hunk)
        assert not old or text.count(old) == 1, old
        text = text.replace(old, new) if old else text + new
    return text


def corpus():
    """Scenes by name, and the cases of each: what it is, a text, and what is said of it."""
    scenes, cases = {}, []
    for part in re.split(r"^= ", "".join(file.read_text(encoding="utf-8") for file in FILES), flags=re.MULTILINE)[1:]:
        head, *changes = (f"{block}\n" for block in part.rstrip().split("\n\n"))
        name, _, text = head.partition("\n")
        name, _, file = name.partition(" of ")
        scenes[name] = (ROOT / f"scenes/{file}.toml").read_text(encoding="utf-8") if file else text
        for case in changes:
            told = re.findall(r"^> (.*)", case, re.MULTILINE)
            cases.append(pytest.param(changed(scenes[name], case), told, id=f"{name}: {told[0].split(': found')[0]}"))
    return scenes, cases


SOUND, REFUSED = corpus()


@pytest.mark.parametrize(("text", "told"), REFUSED)
def test_what_is_wrong_is_said_in_these_lines(text, told, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ephs.SceneError) as caught:
        ephs.load("scene.toml")
    head, *lines = str(caught.value).splitlines()
    assert lines == [f"  {line}" for line in told]
    assert head == f"scene.toml: {len(told)} fault{'s' * (len(told) > 1)}"
    assert str(caught.value.path) == "scene.toml"


@pytest.mark.parametrize("name", SOUND)
def test_without_the_mistake_it_is_a_scene(name):
    """The control: what is refused is the change."""
    assert scene_of_text(SOUND[name]).name
