"""Heat conduction between thermal nodes."""

from typing import final

from ephs.mechanics.scene.custom import Element, key
from ephs.mechanics.scene.rules import rule
from ephs.mechanics.scene.schema_numbers import NonNegative, Pair
from ephs.mechanics.scene.site import Site
from ephs.semantics import library


@final
class Conduction(Element, section="conduction", said="heat conduction between thermal nodes"):
    """Heat conduction between two thermal nodes, or one and the environment."""

    between: Pair = key('two thermal nodes, or one and "environment"', names="node")
    conductance: NonNegative = key("thermal conductance", unit="W/K")

    @rule(
        "between",
        found='"{between[0]}" twice',
        expected="two different points or nodes",
        advice="correct one of the two",
    )
    def differ(self) -> bool:
        """Whether the ends are two nodes."""
        return self.between[0] != self.between[1]

    def build(self, site: "Site") -> None:
        one, other = map(site.entropy, self.between)
        site.add(library.heat_transfer(h=self.conductance), {"s1": one, "s2": other})

    def __str__(self) -> str:
        return f"{super().__str__()}, {self.conductance:g} W/K"
