"""Gears, belts and differentials between joints."""

from collections.abc import Mapping
from typing import Any, Self, final

import numpy as np

from ephs.mechanics.elements.gear import gear
from ephs.mechanics.scene.custom import Element, key
from ephs.mechanics.scene.element import ENVIRONMENT
from ephs.mechanics.scene.rules import Told, rule
from ephs.mechanics.scene.schema_numbers import Names, NonNegative, Number, Numbers, Text
from ephs.mechanics.scene.site import Site
from ephs.semantics.bundles.bundle import Array

ROUNDED = 1e-12
"""Difference of initial rates that gears may leave, relative to what is added: theirs are written in decimals."""


@rule("joints", expected="different joints", advice="name each joint once")
def different(element: Any) -> bool:
    """Whether an element names each of its joints once."""
    return len(set(element.joints)) == len(element.joints)


@rule(
    "ratio",
    "joints",
    expected="{count} numbers: one for each joint; of a gear, one for each joint after the first",
    advice="correct the number of entries",
)
def counted(element: Any) -> Told:
    """Whether there are as many ratios as an element has to have."""
    return np.size(element.ratio) in element.counts or {"count": max(element.counts)}


@final
class Gear(Element, section="gears", said="linear relations between the rates of joints"):
    """A relation of the rates of joints: that of the first is Σ ratio · rate of the others."""

    joints: Names = key(
        "two or more joints with one degree of freedom: a gear, a belt, a differential, a mimic", names="single"
    )
    ratio: Numbers = key("rate of the first joint = Σ ratio · rate of the others", 1.0, unit="q/qᵢ", shown="")
    stiffness: NonNegative = key(
        "stiffness of a belt, {} of the first joint; 0: rigid", 0.0, unit="N m/q²", shown="N m/rad or N/m"
    )
    damping: NonNegative = key("damping of the belt's stretch", 0.0, unit="N m s/q²", shown="N m s/rad or N s/m")
    stretch: Number = key("initial stretch of a belt, {} of the first joint", 0.0, unit="q")
    friction: NonNegative = key(
        "viscous friction on the first joint's rate", 0.0, unit="N m s/q²", shown="N m s/rad or N s/m"
    )
    heat: Text = key("thermal node that takes up the heat of damping and friction", ENVIRONMENT, names="node")
    different = different
    counted = counted

    @property
    def counts(self) -> tuple[int, ...]:
        """Admissible numbers of ratios."""
        return (len(self.joints) - 1,)

    @rule(
        "joints", "ratio", "stiffness", at="", placed=True, found="{found}",
        expected="a rate of {first} of {rate:.6g}", advice="correct the initial rates; they must satisfy the gear",
    )  # fmt: skip
    def turning(self, site: Site) -> Told:
        """Whether the initial rates satisfy it, where it is rigid."""
        first, *others = rates = [float(site.rate(joint)[0]) for joint in self.joints]
        rest = [by * rate for by, rate in zip(np.atleast_1d(self.ratio), others, strict=True)]
        if self.stiffness or abs(first - sum(rest)) <= ROUNDED * sum(map(abs, (first, *rest))):
            return True
        return {"found": ", ".join(map(str, rates)), "first": self.joints[0], "rate": sum(rest)}

    def normalised(self) -> Self:
        return self.changed(ratio=np.atleast_1d(self.ratio).tolist())

    def build(self, site: Site) -> None:
        ports = site.heated(self.heat) if self.friction or (self.stiffness and self.damping) else {}
        made = gear([site.quantity(joint) for joint in self.joints], **self.number_values(), heat=bool(ports))
        site.add(made, {f"p{k}": site.drive(joint) for k, joint in enumerate(self.joints)} | ports)

    def continued(self, states: Mapping[str, Array]) -> Self:
        return self.changed(stretch=float(states["spring.q"][0])) if self.stiffness else self

    def __str__(self) -> str:
        return f"{' – '.join(self.joints)}, {', '.join(f'{x:g}' for x in np.atleast_1d(self.ratio))}"
