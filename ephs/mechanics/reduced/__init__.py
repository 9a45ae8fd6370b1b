"""The reduced form of a mechanism: joint coordinates of a spanning tree, loops closed by the least constraints."""

__all__ = ["EXPLICIT"]

EXPLICIT = ("rk54", "rk87")
"""Methods that integrate it; what runs them is loaded when one is asked for."""
