"""The second multiplier of a stabilised joint, after Gear, Gupta and Leimkuhler: it keeps the joint's positions.

A joint whose relation is one of velocities drifts. Beside it stands a component that moves poses by −W C*γ, so that the
joint is closed at the end of every step. Solutions in continuous time have γ = 0, so that the component is empty there;
over a step γ is of the method's order, and so is the power ⟨e|W C*γ⟩ that it supplies, which is booked.
"""

from typing import Final

import numpy as np

from ephs.mechanics.elements import notation
from ephs.mechanics.elements.components import columns_of, gap_over, joint_matrix, relative
from ephs.operad import Directory, Path, PortType, quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.derive.closing import Closing
from ephs.semantics.primitives.primitives import Kernel, Point, Reversible
from ephs.semantics.spaces import SE3, Pair
from ephs.semantics.verdicts.checks import STATEMENTS
from ephs.semantics.verdicts.verdict import proved

Q1, Q2, Q_R = Path.of("q1"), Path.of("q2"), Path.of("q_r")
MULTIPLIERS: Final = 6


def closing(of: Pair, first: tuple[Array, Array] | None, second: tuple[Array, Array] | None) -> Reversible:
    """f = −W C*γ over a step, with γ such that q₁ o₁ I(q_r) = q₂ o₂ stays true; power ports q1, q2 and q_r.

    W = diag(𝕀₁⁻¹, 𝕀₂⁻¹, W_r), W_r = B*(W₁ + W₂)B seen at the joint, so that relative poses of loops are moved as well.

    Parameters
    ----------
    first, second
        Offset (7,) of the joint's frame in a body, and the body's inertia (6, 6) in its own axes; None for the ground,
        which has no port.
    """
    ends = [(Q1, first), (Q2, second)]
    carried: dict[Path, Array] = {}
    weights: dict[Path, Array] = {}
    numbers: list[float] = []
    entries: list[tuple[str, tuple[float, ...]]] = []
    mobility = np.zeros((6, 6))
    for port, end in ends:
        if end is not None:
            seen = SE3.adjoint(SE3.inverse(end[0]))
            weight: Array = np.asarray(np.linalg.solve(end[1], seen.T), dtype=float)
            carried[port], weights[port] = seen, weight
            entries += [(f"offset {port}", tuple(end[0].tolist())), (f"inertia {port}", tuple(end[1].ravel().tolist()))]
            numbers += [*seen.ravel().tolist(), *weight.ravel().tolist()]
            mobility += seen @ weight
    own = of.basis.T @ mobility @ of.basis
    own = 0.5 * (own + own.T)
    ports = {str(port): PortType(quantity.pose, True) for port in carried} | {"q_r": PortType(relative(of), True)}
    reads, n = (*carried, Q_R), MULTIPLIERS * len(carried) + of.dim

    def structure(_x: Point) -> tuple[Array, Array]:
        return np.zeros((n, n)), np.zeros((MULTIPLIERS, n))

    def discrete(h: float, x0: Point, v: Point, _e: Array) -> tuple[Array, Array]:
        middle = joint_matrix(of, of.manifold.retract(x0[Q_R], 0.5 * v[Q_R]))
        part = {Q1: middle[:, :6], Q2: middle[:, 6:12]}
        velocity = {Q1: np.zeros(6), Q2: np.zeros(6)} | {port: seen @ v[port] / h for port, seen in carried.items()}
        moved = [-part[port] @ weight.T for port, weight in weights.items()]
        rates = np.concatenate([velocity[Q1], velocity[Q2], v[Q_R] / h])
        return np.hstack([*moved, -middle[:, 12:] @ own]), gap_over(of, h, middle, rates)

    return Reversible(
        "closing",
        Directory(ports),
        structure,
        reads,
        discrete,
        (("pair", of.name), *of.parameters, *entries),
        MULTIPLIERS,
        Kernel(
            "closing",
            Closing(of.code, of.size, columns_of(of), (first is not None, second is not None)),
            (*numbers, *own.ravel().tolist()),
        ),
        notation=notation.idle,
        proof=lambda: proved("f = 0 and no condition at an instant: γ = 0 there", *STATEMENTS["reversible"]),
        trusted=True,
        working=True,
    )
