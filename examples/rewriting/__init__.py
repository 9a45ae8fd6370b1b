"""Rewriting of patterns as data: rules, matches up to renaming, derivations that can be checked."""

from examples.rewriting.derivation import Derivation
from examples.rewriting.rules import Fragment, Rule

__all__ = ["Derivation", "Fragment", "Rule"]
