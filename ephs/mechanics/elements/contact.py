"""Contact between two surfaces: energy of their overlap, and loss of its rate, of slip, of rolling and of spinning.

A contact is a joint of all six degrees of freedom between two frames, whose energy reads the gap and whose friction
reads the relative pose; so every method takes it, and all it dissipates is heat. Loss by Hunt and Crossley (1975): the
normal force is φ'(g)(1 − 3/2 α ġ), and never pulls. What is left of the energy where surfaces part faster than the
force allows is lost in the same box, as heat.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from ephs.mechanics.elements import notation
from ephs.mechanics.elements.components import no_potential
from ephs.mechanics.elements.joints import between_frames
from ephs.mechanics.shapes.gap import Gap, cross, dot, ramp
from ephs.mechanics.shapes.impact import Impact, Meeting
from ephs.mechanics.shapes.law import ConstitutiveLaw
from ephs.mechanics.shapes.pairs import Touch
from ephs.mechanics.shapes.selecting import Vector
from ephs.operad import Directory, Path, Pattern, PortType, junction, quantity
from ephs.semantics import library
from ephs.semantics.primitives import structures
from ephs.semantics.primitives.forms import stored
from ephs.semantics.primitives.primitives import Irreversible, Storage, power_ports
from ephs.semantics.systems.system import System
from ephs.semantics.verdicts.checks import STATEMENTS
from ephs.semantics.verdicts.verdict import proved

RELATIVE = quantity.relative_pose("free")
Q_R = Path.of("q_r")
UNITS: Final = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def contact(
    touches: Sequence[Touch],
    law: ConstitutiveLaw | Impact,
    *,
    heat: bool = False,
    ends: Sequence[tuple[str, str]] | None = None,
    shares: Sequence[float] | None = None,
) -> System:
    """Contact of two surfaces, at each of their points that can touch.

    Parameters
    ----------
    touches
        Frames and gap of each point, as `surfaces.touches` gives them; boxes ``point0``, ``point1``, …
    heat
        The heat leaves through a port s; else an environment inside, ``env``, takes it.
    ends
        Ports of each point that carry the momenta of its two bodies; p1 and p2 of all where None.
    shares
        Parts of the stiffness that the points have; 1 where None.
    """
    momentum = quantity.body_momentum
    pairs = [("p1", "p2")] * len(touches) if ends is None else ends
    parted = [1.0] * len(touches) if shares is None else shares
    junctions = {name: junction(momentum, exposed=True) for pair in pairs for name in pair}
    junctions["s"] = junction(quantity.entropy, exposed=heat)
    kinds = [(gap.name, gap.numbers, share) for (_, _, gap), share in zip(touches, parted, strict=True)]
    known = {kind: gap for kind, (_, _, gap) in zip(kinds, touches, strict=True)}
    parts = {kind: _parts(gap, shared(law, kind[2])) for kind, gap in known.items()}
    points: dict[str, System | Storage] = {
        f"point{i}": between_frames(one, two, *parts[kind], heat=True)
        for i, (kind, (one, two, _)) in enumerate(zip(kinds, touches, strict=True))
    }
    boxes = {name: {"p1": one, "p2": two, "s": "s"} for name, (one, two) in zip(points, pairs, strict=True)}
    if not heat:
        boxes["env"], points["env"] = {"s": "s"}, library.environment()
    return System.of(Pattern(junctions=junctions, boxes=boxes), points)


def shared(law: ConstitutiveLaw | Impact, share: float) -> ConstitutiveLaw | Impact:
    """Law of a point with a part of the stiffness; what is relative to the normal force is the same."""
    return law if isinstance(law, Impact) else replace(law, stiffness=law.stiffness * share)


def _parts(gap: Gap, law: ConstitutiveLaw | Impact) -> tuple[Storage, Irreversible]:
    if isinstance(law, Impact):
        return replace(no_potential(RELATIVE, "q_r"), name="wall", gap=gap), impact(gap, law)
    return contact_energy(gap, law), contact_loss(gap, law)


def lever(direction: Vector, point: Vector) -> tuple[Any, ...]:
    """w (6,): ⟨w|u⟩ is the velocity of a point in a direction, for a twist u; a unit force there is the wrench w."""
    return (*cross(point, direction), *direction)


def losses(gap: Gap, law: ConstitutiveLaw, pose: Any, twist: Any) -> list[tuple[Any, tuple[Any, ...]]]:
    """Losses (d, w) of a contact at a relative pose and twist: wrenches −d ⟨w|u⟩ w on the second body.

    Parameters
    ----------
    twist
        Of C2 relative to C1 in the axes of C2.
    """
    normal, point = gap.contact(pose)
    spin = twist[0], twist[1], twist[2]
    moved = cross(spin, point)
    velocity = twist[3] + moved[0], twist[4] + moved[1], twist[5] + moved[2]
    force, along = law.normal(ramp(-gap.distance(pose)), dot(normal, velocity))
    slip, sides = cross(normal, velocity), [cross(normal, unit) for unit in UNITS]  # Σ t tᵀ = 1 − n nᵀ
    across = law.friction * force / np.sqrt(dot(slip, slip) + law.slip**2)
    terms = [(along, lever(normal, point)), *((across, lever(side, point)) for side in sides)]
    if (law.rolling or law.spinning) and gap.radius > 0.0:
        about, rolling, still = dot(normal, spin), cross(normal, spin), (law.slip / gap.radius) ** 2
        pivot = law.spinning * force / np.sqrt(about * about + still)
        roll = law.rolling * force / np.sqrt(dot(rolling, rolling) + still)
        terms += [(pivot, (*normal, 0.0, 0.0, 0.0)), *((roll, (*side, 0.0, 0.0, 0.0)) for side in sides)]
    return terms


def contact_energy(gap: Gap, law: ConstitutiveLaw) -> Storage:
    """Energy of the overlap of two surfaces, no number beyond the depth of its support; port q_r of the free pair."""

    def energy(q_r: Any) -> Any:
        overlap = ramp(-gap.distance(q_r))
        if gap.support.depth == np.inf:
            return law.energy(overlap)
        left = np.sqrt(gap.support.depth - overlap)  # no number beyond the depth; zero is added to all other energies
        return law.energy(overlap) + (left - left)

    return stored(
        gap.name + "_energy",
        power_ports(q_r=RELATIVE),
        energy,
        {},
        (*gap.numbers, ("stiffness", law.stiffness), ("exponent", law.exponent)),
        printed=False,
        proof=lambda: proved(
            "a pose is even; E reads the gap alone, dE = −φ′(⟨−g⟩) dg, and g is differentiable where it is negative",
            *STATEMENTS["storage"],
        ),
        trusted=True,
        support=gap.support,
        gap=gap,
    )


def contact_loss(gap: Gap, law: ConstitutiveLaw) -> Irreversible:
    """Loss of a contact: μ(q_r, u_r) of Hunt and Crossley's force, slip, rolling and spinning; ports p_r, s, q_r."""
    ports = {
        "p_r": PortType(quantity.joint_momentum("free"), True),
        "s": PortType(quantity.entropy, True),
        "q_r": PortType(RELATIVE, False),
    }
    made = structures.dissipation(
        gap.name + "_loss",
        Directory(ports),
        lambda x, u, _theta: _squares(losses(gap, law, x[Q_R], u)),
        parameters=(*gap.numbers, *law.numbers),
        shown=lambda: structures.dissipation_proof(Directory(ports), None),
        trusted=True,
        one_sided=True,
    )
    return replace(made, notation=notation.friction, support=gap.support)


def impact(gap: Gap, law: Impact) -> Irreversible:
    """Impulses of a hard contact at a closed gap, which steps make; it has no rate. Ports p_r, s, q_r."""
    ports = {
        "p_r": PortType(quantity.joint_momentum("free"), True),
        "s": PortType(quantity.entropy, True),
        "q_r": PortType(RELATIVE, False),
    }
    nothing = np.zeros((6, 6))
    made = structures.dissipation(
        gap.name + "_impact",
        Directory(ports),
        lambda _x, _u, _theta: nothing,
        parameters=(*gap.numbers, *law.numbers),
        shown=lambda: structures.dissipation_proof(Directory(ports), None),
        trusted=True,
        one_sided=True,
    )
    return replace(made, notation=notation.friction, impulse=Meeting(gap, law))


def _squares(terms: Any) -> Any:
    """(6, 6) Σ d w wᵀ, symmetric to the last bit."""
    rows = [[0.0] * 6 for _ in range(6)]
    for factor, w in terms:
        for i in range(6):
            for j in range(i, 6):
                rows[i][j] = rows[j][i] = rows[i][j] + factor * (w[i] * w[j])
    return rows
