"""A scene displaced as a whole: placement of a part in the world of its scene."""

from dataclasses import replace

from ephs.mechanics.scene.model import GROUND, KINDS, Scene, World, frozen, mapped
from ephs.mechanics.scene.registry import REGISTERED
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3


def moved(scene: Scene, pose: Array, world: World) -> Scene:
    """The scene with its ground moved by a pose (7,), in another world.

    Body-frame twists stay, so velocities turn with it; what is fixed to the ground moves along.
    """

    def frame(body: str, offset: Array) -> Array:
        return frozen(SE3.compose(pose, offset)) if body == GROUND else offset

    def carried(there: Array) -> Array:
        return frozen(SE3.normalise(SE3.compose(pose, there)))

    changes = {
        **dict.fromkeys((*KINDS, *REGISTERED), lambda _, x: x.moved(pose)),
        "bodies": lambda _, b: replace(b, pose=carried(b.pose)),
        "joints": lambda _, j: replace(j, frame1=frame(j.body1, j.frame1), frame2=frame(j.body2, j.frame2)),
    }
    return mapped(scene, changes, world, origin=carried)
