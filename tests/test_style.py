"""The checkable rules of STYLE.md."""

import ast
import re

import pytest

from tests.scenes import ROOT

SOURCES = sorted((ROOT / "ephs").rglob("*.py"))
TEXTS = sorted(
    file
    for pattern in (
        "*.md",
        "*.toml",
        "Makefile",
        "*.cff",
        ".ci/run",
        "docs/*",
        "scenes/*.toml",
        "examples/*.py",
    )
    for file in ROOT.glob(pattern)
    if file.is_file()
)
MARKS = re.compile(r"\b(TODO|FIXME|XXX|HACK)\b")
MACHINE = re.compile(r"(?<![\w.])/(?:home|root|work|tmp|Users|opt)/")


def named(file):
    return str(file.relative_to(ROOT))


def faults(source: str, *, may_print: bool = False) -> list[str]:
    """Return the broken rules of a module's text, each with its line."""
    found = [f"{n}: leftover mark" for n, line in enumerate(source.splitlines(), 1) if MARKS.search(line)]
    for node in ast.walk(ast.parse(source)):
        line = getattr(node, "lineno", 0)
        match node:
            case ast.Call(func=ast.Name(id="print")) if not may_print:
                found.append(f"{line}: print outside the command line")
            case ast.Call(func=ast.Name(id="hasattr")):
                found.append(f"{line}: hasattr")
            case ast.Assert() if not narrows(node.test):
                found.append(f"{line}: assert; raise the layer's error")
            case ast.Global():
                found.append(f"{line}: global")
            case ast.ExceptHandler(type=None):
                found.append(f"{line}: bare except")
            case ast.ImportFrom(module="__future__"):
                found.append(f"{line}: __future__ import")
            case ast.ClassDef():
                found += [f"{line}: {node.name}: {fault}" for fault in dataclass_faults(node)]
            case _:
                pass
    return found


def narrows(test: ast.expr) -> bool:
    """Tell whether an assertion only tells the type checker what is known: a type, or not None."""
    if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
        test = test.operand
    match test:
        case ast.Call(func=ast.Name(id="isinstance")):
            return True
        case ast.Compare(ops=[ast.IsNot()], comparators=[ast.Constant(value=None)]):
            return True
    return False


def dataclass_faults(node: ast.ClassDef) -> list[str]:
    for decorator in node.decorator_list:
        name = decorator.func if isinstance(decorator, ast.Call) else decorator
        if ast.unparse(name).rpartition(".")[2] != "dataclass":
            continue
        keywords = decorator.keywords if isinstance(decorator, ast.Call) else []
        switched_on = {k.arg for k in keywords if isinstance(k.value, ast.Constant) and k.value.value is True}
        wanted = {"slots"} if node.name.startswith("_") else {"frozen", "slots"}  # a private one may accumulate
        if missing := wanted - switched_on:
            return [f"dataclass without {', '.join(sorted(missing))}"]
    return []


def undocumented(tree: ast.Module) -> list[str]:
    """Return the public top-level names without a docstring, the module itself included."""
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
    public = [node for node in tree.body if isinstance(node, kinds) and not node.name.startswith("_")]
    return [getattr(node, "name", "module") for node in (tree, *public) if not ast.get_docstring(node)]


def in_files(files, found) -> list[str]:
    """Return what ``found`` finds in the texts of files, each fault with its file's name."""
    return [f"{named(file)}: {fault}" for file in files for fault in found(file, file.read_text(encoding="utf-8"))]


def test_sources_keep_the_rules():
    assert not in_files(SOURCES, lambda file, text: faults(text, may_print=named(file) == "ephs/cli/commands.py"))


def test_one_idea_a_file():
    assert not in_files(SOURCES, lambda _, text: [f"{n} lines"] if (n := len(text.splitlines())) > 400 else [])


def test_public_names_are_documented():
    assert not in_files(SOURCES, lambda _, text: undocumented(ast.parse(text)))


def test_no_machine_is_named():
    texts = [file for file in (*SOURCES, *TEXTS) if file.suffix not in {".svg", ".gif", ".png"}]
    assert not in_files(texts, lambda _, text: MACHINE.findall(text))


def test_faults_name_their_file():
    file = ROOT / "ephs" / "cli" / "commands.py"
    assert in_files([file], lambda *_: ["1: print"]) == ["ephs/cli/commands.py: 1: print"]


@pytest.mark.parametrize(
    "source",
    [
        "# TO" + "DO: later",
        "print(1)",
        "hasattr(x, 'y')",
        "assert x",
        "def f():\n    global x",
        "try:\n    f()\nexcept:\n    g()",
        "from __future__ import annotations",
        "@dataclass\nclass A: ...",
        "@dataclasses.dataclass(frozen=True)\nclass A: ...",
        "@final\n@dataclass(frozen=True, slots=False)\nclass A: ...",
        "@dataclass\nclass _A: ...",
    ],
)
def test_a_broken_rule_is_seen(source):
    assert faults(source)


def test_rules_leave_good_source_alone():
    source = "@final\n@dataclass(frozen=True, slots=True)\nclass A:\n    x: int\n"
    assert not faults(source)
    assert faults("print(1)", may_print=True) == []
    assert undocumented(ast.parse(source)) == ["module", "A"]


SMALL = 1e-5
"""Numbers up to this are thresholds, with a name and a reason."""


def bare_thresholds(tree: ast.AST) -> list[int]:
    """Lines of small numbers that no constant in capitals names."""
    named_ones: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = [name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)]
            if names and all(name.isupper() for name in names):
                named_ones |= {id(inner) for inner in ast.walk(node)}
    return [
        node.lineno
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, float) and 0.0 < node.value <= SMALL
        and id(node) not in named_ones
    ]  # fmt: skip


def test_thresholds_have_names():
    assert bare_thresholds(ast.parse("TIGHT = 1e-9\n")) == []
    assert bare_thresholds(ast.parse("if x < 1e-9:\n    y = 1e-7\n")) == [1, 2], "the control"
    found = {named(file): bare_thresholds(ast.parse(file.read_text(encoding="utf-8"))) for file in SOURCES}
    assert {name: lines for name, lines in found.items() if lines} == {}
