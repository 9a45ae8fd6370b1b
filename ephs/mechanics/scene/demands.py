"""Ports that a level of a scene needs from its parts: of bodies, thermal nodes and driven joints."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import final

from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.site import built


@final
@dataclass(frozen=True, slots=True)
class Demands:
    """Bodies, thermal nodes and driven joints that the level above connects to, by names of this level."""

    bodies: frozenset[str]
    nodes: frozenset[str]
    joints: set[str]

    def of_part(self, part: str) -> "Demands":
        """The same, as seen from a part."""
        start = part + "."

        def inside(names: Iterable[str]) -> set[str]:
            return {name[len(start) :] for name in names if name.startswith(start)}

        return Demands(frozenset(inside(self.bodies)), frozenset(inside(self.nodes)), inside(self.joints))


def demands_on_parts(scene: Scene, demands: Demands) -> Demands:
    """Ports that the level above and this level's joints and other elements need from its parts."""
    joints = scene.joints.values()
    bodies = {name for j in joints for name in (j.body1, j.body2)}
    nodes = {x.heat for x in joints}
    turned = {name for name, j in scene.joints.items() if j.armature}
    for path in built(scene).junctions:
        of = {"momenta": bodies, "entropies": nodes, "drives": turned}.get(path[0])
        if of is not None:
            of.add(".".join(path[1:]))
    return Demands(demands.bodies | bodies, demands.nodes | nodes, demands.joints | turned)
