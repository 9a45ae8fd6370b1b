"""Model-based control of mechanisms: computed torque, and task-space dynamics of a body.

Khatib, "A unified approach for motion and force control of robot manipulators: the operational space formulation",
IEEE Journal on Robotics and Automation 3 (1987).
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np
from numpy.typing import ArrayLike

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.decompositions import pseudoinverse, singular_values
from ephs.semantics.spaces.rank import ELIMINATION, rank_of
from ephs.solve.posing.errors import OptionError

if TYPE_CHECKING:
    from ephs.mechanics.dynamics.model import Dynamics
    from ephs.mechanics.dynamics.state import State


@final
@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """The dynamics of k velocities of a body, v = J r, whose accelerations are J ṙ + drift.

    Parameters
    ----------
    jacobian
        (k, n) J.
    drift
        (k,) J̇ r.
    inertia
        (k, k) Λ = (J M⁻¹ Jᵀ)⁻¹: what a force at the task moves.
    inverse
        (n, k) M⁻¹ Jᵀ Λ: the right inverse of J with the least kinetic energy.
    """

    jacobian: Array
    drift: Array
    inertia: Array
    inverse: Array

    def forces(self, acceleration: ArrayLike) -> Array:
        """(n,) forces on the degrees of freedom, beside those that balance bias and what the scene applies, that give
        the task an acceleration (k,) without exciting the null space: Jᵀ Λ (a − J̇ r)."""
        return self.jacobian.T @ (self.inertia @ (np.asarray(acceleration, dtype=float) - self.drift))


def tree_only(model: "Dynamics", what: str) -> None:
    """Refuse a mechanism whose tree has dependent degrees of freedom.

    Raises
    ------
    OptionError
        It has loops or prescribed motions; a ValueError.
    """
    if not model.free:
        found = ", ".join([*model.cut, *model.placing.gears]) or "prescribed motions"
        expected = (
            f"a tree, without loops, gears (here {found}) and prescribed motions: take inverse_dynamics and constraints"
        )
        raise OptionError(what, model.name, expected)


def computed_torque(
    model: "Dynamics",
    state: "State",
    wanted: "State",
    accelerations: ArrayLike,
    stiffness: ArrayLike,
    damping: ArrayLike,
) -> Array:
    """(n,) forces under which the distance to a wanted state dies out like a damped oscillator's.

    Accelerations become ``accelerations + stiffness·difference + damping·(wanted.r − state.r)``, with stiffness ω² in
    1/s² and damping 2 ζ ω in 1/s, numbers or (n,).

    Raises
    ------
    OptionError
        The mechanism has loops or prescribed motions.
    """
    tree_only(model, "computed_torque")
    off = model.difference(state, wanted)
    a = (
        np.asarray(accelerations, dtype=float)
        + np.asarray(stiffness) * off
        + np.asarray(damping) * (wanted.r - state.r)
    )
    return model.inverse_dynamics(state, a)


def task_of(
    model: "Dynamics", state: "State", body: str, point: ArrayLike | None, directions: ArrayLike | None
) -> Task:
    """The dynamics of a body's twist in its frame, or with ``point`` (3,) there, in m, of that point's velocity in the
    world.

    Parameters
    ----------
    directions
        (k, 6) or (k, 3) combinations of these velocities that are the task; all where None.

    Raises
    ------
    OptionError
        The mechanism has loops or prescribed motions, or cannot move in all these directions at once.
    """
    tree_only(model, "task")
    whole = model.jacobian(state, body)
    twist, drift = np.zeros(6), np.zeros(6)
    for where in model.placing.outwards:  # from the ground outwards: each joint turns with the twist of those before it
        step = whole[:, where] @ state.r[where]
        drift += SE3.ad(twist) @ step
        twist += step
    jacobian = whole
    if point is not None:
        at = np.asarray(point, dtype=float)
        jacobian = model.jacobian(state, body, at)
        turn, (w, v), (dw, dv) = model.bodies(state)[body].rotation, np.split(twist, 2), np.split(drift, 2)
        drift = turn @ (dv + np.cross(dw, at) + np.cross(w, v + np.cross(w, at)))
    if directions is not None:
        chosen = np.atleast_2d(np.asarray(directions, dtype=float))
        if chosen.shape[1] != jacobian.shape[0]:
            raise OptionError("directions", chosen.shape, f"rows of {jacobian.shape[0]} numbers")
        jacobian, drift = chosen @ jacobian, chosen @ drift
    root = np.linalg.cholesky(model.mass_matrix(state))
    inside = np.linalg.solve(root, jacobian.T)
    if rank_of(singular_values(inside), ELIMINATION) < jacobian.shape[0]:
        raise OptionError(
            "task", body, f"{jacobian.shape[0]} velocities that the mechanism can have at once; choose directions"
        )
    left = np.asarray(pseudoinverse(inside.T), dtype=float)  # (n, k): inside (insideᵀ inside)⁻¹
    return Task(jacobian, drift, left.T @ left, np.asarray(np.linalg.solve(root.T, left), dtype=float))
