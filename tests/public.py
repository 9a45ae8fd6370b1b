"""The public names with their arguments and defaults, a line each; ``python -m tests.public`` writes them down.

Annotations are left out, since Python's versions print them differently.
"""

import ast
import inspect
from collections.abc import Iterator
from enum import Enum
from importlib import import_module
from pathlib import Path
from textwrap import dedent

MODULES = ("ephs", "ephs.library", "ephs.library.chemistry", "ephs.mechanics", "ephs.testing", "ephs.show")
VALUES = ("ephs.quantity",)
CLASSES = (
    "ephs.mechanics.dynamics.Dynamics",
    "ephs.mechanics.dynamics.State",
    "ephs.mechanics.dynamics.Task",
    "ephs.mechanics.linear.Equilibrium",
    "ephs.mechanics.linear.Mode",
    "ephs.mechanics.linear.PortHamiltonian",
    "ephs.mechanics.linear.StateSpace",
    "ephs.mechanics.methods.registry.MethodEntry",
    "ephs.mechanics.motion.motion.BodyMotion",
    "ephs.mechanics.motion.motion.JointMotion",
    "ephs.mechanics.sensitivity.Fit",
    "ephs.mechanics.sensitivity.Gradient",
    "ephs.mechanics.sensitivity.Sensitivity",
    "ephs.mechanics.motion.views.StateView",
    "ephs.operad.Algebra",
    "ephs.operad.AlgebraMap",
    "ephs.operad.Equation",
    "ephs.operad.Law",
    "ephs.operad.Lax",
    "ephs.operad.Nesting",
    "ephs.semantics.algebra.Conductors",
    "ephs.semantics.algebra.Corelation",
    "ephs.semantics.algebra.Cost",
    "ephs.semantics.algebra.ExactRelation",
    "ephs.semantics.algebra.Sharer",
    "ephs.semantics.algebra.Units",
    "ephs.semantics.meaning.Instant",
    "ephs.semantics.meaning.LinearRelation",
    "ephs.semantics.meaning.StateClass",
    "ephs.semantics.spaces.Pair",
    "ephs.semantics.spaces.PairEntry",
)
"""What public functions return or take, and where it is."""
FILE = Path(__file__).with_name("public.txt")


def lines() -> list[str]:
    """All of it, in a fixed order."""
    found: list[str] = []
    for module in MODULES:
        names = import_module(_home(module)).__all__
        found += [line for name in sorted(names) for line in described(f"{module}.{name}", named(f"{module}.{name}"))]
    for path in CLASSES:
        found += described(path, named(path))
    for path in VALUES:
        found += [line for line in described(path, type(named(path))) if line.startswith(path + ".")]
    return [*found, *commands()]


def named(path: str) -> object:
    """The object of a dotted name."""
    module, _, name = path.rpartition(".")
    return getattr(import_module(_home(module)), name)


def _home(module: str) -> str:
    return module.replace("ephs.library", "ephs.semantics.library")


def described(path: str, value: object) -> Iterator[str]:
    """A line of an object itself, and one for each public member of a class."""
    if not isinstance(value, type):
        yield f"{path}{signature(value)}" if callable(value) else path
        return
    bases = ", ".join(base.__name__ for base in value.__bases__ if base is not object)
    plain = issubclass(value, BaseException | Enum)
    yield f"class {path}{'' if plain else signature(value)}{f': {bases}' if bases else ''}"
    for name in sorted(members(value)):
        member = inspect.getattr_static(value, name, None)
        if isinstance(member, staticmethod | classmethod):
            member = member.__func__
        yield f"{path}.{name}{signature(member) if inspect.isfunction(member) else ''}"


def members(kind: type) -> set[str]:
    """Methods, properties and attributes that a class of the package has of its own or inherits from the package."""
    found: set[str] = set()
    for base in kind.__mro__:
        if base.__module__.startswith("ephs"):
            found |= set(vars(base)) | set(inspect.get_annotations(base))
            tree = ast.parse(dedent(inspect.getsource(base)))
            stored = [n for n in ast.walk(tree) if isinstance(n, ast.Attribute) and isinstance(n.ctx, ast.Store)]
            found |= {node.attr for node in stored if isinstance(node.value, ast.Name) and node.value.id == "self"}
    return {name for name in found if not name.startswith("_")}


def signature(value: object) -> str:
    """Arguments with their defaults; what has no readable default shows as ``…``."""
    try:
        found = inspect.signature(value)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError):
        return ""
    plain = []
    for argument in found.parameters.values():
        default = argument.default
        if default is not argument.empty and not isinstance(default, str | float | int | bool | tuple | None):
            default = _Unreadable()
        plain.append(argument.replace(annotation=argument.empty, default=default))
    return str(found.replace(parameters=plain, return_annotation=found.empty))


class _Unreadable:
    def __repr__(self) -> str:
        return "…"


def commands() -> Iterator[str]:
    """The commands with their options."""
    from ephs.cli import app

    for command in sorted(name for name in app if not name.startswith("-")):
        at = app[command]
        yield f"$ ephs {command}"
        inner = sorted(name for name in at if not name.startswith("-"))
        for within in inner:
            yield f"$ ephs {command} {within}"
            yield from (f"$ ephs {command} {within} {option}" for option in options(at[within]))
        if not inner:
            yield from (f"$ ephs {command} {option}" for option in options(at))


def options(command) -> list[str]:
    """The arguments of one command, by all their names."""
    found = [a for a in command.assemble_argument_collection() if "*" not in a.names]  # "*": a group of others
    return sorted(" ".join(a.names) + (" (required)" if a.required else "") for a in found)


def main() -> None:
    """Write the file."""
    FILE.write_text("\n".join(lines()) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
