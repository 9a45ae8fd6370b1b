"""Errors with texts from a table survive the way to another process; texts are legible."""

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs.operad.messages import legible
from ephs.semantics.derive.errors import DeriveError
from ephs.semantics.spaces import SpaceError

ERRORS = {
    "export": ephs.ExportError("target", found="tape", expected="C"),
    "exchange": ephs.ExchangeError("end", found=1.5, start=0.0),
    "modelica": ephs.ModelicaError("structure", where="resistor", found="no power"),
    "derive": DeriveError("jumps", function="floor"),
    "space": SpaceError("manifold taken", name="SE(3)"),
}


@pytest.mark.parametrize("error", ERRORS.values(), ids=ERRORS)
def test_errors_come_back_from_another_process(error):
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is type(error) and str(back) == str(error)
    assert (back.fault, back.details) == (error.fault, error.details)


@given(st.text(max_size=700))
def test_legible_texts_are_printable_and_short(text):
    found = legible(text)
    assert found.isprintable()
    assert found == text or not text.isprintable() or (len(text) > 600 and len(found) < 300)
