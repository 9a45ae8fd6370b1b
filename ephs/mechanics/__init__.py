"""Mechanics: rigid bodies, joints and scenes as systems; their motion.

Names are imported where they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ephs.mechanics.elements.beam import beam_element as beam_element
    from ephs.mechanics.elements.beam import thermoelastic as thermoelastic
    from ephs.mechanics.elements.bodies import body_pattern as body_pattern
    from ephs.mechanics.elements.bodies import rigid_body as rigid_body
    from ephs.mechanics.elements.cylinder import gas_spring as gas_spring
    from ephs.mechanics.elements.cylinder import hydraulic_cylinder as hydraulic_cylinder
    from ephs.mechanics.elements.gear import gear as gear
    from ephs.mechanics.elements.joints import joint as joint
    from ephs.mechanics.elements.joints import joint_pattern as joint_pattern
    from ephs.mechanics.elements.joints import mbs_pattern as mbs_pattern
    from ephs.mechanics.elements.joints import spring_damper as spring_damper
    from ephs.mechanics.elements.joints import universal_joint as universal_joint
    from ephs.mechanics.elements.motor import armature as armature
    from ephs.mechanics.elements.motor import motor as motor
    from ephs.mechanics.elements.shell.section import Ply as Ply
    from ephs.mechanics.elements.shell.section import ShellSection as ShellSection
    from ephs.mechanics.elements.shell.shell import Shell as Shell
    from ephs.mechanics.elements.shell.system import shell_element as shell_element
    from ephs.mechanics.elements.shell.system import shell_system as shell_system
    from ephs.mechanics.elements.tendon import tendon as tendon
    from ephs.mechanics.motion.inside import Inside as Inside
    from ephs.mechanics.rewrite.stabilised import stabilised as stabilised
    from ephs.mechanics.scene.custom import Element as Element
    from ephs.mechanics.scene.custom import key as key
    from ephs.mechanics.scene.custom import register_element as register_element
    from ephs.mechanics.scene.rules import rule as rule
    from ephs.mechanics.scene.site import Site as Site

_HOME = {
    "armature": "ephs.mechanics.elements.motor",
    "gas_spring": "ephs.mechanics.elements.cylinder",
    "hydraulic_cylinder": "ephs.mechanics.elements.cylinder",
    "gear": "ephs.mechanics.elements.gear",
    "motor": "ephs.mechanics.elements.motor",
    "beam_element": "ephs.mechanics.elements.beam",
    "Inside": "ephs.mechanics.motion.inside",
    "Element": "ephs.mechanics.scene.custom",
    "key": "ephs.mechanics.scene.custom",
    "register_element": "ephs.mechanics.scene.custom",
    "rule": "ephs.mechanics.scene.rules",
    "Site": "ephs.mechanics.scene.site",
    "joint": "ephs.mechanics.elements.joints",
    "body_pattern": "ephs.mechanics.elements.bodies",
    "rigid_body": "ephs.mechanics.elements.bodies",
    "joint_pattern": "ephs.mechanics.elements.joints",
    "mbs_pattern": "ephs.mechanics.elements.joints",
    "spring_damper": "ephs.mechanics.elements.joints",
    "Ply": "ephs.mechanics.elements.shell.section",
    "Shell": "ephs.mechanics.elements.shell.shell",
    "ShellSection": "ephs.mechanics.elements.shell.section",
    "shell_element": "ephs.mechanics.elements.shell.system",
    "shell_system": "ephs.mechanics.elements.shell.system",
    "tendon": "ephs.mechanics.elements.tendon",
    "thermoelastic": "ephs.mechanics.elements.beam",
    "stabilised": "ephs.mechanics.rewrite.stabilised",
    "universal_joint": "ephs.mechanics.elements.joints",
}

__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll] - the names above


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    from ephs.operad.messages import nearest_of

    raise AttributeError(f"module 'ephs.mechanics' has no attribute {name!r}{nearest_of(name, __all__)}")
