"""Gyrators between quantities of equal parity: lawful where an external field is reversed, and said so."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs import Path, Pattern
from ephs import quantity as Q
from ephs.semantics import StructureError, library
from ephs.semantics.primitives.pullback import Map, pull_back
from tests.semantics.test_documents import VALID, alone
from tests.semantics.zoo import drag

TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])
ODD = {"p": Q.momentum, "b": Q.flux_linkage}
PARTS = {
    "permanent-magnet motor": lambda **f: ephs.gyrator({"b": Q.flux_linkage, "p": Q.angular_momentum}, 0.3 * TURN, **f),
    "circulator": lambda **f: ephs.gyrator(
        {"a": Q.charge, "b": Q.charge, "c": Q.charge}, [[0, 1, -1], [-1, 0, 1], [1, -1, 0]], **f
    ),
    "rotating frame": lambda **f: ephs.gyrator({"x": Q.momentum, "y": Q.momentum}, 2.0 * TURN, **f),
    "Lorentz force in a field of the place": lambda **f: ephs.gyrator(
        {"x": Q.momentum, "y": Q.momentum, "~q": Q.displacement}, lambda q: (1.0 + q * q) * TURN, **f
    ),
    "transformer": lambda **f: ephs.transformer({"q": Q.displacement, "p": Q.momentum}, [[2.0]], **f),
    "constraint": lambda **f: ephs.constraint({"q": Q.displacement, "p": Q.momentum}, [[1.0, 2.0]], **f),
}


@pytest.mark.parametrize("name", PARTS)
def test_it_is_proved_with_the_flag_and_refused_without_by_its_name(name):
    verdict = PARTS[name](external_field=True).verdict
    assert verdict == "proved" and "D(ϵx) = ϵD(x)" not in verdict.text
    with pytest.raises(StructureError, match=r"time reversal.*declare external_field=True"):
        PARTS[name]()


def test_what_depends_on_the_direction_names_its_own_flag():
    with pytest.raises(StructureError, match=r"time reversal.*declare one_sided=True"):
        valve(one_sided=False)


@given(st.floats(1e-6, 1e6), st.sampled_from([1e-9, 1e-3, 2.0]))
def test_the_flag_excuses_nothing_else(size, leak):
    with pytest.raises(StructureError, match="not reversible"):
        ephs.gyrator(ODD, size * np.array([[0.0, 1.0], [-1.0 + leak, 0.0]]), external_field=True)


def valve(one_sided=True):
    return drag(lambda p, s: 1.0 + 0.5 * np.tanh(p), one_sided=one_sided)()


@pytest.mark.parametrize("make", [*(lambda p=p: p(external_field=True) for p in PARTS.values()), valve])
def test_documents_keep_both(make):
    part = make()
    text = alone(part).to_json()
    VALID.validate(json.loads(text))
    ((_, again),) = ephs.System.from_json(text).leaves()
    assert again.verdict == part.verdict
    flag = "one_sided" if part.kind == "irreversible" else "external_field"
    assert getattr(again, flag)


def test_folding_keeps_both():
    single = Map(np.array([[3.0]]), PARTS["rotating frame"](external_field=True).interface[Path.of("x")])
    assert pull_back(PARTS["rotating frame"](external_field=True), {Path.of("x"): single}).external_field
    assert pull_back(valve(), {Path.of("p"): Map(np.array([[2.0]]), valve().interface[Path.of("p")])}).one_sided


def test_a_charge_in_a_magnetic_field_runs_on_a_circle():
    """A mass of 1 kg on a force of 2 N s/m times its velocity, turned by 90°: 2 rad/s, the speed kept."""
    pattern = Pattern.from_text("x: momentum; y: momentum; a(p=x); b(p=y); g(x, y)")
    mass = library.point_mass(m=1.0)
    system = pattern(a=mass, b=mass, g=PARTS["rotating frame"](external_field=True))
    found = ephs.simulate(system, 1.0, initial={"a.p": 1.0, "b.p": 0.0}, method="rk87", rtol=1e-10, atol=1e-12)
    end = np.array([found["a.p"].ravel()[-1], abs(found["b.p"].ravel()[-1])])
    assert np.allclose(end, [np.cos(2.0), np.sin(2.0)], atol=1e-8)
