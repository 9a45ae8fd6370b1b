"""Names of the methods by what they can do."""

from ephs.mechanics.methods.registry import METHODS

__all__ = ["FIXED_OF_SCENES", "OF_SCENES"]

OF_SCENES = [name for name, method in METHODS.items() if method.scenes]
"""Methods that move scenes."""

FIXED_OF_SCENES = [name for name in OF_SCENES if METHODS[name].fixed]
"""Those of them that take constant steps."""
