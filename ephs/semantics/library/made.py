"""Ranges of the parameters of the library's parts."""

import math

from ephs.semantics.errors import StructureError

__all__ = ["finite", "non_negative", "positive"]


def positive(path: str, **parameters: float) -> None:
    """Refuse parameters that are not positive."""
    for key, value in parameters.items():
        if not (math.isfinite(value) and value > 0.0):
            raise StructureError("parameter", path, key=key, found=value, expected="a number > 0")


def finite(path: str, **parameters: float) -> None:
    """Refuse parameters that are not finite."""
    for key, value in parameters.items():
        if not math.isfinite(value):
            raise StructureError("parameter", path, key=key, found=value, expected="a finite number")


def non_negative(path: str, **parameters: float) -> None:
    """Refuse parameters that are negative."""
    for key, value in parameters.items():
        if not (math.isfinite(value) and value >= 0.0):
            raise StructureError("parameter", path, key=key, found=value, expected="a number ≥ 0")
