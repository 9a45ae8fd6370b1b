"""SymPy's counterparts of `ephs.semantics.primitives.special`: derivatives, signs, and printing."""

from typing import Any

from ephs.semantics.symbols.algebra import Expr, sp

_Function: Any = sp.Function


class Sinhc(_Function):
    """sinh(z)/z."""

    nargs = 1

    @classmethod
    def eval(cls, z: Expr) -> Any:
        """1 at zero; even."""
        if z.is_zero:
            return sp.Integer(1)
        return cls(-z) if z.could_extract_minus_sign() else None

    def fdiff(self, argindex: int = 1) -> Expr:
        """The derivative."""
        return SinhcSlope(self.args[0])

    def _eval_is_real(self) -> bool | None:
        return self.args[0].is_real

    def _eval_is_positive(self) -> bool | None:
        return True if self.args[0].is_real else None

    def _eval_evalf(self, prec: int) -> Expr:
        z = self.args[0]._eval_evalf(prec)
        return sp.sinh(z) / z

    def _eval_rewrite_as_sinh(self, z: Expr, **_: Any) -> Expr:
        return sp.sinh(z) / z

    def _latex(self, printer: Any, **_: Any) -> str:
        return rf"\operatorname{{sinhc}}\left({printer._print(self.args[0])}\right)"


class SinhcSlope(_Function):
    """(cosh(z) − sinh(z)/z)/z, the derivative of sinh(z)/z."""

    nargs = 1

    @classmethod
    def eval(cls, z: Expr) -> Any:
        """0 at zero; odd."""
        if z.is_zero:
            return sp.Integer(0)
        mirrored: Any = cls(-z) if z.could_extract_minus_sign() else None
        return None if mirrored is None else -mirrored

    def fdiff(self, argindex: int = 1) -> Expr:
        """From z (z sinhc)'' = z² sinhc."""
        z = self.args[0]
        return Sinhc(z) - 2 * self / z

    def _eval_is_real(self) -> bool | None:
        return self.args[0].is_real

    def _eval_evalf(self, prec: int) -> Expr:
        z = self.args[0]._eval_evalf(prec)
        return (sp.cosh(z) - sp.sinh(z) / z) / z
