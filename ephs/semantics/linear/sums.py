"""Sums over many steps that lose no more than rounding of their terms.

Knuth, *The Art of Computer Programming* 2, 4.2.2, theorem B. Numbers are floats, arrays, or abstract ones.
"""

from typing import Any


def grown(total: Any, carry: Any, change: Any) -> tuple[Any, Any]:
    """Return total + carry + change, rounded, and the rounding error for the next sum (Kahan)."""
    wanted = change + carry
    found = total + wanted
    taken = found - total
    return found, (total - (found - taken)) + (wanted - taken)
