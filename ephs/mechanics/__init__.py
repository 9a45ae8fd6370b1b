"""Mechanics: rigid bodies, joints, and scenes of them, as systems; and how they move.

Names are imported where they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ephs.mechanics.bodies import body_pattern as body_pattern
    from ephs.mechanics.bodies import rigid_body as rigid_body
    from ephs.mechanics.elements.beam import beam_element as beam_element
    from ephs.mechanics.inside import Inside as Inside
    from ephs.mechanics.joints import joint as joint
    from ephs.mechanics.joints import joint_pattern as joint_pattern
    from ephs.mechanics.joints import mbs_pattern as mbs_pattern
    from ephs.mechanics.joints import spring_damper as spring_damper
    from ephs.mechanics.joints import universal_joint as universal_joint

_HOME = {
    "beam_element": "ephs.mechanics.elements.beam",
    "Inside": "ephs.mechanics.inside",
    "joint": "ephs.mechanics.joints",
    "body_pattern": "ephs.mechanics.bodies",
    "rigid_body": "ephs.mechanics.bodies",
    "joint_pattern": "ephs.mechanics.joints",
    "mbs_pattern": "ephs.mechanics.joints",
    "spring_damper": "ephs.mechanics.joints",
    "universal_joint": "ephs.mechanics.joints",
}

__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll] - the names above


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'ephs.mechanics' has no attribute {name!r}")
