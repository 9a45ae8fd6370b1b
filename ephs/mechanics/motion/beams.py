"""Beams of a motion: where their nodes are, strains, internal forces and moments, at all instants."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.elements.strain import displacement, mean_stress
from ephs.mechanics.scene.flexible import Beam
from ephs.mechanics.scene.model import Scene
from ephs.semantics.bundle import Array

__all__ = ["BeamMotion", "beam_motion"]


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
        (n, elements, 3) elastic, in N: axial, shear along 2, 3.
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
    scene: Scene, beam: Beam, poses: Callable[[str], Array], relative: Callable[[str], Array]
) -> BeamMotion:
    """Read a beam's motion from its bodies' poses (n, 7) and its joints' relative ones."""
    position = np.stack([poses(node)[:, 4:] for node in beam.nodes], axis=1)
    strains, stresses, energies = list[Array](), list[Array](), list[Array]()
    for name in beam.joints:
        of = scene.joint(name).strain
        assert of is not None
        rows = displacement(relative(name).T, of.length, of.rest)
        strain = np.column_stack([np.broadcast_to(d, len(position)) for d in rows]) / of.length
        strains.append(strain)
        rows = mean_stress(relative(name).T, of.length, of.stiffness, of.rest, of.order)
        stress = np.column_stack([np.broadcast_to(n, len(position)) for n in rows])
        stresses.append(stress)
        energies.append(0.5 * of.length * np.sum(strain * stress, axis=1))
    stress = np.stack(stresses, axis=1)
    return BeamMotion(position, np.stack(strains, axis=1), stress[..., 3:], stress[..., :3], np.stack(energies, axis=1))
