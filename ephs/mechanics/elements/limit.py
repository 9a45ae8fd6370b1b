"""Limits of a joint's coordinate: elastic stops with loss, or hard ones, beside the joint's own spring and friction."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.mechanics.elements import notation
from ephs.mechanics.elements.components import coordinate_energy, joint_momentum, relative
from ephs.mechanics.shapes.dry import Dry
from ephs.mechanics.shapes.gap import ramp
from ephs.mechanics.shapes.impact import Halt, Impact
from ephs.mechanics.shapes.law import ConstitutiveLaw
from ephs.operad import Directory, PortType, quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.primitives import structures
from ephs.semantics.primitives.forms import stored
from ephs.semantics.primitives.primitives import Irreversible, Storage, power_ports
from ephs.semantics.spaces import Pair
from ephs.semantics.verdicts.checks import STATEMENTS
from ephs.semantics.verdicts.verdict import proved

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Stops = tuple[tuple[float, float], ...]
"""(side, bound): +1 at the least coordinate, −1 at the largest; the gap is side·(coordinate − bound)."""


def stops(of: Pair, limits: "ArrayLike") -> Stops:
    """Stops at [lower, upper] coordinates in rad or m; nan: none on that side.

    Raises
    ------
    StructureError
        The joint has not one degree of freedom, or the limits are not in order.
    """
    lower, upper = np.asarray(limits, dtype=float).tolist()
    if of.dim != 1:
        found = f"limits of a joint with {of.dim} degrees of freedom"
        raise StructureError("parameter", of.name, key="limits", found=found, expected="one degree of freedom")
    if lower >= upper or lower == np.inf or upper == -np.inf:
        raise StructureError("parameter", of.name, key="limits", found=[lower, upper], expected="lower < upper")
    return tuple((side, bound) for side, bound in ((1.0, lower), (-1.0, upper)) if np.isfinite(bound))


def limited_spring(of: Pair, stiffness: Array, rest: Array, stops: Stops, law: ConstitutiveLaw) -> Storage:
    """½ k (coordinate − rest)² and the energy of the stops; port q_r."""
    numbers = {f"bound{i}": bound for i, (_, bound) in enumerate(stops)}

    def energy(q_r: Any) -> Any:
        held = sum((law.energy(ramp(side * (bound - q_r))) for side, bound in stops), 0.0)
        return held + (coordinate_energy(of, q_r, stiffness, rest) if np.any(stiffness) else 0.0)

    return stored(
        "limited_spring",
        power_ports(q_r=relative(of)),
        energy,
        {},
        (("stiffness", tuple(stiffness.tolist())), ("rest", tuple(rest.tolist())), *numbers.items(), *law.numbers),
        printed=False,
        proof=lambda: proved("coordinates are even; E is once differentiable", *STATEMENTS["storage"]),
        trusted=True,
    )


def limited_friction(
    of: Pair, mu: Array, stops: Stops, law: ConstitutiveLaw | Impact, dry: Dry | None = None
) -> Irreversible:
    """Friction μ of a joint with one degree of freedom, dry friction, and the loss of its stops or their impulses;
    ports p_r, s, q_r."""
    ports = {
        "p_r": PortType(joint_momentum(of), True),
        "s": PortType(quantity.entropy, True),
        "q_r": PortType(relative(of), False),
    }
    (q_r,) = (port for port, kind in Directory(ports).items() if not kind.power)

    def resistance(x: Any, u: Any, _theta: Any) -> Any:
        rate, at = u[0], x[q_r][0]
        lost: list[Any] = []
        if isinstance(law, ConstitutiveLaw):
            lost = [law.normal(ramp(side * (bound - at)), side * rate)[1] for side, bound in stops]
        return [[sum(lost, float(mu[0, 0])) + (0.0 if dry is None else dry.resistance(rate))]]

    made = structures.dissipation(
        "limited_friction",
        Directory(ports),
        resistance,
        parameters=(
            ("viscous", float(mu[0, 0])),
            *((f"bound{i}", b) for i, (_, b) in enumerate(stops)),
            *law.numbers,
            *(() if dry is None else dry.numbers),
        ),
        shown=lambda: structures.dissipation_proof(Directory(ports), None),
        trusted=True,
        one_sided=True,
    )
    halt = Halt(stops, law) if isinstance(law, Impact) else None
    return replace(made, notation=notation.friction, impulse=halt)
