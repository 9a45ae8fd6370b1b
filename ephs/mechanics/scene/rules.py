"""Rules about the keys of an element's table, with the texts of their faults."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias, final

if TYPE_CHECKING:
    from ephs.mechanics.scene.custom import Element
    from ephs.mechanics.scene.site import Site

Told: TypeAlias = bool | Mapping[str, object] | list[Mapping[str, object]]
"""Answer of a rule: whether it holds, or values for the texts of its fault, or of each of its faults."""


@final
@dataclass(frozen=True, slots=True)
class KeyRule:
    """A condition on keys of a table, with its texts."""

    keys: tuple[str, ...]
    holds: Callable[..., Told]
    expected: str
    advice: str
    found: str
    at: str
    placed: bool
    adjusted: bool

    def texts(self, element: "Element", *site: "Site") -> Iterator[tuple[str, str, str, str]]:
        """Key, and texts of the found value, the expected one and the advice, of each fault; none where it holds."""
        told = self.holds(element, *site)
        own = {name: getattr(element, name, None) for name in type(element).model_fields}
        for given in told if isinstance(told, list) else [] if told is True else [told or {}]:
            values = own | dict(given)
            at, found, expected, advice = (
                text.format_map(values) for text in (self.at, self.found, self.expected, self.advice)
            )
            yield at, found, expected, advice


def rule(
    *keys: str,
    expected: str,
    advice: str = "correct the value",
    found: str = "",
    at: str | None = None,
    placed: bool = False,
    adjusted: bool = False,
) -> Callable[[Callable[..., Told]], KeyRule]:
    """Mark a method as a condition on keys of the table: where it is false there is a fault.

    In place of False it may return values by name, which may stand in braces, too, or a list of such values, one for
    each fault. It is asked where none of these keys has a fault of its own.

    Parameters
    ----------
    keys
        The keys that it reads.
    expected, advice
        Texts of the message; values of keys may stand in braces.
    found
        Text of the found value, with values of keys in braces; default: the value at the key, or ``a table``.
    at
        The key that the message names, ``""`` for the whole table; default: the first one.
    placed
        Whether it is asked once all bodies are where the file has them: then the method takes a `Site`, too.
    adjusted
        Likewise, but where they are after an inconsistent initial state was adjusted.
    """

    def marked(holds: Callable[..., Told]) -> KeyRule:
        where = keys[0] if at is None else at
        return KeyRule(keys, holds, expected, advice, found, where, placed or adjusted, adjusted)

    return marked
