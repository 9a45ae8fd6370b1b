"""Forces and moments on bodies."""

from typing import Self, final

import numpy as np

from ephs.mechanics.scene.custom import Element, key
from ephs.mechanics.scene.element import GROUND
from ephs.mechanics.scene.rules import rule
from ephs.mechanics.scene.schema_numbers import Flag, NonNegative, Text, Vector
from ephs.mechanics.scene.site import Site
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.rotations import quaternion_to_matrix


@final
class Load(Element, section="loads", said="forces and moments on bodies"):
    """A force and a moment on a body's centre of mass."""

    body: Text = key("body; the load acts at its centre of mass", names="body")
    force: Vector = key("force in world axes", [0.0, 0.0, 0.0], unit="N")
    moment: Vector = key("moment in world axes", [0.0, 0.0, 0.0], unit="N m")
    follower: Flag = key("force and moment are given in body axes and turn with the body", False)
    ramp: NonNegative = key("time over which the load grows linearly from 0", 0.0, unit="s")

    @rule("body", expected="a body", advice="choose a body; loads on the ground have no effect")
    def aimed(self) -> bool:
        """Whether it acts on what can move."""
        return self.body != GROUND

    def moved(self, pose: Array) -> Self:
        turn = np.eye(3) if self.follower else quaternion_to_matrix(pose[:4])
        return self.changed(force=(turn @ self.force).tolist(), moment=(turn @ self.moment).tolist())

    def build(self, site: Site) -> None:
        """Nothing: runs have its wrench as a signal."""

    def wrench(self, rotation: Array) -> Array:
        """(6,) moment and force after the ramp, in body axes; of a body with this rotation (3, 3) to the world."""
        turn = np.eye(3) if self.follower else rotation.T
        return np.concatenate([turn @ self.moment, turn @ self.force])

    def __str__(self) -> str:
        return f"on {self.body}"
