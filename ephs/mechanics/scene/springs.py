"""Springs and dampers between two points of bodies."""

from collections.abc import Mapping
from typing import Any, final

import numpy as np

from ephs.mechanics.elements.joints import spring_damper
from ephs.mechanics.scene.custom import Element, key
from ephs.mechanics.scene.element import ENVIRONMENT
from ephs.mechanics.scene.rules import rule
from ephs.mechanics.scene.schema_numbers import NonNegative, Number, Pair, Text, Vector
from ephs.mechanics.scene.site import Site
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.rank import ASSEMBLY


@final
class Spring(Element, section="springs", said="springs and dampers between two points"):
    """A massless spring-damper between two points, ``½ k (distance − length)²``."""

    bodies: Pair = key("body 1 and body 2", names="body")
    at1: Vector = key("point in body 1's centre-of-mass frame (ground: world)", unit="m", frame="bodies[0]")
    at2: Vector = key("point in body 2's", unit="m", frame="bodies[1]")
    stiffness: Number = key("", 0.0, unit="N/m")
    length: NonNegative = key("length without force", 0.0, unit="m")
    damping: NonNegative = key("", 0.0, unit="N s/m")
    heat: Text = key("thermal node that takes up the heat", ENVIRONMENT, names="node")

    @rule(
        "bodies",
        found='"{bodies[0]}" twice',
        expected="two different bodies",
        advice="a joint connects two bodies, or a body and the ground",
    )
    def differ(self) -> bool:
        """Whether it is between two bodies."""
        return self.bodies[0] != self.bodies[1]

    @rule(
        "bodies", "at1", "at2", "length", at="", adjusted=True, found="both ends at the same point",
        expected="two different points or nodes", advice="correct one of the two",
    )  # fmt: skip
    def apart(self, site: Site) -> bool:
        """Whether it has a direction at the start."""
        one, two = (site.in_world(*end) for end in zip(self.bodies, (self.at1, self.at2), strict=True))
        return float(np.linalg.norm(one - two)) >= ASSEMBLY * self.length

    @classmethod
    def _upgraded(cls, table: Mapping[str, Any]) -> Mapping[str, Any]:
        given = dict(table)
        return given | ({"bodies": [given.pop("body1"), given.pop("body2")]} if "body1" in given else {})

    def build(self, site: Site) -> None:
        (one, other), warm = self.bodies, site.heated(self.heat)
        made = spring_damper(self.at1, self.at2, self.stiffness, self.length, self.damping, heat=bool(warm))
        ports = {"p1": site.momentum(one), "p2": site.momentum(other)} | warm
        site.add(made, ports, initial=self._start)

    def _start(self, site: Site) -> Mapping[str, Array]:
        return {"pe.q_r": site.between(self.bodies[0], self.at1, self.bodies[1], self.at2)}

    def __str__(self) -> str:
        return f"{' – '.join(self.bodies)}, {self.stiffness:g} N/m"
