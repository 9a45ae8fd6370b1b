"""The one exception of this room and the texts that it carries."""

from typing import Final, final

from ephs.operad.messages import TextError

TEXTS: Final = {
    "compared": "a number over a step is compared ({order}); an energy does not branch: write abs(…), or a function of "
    "its own for each case.",
    "jumps": "the function {function} jumps, so there is no slope over a step; an energy is continuous.",
    "coordinates": "states of the group with code {code} are not known here; expected one of {expected}.",
}


@final
class DeriveError(TextError, TypeError):
    """A function of which something cannot be derived."""

    _texts = TEXTS
