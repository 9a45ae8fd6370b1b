"""Contact between two surfaces: energy of their overlap, and loss of its rate, of slip, of rolling and of spinning.

A contact is a joint of all six freedoms between two frames, whose energy reads the gap and whose friction reads the
relative pose; so every method takes it, and all it dissipates is heat. Loss by Hunt and Crossley (1975): the normal
force is φ'(g)(1 − 3/2 α ġ), and never pulls. What is left of the energy where surfaces part faster than the force
allows is lost in the same box, as heat.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ephs.mechanics import notation
from ephs.mechanics.shapes.gap import Gap, ramp
from ephs.mechanics.shapes.law import Law
from ephs.mechanics.shapes.pairs import Touch
from ephs.mechanics.joints import between_frames
from ephs.operad import Directory, Path, Pattern, PortType, junction, quantity
from ephs.semantics import structures
from ephs.semantics.checks import STATEMENTS
from ephs.semantics.forms import stored
from ephs.semantics.primitives import Irreversible, Storage, power_ports
from ephs.semantics.system import System
from ephs.semantics.verdict import proved

__all__ = ["contact", "contact_energy", "contact_loss", "normal_force"]

RELATIVE = quantity.relative_pose("free")
Q_R = Path.of("q_r")


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


def normal_force(law: Law, overlap: Any, opening: Any) -> tuple[Any, Any]:
    """Normal force N ≥ 0 at an overlap in m and a rate of the gap in m/s, and its part d per rate: N = φ′ − d ġ."""
    elastic, rate = law.force(overlap), 1.5 * law.loss * opening
    return elastic * ramp(1.0 - rate), 1.5 * law.loss * elastic / (1.0 + ramp(rate - 1.0))


def contact_loss(gap: Gap, law: Law) -> Irreversible:
    """Loss of a contact: μ(q_r, u_r) of Hunt and Crossley's force, slip, rolling and spinning; ports p_r, s, q_r."""
    ports = {
        "p_r": PortType(quantity.joint_momentum("free"), True),
        "s": PortType(quantity.entropy, True),
        "q_r": PortType(RELATIVE, False),
    }
    turning = (law.rolling or law.spinning) and gap.radius > 0.0

    def resistance(x: Any, u: Any, _theta: Any) -> Any:
        normal, point = gap.contact(x[Q_R])
        spin, velocity = u[:3], u[3:] + np.cross(u[:3], point)
        opening = normal @ velocity
        force, along = normal_force(law, ramp(-gap.distance(x[Q_R])), opening)
        slip = np.cross(normal, velocity)
        across = law.friction * force / np.sqrt(slip @ slip + law.slip**2)
        sides = np.cross(normal, np.eye(3))  # Σ t tᵀ = 1 − n nᵀ
        terms = [(along, _lever(normal, point)), *((across, _lever(side, point)) for side in sides)]
        if turning:
            about, rolling, still = normal @ spin, np.cross(normal, spin), (law.slip / gap.radius) ** 2
            pivot = law.spinning * force / np.sqrt(about * about + still)
            roll = law.rolling * force / np.sqrt(rolling @ rolling + still)
            terms += [(pivot, _moment(normal)), *((roll, _moment(side)) for side in sides)]
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


def _lever(direction: Any, point: Any) -> Any:
    """(6,) w: ⟨w|u⟩ is the velocity of a point in a direction, for a twist u."""
    return np.concatenate([np.cross(point, direction), direction])


def _moment(direction: Any) -> Any:
    """(6,) w: ⟨w|u⟩ is the angular velocity about a direction."""
    return np.concatenate([direction, np.zeros(3)])


def _squares(terms: Any) -> Any:
    """(6, 6) Σ d w wᵀ, symmetric to the last bit."""
    rows = [[0.0] * 6 for _ in range(6)]
    for factor, w in terms:
        for i in range(6):
            for j in range(i, 6):
                rows[i][j] = rows[j][i] = rows[i][j] + factor * (w[i] * w[j])
    return rows
