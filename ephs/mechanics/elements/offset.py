"""Frames at constant offsets from those of bodies, as components."""

from functools import cache, lru_cache, partial
from typing import TYPE_CHECKING, Final

import numpy as np

from ephs.mechanics.elements import notation
from ephs.operad import Interface, quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.derive.linear import Linear
from ephs.semantics.primitives.primitives import Formula, Kernel, Point, Reversible, power_ports
from ephs.semantics.spaces import SE3

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

CARRIED: Final = Linear("frame_change")
KEPT: Final = 4096
"""Components that are shared by their offset: points of contact with one surface have the same frame there."""


def frame_change(offset: "ArrayLike", inner: str, outer: str) -> Reversible:
    """Momentum carried from a body's frame (port ``outer``) to a joint frame (port ``inner``) at a constant offset o.

    inner.e = Ad_{o⁻¹} outer.e, outer.f = −Ad*_{o⁻¹} inner.f.
    """
    return _frame_change(np.asarray(offset, dtype=float).tobytes(), inner, outer)


@lru_cache(maxsize=KEPT)
def _frame_change(offset: bytes, inner: str, outer: str) -> Reversible:
    pose = tuple(np.frombuffer(offset).tolist())
    structure = partial(_carrying, pose)
    return Reversible(
        "frame_change",
        _ports(outer, inner),
        structure,
        parameters=(("offset", pose),),
        multipliers=6,
        kernel=Kernel("frame_change", CARRIED, pose),
        formula=Formula(structure),
        notation=notation.frame_change,
        trusted=True,
    )


@cache
def _ports(outer: str, inner: str) -> Interface:
    return power_ports(**{outer: quantity.body_momentum, inner: quantity.body_momentum})


def _carrying(offset: tuple[float, ...], _: Point | None = None) -> tuple[Array, Array]:
    """(L, C) of a frame change."""
    return np.zeros((12, 12)), np.hstack([-SE3.adjoint(SE3.inverse(np.array(offset))), np.eye(6)])
