"""Beams of a motion: poses of nodes, strains, internal forces and moments, at all instants."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.elements.strain import displacement, logarithm, mean_stress
from ephs.mechanics.scene.flexible import Beam
from ephs.mechanics.scene.model import Scene
from ephs.semantics.bundles.bundle import Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class BeamMotion:
    """A beam. Strains, forces and moments are those of its elements, in the axes of their sections: tangent, 2, 3.

    Parameters
    ----------
    position
        (n, nodes, 3) in m.
    strain
        (n, elements, 6) beyond that without force: torsion and bending about 2, 3 in 1/m; stretch, shear along 2, 3.
    force
        (n, elements, 3) in N: axial, shear along 2, 3; elastic and thermal, and of rods without stretch what holds the
        pieces.
    moment
        (n, elements, 3) elastic, in N m: torsion, bending about 2, 3.
    energy
        (n, elements) strain energy in J.
    """

    position: Array
    strain: Array
    force: Array
    moment: Array
    energy: Array


def beam_motion(
    scene: Scene,
    beam: Beam,
    poses: Callable[[str], Array],
    relative: Callable[[str], Array],
    wrench: Callable[[str], Array],
    temperature: Callable[[str], Array],
) -> BeamMotion:
    """Read a beam's motion from its bodies' poses (n, 7), its joints' relative poses, their wrenches (n, 6), and the
    temperatures (n,) of thermal nodes.
    """
    nodes = dict(scene.all_thermal())
    position = np.stack([poses(node)[:, 4:] for node in beam.nodes], axis=1)
    strains, stresses = list[Array](), list[Array]()
    if beam.lengths:
        for name, length in zip(beam.joints, beam.lengths, strict=True):
            pose = relative(name)
            turn = np.column_stack([np.broadcast_to(w, len(pose)) for w in logarithm(pose.T)[:3]])
            strains.append(np.hstack([turn / length, np.zeros_like(turn)]))
            stresses.append(np.hstack([scene.joint(name).stiffness * turn, -_half_turned(pose, wrench(name)[:, 3:])]))
    for name in () if beam.lengths else beam.joints:
        of = scene.joint(name).strain
        assert of is not None
        rows = displacement(relative(name).T, of.length, of.rest)
        strains.append(np.column_stack([np.broadcast_to(d, len(position)) for d in rows]) / of.length)
        rows = mean_stress(relative(name).T, of.length, of.stiffness, of.rest, of.order)
        stresses.append(np.column_stack([np.broadcast_to(n, len(position)) for n in rows]))
    strain, stress = np.stack(strains, axis=1), np.stack(stresses, axis=1)
    lengths = beam.lengths or tuple(s.length for s in (scene.joint(name).strain for name in beam.joints) if s)
    energy = 0.5 * np.array(lengths) * np.sum(strain * stress, axis=2)
    for i, name in enumerate(beam.joints):
        node = nodes.get(scene.joint(name).heat)
        if node is not None and node.pull:
            stress[:, i, 3] -= node.pull * (temperature(node.name) - node.reference)
    return BeamMotion(position, strain, stress[..., 3:], stress[..., :3], energy)


def _half_turned(pose: Array, vectors: Array) -> Array:
    """Vectors (n, 3) in the axes of the second frame, in those halfway between the two; ``pose`` (n, 7) of it."""
    half = pose[:, :4] * np.where(pose[:, :1] < 0.0, -1.0, 1.0)
    half = half + np.array([1.0, 0.0, 0.0, 0.0])
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    side = np.cross(half[:, 1:], vectors)
    return vectors + 2.0 * (half[:, :1] * side + np.cross(half[:, 1:], side))
