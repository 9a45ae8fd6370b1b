"""Systems of a scene's bodies and joints; equal bodies and joints are made once.

A rod has a thousand of them that differ by their names only.
"""

from collections.abc import Hashable
from dataclasses import dataclass, field, fields
from typing import Any, final

import numpy as np

from ephs.mechanics.elements.beam import beam_stretch, elastic
from ephs.mechanics.elements.bodies import rigid_body
from ephs.mechanics.elements.joints import between_frames, joint, universal_joint
from ephs.mechanics.scene.flexible import Strain
from ephs.mechanics.scene.model import ENVIRONMENT, Body, Joint
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.systems.system import System

NOT_OF_SYSTEM = frozenset(
    {"name", "body1", "body2", "heat", "drive", "motion", "coordinate", "rate", "armature"}
)  # fmt: skip
"""Attributes of a joint that its system does not depend on, but for whether there is a place for heat."""


@final
@dataclass(frozen=True, slots=True)
class SystemCache:
    """Cache of systems, by the data that they depend on."""

    systems: dict[Hashable, System] = field(default_factory=dict)

    def body(self, of: Body, gravity: Array) -> System:
        """A body's system."""
        key = of.mass, of.inertia.tobytes(), gravity.tobytes()
        if key not in self.systems:
            # the scene's reader has checked the inertia
            self.systems[key] = rigid_body(of.mass, of.inertia, gravity, strict=False)
        return self.systems[key]

    def joint(self, of: Joint, *, driven: bool, expands: bool = False) -> System:
        """A joint's system; ``driven`` exposes its momentum, ``expands`` the lengthening of a beam's element."""
        names = (each.name for each in fields(of) if each.name not in NOT_OF_SYSTEM)
        key = driven, expands, of.heat != ENVIRONMENT, *(_hashable(getattr(of, name)) for name in names)
        if key not in self.systems:
            self.systems[key] = _joint(of, driven=driven, expands=expands)
        return self.systems[key]


def _hashable(value: Any) -> Hashable:
    if isinstance(value, np.ndarray):
        return value.tobytes()
    return tuple(_hashable(getattr(value, each.name)) for each in fields(value)) if isinstance(value, Strain) else value


def _joint(j: Joint, *, driven: bool, expands: bool) -> System:
    heat = j.heat != ENVIRONMENT
    if j.middle is not None:
        return universal_joint(j.frame1, j.middle, j.frame2, j.friction, j.stiffness, j.rest, heat=heat, driven=driven)
    if j.strain is not None:
        of = j.strain
        parts = elastic(of.length, of.stiffness, of.rest, of.damping, of.order)
        stretch = beam_stretch(float(of.length), tuple(of.rest.tolist())) if expands else None
        return between_frames(j.frame1, j.frame2, *parts, heat=heat, stretch=stretch)
    return joint(
        j.kind, j.frame1, j.frame2, j.friction, j.stiffness, j.rest, pitch=j.pitch, heat=heat, driven=driven,
        limits=j.limits, stop=j.stop, dry=j.dry,
    )  # fmt: skip
