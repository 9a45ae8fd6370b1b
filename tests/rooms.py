"""The rooms of the package, who may know whom, and who does, read from the imports of its files.

`tests/test_layers.py` checks them; `docs/house.py` draws them.
"""

import ast
import io
import token
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCES = sorted((ROOT / "ephs").rglob("*.py"))
_COUNTED = {token.OP, token.NAME, token.NUMBER, token.STRING}

STOREYS: tuple[tuple[frozenset[str], ...], ...] = tuple(
    tuple(frozenset(f"ephs{room}" for room in rooms) for rooms in storey)
    for storey in (
        ([".operad"],),
        ([".semantics.stage"],),
        ([".semantics.spaces", ".semantics.linear"],),
        ([".semantics.derive"],),
        (
            [
                ".semantics",
                ".semantics.library",
                ".semantics.algebra",
                ".semantics.meaning",
                ".semantics.symbols",
                ".semantics.verdicts",
                ".semantics.bundles",
                ".semantics.primitives",
                ".semantics.systems",
                ".semantics.descriptor",
                ".semantics.documents",
            ],
        ),
        (
            [
                ".solve",
                ".solve.posing",
                ".solve.equations",
                ".solve.march",
                ".solve.methods",
                ".solve.result",
                ".solve.auditing",
                ".solve.running",
                ".solve.exchange",
            ],
        ),
        ([".mechanics.shapes"], [".mechanics.road"], [".modelica"]),
        ([".mechanics.elements", ".mechanics.elements.shell"],),
        ([".mechanics.scene", ".mechanics.imports"], [".mechanics.tree", ".mechanics.tree.sweeps"]),
        ([".mechanics.constraints"],),
        ([".mechanics.tree.finding"],),
        ([".mechanics.tree.engine"], [".mechanics.rewrite"]),
        ([".mechanics.tree.equations"],),
        ([".mechanics.methods", ".mechanics.impacts"],),
        ([".mechanics.motion"],),
        ([".mechanics", ".mechanics.runs"],),
        ([".mechanics.dynamics"], [".mechanics.sweep"]),
        ([".mechanics.linear"], [".mechanics.sensitivity"]),
        ([".show.shared"],),
        ([".show.diagrams"], [".show.motions"], [".show.plots"], [".testing"]),
        ([".show", ".show.charts"],),
        ([".exporting"],),
        (["", ".cli"],),
    )
)
"""From the ground up. Rooms that stand together know each other and all storeys below; no others."""
DOORS = {
    ("ephs.operad.pattern", "ephs.show"): "patterns are displayed in notebooks",
    ("ephs.operad.pattern", "ephs.semantics.meaning"): "patterns have their relation",
    ("ephs.operad.algebra", "ephs.semantics.algebra"): "calling the empty pattern gives the empty system",
    ("ephs.semantics.documents.catalogue", "ephs.mechanics.elements"): "documents name components of mechanics",
    ("ephs.semantics.library.units", "ephs.solve.exchange"): "an FMI unit in the library runs sampled",
    ("ephs.semantics.systems.system", "ephs.show"): "systems are displayed in notebooks",
    ("ephs.mechanics.scene.words", "ephs.show"): "scenes are displayed in notebooks",
    ("ephs.solve.result.solution", "ephs.show"): "solutions have plots and animations",
    ("ephs.mechanics.dynamics.model", "ephs.show"): "mechanisms of dynamics are displayed in notebooks",
    ("ephs.mechanics.linear.equilibrium", "ephs.show"): "equilibria are displayed in notebooks",
    ("ephs.mechanics.linear.statespace", "ephs.show"): "eigenvalues of linear systems are displayed in notebooks",
}
"""Module, room above it: why it may know that. What is above is loaded when it is asked for."""
PLACE = {room: (level, flat) for level, storey in enumerate(STOREYS) for flat in storey for room in flat}


@dataclass(frozen=True, slots=True)
class Import:
    """One import: in a line of a module, what it brings in by its absolute name."""

    module: str
    line: int
    target: str

    @property
    def rooms(self) -> tuple[str, str]:
        """The rooms of both."""
        return room_of(self.module), room_of(self.target)

    @property
    def upward(self) -> bool:
        """Whether it leads to where the module has no business to be, but through a door."""
        here, there = self.rooms
        (level, flat), (height, other) = PLACE[here], PLACE[there]
        return flat != other and height >= level

    @property
    def allowed(self) -> bool:
        """Whether it leads down, or stays, or goes through a door."""
        return not self.upward or (self.module, self.rooms[1]) in DOORS


def module_name(file: Path) -> str:
    """The dotted name of a file of the package."""
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def within(module: str, room: str) -> bool:
    """Whether a module is a room, or lies in it."""
    return module == room or module.startswith(room + ".")


def room_of(module: str) -> str:
    """The innermost room that a module lies in."""
    return max((room for room in PLACE if within(module, room)), key=len)


def imported(source: str, module: str, is_package: bool = False) -> Iterator[Import]:
    """Yield all that a module's text imports, lazily or for types only too."""
    package = (module if is_package else module.rpartition(".")[0]).split(".")
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(module, node.lineno, alias.name)
        elif isinstance(node, ast.ImportFrom):
            up = package[: len(package) - node.level + 1] if node.level else []
            origin = ".".join([*up, *([node.module] if node.module else [])])
            for alias in node.names:
                # `from ephs import show` names a module, `from ephs import Pattern` a name of `ephs` itself.
                inner = f"{origin}.{alias.name}"
                path = ROOT.joinpath(*inner.split("."))
                is_module = path.is_dir() or path.with_suffix(".py").is_file()
                yield Import(module, node.lineno, inner if is_module else origin)
        elif isinstance(node, ast.Call) and "import_module" in ast.unparse(node.func):
            for argument in node.args[:1]:
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                    yield Import(module, node.lineno, argument.value)


def imports_of(file: Path) -> list[Import]:
    """What a file of the package imports."""
    return list(imported(file.read_text(encoding="utf-8"), module_name(file), file.name == "__init__.py"))


def house() -> list[Import]:
    """Every import of the package that leads from one room to another."""
    found = [one for file in SOURCES for one in imports_of(file) if within(one.target, "ephs")]
    return [one for one in found if one.rooms[0] != one.rooms[1]]


def size_of(source: str) -> int:
    """Tokens of a file that compute."""
    bodies = (getattr(node, "body", None) for node in ast.walk(ast.parse(source)))
    texts = {
        (first.lineno, first.col_offset)
        for body in bodies
        if isinstance(body, list)
        for first in body
        if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str)
    }
    found = tokenize.generate_tokens(io.StringIO(source).readline)
    return sum(each.type in _COUNTED and not (each.type == token.STRING and each.start in texts) for each in found)
