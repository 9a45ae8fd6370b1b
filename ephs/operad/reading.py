"""Untrusted JSON documents, parsed and validated key by key; errors name the position."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import NoReturn, cast, final

from ephs.operad.errors import PatternError


@final
@dataclass(frozen=True, slots=True)
class Reader:
    """Reader of the parts of a document; every method but `json` takes the position of its value.

    Parameters
    ----------
    what
        What the document is, for messages: ``"pattern"``.

    Raises
    ------
    PatternError
        By every method, for what is not as expected, with its place.
    """

    what: str

    def json(self, text: object) -> object:
        """Parse JSON text: finite numbers, each key once in an object."""
        if not isinstance(text, str | bytes):
            self.refuse("document", type(text).__name__, "JSON text")
        try:
            return json.loads(text, object_pairs_hook=self._unique, parse_constant=self._no_constant)
        except json.JSONDecodeError as error:
            self.refuse(f"line {error.lineno}, column {error.colno}", error.msg, "JSON")
        except (UnicodeDecodeError, RecursionError) as error:
            self.refuse("document", type(error).__name__, "JSON text in UTF-8 of moderate depth")
        except PatternError:
            raise
        except ValueError as error:  # a number of too many digits
            self.refuse("document", str(error), "JSON")

    def format(self, found: Mapping[str, object], number: int) -> None:
        """Refuse a document of another format."""
        if type(found["format"]) is not int or found["format"] != number:
            self.refuse("format", found["format"], f"{number}")

    def record(self, where: str, value: object, needed: set[str], allowed: set[str]) -> dict[str, object]:
        """An object with all required keys and no others than these and the optional ones."""
        found = dict(self.mapping(where, value))
        if missing := sorted(needed - found.keys()):
            self.refuse(where, f"no key {missing[0]}", f"the keys {', '.join(sorted(needed))}")
        if extra := sorted(found.keys() - needed - allowed):
            self.refuse(where, f"key {extra[0]}", f"only {', '.join(sorted(needed | allowed))}")
        return found

    def mapping(self, where: str, value: object) -> list[tuple[str, object]]:
        """An object, as pairs."""
        if not isinstance(value, Mapping):
            self.refuse(where, value, "an object")
        pairs = list(cast("Mapping[object, object]", value).items())
        for key, _ in pairs:
            if not isinstance(key, str):
                self.refuse(where, key, "keys that are text")
        return cast("list[tuple[str, object]]", pairs)

    def list(self, where: str, value: object) -> Sequence[object]:
        """A list."""
        if not isinstance(value, list | tuple):
            self.refuse(where, value, "a list")
        return cast("Sequence[object]", value)

    def text(self, where: str, value: object) -> str:
        """A text."""
        return value if isinstance(value, str) else self.refuse(where, value, "text")

    def whole(self, where: str, value: object) -> int:
        """A whole number."""
        return value if type(value) is int else self.refuse(where, value, "a whole number")

    def number(self, where: str, value: object) -> float:
        """A number; `finite` also refuses those that JSON's digits overflow to."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.refuse(where, value, "a number")
        try:
            return float(value)
        except OverflowError:
            self.refuse(where, "a whole number of too many digits", "a number")

    def finite(self, where: str, value: object) -> float:
        """A finite number."""
        number = self.number(where, value)
        return number if isfinite(number) else self.refuse(where, value, "a finite number")

    def refuse(self, where: str, found: object, expected: str) -> NoReturn:
        """Refuse the document."""
        shown = found if isinstance(found, str) else repr(found)
        raise PatternError("json", where=where, found=shown, expected=expected, what=self.what)

    def _unique(self, pairs: "list[tuple[str, object]]") -> dict[str, object]:
        found = dict(pairs)
        if len(found) < len(pairs):
            names = [name for name, _ in pairs]
            again = next(name for name in found if names.count(name) > 1)
            self.refuse("document", f"the key {again} twice in one object", "each key once")
        return found

    def _no_constant(self, name: str) -> NoReturn:
        self.refuse("document", name, "finite numbers")
