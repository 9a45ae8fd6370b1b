"""Other programs on the same scenes: Pinocchio with SciPy's integrators, and MuJoCo, built from the scene."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import final

from ephs.mechanics.scene.model import Scene
from ephs.show.charts import peer_mujoco, peer_pin
from ephs.show.charts.peer_scene import Go, PeerError, PeerRun

__all__ = ["PEERS", "Peer", "PeerError", "PeerRun"]


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
        Peer("pin DOP853", True, False, "pinocchio", peer_pin.integrator("DOP853")),
        Peer("pin LSODA", True, False, "pinocchio", peer_pin.integrator("LSODA")),
        Peer("pin Radau", True, False, "pinocchio", peer_pin.integrator("Radau")),
        Peer("pin soft DOP853", True, False, "pinocchio", peer_pin.integrator("DOP853", proximal=peer_pin.SOFT)),
        Peer("mujoco RK4", False, True, "mujoco", peer_mujoco.integrator("RK4")),
        Peer("mujoco Euler", False, True, "mujoco", peer_mujoco.integrator("Euler")),
        Peer("mujoco implicitfast", False, True, "mujoco", peer_mujoco.integrator("implicitfast")),
    )
}
