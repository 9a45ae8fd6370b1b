"""Layers of shells: the tables of their list, and their numbers in other units."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import Field, WrapValidator

from ephs.mechanics.elements.shell.section import Ply, ShellSection
from ephs.mechanics.scene.custom import dimensions, key
from ephs.mechanics.scene.schema_numbers import EntryTable, NonNegative, Number, Positive


class LayerEntry(EntryTable):
    """``layer`` of a shell: a sheet of fibres, or of one material."""

    thickness: Positive = key("", unit="m")
    E1: Positive = key("Young's modulus along the fibres", unit="Pa")
    E2: Positive = key("across them", unit="Pa")
    G12: Positive = key("shear modulus", unit="Pa")
    nu12: Number = key("contraction across the fibres of a pull along them", 0.0, unit="1")
    angle: Number = key("from the first axis of elements to the fibres, about the normal", 0.0, unit="rad")
    rho: NonNegative = key("density", 0.0, unit="kg/m³")
    G13: Positive | None = key("modulus of transverse shear along the fibres; default: G12", None, unit="Pa")
    G23: Positive | None = key("across them; default: G12", None, unit="Pa")


def _layer(value: Any, _handler: Any) -> dict[str, Any]:
    return LayerEntry.model_validate(value).model_dump(exclude_none=True)


Layer = Annotated[dict[str, Any], WrapValidator(_layer, json_schema_input_type=LayerEntry)]
Layers = Annotated[list[Layer], Field(min_length=1)]
LAYER_NUMBERS = dimensions(LayerEntry)
"""Keys of a layer, and their dimensions."""


def laminate(layers: Sequence[Mapping[str, float]]) -> ShellSection:
    """Their section, the lowest layer first.

    Raises
    ------
    StructureError
        A number is out of range.
    """
    return ShellSection.laminate([Ply(**layer) for layer in layers], named="layers")


def layer_number(layer: Mapping[str, float], key: str) -> float:
    """Its number at a key, or what stands for it where it is not given."""
    return layer.get(key, layer["G12"])  # G13 and G23 alone are left out: all others have values


def rescaled_layers(
    layers: Sequence[Mapping[str, float]], length: float, mass: float, time: float
) -> list[dict[str, float]]:
    """The same in other units."""
    return [
        {name: value * float(LAYER_NUMBERS[name].unit(length, mass, time, ())) for name, value in layer.items()}
        for layer in layers
    ]
