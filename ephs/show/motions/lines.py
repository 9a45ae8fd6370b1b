"""What runs straight from point to point of bodies: springs, segments of tendons, lines of elements of one's own."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, final

import numpy as np

from ephs.mechanics.scene.element import ENVIRONMENT, GROUND
from ephs.mechanics.scene.model import elements_of
from ephs.mechanics.scene.site import Site
from ephs.show.motions.motion import Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class BodyLine:
    """From a point (3,) of one body to one of another, each in its body's frame; drawn as a coil, or straight."""

    body1: str
    body2: str
    at1: Array
    at2: Array
    heat: str
    coiled: bool


def lines_of(scene: Any) -> dict[str, BodyLine]:
    """The springs of a scene, the segments NAME-1, NAME-2, … of its tendons, and lines of its elements."""
    found = {
        name: BodyLine(s.bodies[0], s.bodies[1], np.array(s.at1), np.array(s.at2), s.heat, coiled=True)
        for name, s in scene.all_springs()
    }
    for name, tendon in scene.all_tendons():
        ends = pairwise(zip(tendon.bodies, map(np.array, tendon.points), strict=True))
        for k, ((one, here), (two, there)) in enumerate(ends, 1):
            found[f"{name}-{k}"] = BodyLine(one, two, here, there, tendon.heat, coiled=False)
    for path, level in scene.levels():
        for element in elements_of(level):
            site = Site(level, element)
            for k, (one, here, two, there) in enumerate(element.lines(site), 1):
                ends = [
                    (body if body == GROUND else path + body, site.point(body, at))
                    for body, at in ((one, here), (two, there))
                ]
                name = f"{element.section}.{path}{element.name}-{k}"
                found[name] = BodyLine(ends[0][0], ends[1][0], ends[0][1], ends[1][1], ENVIRONMENT, coiled=False)
    return found
