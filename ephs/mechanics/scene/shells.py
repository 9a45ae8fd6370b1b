"""Shells: flat or slightly warped sheets between four corners, in elements whose nodes are bodies."""

from collections.abc import Mapping
from typing import Annotated, final

import numpy as np
from pydantic import Field

from ephs.mechanics.elements.shell.mesh import grid
from ephs.mechanics.elements.shell.section import ShellSection
from ephs.mechanics.elements.shell.shell import Shell
from ephs.mechanics.elements.shell.system import shell_system
from ephs.mechanics.scene.custom import Element, key
from ephs.mechanics.scene.element import ENVIRONMENT, FREE_END, GROUND
from ephs.mechanics.scene.faces import Faces
from ephs.mechanics.scene.rules import Told, rule
from ephs.mechanics.scene.schema_numbers import NonNegative, Number, Positive, Text, Vector
from ephs.mechanics.scene.site import Site
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.spaces import SE3, translation

Four = Field(min_length=4, max_length=4)


@final
class ShellSheet(Element, section="shells", said="sheets that bend and stretch"):
    """A shell of one material on a grid of quadrilaterals, without stress and at rest at the start."""

    corners: Annotated[list[Vector], Four] = key(
        "in the world, one after the other around the normal, m", frame="grounds"
    )
    elements: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=2, max_length=2)] = key(
        "number along the first side, and along the second"
    )
    thickness: Positive = key("", unit="m")
    E: Positive = key("Young's modulus", unit="Pa")
    nu: Annotated[Number, Field(gt=-1.0, le=0.5)] = key("Poisson's ratio", 0.0, unit="1")
    rho: Positive = key("density", unit="kg/m³")
    damping: NonNegative = key("Kelvin–Voigt time, {}", 0.0, unit="s")
    edges: Annotated[list[Text], Four] = key(
        'what each side is welded to, from the first corner to the second and so on: a body, "ground" or "free"',
        [FREE_END] * 4,
        names="end",
    )
    heat: Text = key("where the heat of damping goes: a thermal node", ENVIRONMENT, names="node")

    @rule(
        "corners", "elements", "thickness", "E", "nu", "rho", found="{reason}",
        expected="convex corners, nearly in a plane", advice="correct the corners",
    )  # fmt: skip
    def sound(self) -> Told:
        """Whether its elements are those of a shell."""
        try:
            self.shell()
        except StructureError as error:
            return {"reason": str(error)}
        return True

    @property
    def grounds(self) -> list[str]:
        """The ground for each corner: all are in the world."""
        return [GROUND] * 4

    def shell(self) -> Shell:
        """Its mesh without stress."""
        a, b, c, d = (np.array(corner) for corner in self.corners)

        def surface(u: Array, v: Array) -> Array:
            u, v = u[:, None], v[:, None]
            return ((1.0 - u) * ((1.0 - v) * a + v * d) + u * ((1.0 - v) * b + v * c)).T

        points, _, cells = grid(surface, (self.elements[0], self.elements[1]))
        return Shell.of(points, cells, ShellSection.isotropic(self.thickness, self.E, self.nu, self.rho))

    def welds(self) -> Mapping[str, list[int]]:
        """Body, or the ground -> numbers of the nodes that are welded to it; of two at a corner the first side's."""
        across, along = self.elements
        number = np.arange((across + 1) * (along + 1)).reshape(across + 1, along + 1)
        known: dict[int, str] = {}
        for body, nodes in zip(self.edges, (number[:, 0], number[-1], number[:, -1], number[0]), strict=True):
            if body != FREE_END:
                known = dict.fromkeys(nodes.tolist(), body) | known
        return {body: [node for node, at in known.items() if at == body] for body in dict.fromkeys(known.values())}

    def free(self) -> list[int]:
        """Numbers of the nodes that are welded to nothing."""
        welded = {node for nodes in self.welds().values() for node in nodes}
        return [i for i in range((self.elements[0] + 1) * (self.elements[1] + 1)) if i not in welded]

    def node(self, number: int) -> str:
        """Name of a node in pictures."""
        return f"{self.name}-node{number}"

    def faces(self, site: Site) -> Faces:
        """Its elements; of a scene whose nodes are no bodies where these are at the start."""
        shell, welded = self.shell(), {node: body for body, nodes in self.welds().items() for node in nodes}
        bodies = {name for name, _ in site.scene.all_bodies()}

        def end(i: int) -> tuple[str, Array]:
            body, at = welded.get(i, self.node(i)), shell.points[i]
            if body not in bodies:
                return GROUND, at
            return body, SE3.compose(SE3.inverse(site.pose(body)), translation(at))[4:]

        ends = tuple(end(i) for i in range(len(shell.points)))
        return Faces(ends, shell.cells, frozenset(map(self.node, self.free())))

    def build(self, site: Site) -> None:
        welds, warm = dict(self.welds()), site.heated(self.heat) if self.damping else {}
        held = welds.pop(GROUND, [])
        carried = {f"p_body{k}": (site.pose(body), nodes) for k, (body, nodes) in enumerate(welds.items())}
        made = shell_system(
            self.shell(), gravity=site.gravity, damping=self.damping, held=held, carried=carried, heat=bool(warm)
        )
        site.add(made, {port: site.momentum(body) for port, body in zip(carried, welds, strict=True)} | warm)

    def __str__(self) -> str:
        return f"{self.elements[0]} × {self.elements[1]} elements, {self.thickness:g} m"
