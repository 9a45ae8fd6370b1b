"""Other programs on the same scenes: Pinocchio with SciPy's integrators, and MuJoCo, built from the scene."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import final

from benchmarks.peers import mujoco, pinocchio
from benchmarks.peers.scene import Go, PeerError
from ephs.mechanics.scene.model import Scene

__all__ = ["PEERS", "Peer"]


@final
@dataclass(frozen=True, slots=True)
class Peer:
    """A program with one of its integrators; `build` makes the function that runs a scene up to a time."""

    name: str
    adaptive: bool
    fixed: bool
    package: str
    build: Callable[[Scene, float], Go]

    def prepare(self, scene: Scene, until: float) -> Go:
        """Runner of the scene with a setting and a time limit in s.

        Raises
        ------
        PeerError
            The program is not installed, or cannot do the scene.
        """
        try:
            import_module(self.package)
        except ImportError as error:
            raise PeerError(f"{self.package} is not installed") from error
        return self.build(scene, until)


PEERS = {
    peer.name: peer
    for peer in (
        Peer("pin DOP853", True, False, "pinocchio", pinocchio.integrator("DOP853")),
        Peer("pin LSODA", True, False, "pinocchio", pinocchio.integrator("LSODA")),
        Peer("pin Radau", True, False, "pinocchio", pinocchio.integrator("Radau")),
        Peer("pin soft DOP853", True, False, "pinocchio", pinocchio.integrator("DOP853", proximal=pinocchio.SOFT)),
        Peer("mujoco RK4", False, True, "mujoco", mujoco.integrator("RK4")),
        Peer("mujoco Euler", False, True, "mujoco", mujoco.integrator("Euler")),
        Peer("mujoco implicitfast", False, True, "mujoco", mujoco.integrator("implicitfast")),
    )
}
