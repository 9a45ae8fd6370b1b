"""Syntax: names, quantities, interconnection patterns, the operad that they form, its algebras, and their laws."""

from ephs.operad.algebra import Algebra, AlgebraMap, Composable, Lax
from ephs.operad.directory import Directory
from ephs.operad.equations import Equation, Law
from ephs.operad.errors import PatternError
from ephs.operad.isomorphism import Renaming
from ephs.operad.laws import ALGEBRA_LAWS, LAWS, MAP_LAWS, law
from ephs.operad.names import ROOT, Path
from ephs.operad.nesting import Nesting
from ephs.operad.parts import Box, Junction, Port, junction
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import Interface, PortType, Quantity, Space, quantity

__all__ = [
    "ALGEBRA_LAWS",
    "LAWS",
    "MAP_LAWS",
    "ROOT",
    "Algebra",
    "AlgebraMap",
    "Box",
    "Composable",
    "Directory",
    "Equation",
    "Interface",
    "Junction",
    "Law",
    "Lax",
    "Nesting",
    "Path",
    "Pattern",
    "PatternError",
    "Port",
    "PortType",
    "Quantity",
    "Renaming",
    "Space",
    "junction",
    "law",
    "quantity",
]
