"""What corrections put into the states of a run that are kept."""

from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.running.snapshot import Resumable


@final
class Noted(Resumable):
    """The largest sum in J of what corrections put in, its time in s, and the sum of sizes."""

    changing = "_largest", "_at", "_total"

    def __init__(self) -> None:
        self._largest = self._at = self._total = 0.0

    def note(self, times: Array, put: Array) -> None:
        """Remember what corrections put in up to states that are kept: (n,) in s, (n, 2) the sum and that of sizes."""
        if not times.size:
            return
        sizes = np.abs(put[:, 0])
        worst = int(np.argmax(sizes))
        self._total = float(put[-1, 1])
        if sizes[worst] > self._largest:
            self._largest, self._at = float(sizes[worst]), float(times[worst])

    def stats(self) -> dict[str, Any]:
        """Statistics of corrected steps: by how much the balance would be missed without corrections."""
        return {"plain_defect": {"sum": self._total, "largest": self._largest, "at": self._at}}
