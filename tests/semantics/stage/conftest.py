"""A store of compiled programs that is a test's own."""

from pathlib import Path

import pytest

from ephs.semantics.stage import store


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where it is; nothing is remembered in the process."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(store.STORE, "usable", True)
    store._prune.cache_clear()
    return tmp_path / "cache" / "ephs" / "objects"
