"""What checking a system says: one line for each law, and where a system fails."""

import pytest

import ephs
from ephs import quantity as Q
from ephs.operad import Pattern
from ephs.semantics import Irreversible, Reference, library
from ephs.semantics.systems.laws import SYSTEM_LAWS
from tests.operad.models import DAMPED
from tests.oscillator import free_oscillator, oscillator


def system(friction):
    return DAMPED(osc=oscillator(), mf=friction, env=library.environment())


@pytest.mark.parametrize("state", [None, {"osc.pe.q": 1.0}])
def test_every_check_holds_of_the_damped_oscillator(state):
    report = system(library.friction(d=0.1)).check(Reference(300.0), state=state)
    assert report.ok, str(report)
    assert [item.name.partition(":")[0] for item in report.items[4:]] == [law.name for law in SYSTEM_LAWS]
    assert all(item.detail for item in report.items)
    assert str(report).count("holds") == len(report.items)


def forged(sign):
    """Friction that passed its checks and then changed: heat comes out of it, or vanishes in it."""
    honest = library.friction(d=0.1)
    factor = [1.0]

    def matrix(x, e, reference):
        m = honest.matrix(x, e, reference).copy()
        m[1] *= factor[0]
        return m

    made = Irreversible("forged", honest.interface, matrix)
    factor[0] = sign
    return made


@pytest.mark.parametrize(("factor", "law"), [(-1.0, "entropy production"), (0.5, "power balance"), (0.5, "exergy")])
def test_a_component_that_breaks_a_law_is_found(factor, law):
    report = system(forged(factor)).check()
    failed = [item.name for item in report.items if not item.ok]
    assert any(name.startswith(law) for name in failed), str(report)
    assert failed[0] == "structure"
    assert "mf" in next(item.detail for item in report.items if item.name == "structure")


def test_a_system_without_equations_is_reported():
    twice = Pattern.from_text("q: displacement; a(q); b(q)")
    report = twice(a=library.spring(k=1.0), b=library.spring(k=2.0)).check()
    assert not report.ok
    assert report.items[-1].name == "assembly"
    assert "a.q and b.q" in report.items[-1].detail


def test_what_is_called_back_in_python_is_named():
    opaque = ephs.storage({"q": Q.displacement}, lambda q: float(q) ** 2)
    report = free_oscillator(pe=opaque).check()
    assert report.ok
    assert "evaluated in Python, which is slow: pe" in str(report)
