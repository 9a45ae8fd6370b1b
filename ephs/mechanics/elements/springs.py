"""Springs and dampers between two points, and the rate of their distance: components."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from ephs.mechanics.elements import notation
from ephs.operad import Directory, Path, PortType, quantity
from ephs.semantics.primitives import structures
from ephs.semantics.primitives.forms import coupled, stored
from ephs.semantics.primitives.primitives import Irreversible, Reversible, Storage, power_ports
from ephs.semantics.primitives.special import choose
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.verdicts.checks import STATEMENTS
from ephs.semantics.verdicts.verdict import proved

RELATIVE = quantity.relative_pose("free")


def point_spring(stiffness: float, length: float) -> Storage:
    """½ k (|r| − L)² between the origins of two frames; port q_r of the free pair, k in N/m, L in m.

    The discrete gradient is that of k/2 (|r| − L)² as a function of |r|², along the chord of r.
    """
    return stored(
        "point_spring",
        power_ports(q_r=RELATIVE),
        distance_energy,
        {"stiffness": stiffness, "length": length},
        printed=False,
        proof=lambda: proved(
            "a pose is even; E reads the position alone, dE = (0, Rᵀ k (1 − L/|r|) r)", *STATEMENTS["storage"]
        ),
        trusted=bool(np.isfinite(stiffness) and np.isfinite(length)),
    )


def distance_energy(q_r: Any, stiffness: float, length: float) -> Any:
    """½ k (|r| − L)² of a relative pose; smooth at r = 0 where L = 0."""
    r = q_r[4:]
    if length == 0.0:
        return 0.5 * stiffness * (r @ r)
    return 0.5 * stiffness * (np.sqrt(r @ r) - length) ** 2


def point_damper(damping: float) -> Irreversible:
    """Damping of the distance of two points, μ(q_r) = c n nᵀ with n = (0, Rᵀ r/|r|); ports p_r, s, reads q_r.

    c in N s/m. Where r = 0 every velocity υ changes the distance by |υ|: n is along it, and μ υ = c υ.
    """
    q_r = Path.of("q_r")
    ports = {
        "p_r": PortType(quantity.joint_momentum("free"), True),
        "s": PortType(quantity.entropy, True),
        "q_r": PortType(RELATIVE, False),
    }

    sound = bool(0.0 <= damping < np.inf)
    made = structures.dissipation(
        "point_damper",
        Directory(ports),
        lambda x, u, _theta: distance_resistance(x[q_r], u, damping),
        parameters=(("damping", damping),),
        shown=(lambda: structures.dissipation_proof(Directory(ports), None)) if sound else None,
        trusted=sound,
    )
    return replace(made, notation=notation.friction)


def distance_resistance(pose: Any, u: Any, damping: float) -> Any:
    """c n nᵀ (6, 6) of the direction n of a relative pose's position, in turning axes; of the velocity where r = 0."""
    along, square = _along(pose)
    speed = u[3:] @ u[3:]
    out = [[0.0] * 6 for _ in range(6)]
    for i in range(3):
        for j in range(3):
            still = choose(speed, u[3 + i] * u[3 + j] / speed, 0.0)
            out[3 + i][3 + j] = damping * choose(square, along[i] * along[j] / square, still)
    return out


@cache
def point_stretch() -> Reversible:
    """The distance of two points at its rate n·u_r, n = (0, Rᵀ r/|r|): e.f = −n p_r.e, p_r.f = n e.e; reads q_r.

    The effort of e is the tension in N. Where r = 0 it is undefined.
    """

    def structure(q_r: Any) -> Any:
        along, square = _along(q_r)
        length = np.sqrt(square)
        row = [0.0, 0.0, 0.0, *(x / length for x in along)]
        return [*([0.0] * 6 + [n] for n in row), [*(-n for n in row), 0.0]], None

    ports = Directory(
        {
            "p_r": PortType(quantity.joint_momentum("free"), True),
            "e": PortType(quantity.displacement, True),
            "q_r": PortType(RELATIVE, False),
        }
    )
    return coupled(
        "point_stretch",
        ports,
        structure,
        proof=lambda: proved(
            "L = [[0, n], [−nᵀ, 0]], n even in q_r, which reads q and −q alike", *STATEMENTS["reversible"]
        ),
        trusted=True,
    )


def _along(pose: Any) -> tuple[Any, Any]:
    """Rᵀ r (3,), the position of a relative pose in turning axes, and r·r."""
    r = pose[4:]
    return quaternion_to_matrix(pose[:4]).T @ r, r @ r
