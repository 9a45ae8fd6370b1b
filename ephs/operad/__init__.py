"""Syntax: names, quantities, interconnection patterns, and the laws of the operad that patterns form."""

from ephs.operad.directory import Directory
from ephs.operad.errors import PatternError
from ephs.operad.isomorphism import Renaming
from ephs.operad.laws import LAWS, Equation, Law, law
from ephs.operad.names import ROOT, Path
from ephs.operad.nesting import Nesting
from ephs.operad.parts import Box, Junction, Port, junction
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import Interface, PortType, Quantity, Space, quantity

__all__ = [
    "LAWS",
    "ROOT",
    "Box",
    "Directory",
    "Equation",
    "Interface",
    "Junction",
    "Law",
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
