"""The mechanisms that are measured, with reference states from independent computations."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

import numpy as np

import ephs
from ephs.mechanics.scene.model import Joint, Scene, free_joint, frozen

HERE = Path(__file__).parent


@final
@dataclass(frozen=True, slots=True)
class Case:
    """A scene with the time of its reference state and a coarse step for the observed order.

    Parameters
    ----------
    friction
        μ of each joint in the variant with friction, in N m s or N s/m.
    """

    name: str
    time: float
    step: float
    friction: float

    def scene(self) -> Scene:
        """The scene without friction."""
        return ephs.load(HERE / "scenes" / f"{self.name}.toml")

    def with_friction(self) -> Scene:
        """The scene with friction in each joint; a body without a joint gets a free one to the ground."""
        scene = self.scene()
        joints = {
            **scene.joints,
            **{name: free_joint(scene.body(name)) for name, _ in scene.implicit_joints()},
        }
        return replace(scene, joints={name: self._rubbing(joint) for name, joint in joints.items()})

    def reference(self) -> dict[str, Any]:
        """Body name -> position, quaternion, velocity, angular_velocity at ``time``."""
        return self._known()["bodies"]

    def cross_check(self) -> float:
        """The largest difference between two independent computations of the reference."""
        return float(self._known()["cross_check"] or 0.0)

    def error(self, solution: ephs.Solution) -> float:
        """Largest deviation of any body's position or rotation matrix at the end from the reference."""
        worst = 0.0
        for name, state in self.reference().items():
            body = solution.body(name)
            off = np.abs(body.position[-1] - np.array(state["position"])).max()
            turned = np.abs(body.rotation[-1] - _matrix(state["quaternion"])).max()
            worst = max(worst, float(off), float(turned))
        return worst

    def _known(self) -> dict[str, Any]:
        data = json.loads((HERE / "reference" / f"{self.name}.json").read_text())
        return data["states"][repr(self.time)]

    def _rubbing(self, joint: Joint) -> Joint:
        return replace(joint, friction=frozen(self.friction * np.eye(joint.dim)))


def _matrix(q: list[float]) -> np.ndarray:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


CASES = (
    Case("heavy-top", 0.5, 4e-4, 0.01),
    Case("tumbling-body", 5.0, 0.02, 0.01),
    Case("revolute-chain-4", 1.0, 0.01, 0.1),
    Case("spherical-chain-2", 2.0, 0.01, 0.1),
    Case("four-bar-windows-1", 5.0, 0.01, 0.1),
    Case("andrews-squeezer", 0.01, 1e-5, 1e-5),
)
