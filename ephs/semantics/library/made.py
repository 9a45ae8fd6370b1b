"""Ranges of the parameters of the library's parts."""

import math

from ephs.semantics.bundles.errors import StructureError

__all__ = ["finite", "non_negative", "positive"]


def positive(path: str, **parameters: float | None) -> None:
    """Refuse parameters that are not positive."""
    for key, value in parameters.items():
        if value is None or not (_is_number(value) and value > 0.0):
            raise StructureError("parameter", path, key=key, found=repr(value), expected="a number > 0")


def finite(path: str, **parameters: float) -> None:
    """Refuse parameters that are not finite."""
    for key, value in parameters.items():
        if not _is_number(value):
            raise StructureError("parameter", path, key=key, found=repr(value), expected="a finite number")


def non_negative(path: str, **parameters: float) -> None:
    """Refuse parameters that are negative."""
    for key, value in parameters.items():
        if not (_is_number(value) and value >= 0.0):
            raise StructureError("parameter", path, key=key, found=repr(value), expected="a number ≥ 0")


def _is_number(value: object) -> bool:
    """Whether a value is a finite number; no text is."""
    try:
        return math.isfinite(value)  # pyright: ignore[reportArgumentType] - of whatever a user gave
    except TypeError:
        return False
