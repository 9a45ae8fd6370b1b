"""SymPy as a value without types: it ships none, and half-known types are worse than none."""

from importlib import import_module
from typing import Any, TypeAlias

__all__ = ["Expr", "python_code", "sp"]

sp: Any = import_module("sympy")
Expr: TypeAlias = Any
"""An expression of SymPy."""


def python_code(expression: Expr) -> str:
    """An expression as Python, with functions of `math`."""
    printer: Any = import_module("sympy.printing.pycode").PythonCodePrinter({"fully_qualified_modules": True})
    return str(printer.doprint(expression))
