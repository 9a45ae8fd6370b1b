"""Sections of scene files that users registered, with their element classes. Imports nothing heavy."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ephs.mechanics.scene.custom import Element

REGISTERED: "dict[str, type[Element]]" = {}
"""Section -> its elements, in the order of registration."""


def registered(section: str) -> "type[Element]":
    """Element class of a registered section.

    Raises
    ------
    ValueError
        Nothing registered it in this process.
    """
    if section not in REGISTERED:
        raise ValueError(f"[{section}.NAME] is not registered: import what calls register_element for it first")
    return REGISTERED[section]


def elements_from(data: Mapping[str, Mapping[str, Any]]) -> "dict[str, dict[str, Element]]":
    """Elements by section and name, of their tables.

    Raises
    ------
    ValueError
        A section is not registered, or a table is not sound.
    """
    return {
        section: {name: registered(section).of_table(name, table) for name, table in tables.items()}
        for section, tables in data.items()
    }
