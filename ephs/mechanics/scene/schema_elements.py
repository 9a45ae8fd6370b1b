"""Tables of scene files whose keys are the attributes of an element."""

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Annotated, Any, Final, get_args

from pydantic import Field, create_model

from ephs.mechanics.scene import schema_numbers as forms
from ephs.mechanics.scene.element import NON_NEGATIVE, POSITIVE, Measured, Number, part_of

_RANGES: Final[Mapping[Any, Any]] = {
    None: forms.Number,
    POSITIVE: forms.Positive,
    NON_NEGATIVE: forms.NonNegative,
}
_FORMS: Final[Mapping[Any, Any]] = {
    bool: forms.Flag,
    str: forms.Text,
    tuple[str, ...]: forms.Names,
}


def table_of(kind: type[Measured], title: str, **others: Any) -> Any:
    """The model of a table with an element's attributes for keys; ``others`` are keys of another form."""
    keys: dict[str, Any] = {}
    for each in fields(kind):  # pyright: ignore[reportArgumentType] - all are dataclasses
        if each.name in others:
            keys[each.name] = others.pop(each.name)
        elif said := part_of(each.type, str):
            keys[each.name] = _key(each, part_of(each.type, Number), said)
    return create_model(f"{kind.__name__}Entry", __base__=forms.Entry, __doc__=f"``[{title}]``", **others, **keys)


def _key(of: Any, number: Number | None, said: str) -> tuple[Any, Any]:
    """Form and field of an attribute."""
    default = of.default if of.default_factory is MISSING else of.default_factory().tolist()
    if number is None:
        form = _FORMS[get_args(of.type)[0]]
    elif number.count:
        form = Annotated[list[_RANGES[number.least]], Field(min_length=number.count, max_length=number.count)]
    else:
        form = _RANGES[number.least]
    return form, forms.key(said, ... if default is MISSING else default)
