"""A component of Modelica as flat equations of Pymoca, in SymPy's expressions."""

import logging
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any, final

from ephs.modelica.errors import ModelicaError
from ephs.modelica.expressions import Expr, ExpressionReader, Symbol, node_text, sp
from ephs.operad import Quantity, quantity
from ephs.solve.posing.errors import nearest_of


@final
@dataclass(frozen=True, slots=True)
class Domain:
    """A kind of connector: units of its potential and its flow variable.

    Parameters
    ----------
    quantity
        Of the power port that it is.
    position
        Whether the effort is the potential's derivative, not the potential.
    """

    potential: str
    flow: str
    quantity: Quantity
    position: bool = False


LENGTHS = ("rad", "m")
"""Units of positions."""
DOMAINS = (
    Domain("V", "A", quantity.charge),
    Domain("rad", "N.m", quantity.angular_momentum, position=True),
    Domain("m", "N", quantity.momentum, position=True),
    Domain("K", "W", quantity.entropy),
)


@final
@dataclass(frozen=True, slots=True)
class Connector:
    """A connector: symbols of its potential and of its flow, which is positive into the component."""

    name: str
    domain: Domain
    potential: Symbol
    flow: Symbol

    @property
    def heat(self) -> bool:
        """Whether the flow is a power by itself."""
        return self.domain.flow == "W"


@final
@dataclass(frozen=True, slots=True)
class ZeroResidual:
    """0 = residual, and the equation's text."""

    residual: Expr
    text: str


@final
@dataclass(frozen=True, slots=True)
class Flat:
    """A component: its ports, its equations, and of each variable the unit and the start value.

    Variables without a unit entry are signals that are read: Pymoca leaves connectors of signals undeclared. Those in
    ``held`` start at these values and not near them, by what is written there.
    """

    name: str
    ports: tuple[Connector, ...]
    equations: tuple[ZeroResidual, ...]
    units: Mapping[Symbol, str]
    starts: Mapping[Symbol, float]
    held: Mapping[Symbol, str]

    def require_started(self, states: Collection[Symbol]) -> None:
        """Refuse values at the start of what is none of the states: nothing would begin there.

        A position that is zero is where all others are that nobody places.
        """
        for symbol, text in self.held.items():
            if symbol not in states and (self.starts[symbol] or self.units[symbol] not in LENGTHS):
                raise ModelicaError("initial", where=self.name, equation=text)


def tree_of(paths: tuple[Path, ...]) -> Any:
    """The syntax tree of files and of folders with libraries.

    Raises
    ------
    ModelicaError
        No such file, or none of Modelica.
    """
    try:
        from pymoca import parser
    except ImportError as error:
        raise ModelicaError("package") from error
    logging.getLogger("pymoca").setLevel(logging.CRITICAL)
    tree = parser.modelicapath_to_tree([path for path in paths if path.is_dir()])
    for path in paths:
        if path.is_dir():
            continue
        if not path.is_file():
            raise ModelicaError("file", where=path)
        try:
            tree.extend(parser.parse_file(path))
        except (parser.ModelicaSyntaxError, UnicodeDecodeError, AttributeError, KeyError) as error:
            raise ModelicaError("text", where=path, found=_first(error)) from error
    return tree


def flattened(tree: Any, name: str, given: Mapping[str, float]) -> Flat:
    """The equations of one class of the tree, with parameters of those values.

    Raises
    ------
    ModelicaError
        What is not read: see `errors`.
    """
    from pymoca import ast
    from pymoca.tree import flatten, instantiate

    try:
        found = flatten(tree, name).classes[name]
        readings = set(_readings(instantiate(tree, name))) - found.symbols.keys()
    except Exception as error:  # the parser raises many kinds of exceptions
        raise ModelicaError("flat", where=name, found=_first(error)) from error
    if found.statements or found.initial_statements:
        raise ModelicaError("algorithm", where=name)
    symbols: dict[str, Any] = dict(found.symbols)
    fixed = {key for key, symbol in symbols.items() if {"parameter", "constant"} & set(symbol.prefixes)}
    parameters = _parameters(name, {key: symbols[key] for key in symbols if key in fixed}, given, ast.Primary)
    free = {key: symbol for key, symbol in symbols.items() if key not in fixed}
    for key, symbol in free.items():
        if "input" in symbol.prefixes:
            raise ModelicaError("signal", where=name, found=key)
        if any(str(getattr(extent, "value", extent)) != "None" for extents in symbol.dimensions for extent in extents):
            raise ModelicaError("array", where=name, found=key)
    real = {key: sp.Symbol(key, real=True) for key, symbol in free.items() if str(symbol.type.name) == "Real"}
    real |= {key: sp.Symbol(key, real=True) for key in sorted(readings)}
    kinds = {key: str(symbol.type.name) for key, symbol in free.items() if key not in real}
    reader = ExpressionReader(name, real, parameters, lambda parts, scope: _constant(tree, parts, scope), kinds)
    units = {real[key]: str(free[key].unit.value or "") if key in free else "" for key in real}
    ports = _ports(name, real, free, units)
    own = {port.flow.name for port in ports}
    try:
        equations = tuple(_equations(reader, found.equations, own))
        starts, held = _starts(reader, free, _equations(reader, found.initial_equations, own))
    except RecursionError:
        raise ModelicaError("expression", where=name, found="parameters that need each other") from None
    return Flat(name, ports, equations, units, starts, held)


def _readings(instance: Any) -> Iterator[str]:
    """Output signals of a class, by the names of their types in Modelica's standard library."""
    for key, symbol in instance.symbols.items():
        if str(getattr(symbol.type, "name", "")).endswith("Output"):
            yield key
    for base in instance.extends:
        if type(base).__name__ == "InstanceClass":
            yield from _readings(base)


def _first(error: Exception) -> str:
    """First line of an error message."""
    return next(iter(str(error).splitlines()), type(error).__name__)


def _starts(
    reader: ExpressionReader, free: Mapping[str, Any], initial: Sequence[ZeroResidual]
) -> tuple[dict[Symbol, float], dict[Symbol, str]]:
    """Values at the start: those of variables, unless initial equations give them; and the fixed ones, as equations."""
    out = {symbol: 0.0 for symbol in reader.variables.values()}
    held: dict[Symbol, str] = {}
    for key, symbol in reader.variables.items():
        if key in free and getattr(free[key].start, "value", 0) is not None:
            out[symbol] = float(reader.value(free[key].start))
            if reader.truth(free[key].fixed):
                held[symbol] = f"{key} = {node_text(free[key].start)}"
    for each in initial:
        symbol = next(iter(each.residual.free_symbols), None)
        slope = each.residual.diff(symbol) if symbol in out else sp.Symbol("none")
        if slope.free_symbols or each.residual.free_symbols != {symbol}:
            raise ModelicaError("initial", where=reader.where, equation=each.text)
        out[symbol], held[symbol] = float(sp.expand(symbol - each.residual / slope)), each.text
    return out, held


def _parameters(
    where: str, symbols: Mapping[str, Any], given: Mapping[str, float], literal: type[Any]
) -> dict[str, Any]:
    """The nodes of their values: the given one, else the declared one, else the start value, as in Modelica."""
    for key in given:
        if key not in symbols:
            known = [each for each in symbols if "." not in each]
            raise ModelicaError(
                "parameter", where=where, found=key, expected=", ".join(known) or "none", near=nearest_of(key, known)
            )
    out: dict[str, Any] = {}
    for key, symbol in symbols.items():
        nodes = (literal(value=given[key]) if key in given else None, symbol.value, symbol.start)
        found = (node for node in nodes if node is not None and getattr(node, "value", 0) is not None)
        out[key] = next((node for node in found if str(node) != key), None)  # Pymoca takes R = R for its own
        if key in ("useHeatPort", "useSupport"):  # Pymoca keeps conditional connectors whose condition is false
            out[key] = literal(value=True)
    return out


def _constant(tree: Any, parts: tuple[str, ...], scope: Any) -> tuple[Any, Any]:
    """The value's node of a constant of a package, and the package; None where there is none."""
    for start in (scope, tree):
        inside = start
        for part in parts[:-1]:
            inside = None if inside is None else inside.classes.get(part)
        if inside is not None and parts[-1] in inside.symbols:
            symbol = inside.symbols[parts[-1]]
            changed = symbol.class_modification.arguments if symbol.class_modification is not None else ()
            given = [node for each in changed for node in getattr(each.value, "modifications", ())]
            value = symbol.value if getattr(symbol.value, "value", 0) is not None else (given or [None])[-1]
            return value, inside
    return None, None


def _ports(
    where: str, real: Mapping[str, Symbol], free: Mapping[str, Any], units: Mapping[Symbol, str]
) -> tuple[Connector, ...]:
    """Connectors of the component itself: a flow variable and a potential under one name."""
    out: list[Connector] = []
    for key, symbol in free.items():
        if "flow" not in symbol.prefixes or key.count(".") != 1:
            continue
        name = key.split(".")[0]
        beside = [each for each in free if each.startswith(f"{name}.") and each != key]
        found = (*(units.get(real.get(each, sp.Symbol(each)), "?") for each in beside), units[real[key]])
        domain = next((each for each in DOMAINS if (each.potential, each.flow) == found), None)
        if domain is None:
            expected = "; ".join(f"{each.potential}, {each.flow}" for each in DOMAINS)
            raise ModelicaError("connector", where=where, port=name, found=", ".join(found), expected=expected)
        out.append(Connector(name, domain, real[beside[0]], real[key]))
    if not out:
        raise ModelicaError("ports", where=where)
    return tuple(out)


def _equations(reader: ExpressionReader, nodes: Any, own: set[str]) -> list[ZeroResidual]:
    """Equations of the active branches, without those for unconnected connectors of the component."""
    out: list[ZeroResidual] = []
    for node in nodes:
        kind = type(node).__name__
        if kind == "Function" or (kind == "Expression" and str(node.operator) in ("assert", "terminate")):
            continue
        if kind == "IfEquation":
            branches = zip_longest(node.conditions, node.blocks, fillvalue=True)
            taken = next((block for condition, block in branches if reader.truth(condition)), ())
            out += _equations(reader, taken, own)
        elif kind == "WhenEquation":
            raise ModelicaError("branch", where=reader.where, found=f"when {node_text(node.conditions[0])}")
        elif kind == "ConnectClause":  # connectors of power are equations already
            raise ModelicaError("signal", where=reader.where, found=f"{node.left} as {node.right}")
        elif kind != "Equation":
            raise ModelicaError("expression", where=reader.where, found=f"{kind} {node_text(node)}")
        elif type(node.left).__name__ in ("Symbol", "InstanceSymbol"):  # of an open connector
            if node.left.name not in own:
                out.append(ZeroResidual(reader.variables[node.left.name], f"{node.left.name} = 0"))
        else:
            left, right = reader.value(node.left), reader.value(node.right)
            out.append(ZeroResidual(sp.expand(left - right), node_text(node)))
    return out
