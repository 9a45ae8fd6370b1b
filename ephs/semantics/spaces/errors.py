"""The one exception of this room and the texts that it carries."""

from typing import Final, final

from ephs.operad.messages import TextError

TEXTS: Final = {
    "unknown space": "space '{name}' is not known; known are {known}, and every name ending in '*'. "
    "Register others with register_manifold(name, factory).",
    "space numbers": "space '{name}' is declared with (dim, size) = {found}, but its manifold has "
    "{expected}. Correct the space, or register the manifold under another name.",
    "manifold taken": "a manifold named '{name}' is registered already. Choose another name.",
    "dual name": "'{name}' cannot be registered: names ending in '*' are the dual vector spaces.",
    "unknown pair": "joint kind '{name}' is not known; known are {known}. Register others with register_pair(entry).",
    "pair taken": "a pair named '{name}' is registered already. Choose another name.",
    "pair parameters": "pair '{name}' takes the parameters {expected}, found {found}.",
    "pair basis": "pair '{name}': found a basis of shape {found}, expected {expected} "
    "(rows ω then υ, one column per degree of freedom).",
    "pair coordinates": "pair '{name}': found coordinates of shape {found}, expected {expected}.",
    "no material form": "material velocities and covectors belong to rigid motions; "
    "found '{name}', expected 'SE(3)' or 'SO(3)xR3'.",
}


@final
class SpaceError(TextError, ValueError):
    """A space or a pair was named, registered or used wrongly."""

    _texts = TEXTS
