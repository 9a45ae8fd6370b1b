"""What corrections put into the states of a run that are kept."""

from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.running.snapshot import Resumable


@final
class Noted(Resumable):
    """The largest sum in J of what corrections put in, its time in s, the sum of sizes, and the most that was left."""

    changing = "_largest", "_at", "_total", "_left"

    def __init__(self) -> None:
        self._largest = self._at = self._total = self._left = 0.0

    def note(self, times: Array, put: Array) -> None:
        """Remember what corrections put in up to states that are kept.

        Of times (n,) in s, the sum and that of sizes (n, 2) in J; (n, 3) with what they left missing, where nothing
        could be moved.
        """
        if not times.size:
            return
        sizes = np.abs(put[:, 0])
        worst = int(np.argmax(sizes))
        self._total = float(put[-1, 1])
        self._left = max(self._left, float(np.abs(put[:, 2:]).max(initial=0.0)))
        if sizes[worst] > self._largest:
            self._largest, self._at = float(sizes[worst]), float(times[worst])

    def stats(self) -> dict[str, Any]:
        """Statistics of corrected steps: by how much the balance would be missed without corrections."""
        return {"plain_defect": {"sum": self._total, "largest": self._largest, "at": self._at, "left": self._left}}
