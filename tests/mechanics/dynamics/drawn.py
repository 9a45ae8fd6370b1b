"""Mechanisms in motion, drawn: trees walked either way, prescribed joints, closed loops, forces, heat."""

from dataclasses import replace

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

import ephs
from benchmarks import families
from ephs import PolynomialMotion
from ephs.mechanics.scene.geometry import coupling_of
from ephs.mechanics.scene.model import frozen
from ephs.testing import mechanisms
from tests.numerics import generators

SHARED = ephs.dynamics(families.scene("planar-chain", 1))
"""Compiles what all mechanisms share, before draws are timed."""
SHARED.derivatives(SHARED.state0)


def turned(joint):
    """The joint with its bodies exchanged, in the same place and motion: the tree then walks it backward."""
    of = coupling_of(joint).pair
    x = of.manifold.inverse(joint.coordinate)
    pull = joint.stiffness if joint.kind in ("revolute", "prismatic", "screw") else np.zeros(joint.dim)
    return replace(
        joint,
        body1=joint.body2,
        body2=joint.body1,
        frame1=joint.frame2,
        frame2=joint.frame1,
        coordinate=frozen(x),
        rate=frozen(-of.manifold.adjoint(np.asarray(joint.coordinate)) @ joint.rate),
        stiffness=frozen(pull),
    )


@st.composite
def moving(draw, **options):
    """(scene, its dynamics, a state in motion, generator): some joints turned, some driven, some prescribed."""
    scene = draw(mechanisms(**({"max_bodies": 4} | options)))
    rng = draw(generators)
    joints = {}
    tree = len(scene.joints) == len(scene.bodies)
    for name, joint in scene.joints.items():
        if joint.middle is None and draw(st.booleans()):
            joint = turned(joint)
        choice = draw(st.sampled_from(["free", "driven", "prescribed"])) if options.get("springs", True) else "free"
        if choice == "driven":
            joint = replace(joint, drive=frozen(rng.standard_normal(joint.dim)))
        if choice == "prescribed" and tree and joint.dim == 1:
            joint = replace(joint, motion=PolynomialMotion((float(joint.rate[0]),)))
        joints[name] = joint
    scene = replace(scene, joints=joints)
    model = ephs.dynamics(scene)
    array = np.array(model.state0.array)
    n = model.layout.n
    assume(n > 0)
    first = array.size - n - len(model.layout.entropies)
    array[first : first + n] += 0.5 * rng.standard_normal(n)
    return scene, model, model.closed(model.unpack(array)), rng
