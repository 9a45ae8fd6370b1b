"""Two runs to draw: a slider-crank with friction and heat, and a damped oscillator, which has no scene."""

from typing import Any, final

import pytest

import ephs
from tests.oscillator import damped_oscillator
from tests.scenes import shipped


@final
class Altered:
    """A solution of which some parts are others."""

    def __init__(self, solution: ephs.Solution, **parts: Any) -> None:
        self.solution, self.parts = solution, parts

    def __getattr__(self, name: str) -> Any:
        return self.parts[name] if name in self.parts else getattr(self.solution, name)


@pytest.fixture(scope="session")
def circuit() -> ephs.Solution:
    """A damped oscillator: states and ledgers, no scene."""
    return ephs.simulate(damped_oscillator(k=1.0, m=1.0), 10.0, initial={"osc.pe.q": 1.0}, method="natural", step=0.02)


@pytest.fixture(scope="session")
def crank() -> ephs.Solution:
    return ephs.simulate(shipped("slider-crank"), 0.5, step=5e-3)
