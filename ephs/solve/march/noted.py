"""What corrections put into the states of a run that are kept."""

from typing import Any, final

from ephs.solve.snapshot import Snapshot


@final
class Noted:
    """The largest sum in J of what corrections put in, its time in s, and the sum of sizes."""

    def __init__(self) -> None:
        self._largest = self._at = self._total = 0.0

    def note(self, t: float, put: float, total: float) -> None:
        """Remember what corrections put in up to a state that is kept."""
        self._total = total
        if abs(put) > self._largest:
            self._largest, self._at = abs(put), t

    def snapshot(self) -> Snapshot:
        """Notes of the run, for a journal."""
        return {"largest": self._largest, "at": self._at, "total": self._total}

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        self._largest, self._at, self._total = (snapshot[name] for name in ("largest", "at", "total"))

    def stats(self) -> dict[str, Any]:
        """Statistics of corrected steps: by how much the balance would be missed without corrections."""
        return {"plain_defect": {"sum": self._total, "largest": self._largest, "at": self._at}}
