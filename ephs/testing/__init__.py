"""Hypothesis strategies and checks for suites that build on this package."""

from ephs.testing.algebras import algebra_inputs, check_algebra, check_algebra_map
from ephs.testing.laws import check_operad_laws, law_inputs
from ephs.testing.mechanisms import mechanisms
from ephs.testing.patterns import fresh_names, interfaces, nestings, paths, patterns, quantities
from ephs.testing.primitives import irreversibles, reversibles, storages
from ephs.testing.structures import check_entropy_production, check_primitive
from ephs.testing.systems import (
    check_functoriality,
    check_natural,
    check_power_balance,
    fillings,
    systems,
)

__all__ = [
    "algebra_inputs",
    "check_algebra",
    "check_algebra_map",
    "check_entropy_production",
    "check_functoriality",
    "check_natural",
    "check_operad_laws",
    "check_power_balance",
    "check_primitive",
    "fillings",
    "fresh_names",
    "interfaces",
    "irreversibles",
    "law_inputs",
    "mechanisms",
    "nestings",
    "paths",
    "patterns",
    "quantities",
    "reversibles",
    "storages",
    "systems",
]
