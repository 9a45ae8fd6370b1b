"""Contact between two surfaces: energy of their overlap, and loss of its rate, of slip, of rolling and of spinning.

A contact is a joint of all six freedoms between two frames, whose energy reads the gap and whose friction reads the
relative pose; so every method takes it, and all it dissipates is heat. Loss by Hunt and Crossley (1975): the normal
force is φ'(g)(1 − 3/2 α ġ), and never pulls. What is left of the energy where surfaces part faster than the force
allows is lost in the same box, as heat.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, final

import numpy as np

from ephs.mechanics import notation
from ephs.mechanics.joints import between_frames
from ephs.mechanics.shapes.gap import Gap, Vector, cross, dot, ramp
from ephs.mechanics.shapes.law import Law
from ephs.mechanics.shapes.pairs import Touch
from ephs.operad import Directory, Path, Pattern, PortType, junction, quantity
from ephs.semantics import structures
from ephs.semantics.checks import STATEMENTS
from ephs.semantics.forms import stored
from ephs.semantics.primitives import Irreversible, Storage, power_ports
from ephs.semantics.system import System
from ephs.semantics.verdict import proved

__all__ = ["Touching", "contact", "contact_energy", "contact_loss"]

RELATIVE = quantity.relative_pose("free")
Q_R = Path.of("q_r")
UNITS: Final = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def contact(touches: Sequence[Touch], law: Law, *, heat: bool = False) -> System:
    """Contact of two surfaces, at each of their points that can touch; ports p1, p2 carry the bodies' momenta.

    Parameters
    ----------
    touches
        Frames and gap of each point, as `surfaces.touches` gives them; boxes ``point0``, ``point1``, …
    heat
        The heat leaves through a port s; else environments inside take it.
    """
    momentum = quantity.body_momentum
    junctions = {"p1": junction(momentum, exposed=True), "p2": junction(momentum, exposed=True)}
    wires = {"p1": "p1", "p2": "p2"}
    if heat:
        junctions["s"] = junction(quantity.entropy, exposed=True)
        wires["s"] = "s"
    points = {
        f"point{i}": between_frames(one, two, contact_energy(gap, law), contact_loss(gap, law), heat=heat)
        for i, (one, two, gap) in enumerate(touches)
    }
    return System.of(Pattern(junctions=junctions, boxes=dict.fromkeys(points, wires)), points)


@final
@dataclass(frozen=True, slots=True)
class Touching:
    """Contact of two surfaces at one pose and twist, or at many.

    Parameters
    ----------
    overlap
        In m, 0 where the surfaces are apart.
    normal, point
        As of a `Gap`.
    opening
        Rate of the gap, m/s.
    slip
        Velocity of the point across the normal, m/s, turned about the normal by a quarter.
    force, loss
        Normal force in N, and its part per rate of the gap in N s/m.
    """

    overlap: Any
    normal: Vector
    point: Vector
    opening: Any
    slip: Vector
    force: Any
    loss: Any

    @staticmethod
    def of(gap: Gap, law: Law, pose: Any, twist: Any) -> "Touching":
        """At a relative pose and a twist of C2 relative to C1 in the axes of C2."""
        normal, point = gap.contact(pose)
        turned = cross((twist[0], twist[1], twist[2]), point)
        velocity = twist[3] + turned[0], twist[4] + turned[1], twist[5] + turned[2]
        overlap, opening = ramp(-gap.distance(pose)), dot(normal, velocity)
        force, loss = law.normal(overlap, opening)
        return Touching(overlap, normal, point, opening, cross(normal, velocity), force, loss)


def contact_energy(gap: Gap, law: Law) -> Storage:
    """Energy of the overlap of two surfaces; port q_r of the free pair."""
    return stored(
        gap.name + "_energy",
        power_ports(q_r=RELATIVE),
        lambda q_r: law.energy(ramp(-gap.distance(q_r))),
        {},
        (*gap.numbers, ("stiffness", law.stiffness), ("exponent", law.exponent)),
        printed=False,
        proof=lambda: proved(
            "a pose is even; E reads the gap alone, dE = −φ′(⟨−g⟩) dg, and g is differentiable where it is negative",
            *STATEMENTS["storage"],
        ),
        trusted=True,
    )


def contact_loss(gap: Gap, law: Law) -> Irreversible:
    """Loss of a contact: μ(q_r, u_r) of Hunt and Crossley's force, slip, rolling and spinning; ports p_r, s, q_r."""
    ports = {
        "p_r": PortType(quantity.joint_momentum("free"), True),
        "s": PortType(quantity.entropy, True),
        "q_r": PortType(RELATIVE, False),
    }
    turning = (law.rolling or law.spinning) and gap.radius > 0.0

    def resistance(x: Any, u: Any, _theta: Any) -> Any:
        at = Touching.of(gap, law, x[Q_R], u)
        across = law.friction * at.force / np.sqrt(dot(at.slip, at.slip) + law.slip**2)
        sides = [cross(at.normal, unit) for unit in UNITS]  # Σ t tᵀ = 1 − n nᵀ
        terms = [(at.loss, _lever(at.normal, at.point)), *((across, _lever(side, at.point)) for side in sides)]
        if turning:
            spin, still = (u[0], u[1], u[2]), (law.slip / gap.radius) ** 2
            about, rolling = dot(at.normal, spin), cross(at.normal, spin)
            pivot = law.spinning * at.force / np.sqrt(about * about + still)
            roll = law.rolling * at.force / np.sqrt(dot(rolling, rolling) + still)
            terms += [(pivot, (*at.normal, 0.0, 0.0, 0.0)), *((roll, (*side, 0.0, 0.0, 0.0)) for side in sides)]
        return _squares(terms)

    made = structures.dissipation(
        gap.name + "_loss",
        Directory(ports),
        resistance,
        parameters=(*gap.numbers, *law.numbers),
        shown=lambda: structures.dissipation_proof(Directory(ports), None),
        trusted=True,
        one_sided=True,
    )
    return replace(made, notation=notation.friction)


def _lever(direction: Vector, point: Vector) -> tuple[Any, ...]:
    """w (6,): ⟨w|u⟩ is the velocity of a point in a direction, for a twist u."""
    return (*cross(point, direction), *direction)


def _squares(terms: Any) -> Any:
    """(6, 6) Σ d w wᵀ, symmetric to the last bit."""
    rows = [[0.0] * 6 for _ in range(6)]
    for factor, w in terms:
        for i in range(6):
            for j in range(i, 6):
                rows[i][j] = rows[j][i] = rows[i][j] + factor * (w[i] * w[j])
    return rows
