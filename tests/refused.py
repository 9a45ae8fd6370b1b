"""Bad input as texts, each with the lines that are said of it: the whole of its message, to the letter.

A line = begins a sound text, whose name it has; or the name of a shipped scene, after "of". Changes of it follow, after
empty lines: its lines - become lines +, which go to its end where they replace none, and lines > are what is said.
"""

import re
from pathlib import Path

import pytest

from tests.scenes import ROOT

__all__ = ["corpus"]


def corpus(folder):
    """Sound texts by name, and parameters of tests: the name, a changed text, and what is said of it."""
    sound, cases, files = {}, [], sorted(Path(folder).glob("*.txt"))
    for part in re.split(r"^= ", "".join(file.read_text(encoding="utf-8") for file in files), flags=re.MULTILINE)[1:]:
        head, *changes = (f"{block}\n" for block in part.rstrip().split("\n\n"))
        name, _, text = head.partition("\n")
        name, _, scene = name.partition(" of ")
        sound[name] = (ROOT / f"scenes/{scene}.toml").read_text(encoding="utf-8") if scene else text
        for case in changes:
            told = re.findall(r"^> (.*)", case, re.MULTILINE)
            known = f"{name}: {told[0].split(': found')[0]}"
            cases.append(pytest.param(name, _changed(sound[name], case), told, id=known))
    return sound, cases


def _changed(text, case):
    for hunk in re.findall(r"^((?:- .*\n)*)((?:\+ .*\n)*)", case, re.MULTILINE):
        old, new = (re.sub(r"^. ", "", lines, flags=re.MULTILINE) for lines in hunk)
        assert not old or text.count(old) == 1, old
        text = text.replace(old, new) if old else text + new
    return text
