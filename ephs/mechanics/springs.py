"""Springs and dampers between two points: what their boxes are filled with."""

from dataclasses import replace

import numpy as np

from ephs.mechanics import notation
from ephs.operad import Directory, Path, PortType, quantity
from ephs.semantics import structures
from ephs.semantics.bundle import Array
from ephs.semantics.checks import STATEMENTS
from ephs.semantics.errors import StructureError
from ephs.semantics.primitives import Irreversible, Kernel, Point, Storage, power_ports
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix, rotation_dexp
from ephs.semantics.verdict import proved

__all__ = ["point_damper", "point_spring"]

SPRINGS = "ephs.mechanics.spring_kernels"
RELATIVE = quantity.relative_pose("free")


def point_spring(stiffness: float, length: float) -> Storage:
    """½ k (|r| − L)² between the origins of two frames; port q_r of the free pair, k in N/m, L in m.

    The discrete gradient is that of k/2 (|r| − L)² as a function of |r|², along the chord of r.
    """
    q_r = Path.of("q_r")

    def energy(x: Point) -> float:
        return 0.5 * stiffness * (float(np.linalg.norm(x[q_r][4:])) - length) ** 2

    def pull(rotation: Array, mean: Array, lengths: float) -> Array:
        if length == 0.0:
            return rotation.T @ (stiffness * mean)
        if not lengths > 0.0:
            raise StructureError("parameter", "point_spring", key="distance", found=0.0, expected="> 0")
        return rotation.T @ (stiffness * (1.0 - 2.0 * length / lengths) * mean)

    def gradient(x: Point) -> Array:
        r = x[q_r][4:]
        force = pull(quaternion_to_matrix(x[q_r][:4]), r, 2.0 * float(np.linalg.norm(r)))
        return np.concatenate([np.zeros(3), force])

    def discrete_gradient(x0: Point, v: Array) -> Array:
        r0, r1 = x0[q_r][4:], SE3.retract(x0[q_r], v)[4:]
        rotation = quaternion_to_matrix(x0[q_r][:4]) @ rotation_dexp(v[:3])
        lengths = float(np.linalg.norm(r0) + np.linalg.norm(r1))
        return np.concatenate([np.zeros(3), pull(rotation, 0.5 * (r0 + r1), lengths)])

    return Storage(
        "point_spring",
        power_ports(q_r=RELATIVE),
        energy,
        gradient,
        discrete_gradient,
        (("stiffness", stiffness), ("length", length)),
        kernel=Kernel(SPRINGS, "point_spring", (stiffness, length)),
        proof=lambda: proved(
            "a pose is even; E reads the position alone, dE = (0, Rᵀ k (1 − L/|r|) r)", *STATEMENTS["storage"]
        ),
        trusted=bool(np.isfinite(stiffness) and np.isfinite(length)),
    )


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

    def resistance(x: Point, _u: Array, _theta: float) -> Array:
        r = x[q_r][4:]
        if not r.any():
            return damping * np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
        axis = quaternion_to_matrix(x[q_r][:4]).T @ (r / np.linalg.norm(r))
        n = np.concatenate([np.zeros(3), axis])
        return damping * np.outer(n, n)

    kernel = Kernel(SPRINGS, "point_damper", (damping,))
    entries, sound = (("damping", damping),), bool(0.0 <= damping < np.inf)
    made = structures.dissipation(
        "point_damper",
        Directory(ports),
        resistance,
        reads=(q_r,),
        kernel=kernel,
        parameters=entries,
        shown=(lambda: structures.dissipation_proof(Directory(ports), None)) if sound else None,
        trusted=sound,
    )
    return replace(made, notation=notation.friction)
