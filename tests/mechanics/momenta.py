"""Momenta of a solution's bodies by Newton's and Euler's formulas, and mechanisms that nothing holds."""

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from ephs.mechanics.scene.model import Body, World, frozen
from ephs.semantics.spaces import SE3
from ephs.testing import mechanisms
from tests.numerics import generators

__all__ = ["floating", "momenta"]


def momenta(scene, sol):
    """Linear and angular momentum of all bodies about the world's origin, (n, 6)."""
    total = np.zeros((len(sol), 6))
    for name, body in scene.all_bodies():
        motion = sol.body(name)
        linear = body.mass * motion.velocity
        spin = np.einsum("nij,jk,nk->ni", motion.rotation, np.array(body.inertia), motion.angular_velocity)
        total[:, :3] += linear
        total[:, 3:] += spin + np.cross(motion.position, linear)
    return total


@st.composite
def floating(draw, gravity=(0.0, 0.0, 0.0), **options):
    """Scenes of `mechanisms` with a body that moves and turns in place of the ground."""
    scene = draw(mechanisms(**({"max_bodies": 3} | options)))
    rng = draw(generators)
    twist = rng.standard_normal(6)
    base = Body("base", 2.0, frozen(np.diag([0.7, 0.8, 1.1])), frozen(SE3.identity()), frozen(np.zeros(6)))
    bodies = {
        name: replace(body, twist=frozen(body.twist + SE3.adjoint(SE3.inverse(np.array(body.pose))) @ twist))
        for name, body in {"base": base, **scene.bodies}.items()
    }

    def released(parts):
        ends = {
            name: {key: "base" for key in ("body1", "body2") if getattr(part, key) == "ground"}
            for name, part in parts.items()
        }
        return {name: replace(part, **ends[name]) for name, part in parts.items()}

    return replace(
        scene, world=World(gravity=frozen(list(gravity))), bodies=bodies, joints=released(scene.joints),
        springs={
            name: spring.changed(bodies=["base" if body == "ground" else body for body in spring.bodies])
            for name, spring in scene.springs.items()
        },
    )  # fmt: skip
