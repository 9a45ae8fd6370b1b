"""Systems without mechanics, for tests of the solver."""

import pytest

from ephs.operad import Pattern, junction
from ephs.operad import quantity as Q
from ephs.semantics import System
from ephs.semantics import library as lib

OSCILLATOR = Pattern(
    junctions={"q": junction(Q.displacement), "p": junction(Q.momentum, exposed=True)},
    boxes={"pe": {"q": "q"}, "ke": {"p": "p"}, "pkc": {"q": "q", "p": "p"}},
)
DAMPED = Pattern(
    junctions={"p": junction(Q.momentum), "s": junction(Q.entropy)},
    boxes={"osc": {"p": "p"}, "mf": {"p": "p", "s": "s"}, "env": {"s": "s"}},
)


def oscillator(k: float = 1.5, m: float = 1.0) -> System:
    """A spring and a mass, the momentum exposed."""
    return OSCILLATOR(pe=lib.spring(k=k), ke=lib.point_mass(m=m), pkc=lib.pkc())


@pytest.fixture
def damped() -> System:
    """The damped oscillator, nested."""
    return DAMPED(osc=oscillator(), mf=lib.friction(d=0.1), env=lib.environment())


@pytest.fixture
def driven() -> System:
    """An oscillator with an open momentum port."""
    return oscillator()
