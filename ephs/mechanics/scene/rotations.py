"""Rotations in scene files: quaternions, roll–pitch–yaw angles, or an axis with an angle."""

import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import TypeAdapter, WrapValidator
from pydantic_core import PydanticCustomError

from ephs.mechanics.scene.errors import TEXTS, shown
from ephs.mechanics.scene.rules import Told, rule
from ephs.mechanics.scene.schema_numbers import EntryTable, Number, Quaternion, Vector, key

TOLERANCE = 1e-6
"""Most by which the norm of a given quaternion differs from 1."""
FORMS = "rpy, rpy_deg, or axis with angle or angle_deg"


_QUATERNION: TypeAdapter[list[float]] = TypeAdapter(Quaternion)


class RotationEntry(EntryTable):
    """A rotation given by angles instead of a quaternion; one of rpy, rpy_deg, and axis with angle or angle_deg."""

    rpy: Vector | None = key("roll, pitch, yaw about the fixed axes x, y, z in turn, rad", None)
    rpy_deg: Vector | None = key("likewise, in degrees", None)
    axis: Vector | None = key("axis of rotation, of any length but 0", None)
    angle: Number | None = key("about axis, rad", None)
    angle_deg: Number | None = key("about axis, in degrees", None)

    def quaternion(self) -> list[float]:
        """Unit quaternion [w, x, y, z].

        Raises
        ------
        PydanticCustomError
            The keys do not make one rotation.
        """
        given = {key for key, value in self if value is not None}
        if given in ({"rpy"}, {"rpy_deg"}):
            roll, pitch, yaw = self.rpy or [math.radians(angle) for angle in self.rpy_deg or ()]
            x, y, z = np.eye(3).tolist()
            return _times(_about(z, yaw), _times(_about(y, pitch), _about(x, roll)))
        if given in ({"axis", "angle"}, {"axis", "angle_deg"}) and self.axis is not None and any(self.axis):
            return _about(self.axis, self.angle if self.angle is not None else math.radians(self.angle_deg or 0.0))
        raise PydanticCustomError("rotation", FORMS)


def _about(axis: list[float], angle: float) -> list[float]:
    size = math.hypot(*axis)
    return [math.cos(angle / 2), *(math.sin(angle / 2) * x / size for x in axis)]


def _times(p: list[float], q: list[float]) -> list[float]:
    """Product of two quaternions: the second rotation comes first."""
    a, b = np.array(p[1:]), np.array(q[1:])
    return [p[0] * q[0] - float(a @ b), *(p[0] * b + q[0] * a + np.cross(a, b)).tolist()]


def _rotation(value: Any, _handler: Any) -> list[float]:
    """A quaternion from any of the forms; faults of one form only."""
    if isinstance(value, Mapping):
        return RotationEntry.model_validate(value).quaternion()
    if not isinstance(value, list):
        raise PydanticCustomError("rotation_type", "a quaternion or a table")
    return _QUATERNION.validate_python(value)


Rotation = Annotated[list[float], WrapValidator(_rotation, json_schema_input_type=Quaternion | RotationEntry)]
"""Validated to a quaternion [w, x, y, z]."""


@rule("rotation", found="{found}", expected=TEXTS["quaternion"][0], advice=TEXTS["quaternion"][1])
def turned(element: Any) -> Told:
    """Whether the rotation of an element is a unit quaternion."""
    size = 1.0 if element.rotation is None else float(np.linalg.norm(element.rotation))
    return abs(size - 1.0) <= TOLERANCE or {"found": f"{shown(element.rotation)} of norm {size:.9g}"}
