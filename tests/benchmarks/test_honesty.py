"""Hard cases: no run is wrong in silence, in the table that the docs show and in some of its cells that run here."""

import pytest

from benchmarks.hard import CASES
from benchmarks.honesty import Kind, cells, known, methods, settings
from ephs.solve.auditing.findings import Audit
from ephs.solve.running import ending

HERE = {
    "brake 100": ("natural", "natural4", "radau", "rk54"),
    "beyond stability": ("auto", "natural", "variational", "rk54", "rk87"),
    "dead centre": ("rk87", "variational"),
    "pin tilted 1e-07": ("auto", "natural"),
    "heavy rocker": ("natural4", "radau"),
    "wired and open": ("natural", "radau", "rk54"),
    "jumps": ("natural4", "rk87"),
    "bricard": ("radau", "rk54"),
    "nothing supplied": ("rk54", "radau"),
    "size 3e-09 m": ("auto", "rk54", "rk87"),
}
"""Cases and methods that are run here."""
LIMIT = 120.0
"""Seconds after which a run counts as one that never ends: far more than any takes on a slow machine."""


def some(case):
    return cells(CASES[case], {name: methods()[name] for name in HERE[case]}, LIMIT)


@pytest.mark.parametrize("case", HERE)
def test_a_case_is_right_or_refused_or_found_wrong(case):
    found = some(case)
    assert [cell for cell in found if cell.kind in {Kind.SILENT, Kind.SLOW}] == []
    assert all(cell.said for cell in found if cell.kind is not Kind.RIGHT)
    if case == "dead centre":  # the mechanism may branch there: rounding decides which way
        return
    shown = {(cell.method, cell.setting): cell.kind for cell in known() if cell.case == case}
    assert {(cell.method, cell.setting): cell.kind for cell in found}.items() <= shown.items()


def test_without_the_audit_some_are_silent(monkeypatch):
    monkeypatch.setattr(ending, "audit", lambda *_: Audit())
    silent = {cell.method for cell in some("beyond stability") if cell.kind is Kind.SILENT}
    assert silent >= {"rk54", "rk87"}


def test_the_table_of_the_docs_has_every_case_by_every_method_and_nothing_silent():
    found = known()
    assert [(cell.case, cell.method, cell.setting) for cell in found] == [
        (case.name, name, str(setting))
        for case in CASES.values()
        for name, method in methods().items()
        for setting in settings(case, method)
    ]
    assert [cell for cell in found if cell.kind == Kind.SILENT] == []
