"""Rewriting of patterns as data: rules, matches up to renaming, derivations that can be checked."""

from ephs.operad.rewriting.derivation import Derivation
from ephs.operad.rewriting.rules import Fragment, Rule

__all__ = ["Derivation", "Fragment", "Rule"]
