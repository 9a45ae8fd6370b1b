"""The examples in docstrings run; names that are exported exist."""

import doctest
import importlib
import pkgutil

import pytest

import ephs.operad
import ephs.semantics.algebra

MODULES = [
    f"{room.__name__}.{found.name}"
    for room in (ephs.operad, ephs.semantics.algebra)
    for found in pkgutil.iter_modules(room.__path__)
]


@pytest.mark.parametrize("name", MODULES)
def test_examples_in_docstrings(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0


def test_there_are_examples():
    tried = [doctest.testmod(importlib.import_module(name)).attempted for name in MODULES]
    assert sum(tried) >= 5


def test_what_is_exported_exists():
    assert all(word in dir(ephs.operad) for word in ephs.operad.__all__)
