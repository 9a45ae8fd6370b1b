"""Names and units of the components of a state."""

from dataclasses import dataclass
from functools import cache
from typing import final

from ephs.operad import Quantity
from ephs.operad.units import effort_unit, flow_unit
from ephs.semantics.spaces import PAIRS, Pair

OWN = "SI"
"""Default unit of quantities."""
_POWER = {
    "rad": ("rad/s", "N m"),
    "kg m²/s": ("N m", "rad/s"),
    "J/K": ("W/K", "K"),
}
"""Unit of a state -> customary units of its flow and effort."""


@final
@dataclass(frozen=True, slots=True)
class Labels:
    """Names of the components of an array.

    Parameters
    ----------
    dimension
        What they are the components of; empty for scalars.
    names, units
        One a component; a single unit for scalars.
    """

    dimension: str
    names: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def unit(self) -> str:
        """The unit of all, or those of each in their order."""
        return self.units[0] if len(set(self.units)) == 1 else ", ".join(self.units)


POSE = Labels("pose", ("qw", "qx", "qy", "qz", "x", "y", "z"), ("1",) * 4 + ("m",) * 3)
MOMENTUM = Labels("momentum", ("lx", "ly", "lz", "px", "py", "pz"), ("kg m²/s",) * 3 + ("kg m/s",) * 3)
TWIST = Labels("twist", ("wx", "wy", "wz", "vx", "vy", "vz"), ("rad/s",) * 3 + ("m/s",) * 3)
WRENCH = Labels("wrench", ("mx", "my", "mz", "fx", "fy", "fz"), ("N m",) * 3 + ("N",) * 3)
_WHOLE = {
    ("pose", 7): POSE,
    ("momentum", 6): MOMENTUM,
}


@cache
def labels_of(quantity: Quantity) -> Labels:
    """Names of the components of a state in solutions: relative poses in the joint's coordinates."""
    space = quantity.space
    if quantity.kind == "relative_pose" and space.name in PAIRS:
        return freedoms(Pair.from_space(space))
    if quantity.kind == "momentum" and space.name.removesuffix("*") in PAIRS:
        of = freedoms(Pair.from_space(type(space)(space.name[:-1], space.dim, space.size, space.parameters)))
        units = tuple("kg m²/s" if unit == "rad" else "kg m/s" for unit in of.units)
        return Labels(f"{of.dimension} momentum", of.names, units)
    if (found := _WHOLE.get((quantity.kind, space.size))) is not None:
        return found
    unit = quantity.unit or OWN
    if space.size == 1:
        return Labels("", (), (unit,))
    return Labels(f"{space.name} {space.size}", tuple(map(str, range(space.size))), (unit,) * space.size)


def freedoms(of: Pair) -> Labels:
    """The coordinates of a lower pair: angles and rotation vectors in rad, distances in m."""
    turning = [bool(column[:3].any()) for column in of.basis.T]
    axes = [
        "xyz"[int(abs(column[:3] if turns else column[3:]).argmax())]
        for column, turns in zip(of.basis.T, turning, strict=True)
    ]
    alone = {True: "angle", False: "distance"}
    names = [
        alone[turns] if turning.count(turns) == 1 else f"r{axis}" if turns else axis
        for axis, turns in zip(axes, turning, strict=True)
    ]
    return Labels(of.name, tuple(names), tuple("rad" if turns else "m" for turns in turning) or ("1",))


def power_labels(quantity: Quantity, *, effort: bool) -> Labels:
    """Names of the components of a flow or an effort at a port."""
    of = labels_of(quantity)
    if of.dimension == "pose":  # flows of poses are twists
        return Labels("twist", TWIST.names, WRENCH.units if effort else TWIST.units)
    units = tuple(OWN if unit == OWN else _power(unit)[effort] for unit in of.units)
    whole = any(quantity.kind == kind for kind, _ in _WHOLE)  # one number beside those of bodies, as of tensions
    scalar = f"{quantity.kind} 1" if whole else quantity.kind
    return Labels(of.dimension or scalar, of.names or (quantity.kind,), units)


def _power(unit: str) -> tuple[str, str]:
    return _POWER.get(unit) or (flow_unit(unit), effort_unit(unit))
