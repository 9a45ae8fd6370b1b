"""Expressions of Modelica's syntax tree as SymPy's, with exact numbers, and as text."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Final, TypeAlias, final

from ephs.modelica.errors import ModelicaError

sp: Any = import_module("sympy")
"""SymPy, whose own types are narrower than its functions."""
Expr: TypeAlias = Any
Matrix: TypeAlias = Any
Symbol: TypeAlias = Any
ARITHMETIC: Final[Mapping[str, Callable[..., Any]]] = {
    "+": lambda a, b=None: a if b is None else a + b,
    "-": lambda a, b=None: -a if b is None else a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "^": lambda a, b: a**b,
    "<": sp.Lt,
    "<=": sp.Le,
    ">": sp.Gt,
    ">=": sp.Ge,
    "==": sp.Eq,
    "<>": sp.Ne,
    "not": sp.Not,
    "and": sp.And,
    "or": sp.Or,
    "noEvent": lambda a: a,
    "smooth": lambda order, a: a,
    "abs": sp.Abs,
    "max": sp.Max,
    "min": sp.Min,
    **{name: getattr(sp, name) for name in ("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan",
                                               "atan2", "sinh", "cosh", "tanh")},
}  # fmt: skip
"""Operators and functions by their names in Modelica."""


def derivative(symbol: Symbol) -> Symbol:
    """The symbol of a variable's derivative in time."""
    return sp.Symbol(f"der({symbol.name})", real=True)


@final
@dataclass(frozen=True, slots=True)
class ExpressionReader:
    """Expressions of a flat component.

    Parameters
    ----------
    where
        The component's name, for errors.
    variables
        Symbols by name.
    parameters
        Nodes of the values of parameters and constants by name, None where they have none.
    constants
        The value's node of a constant of the library, by its parts and the class where it is named, with its class.
    kinds
        Types of what is no real number.
    """

    where: str
    variables: Mapping[str, Symbol]
    parameters: Mapping[str, Any]
    constants: Callable[[tuple[str, ...], Any], tuple[Any, Any]]
    kinds: Mapping[str, str]

    def value(self, node: Any, scope: Any = None) -> Any:
        """The node as an expression of SymPy."""
        kind = type(node).__name__
        if kind == "Primary":
            return _number(self.where, node.value)
        if kind == "ComponentRef":
            return self._named(node, scope)
        if kind == "IfExpression":
            branches = zip(node.conditions, node.expressions, strict=False)
            taken = next((found for condition, found in branches if self.truth(condition)), node.expressions[-1])
            return self.value(taken, scope)
        if kind == "Expression":
            return self._applied(node, scope)
        raise ModelicaError("expression", where=self.where, found=node_text(node))

    def truth(self, condition: Any) -> bool:
        """Whether a condition on parameters holds."""
        found = sp.true if condition is True else self.value(condition)
        if found not in (sp.true, sp.false):
            raise ModelicaError("branch", where=self.where, found=node_text(condition))
        return bool(found)

    def _applied(self, node: Any, scope: Any) -> Any:
        package, _, name = str(node.operator).rpartition(".")
        if name == "der":
            inner = self.value(node.operands[0], scope)
            return sum(
                (sp.diff(inner, symbol) * derivative(symbol) for symbol in sorted(inner.free_symbols, key=str)),
                sp.Integer(0),
            )
        if name == "initial":
            raise ModelicaError("branch", where=self.where, found="initial()")
        if name == "homotopy":
            return self.value(node.operands[0], scope)
        if name not in ARITHMETIC or package.rpartition(".")[-1] not in ("", "Math"):
            raise ModelicaError("expression", where=self.where, found=f"the function {node_text(node)}")
        try:
            return ARITHMETIC[name](*(self.value(each, scope) for each in node.operands))
        except TypeError as error:
            raise ModelicaError("expression", where=self.where, found=f"{node_text(node)} ({error})") from None

    def _named(self, node: Any, scope: Any) -> Any:
        name = str(node)
        if scope is None:
            if name in self.variables:
                return self.variables[name]
            if name in self.parameters:
                if self.parameters[name] is None:
                    raise ModelicaError("value", where=self.where, found=name)
                return self.value(self.parameters[name])
            if name in self.kinds:
                raise ModelicaError("discrete", where=self.where, found=name, kind=self.kinds[name])
            if name == "time":
                raise ModelicaError("time", where=self.where)
        found, inside = self.constants(tuple(name.split(".")), scope)
        if inside is None and scope is None:  # a signal's connector
            return sp.Symbol(name, real=True)
        if found is None:
            raise ModelicaError("expression", where=self.where, found=f"{name} without a value")
        return self.value(found, inside)


def _number(where: str, value: Any) -> Any:
    """The exact value of a literal."""
    if isinstance(value, bool):
        return sp.true if value else sp.false
    if isinstance(value, int):
        return sp.Integer(value)
    if isinstance(value, float):
        return sp.Rational(repr(value))
    raise ModelicaError("expression", where=where, found=f"the literal {value!r}")


def node_text(node: Any) -> str:
    """A node of the syntax tree as text."""
    kind = type(node).__name__
    if kind == "Primary":
        return str(node.value)
    if kind == "Equation":
        return f"{node_text(node.left)} = {node_text(node.right)}"
    if kind == "IfEquation":
        return f"if {node_text(node.conditions[0])} then …"
    if kind == "IfExpression":
        condition, then, *_, otherwise = map(node_text, (node.conditions[0], *node.expressions))
        return f"if {condition} then {then} else {otherwise}"
    if kind != "Expression":
        return str(node) if kind == "ComponentRef" else kind
    name, inner = str(node.operator), [node_text(each) for each in node.operands]
    if name in ("+", "-", "*", "/", "^", "<", "<=", ">", ">=", "==", "<>", "and", "or") and len(inner) == 2:
        bare = name not in ("*", "/", "^")
        left, right = (text if bare or " " not in text else f"({text})" for text in inner)
        if name == "-" and " " in right:
            right = f"({right})"
        return f"{left} {name} {right}" if name != "^" else f"{left}^{right}"
    if name in ("-", "not"):
        return f"{name}{' ' if name == 'not' else ''}{inner[0]}"
    return f"{name}({', '.join(inner)})"
