"""Systems without mechanics, for tests of the solver."""

import pytest

from ephs.semantics import System
from tests.oscillator import damped_oscillator, oscillator


@pytest.fixture
def damped() -> System:
    """The damped oscillator, nested."""
    return damped_oscillator(m=1.0)


@pytest.fixture
def driven() -> System:
    """An oscillator with an open momentum port."""
    return oscillator()
