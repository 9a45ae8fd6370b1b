"""SymPy as a value without types: it ships none, and half-known types are worse than none."""

from importlib import import_module
from typing import Any, TypeAlias

sp: Any = import_module("sympy")
Expr: TypeAlias = Any
"""An expression of SymPy."""


def text_of(expression: Expr) -> str:
    """An expression as text; compositions of operators are written side by side."""
    return str(_Text().doprint(expression))


_Printer: Any = import_module("sympy.printing.str").StrPrinter


class _Text(_Printer):
    """SymPy's function, except for non-commutative products."""

    def _print_Mul(self, expression: Expr) -> str:
        numbers, operators = expression.args_cnc()
        if not operators:
            return str(_Printer._print_Mul(self, expression))
        factor = sp.Mul(*numbers)
        head = {1: "", -1: "-"}.get(factor, f"{_Printer.doprint(self, factor)} ")
        mine = sp.printing.precedence.PRECEDENCE["Mul"]
        return head + " ".join(_Printer.parenthesize(self, entry, mine) for entry in operators)

    def _print_Pow(self, expression: Expr, rational: bool = False) -> str:
        return str(_Printer._print_Pow(self, expression, rational)).replace("**", "^")
