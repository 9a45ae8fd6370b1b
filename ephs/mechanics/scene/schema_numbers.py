"""Kinds of numbers and texts in scene files, with one message for each fault."""

import math
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema, WrapValidator
from pydantic_core import PydanticCustomError

LARGEST = 1e50
"""No number of a scene is larger in size, and those below its inverse count as 0: products of several stay finite."""


def _settled(value: Any) -> Any:
    return 0.0 if isinstance(value, float) and -1.0 / LARGEST < value < 1.0 / LARGEST else value


# Editors are told of the signs that numbers must have, not of sizes that nobody reaches.
_NUMBER_SCHEMA: dict[str, Any] = {"type": "number"}
Number = Annotated[
    float,
    BeforeValidator(_settled),
    Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST),
    WithJsonSchema(_NUMBER_SCHEMA),
]
NonNegative = Annotated[
    float,
    BeforeValidator(_settled),
    Field(strict=True, allow_inf_nan=False, ge=0.0, le=LARGEST),
    WithJsonSchema(_NUMBER_SCHEMA | {"minimum": 0.0}),
]
Positive = Annotated[
    float,
    BeforeValidator(_settled),
    Field(strict=True, allow_inf_nan=False, gt=0.0, le=LARGEST),
    WithJsonSchema(_NUMBER_SCHEMA | {"exclusiveMinimum": 0.0}),
]
Series = Annotated[list[Number], Field(min_length=1)]
Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]
Quaternion = Annotated[list[Number], Field(min_length=4, max_length=4)]
Text = Annotated[str, Field(strict=True, min_length=1)]
Flag = Annotated[bool, Field(strict=True)]
Names = Annotated[list[Text], Field(min_length=2)]
Pair = Annotated[list[Text], Field(min_length=2, max_length=2)]
Extents = Annotated[list[Positive], Field(min_length=3, max_length=3)]
Sizes = Annotated[list[Positive], Field(min_length=2, max_length=2)]
Couple = Annotated[list[Number], Field(min_length=2, max_length=2)]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _check_sizes(entries: list[Any]) -> None:
    if not all(-math.inf < entry < math.inf for entry in entries):
        raise PydanticCustomError("finite_number", "a finite number")
    if not all(-LARGEST <= entry <= LARGEST for entry in entries):
        raise PydanticCustomError("large", "a number of moderate size")


_LIST_SCHEMA: dict[str, Any] = {"type": "array", "items": {"type": "number"}}


def _limits(value: Any, _handler: Any) -> list[float]:
    """Two ascending numbers, either of which may be nan."""
    if not isinstance(value, list) or len(value) != 2 or not all(_is_number(entry) for entry in value):
        raise PydanticCustomError("limits", "two numbers")
    lower, upper = map(float, value)
    if not all(math.isnan(x) or -LARGEST <= x <= LARGEST for x in (lower, upper)) or lower >= upper:
        raise PydanticCustomError("limits", "two numbers")
    return [lower, upper]


def _numbers(value: Any, handler: Any) -> Any:
    """A number or a list of numbers, with one message instead of one for each alternative."""
    entries = value if isinstance(value, list) else [value]
    if not all(_is_number(entry) for entry in entries):
        raise PydanticCustomError("numbers", "a number or a list of numbers")
    _check_sizes(entries)
    return handler([_settled(entry) for entry in value] if isinstance(value, list) else _settled(value))


def _matrix(value: Any, handler: Any) -> Any:
    """A number, a list of numbers or a list of rows."""
    if not isinstance(value, list) or not value or not all(isinstance(row, list) for row in value):
        return _numbers(value, handler)
    entries = [entry for row in value for entry in row]
    if not all(_is_number(entry) for entry in entries):
        raise PydanticCustomError("numbers", "a number, a list of numbers or a symmetric matrix")
    _check_sizes(entries)
    return handler([[_settled(entry) for entry in row] for row in value])


def _inertia(value: Any, handler: Any) -> Any:
    """Three or six numbers."""
    if isinstance(value, list) and len(value) not in (3, 6):
        raise PydanticCustomError("inertia_length", "3 or 6 numbers")
    return handler(value)


def _range(value: Any, _handler: Any) -> list[float]:
    """Two numbers, the second not below the first."""
    if not isinstance(value, list) or len(value) != 2 or not all(_is_number(entry) for entry in value):
        raise PydanticCustomError("ordered", "two numbers")
    lower, upper = map(float, value)
    if not -LARGEST <= lower <= upper <= LARGEST:
        raise PydanticCustomError("ordered", "two numbers")
    return [lower, upper]


Limits = Annotated[list[float], WrapValidator(_limits), WithJsonSchema(_LIST_SCHEMA | {"minItems": 2, "maxItems": 2})]
Range = Annotated[list[float], WrapValidator(_range), WithJsonSchema(_LIST_SCHEMA | {"minItems": 2, "maxItems": 2})]
_ROWS_SCHEMA: dict[str, Any] = {"type": "array", "items": _LIST_SCHEMA}

Numbers = Annotated[
    float | list[float], WrapValidator(_numbers), WithJsonSchema({"anyOf": [_NUMBER_SCHEMA, _LIST_SCHEMA]})
]
Matrix = Annotated[
    float | list[float] | list[list[float]],
    WrapValidator(_matrix),
    WithJsonSchema({"anyOf": [_NUMBER_SCHEMA, _LIST_SCHEMA, _ROWS_SCHEMA]}),
]
Inertia = Annotated[
    list[Number], WrapValidator(_inertia), WithJsonSchema(_LIST_SCHEMA | {"minItems": 3, "maxItems": 6})
]


class EntryTable(BaseModel):
    """Base of all tables: unknown keys are faults."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def key(meaning: str, default: Any = ..., **more: Any) -> Any:
    """A key of a table; it is required where it has no default."""
    return Field(default=default, description=meaning, **more)
