"""No run is wrong in silence: each is right, refused with a message, or found by its audit."""

import pytest

from ephs.mechanics.methods.registry import METHODS
from ephs.show.charts import FAMILIES, SILENT, ChartOutcome, stability
from ephs.solve.auditing.findings import Audit
from ephs.solve.running import ending

LIMIT = 0.5
"""Processor time in s of a run."""
CHOSEN = ("large-steps", "half-turn", "slender", "toggle", "universal", "immobile")
NAMES = [name for name, method in METHODS.items() if method.scenes]


def judged(family):
    """Both ends of a family, all methods, the coarse step and the tolerances."""
    return stability(FAMILIES[family], NAMES, quick=True, limit=LIMIT)


@pytest.mark.parametrize("family", CHOSEN)
def test_every_run_is_right_or_refused_or_found_wrong(family):
    cells = judged(family)
    assert {cell.value for cell in cells} == {FAMILIES[family].values[0], FAMILIES[family].values[-1]}
    assert [(cell.value, cell.method, str(cell.setting), cell.error) for cell in cells if cell.outcome in SILENT] == []
    assert all(cell.message for cell in cells if cell.outcome in {ChartOutcome.REFUSED, ChartOutcome.FLAGGED})
    assert sum(cell.outcome is ChartOutcome.RIGHT for cell in cells) > len(cells) // 3


def test_without_the_audit_some_are_wrong_in_silence(monkeypatch):
    monkeypatch.setattr(ending, "audit", lambda *_: Audit())
    cells = stability(FAMILIES["half-turn"], ["natural"], quick=True, limit=LIMIT)
    assert any(cell.outcome in SILENT for cell in cells)
