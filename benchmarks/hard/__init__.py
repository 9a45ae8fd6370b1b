"""Hard cases: models on which methods have gone wrong, with their true motions."""

from benchmarks.hard import brakes, dead_centre, four_bars, loops, pushes
from benchmarks.hard.case import Case

__all__ = ["CASES", "Case"]

CASES = {case.name: case for case in (*brakes.CASES, *dead_centre.CASES, *four_bars.CASES, *pushes.CASES, *loops.CASES)}
"""The cases by name."""
