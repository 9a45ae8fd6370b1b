"""Tables of scene files whose keys are the numbers of an element."""

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field, create_model

from ephs.mechanics.scene import schema_numbers as forms
from ephs.mechanics.scene.element import NON_NEGATIVE, POSITIVE, Measured, NumberForm, frozen, part_of

_RANGES: Final[Mapping[Any, Any]] = {
    None: forms.Number,
    POSITIVE: forms.Positive,
    NON_NEGATIVE: forms.NonNegative,
}


def table_of(kind: type[Measured], title: str) -> Any:
    """The model of a table with an element's numbers for keys."""
    keys: dict[str, Any] = {}
    for each in fields(kind):  # pyright: ignore[reportArgumentType] - all are dataclasses
        number, said = part_of(each.type, NumberForm), part_of(each.type, str)
        if number and said:
            keys[each.name] = _key(each, number, said)
    return create_model(f"{kind.__name__}Entry", __base__=forms.EntryTable, __doc__=f"``[{title}]``", **keys)


def _key(of: Any, number: NumberForm, said: str) -> tuple[Any, Any]:
    """Form and field of an attribute."""
    default = of.default if of.default_factory is MISSING else of.default_factory().tolist()
    if number.count:
        form = Annotated[list[_RANGES[number.least]], Field(min_length=number.count, max_length=number.count)]
    else:
        form = _RANGES[number.least]
    return form, forms.key(said, ... if default is MISSING else default)


def attributes(kind: type[Measured], entry: Any) -> dict[str, Any]:
    """The attributes of an element that are keys of its table, as it has them."""
    given: dict[str, Any] = {}
    for key in {each.name for each in fields(kind)} & set(type(entry).model_fields):  # pyright: ignore[reportArgumentType]
        value, number = getattr(entry, key), kind.numbers.get(key)
        if number is not None and number.shape(0) and value is not None:
            value = frozen(np.atleast_1d(np.asarray(value, dtype=float)))
        given[key] = tuple(value) if isinstance(value, list) else value
    return given
