"""What the texts name exists: make targets, files, modules, benchmarks, names of the package, commands with options."""

import re
import shlex
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

from benchmarks.__main__ import TABLES
from ephs.cli import app
from tests.scenes import ROOT

TEXTS = [ROOT / f"{name}.md" for name in ("README", "CONTRIBUTING", "STYLE")] + sorted((ROOT / "docs").glob("*.md"))
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
TARGETS = set(re.findall(r"^([a-z-]+):", MAKEFILE, re.MULTILINE))
HOUSE = "ephs|docs|tests|tests_real|tests_learning|benchmarks|examples|scenes"
TOP = r"[A-Z]+\.md|Makefile|CITATION\.cff|pyproject\.toml"
MADE = ("docs/_build",)
"""What is not in the tree, but made by a command that the text names."""
WRONG = {"ephs rnu scenes/mbs.toml --until 1"}
"""What is shown with the message that it gets."""


def code_of(text: str) -> list[str]:
    """What stands between single backticks."""
    return re.findall(r"(?<!`)`([^`\n]+)`(?!`)", text)


def commands_of(text: str) -> list[str]:
    """The commands that a text shows, at a prompt or between backticks, with the comments behind them gone."""
    typed = re.findall(r"^\$ (.+)$", text, re.MULTILINE) + re.findall(r"^(python -m .+)$", text, re.MULTILINE)
    return [line.partition(" #")[0].strip() for line in (*typed, *code_of(text))]


def resolves(dotted: str) -> bool:
    """Tell whether a dotted name is a module or can be read off one."""
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        try:
            found = import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            fields = getattr(found, "__dataclass_fields__", {})
            if part in fields or part in getattr(found, "__annotations__", {}):
                return True
            try:
                found = getattr(found, part)
            except AttributeError:
                return False
        return True
    return False


def faults(text: str, folder: Path = ROOT) -> list[str]:
    """Return what a text names and is not there; links start from the folder."""
    found = [f"make {name}" for line in commands_of(text) for name in re.findall(r"\bmake ([a-z][a-z-]*)\b", line)
             if name not in TARGETS]  # fmt: skip
    links = re.findall(r"\]\(([\w./-]+)(?:#[\w-]+)?\)", text)
    found += [link for link in links if not (folder / link).exists()]
    for word in code_of(text):
        path = re.fullmatch(rf"((?:{HOUSE})/[\w./-]+|{TOP})(?:::?\w+)?", word)
        if path and "NAME" not in path[1] and not path[1].startswith(MADE) and not (ROOT / path[1]).exists():
            found.append(path[1])
        name = re.fullmatch(r"(ephs(?:\.\w+)+)(?:\(.*\))?", word)
        if name and not resolves(name[1]):
            found.append(name[1])
    for line in commands_of(text):
        if module := re.match(r"python -m ((?:tests|benchmarks)[\w.]*)((?: [a-z]+)*)", line):
            found += [] if find_spec(module[1]) else [module[1]]
            found += [name for name in module[2].split() if module[1] == "benchmarks" and name not in TABLES]
        elif line.startswith("ephs ") and line not in WRONG and (fault := misspelled(line)):
            found.append(fault)
    return found


def misspelled(line: str) -> str:
    """What is wrong with an `ephs` command: a command or an option that there is not."""
    words = [word for word in shlex.split(line.replace("…", ""))[1:] if word not in ("|", ">")]
    level, names = app, []
    while words and words[0] in list(level) and not words[0].startswith("-"):
        level = level[words[0]]
        names.append(words.pop(0))
    if not names and words and re.fullmatch(r"[a-z][a-z-]*", words[0]):
        return f"ephs {words[0]}"
    known = {option for option in re.findall(r"--?[a-z][\w-]*", options_of(level))}
    return next((f"{line}: {word}" for word in words if word.startswith("--") and word not in known), "")


def options_of(level) -> str:
    """The options of a command, as its help names them."""
    collected = level.assemble_argument_collection() if level.default_command else []
    return " ".join([*(name for argument in collected for name in argument.names), *level.help_flags, *list(level)])


def test_what_the_texts_name_exists():
    found = [(file.name, fault) for file in TEXTS for fault in faults(file.read_text(encoding="utf-8"), file.parent)]
    assert not found


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("Run `make al`.", "make al"),
        ("See `tests/test_nothing.py`.", "tests/test_nothing.py"),
        ("See `ephs.simulat`.", "ephs.simulat"),
        ("See `ephs.mechanics.nowhere.thing`.", "ephs.mechanics.nowhere.thing"),
        ("See `NOTHING.md`.", "NOTHING.md"),
        ("See [](nothing.md).", "nothing.md"),
        ("See [there](docs/nothing.md#part).", "docs/nothing.md"),
        ("`python -m benchmarks evaluatoin`", "evaluatoin"),
        ("`python -m tests.nothing`", "tests.nothing"),
        ("```console\n$ ephs rnu a.toml\n```", "ephs rnu"),
        ("```console\n$ ephs run a.toml --utnil 1\n```", "ephs run a.toml --utnil 1: --utnil"),
    ],
)
def test_what_does_not_exist_is_seen(text, fault):
    assert faults(text) == [fault]


def test_what_exists_is_let_through():
    assert not faults("`make test`, `tests/conftest.py`, `ephs.simulate(scene, 1)`, `ephs.Scene.at`, `STYLE.md`, "
                      "`ephs run a.toml --until 1 --inertia warn`, `ephs chart stability spin -o out`")  # fmt: skip


def test_the_help_of_make_names_every_target():
    told = set(re.findall(r"make ([a-z][a-z-]*)", MAKEFILE.partition("help:\n")[2].partition("\n\n")[0]))
    phony = set(re.search(r"^\.PHONY: (.+)$", MAKEFILE, re.MULTILINE)[1].split())
    assert told == phony - {"help"} == TARGETS - {"help"}


def test_make_demo_says_what_it_does_before_each_stage():
    text = (ROOT / "Makefile").read_text("utf-8")
    for target, stage in {"$(BIN)/python": "-m venv", "$(VENV)/.installed-%": "$(PIP)", "demo": "ephs run"}.items():
        (recipe,) = re.findall(rf"^{re.escape(target)}:.*\n((?:\t.*\n)+)", text, re.MULTILINE)
        first, second, *_ = recipe.splitlines()
        assert first.startswith("\t@echo '") and re.search("second|minute| s[: ]", first) and stage in second
