"""Where a component acts, of the states that it reads."""

import math
from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, slots=True)
class Support:
    """Where a component acts: outside of it energies, efforts and flows are 0.

    Parameters
    ----------
    places
        Places among the states' coordinates.
    limit
        The largest value of that coordinate, or norm of several, at which anything happens.
    halves
        Half lengths in m of two boxes about the frames of a relative pose, or none.
    margin
        The largest distance in m of these boxes at which anything happens.
    parallel
        Square of the sine of the angle between the z axes below which nothing happens, of boxes along these.
    depth
        Overlap of surfaces in m beyond which the energy is no number.
    """

    places: tuple[int, ...]
    limit: float
    halves: tuple[float, ...] = ()
    margin: float = 0.0
    parallel: float = 0.0
    depth: float = math.inf
