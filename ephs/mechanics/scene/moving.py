"""A scene displaced as a whole: placement of a part in the world of its scene."""

from dataclasses import replace

import numpy as np

from ephs.mechanics.scene.flexible import Tendon
from ephs.mechanics.scene.model import GROUND, KINDS, Scene, Spring, World, frozen, mapped
from ephs.mechanics.scene.registry import REGISTERED
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3, translation
from ephs.semantics.spaces import rotations as so3


def moved(scene: Scene, pose: Array, world: World) -> Scene:
    """The scene with its ground moved by a pose (7,), in another world.

    Body-frame twists stay, so velocities turn with it; what is fixed to the ground moves along.
    """

    def frame(body: str, offset: Array) -> Array:
        return frozen(SE3.compose(pose, offset)) if body == GROUND else offset

    def point(body: str, position: Array) -> Array:
        return frozen(so3.quaternion_to_matrix(pose[:4]) @ position + pose[4:]) if body == GROUND else position

    def tendon(_: str, t: Tendon) -> Tendon:
        return replace(t, points=frozen([point(body, at) for body, at in zip(t.bodies, t.points, strict=True)]))

    return _carried(
        mapped(
            scene,
            {
                **dict.fromkeys((*KINDS, *REGISTERED), lambda _, x: x.moved(pose)),
                "tendons": tendon,
                "bodies": lambda _, b: replace(b, pose=frozen(SE3.normalise(SE3.compose(pose, b.pose)))),
                "joints": lambda _, j: replace(j, frame1=frame(j.body1, j.frame1), frame2=frame(j.body2, j.frame2)),
                "springs": lambda _, s: replace(s, at1=point(s.body1, s.at1), at2=point(s.body2, s.at2)),
                "surfaces": lambda _, s: replace(s, frame=frame(s.body, s.frame)),
            },
            world,
        ),
        pose,
    )


def _carried(scene: Scene, pose: Array) -> Scene:
    """The scene with the origins of all its levels moved by a pose."""
    parts = {name: _carried(part, pose) for name, part in scene.parts.items()}
    return replace(scene, parts=parts, origin=frozen(SE3.normalise(SE3.compose(pose, scene.origin))))


def spring_length(scene: Scene, spring: Spring) -> float:
    """The distance of a spring's two points."""
    ends = [
        at if name == GROUND else SE3.compose(scene.body(name).pose, translation(at))[4:]
        for name, at in ((spring.body1, spring.at1), (spring.body2, spring.at2))
    ]
    return float(np.linalg.norm(ends[0] - ends[1]))
