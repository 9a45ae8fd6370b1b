"""The rigid body as a system of four boxes (Lohmayer, Capobianco, Leyendecker, section 4)."""

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from ephs.mechanics.elements import components
from ephs.operad import Pattern, junction
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError, nearest_of
from ephs.semantics.spaces.decompositions import symmetric_eigenvalues
from ephs.semantics.spaces.rank import INERTIA
from ephs.semantics.systems.system import System

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

SYMMETRIC = 1e-12
"""Relative asymmetry of an inertia that counts as rounding."""
GRAVITY = (0.0, 0.0, -9.81)


@cache
def body_pattern(group: str = "SE3", *, massless: bool = False) -> Pattern:
    """Potential energy at the pose q, kinetic energy and gyroscopic forces at the momentum p, coupled; p is exposed.

    A massless frame has neither kinetic energy nor gyroscopic forces.
    """
    boxes = {"pe": {"q": "q"}, "pkc": {"q": "q", "p": "p"}}
    if not massless:
        boxes |= {"ke": {"p": "p"}, "lp": {"p": "p"}}
    q, p = components.POSES[group], components.MOMENTA[group]
    return Pattern(junctions={"q": junction(q), "p": junction(p, exposed=True)}, boxes=boxes)


def rigid_body(
    mass: float,
    inertia: "ArrayLike",
    gravity: "ArrayLike" = GRAVITY,
    potential: Callable[[Array], float] | None = None,
    group: str = "SE3",
    *,
    strict: bool = True,
) -> System:
    """A rigid body; its port p carries the body-frame momentum, flow a wrench on the body, effort its twist.

    Parameters
    ----------
    mass
        In kg; 0, with zero inertia, for a frame without kinetic energy.
    inertia
        About the centre of mass in body axes, kg m²: xx yy zz; xx yy zz xy xz yz; or (3, 3).
    gravity
        (3,) acceleration in world axes, m/s².
    potential
        Any further potential in J, a Python function of the pose (7,): quaternion, position.
    group
        ``"SE3"``: twists in the body frame, as joints want them. ``"SO3xR3"``: the velocity of the centre of mass in
        world axes.
    strict
        Refuse an inertia that no distribution of mass has; else one without an inverse only. Scenes decide that when
        they are read.

    Raises
    ------
    StructureError
        The mass is negative, or the inertia is refused.
    """
    tensor = _inertia(mass, inertia, strict)
    weight = -float(mass) * np.asarray(gravity, dtype=float)
    if group not in components.POSES:
        raise StructureError(
            "parameter",
            "rigid_body",
            key="group",
            found=group,
            expected=" or ".join(components.POSES) + nearest_of(group, components.POSES),
        )
    if weight.shape != (3,) or not np.all(np.isfinite(weight)):
        raise StructureError("parameter", "rigid_body", key="gravity", found=gravity, expected="3 finite numbers")
    q, p = components.POSES[group], components.MOMENTA[group]
    if potential is not None:
        given = potential
        pe = components.potential(q, "q", lambda pose: given(pose) + float(weight @ pose[4:]))
    else:
        pe = components.gravity(weight, group) if np.any(weight) else components.no_potential(q, "q")
    parts = {"pe": pe, "pkc": components.kinematic_coupling(q, p, "q", "p")}
    if mass > 0.0:
        parts |= {"ke": components.kinetic(mass, tensor, group), "lp": components.lie_poisson(group)}
    return System.of(body_pattern(group, massless=not mass > 0.0), parts)


def _inertia(mass: float, inertia: "ArrayLike", strict: bool) -> Array:
    given = np.asarray(inertia, dtype=float)
    if given.shape == (3,):
        tensor = np.diag(given)
    elif given.shape == (6,):
        xx, yy, zz, xy, xz, yz = given
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    elif given.shape == (3, 3):
        tensor = given
    else:
        raise _bad("inertia", given.tolist(), "3 or 6 numbers, or a (3, 3) matrix")
    if not np.isfinite(mass) or mass < 0.0:
        raise _bad("mass", mass, "a number ≥ 0")
    if not np.all(np.isfinite(tensor)) or np.abs(tensor - tensor.T).max() > SYMMETRIC * np.abs(tensor).max():
        raise _bad("inertia", tensor.tolist(), "a finite symmetric matrix")
    if mass == 0.0:
        if np.any(tensor):
            raise _bad("inertia", tensor.tolist(), "0, since the mass is 0")
        return tensor
    least, middle, most = symmetric_eigenvalues(tensor)
    if not strict and 0.0 not in (least, middle, most):
        return tensor
    if not least > 0.0:
        raise _bad("inertia", tensor.tolist(), f"positive principal moments; the least is {least:.6g}")
    if strict and most > (least + middle) * (1.0 + INERTIA):
        raise _bad("inertia", tensor.tolist(), f"principal moments with {most:.6g} ≤ {least:.6g} + {middle:.6g}")
    return tensor


def _bad(key: str, found: object, expected: str) -> StructureError:
    return StructureError("parameter", "rigid_body", key=key, found=found, expected=expected)
