"""Resolved beams: elasticity of an element, nodes and elements of a rod."""

from dataclasses import dataclass
from typing import Annotated, final

from ephs.mechanics.scene.element import Measured, Named, Number, SceneElement
from ephs.semantics.bundles.bundle import Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Strain(Measured):
    """Elasticity of a beam element: the energy of the mean strain ξ = log(exp(L ξ₀) q_r)/L.

    Its joint's frame C1 is where C2 would be without force, so that q_r is 1 there.

    Attributes
    ----------
    length : L in m
    stiffness : (6,) diagonal of K: GJ, EI2, EI3 in N m², EA, GA2, GA3 in N
    rest : (6,) ξ₀: torsion and curvatures in 1/m, stretch (1: none) and shears
    damping : Kelvin–Voigt time in s: τ K resists the rate of ξ
    order : 2, the strain is the same all along, or 4, the stress is in balance; see `elements.strain`
    """

    length: Annotated[float, Number(length=1)]
    stiffness: Annotated[Array, Number(energy=1, length=-1, head=1, ahead=3, count=6)]
    rest: Annotated[Array, Number(head=-1, ahead=3, count=6)]
    damping: Annotated[float, Number(time=1)] = 0.0
    order: int = 2


@final
@dataclass(frozen=True, slots=True)
class Beam(SceneElement):
    """A rod: its nodes are the bodies ``NAME.0`` … ``NAME.n``, its elements the joints ``NAME-1`` … ``NAME-n``.

    Attributes
    ----------
    ends : what the first and the last node are welded to, ``"free"`` where to nothing
    outline : radius of a round section, or extents along axes 2 and 3 in m; for pictures
    lengths : of the elements in m, where these are spherical joints between rigid pieces
    heat : where the heat of contacts of its surface goes, or None
    """

    name: str
    elements: int
    ends: Annotated[tuple[str, str], Named("end")]
    outline: tuple[float, ...]
    lengths: tuple[float, ...] = ()
    heat: Annotated[str | None, Named("node")] = None

    @property
    def nodes(self) -> list[str]:
        """The bodies."""
        return [f"{self.name}.{i}" for i in range(self.elements + 1)]

    @property
    def joints(self) -> list[str]:
        """The joints that are its elements."""
        return [f"{self.name}-{i}" for i in range(1, self.elements + 1)]
