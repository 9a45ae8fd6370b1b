"""A mechanism that is a part of a larger system, read from the solution of the whole."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast, final

import numpy as np

from ephs.mechanics.motion.motion import BodyMotion, JointMotion, MarkerMotion, SceneMotion, ThermalMotion
from ephs.mechanics.motion.moving import BoxMotion
from ephs.mechanics.motion.reduced import motion_of
from ephs.mechanics.motion.shells import ShellMotion
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.solve.result.labels import Labels

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ephs.mechanics.scene.model import Scene
    from ephs.solve.result.solution import Solution


@final
class Inside:
    """The motion of a scene as a box of a larger system, with the interface of the scene's own solution.

    `ephs.show.animate` takes it, too.

    Parameters
    ----------
    solution
        Of the whole system.
    path
        Where the scene's system is in it, as ``"engine"``.
    scene
        Whose system it is.

    Raises
    ------
    KeyError
        A state of the scene is not there; the message names the nearest.
    """

    def __init__(self, solution: "Solution", path: str | Path, scene: "Scene") -> None:
        self._solution, self._path, self.scene = solution, Path.of(path), scene
        self.t, self.name, self.stats = solution.t, f"{solution.name}.{path}", solution.stats
        self.problem = None  # the loads on the mechanism do not define a problem
        self._motion = SceneMotion(scene, cast(Any, self), lambda: BoxMotion(motion_of(solution), self._path))
        for name, _ in scene.all_bodies():
            self._motion.poses(name)

    def __len__(self) -> int:
        return len(self._solution)

    def __getitem__(self, path: str | Path) -> Array:
        """The state at a path of the scene's system."""
        return self._solution[self._path / path]

    def __contains__(self, path: str | Path) -> bool:
        return self._path / path in self._solution

    @property
    def outline(self) -> "Scene":
        """The drawn scene."""
        return self._motion.outline()

    @property
    def freedoms(self) -> Mapping[str, Labels]:
        """Names and units of the coordinates of each joint."""
        return self._motion.freedoms

    @property
    def constraint_error(self) -> Array:
        """(n,) largest position residual of any joint, in m or rad."""
        return self._motion.constraint_error()

    def body(self, name: str) -> BodyMotion:
        """The motion of a body: position, quaternion, rotation, velocity, angular_velocity."""
        return self._motion.body(name)

    def joint(self, name: str) -> JointMotion:
        """The motion of a joint: coordinate, rate, wrench."""
        return self._motion.joint(name)

    def thermal(self, name: str) -> ThermalMotion:
        """The temperature of a thermal node."""
        return self._motion.thermal(name)

    def shell(self, name: str) -> ShellMotion:
        """The motion of a shell: nodes, membrane and transverse forces, moments and energy."""
        return self._motion.shell(name)

    def marker(self, name: str) -> MarkerMotion:
        """The motion of a marker: position and velocity in the world."""
        return self._motion.marker(name)

    def point(self, body: str, xyz: "ArrayLike") -> Array:
        """(n, 3) world position of a point of the body's frame."""
        motion = self.body(body)
        return motion.position + motion.rotation @ np.asarray(xyz, dtype=float)
