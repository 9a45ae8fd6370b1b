"""The library that the tests read: textbook components in the connectors of Modelica's libraries."""

from pathlib import Path

import pytest

import ephs

PARTS = Path(__file__).with_name("parts.mo")


@pytest.fixture(scope="session")
def parts():
    """All parts, lawful and not."""
    return ephs.ModelicaLibrary(PARTS)
