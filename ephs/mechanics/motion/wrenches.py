"""Joint wrenches of a mechanism, from its bodies' equations of motion alone.

The constraints A u + B u_r = 0 of all joints, differentiated once, and the balances of bodies and of massless joints,

    M u̇ = f(u) − Aᵀ λ,    Bᵀ λ = f_r,    A u̇ + B u̇_r = −(Ȧ u + Ḃ u_r),

determine λ as far as the joints leave it determined. The same as `instant` says of the whole descriptor form, which is
the oracle, with the bodies' momenta and all that is no joint eliminated beforehand.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol, final

import numpy as np

from ephs.mechanics.motion.contacts import contact_wrenches
from ephs.mechanics.motion.loads import Inputs, Read, body_loads, joint_load
from ephs.mechanics.scene.model import GROUND, Body, Joint, Scene
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import pair
from ephs.semantics.spaces.rank import CONSTRAINT, REGULAR, SPANNED, rank_of
from ephs.solve.threads import in_one_thread

__all__ = ["Hold", "Moving", "root_of", "signs_of", "transmitted", "wrenches"]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Hold:
    """What a joint does at an instant: Σ rows[body] · twist + basis · rate = 0.

    Parameters
    ----------
    rows
        Body -> (6, 6).
    basis
        (6, d).
    force
        (d,) generalised force on the rate, by drives, friction and stiffness.
    turning
        (6,) the part of the constraint's time derivative without accelerations.
    prescribed
        Whether the rate is prescribed, and constant; whatever force that takes is then in λ.
    """

    rows: Mapping[str, Array]
    basis: Array
    force: Array
    turning: Array
    prescribed: bool


def transmitted(
    holds: list[Hold], roots: Mapping[str, Array], forces: Mapping[str, Array], signs: Mapping[str, Array]
) -> list[Array]:
    """The multiplier (6,) of each joint at an instant, NaN in components that are statically indeterminate.

    Parameters
    ----------
    roots
        Body -> (6, 6) symmetric root of the inverse of its inertia; bodies that are missing have no inertia.
    forces
        Body -> (6,) wrench in its own frame, inertial forces included.
    signs
        Body -> (6, 6) the signs of its inertia, of bodies that have a negative principal moment.
    """
    light = [name for name in forces if name not in roots]
    columns = {name: 6 * i for i, name in enumerate(forces if not light else [*roots, *light])}
    heavy, n = 6 * len(roots), 6 * len(holds)
    dims = [0 if hold.prescribed else hold.basis.shape[1] for hold in holds]
    matrix = np.zeros((n, 6 * len(columns) + sum(dims)))
    pull = np.zeros(matrix.shape[1])
    for name, at in columns.items():
        pull[at : at + 6] = roots[name] @ forces[name] if name in roots else forces[name]
    right, column = np.zeros(n), 6 * len(columns)
    for i, (hold, dim) in enumerate(zip(holds, dims, strict=True)):
        own = slice(6 * i, 6 * i + 6)
        for name, block in hold.rows.items():
            matrix[own, columns[name] : columns[name] + 6] += block @ roots[name] if name in roots else block
        matrix[own, column : column + dim] = hold.basis[:, :dim]
        pull[column : column + dim] = hold.force[:dim]
        right[own] = hold.turning
        column += dim
    u, sigma, _ = np.linalg.svd(matrix)
    rank = rank_of(sigma, CONSTRAINT)
    held, loose = u[:, :rank], np.abs(u[:, rank:]).max(axis=1, initial=0.0) > SPANNED
    moved, still = held.T @ matrix[:, :heavy], held.T @ matrix[:, heavy:]
    k, signed = still.shape[1], moved.copy()
    for name, sign in signs.items():
        own = slice(columns[name], columns[name] + 6)
        signed[:, own] = moved[:, own] @ sign
    system = np.block([[signed @ moved.T, -still], [still.T, np.zeros((k, k))]])
    wanted = np.concatenate([signed @ pull[:heavy] + held.T @ right, pull[heavy:]])
    values = held @ np.linalg.lstsq(system, wanted, rcond=REGULAR)[0][:rank]
    return list(np.where(loose, np.nan, values).reshape(len(holds), 6))


class Moving(Read, Protocol):
    """A motion of a scene, as its joints are read."""

    @property
    def rates(self) -> Mapping[str, Array]:
        """(n, d) by joint."""
        ...

    def chunks(self) -> Iterator[slice]:
        """Instants that are treated together."""
        ...

    def coordinates(self, name: str) -> Array:
        """(n, d) of a joint."""
        ...

    def inclusion(self, name: str) -> Array:
        """(n, 7) poses of C2 in C1."""
        ...

    def joint_rows(self, at: slice) -> Iterator[tuple[str, Array, Array, Array]]:
        """Per joint what its constraint says of body 1, of body 2 and of its rate, each (size, 6, ·)."""
        ...


@in_one_thread
def wrenches(scene: Scene, inputs: Inputs, motion: Moving) -> dict[str, Array]:
    """(n, 6) of every joint: λ on body 2 in the joint frame C2, NaN in components that are indeterminate.

    Parameters
    ----------
    inputs
        (n, dim) at each outer port.
    """
    joints = dict(scene.all_joints())
    roots = {name: root_of(body) for name, body in scene.all_bodies() if body.mass > 0.0}
    signs = signs_of(scene)
    loads = body_loads(scene, inputs, motion)
    for name, wrench in contact_wrenches(scene, motion):
        loads[name] += wrench
    pulls = {
        name: joint_load(j, inputs, motion.coordinates(name), motion.rates[name], motion.inclusion(name))
        for name, j in joints.items()
    }
    out = {name: np.empty_like(motion.inclusion(name)[:, :6]) for name in joints}
    for at in motion.chunks():
        rows = list(motion.joint_rows(at))
        turns = [_turning(joints[name], first, basis, motion, at) for name, first, _, basis in rows]
        for k in range(at.stop - at.start):
            holds: list[Hold] = []
            for (name, first, second, basis), turn in zip(rows, turns, strict=True):
                joint = joints[name]
                sides = ((joint.body1, first[k]), (joint.body2, second[k]))
                held = {body: block for body, block in sides if body != GROUND}
                holds.append(Hold(held, basis[k], pulls[name][at.start + k], turn[k], joint.motion is not None))
            found = transmitted(holds, roots, {name: load[at.start + k] for name, load in loads.items()}, signs)
            for (name, *_), value in zip(rows, found, strict=True):
                out[name][at.start + k] = value
    return out


def root_of(body: Body) -> Array:
    """(6, 6) symmetric root of the inverse of a body's inertia, its moments taken without their signs."""
    sigma, vectors = np.linalg.eigh(body.inertia)
    out = np.zeros((6, 6))
    out[:3, :3] = (vectors / np.sqrt(np.abs(sigma))) @ vectors.T
    out[3:, 3:] = np.eye(3) / np.sqrt(body.mass)
    return out


def signs_of(scene: Scene) -> dict[str, Array]:
    """Body -> (6, 6) S with root · S · root the inverse of its inertia, of bodies with a negative principal moment."""
    out: dict[str, Array] = {}
    for name, body in scene.all_bodies():
        sigma, vectors = np.linalg.eigh(body.inertia)
        if body.mass > 0.0 and sigma[0] < 0.0:
            out[name] = np.eye(6)
            out[name][:3, :3] = (vectors * np.sign(sigma)) @ vectors.T
    return out


def _turning(joint: Joint, first: Array, basis: Array, motion: Moving, at: slice) -> Array:
    """(size, 6) Ȧ u + Ḃ u_r: A turns with the joint, B of a universal joint with its second angle."""
    rate = motion.rates[joint.name][at]
    relative = np.einsum("nij,nj->ni", basis, rate)
    out = np.zeros_like(relative)
    if joint.body1 != GROUND:
        out -= _bracket(relative, np.einsum("nij,nj->ni", first, motion.twists[joint.body1][at]))
    if joint.middle is not None:
        after = rate[:, 1:] * pair("revolute").basis[:, 0]
        out -= _bracket(after, basis[:, :, 0] * rate[:, :1])
    return out


def _bracket(a: Array, b: Array) -> Array:
    """(n, 6) ad_a b of twists."""
    turned = np.cross(a[:, :3], b[:, :3])
    moved = np.cross(a[:, :3], b[:, 3:]) + np.cross(a[:, 3:], b[:, :3])
    return np.concatenate([turned, moved], axis=1)
