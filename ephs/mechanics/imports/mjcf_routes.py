"""Tendons of a compiled MJCF that run straight from site to site: springs and dampers between two points.

The length of a tendon whose sites move against each other in one place only is a constant and the distance of two
points, by the divisor of its pulley.
"""

from dataclasses import dataclass
from importlib import import_module
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.imports.draft import Draft
from ephs.mechanics.imports.mjcf_names import Names

__all__ = ["Route", "route_of"]

Array = NDArray[np.float64]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """A length constant + distance / divisor of two points, each (3,) in the frame of the body of its number.

    Parameters
    ----------
    distance
        Of the points in the reference configuration, m.
    """

    bodies: tuple[int, int]
    points: tuple[Array, Array]
    constant: float
    distance: float
    divisor: float

    def pull(self, name: str, stiffness: float, rest: float, damping: float, names: Names, draft: Draft) -> bool:
        """A spring and a damper along this length, in N/m, m and N s/m; whether the scene has them."""
        if not (stiffness or damping):
            return True
        length = self.divisor * (rest - self.constant) if stiffness else 0.0
        if stiffness < 0.0 or damping < 0.0 or length < 0.0 or not self.distance:
            return False
        first, second = (names.bodies[body] for body in self.bodies)
        scale = 1.0 / self.divisor**2
        draft.spring(name, (first, second), self.points, scale * stiffness, length, scale * damping)
        return True


def route_of(model: Any, t: int) -> Route | None:
    """The route of a tendon through sites of which two in a row move against each other; None of others."""
    mujoco: Any = import_module("mujoco")
    kinds, first = mujoco.mjtWrap, int(model.tendon_adr[t])
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    constant, divisor, before, moving = 0.0, 1.0, -1, list[tuple[int, int, float, float]]()
    for w in range(first, first + int(model.tendon_num[t])):
        kind, site = int(model.wrap_type[w]), int(model.wrap_objid[w])
        if kind == kinds.mjWRAP_PULLEY:
            divisor, before = float(model.wrap_prm[w]), -1
            continue
        if kind != kinds.mjWRAP_SITE:
            return None
        if before >= 0:
            distance = float(np.linalg.norm(data.site_xpos[site] - data.site_xpos[before]))
            a, b = (int(model.body_weldid[model.site_bodyid[s]]) for s in (before, site))
            if a == b:
                constant += distance / divisor
            else:
                moving.append((before, site, distance, divisor))
        before = site
    if len(moving) != 1:
        return None
    (a, b, distance, over), = moving  # fmt: skip
    ends = int(model.site_bodyid[a]), int(model.site_bodyid[b])
    return Route(ends, (np.array(model.site_pos[a]), np.array(model.site_pos[b])), constant, distance, over)
