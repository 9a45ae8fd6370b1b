"""Hypothesis plug-in: ``from_type(Pattern)`` works in the test suites of users.

It stands apart from `ephs.testing`: that imports Hypothesis, which then calls this before `ephs.testing` is whole.
"""


def register() -> None:
    """Tell Hypothesis how to make paths, quantities, patterns, systems and scenes, each when it is asked for."""
    from importlib import import_module

    from hypothesis import strategies as st

    from ephs.mechanics.scene import Scene
    from ephs.operad import Path, Pattern, Quantity
    from ephs.semantics import System

    strategies = {
        Path: "paths",
        Quantity: "quantities",
        Pattern: "patterns",
        System: "systems",
        Scene: "mechanisms",
    }
    for kind, name in strategies.items():
        st.register_type_strategy(kind, lambda _, name=name: getattr(import_module("ephs.testing"), name)())
