"""Who may know whom: the rooms of the package form a house without stairs upwards."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = sorted((ROOT / "ephs").rglob("*.py"))

# Room: the rooms that it may know, itself included. A module belongs to the longest room that prefixes it.
MAY_KNOW = {
    "ephs.operad": {"ephs.operad"},
    "ephs.semantics.spaces": {"ephs.operad", "ephs.semantics.spaces"},
    "ephs.semantics": {"ephs.operad", "ephs.semantics"},
    "ephs.mechanics.solve": {"ephs.operad", "ephs.semantics", "ephs.mechanics.solve"},
    "ephs.mechanics": {"ephs.operad", "ephs.semantics", "ephs.mechanics"},
    "ephs.show": {"ephs", "ephs.operad", "ephs.semantics", "ephs.mechanics", "ephs.show"},
    "ephs.testing": {"ephs", "ephs.operad", "ephs.semantics", "ephs.mechanics", "ephs.testing"},
    "ephs.cli": {"ephs"},
    "ephs.cli_input": {"ephs"},
    "ephs.plugin": {"ephs"},
    "ephs.__main__": {"ephs"},
    "ephs": {"ephs"},
}
# Doors for notebooks: a value shows itself by the room of pictures, which is loaded when it is asked to.
DOORS = {
    "ephs.operad.pattern",
    "ephs.semantics.system",
    "ephs.mechanics.scene.words",
    "ephs.mechanics.solve.solution",
}
OPEN = {"ephs.cli", "ephs.cli_input", "ephs.plugin", "ephs.__main__", "ephs"}  # these stand above all rooms
HEAVY = (
    "scipy",
    "networkx",
    "numba",
    "sympy",
    "pydantic",
    "xarray",
    "matplotlib",
    "viser",
    "mujoco",
    "hypothesis",
)


def module_name(file: Path) -> str:
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def within(module: str, room: str) -> bool:
    return module == room or module.startswith(room + ".")


def room_of(module: str) -> str:
    return max((room for room in MAY_KNOW if within(module, room)), key=len)


def imported(tree: ast.AST, module: str, is_package: bool) -> Iterator[tuple[int, str]]:
    """Yield line and absolute name of all that a module imports, lazily or for types only too."""
    package = (module if is_package else module.rpartition(".")[0]).split(".")
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom):
            up = package[: len(package) - node.level + 1] if node.level else []
            origin = ".".join([*up, *([node.module] if node.module else [])])
            for alias in node.names:
                # `from ephs import show` names a module, `from ephs import Pattern` a name of `ephs` itself.
                inner = f"{origin}.{alias.name}"
                path = ROOT.joinpath(*inner.split("."))
                yield node.lineno, inner if path.is_dir() or path.with_suffix(".py").is_file() else origin
        elif isinstance(node, ast.Call) and "import_module" in ast.unparse(node.func):
            for argument in node.args[:1]:
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                    yield node.lineno, argument.value


def allowed(module: str, target: str) -> bool:
    room = room_of(module)
    if room in OPEN or (module in DOORS and within(target, "ephs.show")):
        return True
    # The bare name `ephs` opens every room, so only the upper rooms may use it.
    return any(target == known if known == "ephs" else within(target, known) for known in MAY_KNOW[room])


def faults(source: str, module: str, is_package: bool = False) -> list[str]:
    return [
        f"{module}:{line} imports {target}"
        for line, target in imported(ast.parse(source), module, is_package)
        if within(target, "ephs") and not allowed(module, target)
    ]


@pytest.mark.parametrize("file", SOURCES, ids=module_name)
def test_no_room_knows_what_is_above_it(file):
    assert not faults(file.read_text(encoding="utf-8"), module_name(file), file.name == "__init__.py")


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("ephs.operad.pattern", "import ephs.semantics"),
        ("ephs.operad.normal", "from ephs.show import draw"),
        ("ephs.operad.pattern", "from ephs import Pattern"),
        ("ephs.operad.pattern", "from ..semantics import relation"),
        ("ephs.semantics.system", "def f():\n    from ephs.mechanics import scene"),
        ("ephs.mechanics.solve.model", "from ephs.mechanics.bodies import body"),
        ("ephs.mechanics.solve.model", "from .. import body"),
        ("ephs.mechanics.bodies", "from ephs import show"),
        ("ephs.mechanics.bodies", "import importlib\nimportlib.import_module('ephs.show')"),
        ("ephs.show.plots", "from ephs.cli import main"),
    ],
)
def test_an_import_upwards_is_seen(module, source):
    assert faults(source, module)


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("ephs.operad.pattern", "from .names import Path\nimport json"),
        ("ephs.semantics.system", "from ..operad import Pattern\nfrom .relation import Relation"),
        ("ephs.mechanics.bodies", "from .solve.model import Model"),
        ("ephs.operad.pattern", "def f():\n    from ephs.show import draw"),
        ("ephs.show.plots", "from ephs import Solution"),
    ],
)
def test_an_import_downwards_is_allowed(module, source):
    assert not faults(source, module)


def test_the_syntax_needs_no_numpy():
    for file in (ROOT / "ephs" / "operad").rglob("*.py"):
        names = [name for _, name in imported(ast.parse(file.read_text(encoding="utf-8")), module_name(file), False)]
        assert not [name for name in names if within(name, "numpy")], file


def test_import_loads_nothing_heavy():
    script = f"import sys, ephs; print(*[name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
