"""Bad input is refused by name: the key, what was found, what was expected and what to do, to the letter."""

from pathlib import Path

import pytest

import ephs
from tests.refused import corpus
from tests.written import scene_of_text

SOUND, REFUSED = corpus(Path(__file__).parent / "refused")


@pytest.mark.parametrize(("name", "text", "told"), REFUSED)
def test_what_is_wrong_is_said_in_these_lines(name, text, told, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ephs.SceneError) as caught:
        ephs.load("scene.toml")
    head, *lines = str(caught.value).splitlines()
    assert lines == [f"  {line}" for line in told], name
    assert head == f"scene.toml: {len(told)} fault{'s' * (len(told) > 1)}"
    assert str(caught.value.path) == "scene.toml"


@pytest.mark.parametrize("name", SOUND)
def test_without_the_mistake_it_is_a_scene(name):
    """The control: what is refused is the change."""
    assert scene_of_text(SOUND[name]).name
