"""Tendons of a compiled MJCF that run straight from site to site.

Where two points alone move against each other, the length is a constant and their distance, by the divisor of its
pulley: a spring and a damper between two points. Other lengths without pulleys are tendons of the scene.
"""

from dataclasses import dataclass
from importlib import import_module
from typing import Any, final

import numpy as np

from ephs.mechanics.imports.draft import Draft
from ephs.mechanics.imports.mjcf_names import MjcfNames
from ephs.semantics.bundles.bundle import Array

MEETING = 1e-9
"""Length of a segment between two bodies, relative to the whole, below which it has no direction."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """A length constant + (Σ distance) / divisor from point to point, each (3,) in the frame of the body of its number.

    Parameters
    ----------
    divisor
        1 but for two points.
    """

    bodies: tuple[int, ...]
    points: tuple[Array, ...]
    constant: float
    divisor: float

    def pull(
        self,
        name: str,
        stiffness: float,
        rest: float,
        damping: float,
        names: MjcfNames,
        draft: Draft,
        *,
        slack: bool = False,
    ) -> str | None:
        """A spring and a damper along this length, in N/m, m and N s/m: the scene's tendon, "" where it needs none;
        None where the scene has no such ones.
        """
        if not (stiffness or damping):
            return ""
        length = self.divisor * (rest - self.constant) if stiffness else 0.0
        if stiffness < 0.0 or damping < 0.0 or length < 0.0:
            return None
        k, c = stiffness / self.divisor**2, damping / self.divisor**2
        if len(self.bodies) == 2 and not slack:
            (one, two), (here, there) = (names.bodies[body] for body in self.bodies), self.points
            draft.spring(name, (one, two), (here, there), k, length, c)
            return ""
        if slack and damping:
            self.tendon(f"{name}_damping", names, draft, damping=c)
            c = 0.0
        return self.tendon(name, names, draft, stiffness=k, length=length, damping=c, slack=slack)

    def tendon(self, name: str, names: MjcfNames, draft: Draft, **numbers: Any) -> str:
        """A tendon of the scene along this route; its name there."""
        return draft.tendon(name, [names.bodies[body] for body in self.bodies], self.points, **numbers)


def route_of(model: Any, t: int) -> Route | None:
    """The route of a tendon through sites; None of others, of several moving segments with pulleys, and where sites of
    two bodies meet.
    """
    mujoco: Any = import_module("mujoco")
    kinds, first = mujoco.mjtWrap, int(model.tendon_adr[t])
    data = mujoco.MjData(model.raw)
    mujoco.mj_kinematics(model.raw, data)
    constant, divisor, before = 0.0, 1.0, -1
    spots, moving = list[tuple[int, Array]](), list[tuple[int, int, float, float]]()
    for w in range(first, first + int(model.tendon_num[t])):
        kind, site = int(model.wrap_type[w]), int(model.wrap_objid[w])
        if kind == kinds.mjWRAP_PULLEY:
            divisor, before = float(model.wrap_prm[w]), -1
            continue
        if kind != kinds.mjWRAP_SITE:
            return None
        spots.append(_spot(model, data, site))
        if before >= 0:
            distance = float(np.linalg.norm(data.site_xpos[site] - data.site_xpos[before]))
            if spots[-1][0] == spots[-2][0]:
                constant += distance / divisor
            else:
                moving.append((len(spots) - 2, len(spots) - 1, distance, divisor))
        before = site
    least = min([distance for _, _, distance, _ in moving], default=0.0)
    if least <= MEETING * (constant + sum(distance for _, _, distance, _ in moving)):
        return None
    if len(moving) == 1:
        (a, b, _, over), = moving  # fmt: skip
        return Route((spots[a][0], spots[b][0]), (spots[a][1], spots[b][1]), constant, over)
    if any(int(model.wrap_type[w]) == kinds.mjWRAP_PULLEY for w in range(first, first + int(model.tendon_num[t]))):
        return None
    return Route(tuple(body for body, _ in spots), tuple(at for _, at in spots), 0.0, 1.0)


def _spot(model: Any, data: Any, site: int) -> tuple[int, Array]:
    """The body that carries a site and all that is welded to it, and the site in its frame (3,)."""
    body = int(model.body_weldid[model.site_bodyid[site]])
    turn = np.array(data.xmat[body], dtype=float).reshape(3, 3)
    return body, turn.T @ (np.array(data.site_xpos[site]) - np.array(data.xpos[body]))
