"""Hypothesis strategies and checks for suites that build on this package."""

from ephs.testing.laws import check_operad_laws, law_inputs
from ephs.testing.patterns import Nesting, interfaces, nestings, paths, patterns, quantities

__all__ = [
    "Nesting",
    "check_operad_laws",
    "interfaces",
    "law_inputs",
    "nestings",
    "paths",
    "patterns",
    "quantities",
    "register",
]


def register() -> None:
    """Tell Hypothesis how to make paths, quantities and patterns; it calls this when it is imported."""
    from hypothesis import strategies as st

    from ephs.operad import Path, Pattern, Quantity

    st.register_type_strategy(Path, paths())
    st.register_type_strategy(Quantity, quantities())
    st.register_type_strategy(Pattern, patterns())
