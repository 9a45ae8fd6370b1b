"""Tendons through points of bodies."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Self, final

import numpy as np
from pydantic import Field

from ephs.mechanics.elements.tendon import tendon
from ephs.mechanics.scene.custom import Element, key
from ephs.mechanics.scene.element import ENVIRONMENT
from ephs.mechanics.scene.rules import Told, rule
from ephs.mechanics.scene.schema_numbers import Flag, Names, NonNegative, Text, Vector
from ephs.mechanics.scene.site import Site
from ephs.operad import quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.rank import ASSEMBLY

_Spot = tuple[str, Vector]


@final
class Tendon(Element, section="tendons", said="tendons through points of bodies"):
    """A tendon without mass, straight from point to point of bodies, through which it slides."""

    bodies: Names = key(
        'what carries its points, in their order; the tension is the input "actuators.NAME", in N', names="body"
    )
    points: Annotated[list[Vector], Field(min_length=2)] = key(
        "one in each, in its centre-of-mass frame (ground: world), m", frame="bodies"
    )
    stiffness: NonNegative = key("", 0.0, unit="N/m")
    length: NonNegative | None = key("without force, {}; default: as at the start", None, unit="m")
    damping: NonNegative = key("{}; 0 of one with slack", 0.0, unit="N s/m")
    slack: Flag = key("no elastic force where it is shorter than its length: a cable", False)
    heat: Text = key("where the heat goes: a thermal name", ENVIRONMENT, names="node")

    @rule(
        "damping",
        "slack",
        expected="0 for a tendon with slack",
        advice="remove one of the two; joints may have friction",
    )
    def taut(self) -> bool:
        """Whether it has damping only where it is always taut."""
        return not (self.slack and self.damping)

    @rule(
        "points", "bodies", found="{found}", expected="{count} points, one for each body",
        advice="correct the number of points",
    )  # fmt: skip
    def counted(self) -> Told:
        """Whether each of its bodies carries a point."""
        found, count = len(self.points), len(self.bodies)
        return found == count or {"found": found, "count": count}

    @rule(
        "bodies",
        "points",
        expected="a segment between two different bodies",
        advice="route it from one body to another",
    )
    def between(self) -> bool:
        """Whether it leads from one body to another."""
        return any(one != two for one, two in pairwise(self.bodies))

    @rule(
        "points", "bodies", at="points[{second}]", placed=True, found="where the point before is at the start",
        expected="two different points or nodes", advice="correct one of the two",
    )  # fmt: skip
    def apart(self, site: Site) -> list[Mapping[str, object]]:
        """The segments between bodies that have no direction at the start."""
        lengths = self._lengths(site)
        short = [length <= ASSEMBLY * sum(lengths) for length in lengths]
        return [{"second": k} for k, each in enumerate(short, 1) if each and self.bodies[k - 1] != self.bodies[k]]

    def settled(self, site: Site) -> Self:
        return self.changed(length=sum(self._lengths(site))) if self.length is None else self

    def build(self, site: Site) -> None:
        segments, warm = self.segments, site.heated(self.heat) if self.damping else {}
        made = tendon(
            [(one[1], two[1]) for one, two in segments],
            self.stiffness,
            (self.length or 0.0) - self.inside,
            self.damping,
            slack=self.slack,
            heat=bool(warm),
        )
        ports = {
            f"{side}{k}": site.momentum(body)
            for k, ends in enumerate(segments, 1)
            for side, (body, _) in zip("ab", ends, strict=True)
        }
        pull = site.input(quantity.momentum, at="tensions", effort=False, named=False)
        site.add(made, ports | {"p": pull} | warm, initial=self._start)

    def _start(self, site: Site) -> Mapping[str, Array]:
        out = {f"segment{k}.pe.q_r": site.between(*one, *two) for k, (one, two) in enumerate(self.segments, 1)}
        if self.stiffness:
            apart = ([site.in_world(*end) for end in ends] for ends in self.segments)
            out["spring.q"] = np.array([sum(float(np.linalg.norm(two - one)) for one, two in apart)])
        return out

    @property
    def segments(self) -> list[tuple[_Spot, _Spot]]:
        """The (body, point) at both ends of each segment between two different bodies."""
        return [(one, two) for one, two in self._pieces() if one[0] != two[0]]

    @property
    def inside(self) -> float:
        """Length of the pieces within bodies, m."""
        return sum(float(np.linalg.norm(np.subtract(q, p))) for (a, p), (b, q) in self._pieces() if a == b)

    def _pieces(self) -> Iterator[tuple[_Spot, _Spot]]:
        return pairwise(zip(self.bodies, self.points, strict=True))

    def _lengths(self, site: Site) -> list[float]:
        """Lengths of all pieces at the start, those within bodies too."""
        places = [site.in_world(body, at) for body, at in zip(self.bodies, self.points, strict=True)]
        return [float(np.linalg.norm(two - one)) for one, two in pairwise(places)]

    def __str__(self) -> str:
        return f"{' – '.join(self.bodies)}, {self.stiffness:g} N/m"
