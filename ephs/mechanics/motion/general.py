"""Velocities and joint wrenches of a solution by the general form, where there are no joint coordinates."""

from collections.abc import Mapping
from functools import cached_property
from itertools import accumulate
from typing import final

import numpy as np

from ephs.mechanics.motion.batch import adjoint_inverse, compose, included
from ephs.mechanics.scene.geometry import JointCoupling
from ephs.mechanics.tree.finding.frames import GROUND, Frames, Link, LinkJoint
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.decompositions import pseudoinverse, symmetric_eigen
from ephs.semantics.spaces.rank import CONSTRAINT
from ephs.solve.posing.motion_law import MotionLaw
from ephs.solve.result.ports import rates_at
from ephs.solve.result.solution import Solution
from ephs.solve.running.threads import in_one_thread


@final
class GeneralMotion:
    """The motion of one solution: momenta projected on the joints, multipliers of the whole descriptor form."""

    def __init__(self, solution: Solution, frames: Frames) -> None:
        self._solution, self._frames = solution, frames
        self._joints = {joint.path: joint for joint in frames.joints}

    @property
    def twists(self) -> Mapping[Path, Array]:
        """Path of a body -> (n, 6) in its frame; rad/s, m/s."""
        return {link.path: self._projected[0][i] for i, link in enumerate(self._frames.links) if link.path is not None}

    def rate(self, joint: Path) -> Array:
        """(n, d) of the joint with this box, in the axes of C2."""
        return self._projected[1][list(self._joints).index(joint)]

    def pressed(self, point: Path) -> tuple[Array, list[Array]]:
        """(n, 3) NaN: without joint coordinates forces of hard contacts are not known."""
        return np.full((len(self._solution), 3), np.nan), [np.zeros((3, 0))] * len(self._solution)

    def wrench(self, joint: Path) -> Array:
        """(n, 6) of the joint with this box: λ on body 2 in C2, NaN in components that are indeterminate."""
        return self._multipliers[list(self._joints).index(joint)]

    @cached_property
    @in_one_thread
    def _multipliers(self) -> Array:
        """(joints, n, 6)."""
        problem, joints = self._solution.problem, self._joints.values()
        out = np.full((len(self._joints), len(self._solution), 6), np.nan)
        if problem is None:
            return out
        momenta = [
            (link.momentum.path, twist @ link.inertia)
            for link, twist in zip(self._frames.links, self._projected[0], strict=True)
            if link.momentum is not None
        ]
        d = problem.descriptor
        for k in range(len(self._solution)):
            found = rates_at(self._solution, k, self._solution.state_at(k) | {path: rows[k] for path, rows in momenta})
            out[:, k] = [found.multiplier(d.components[joint.relation].path) for joint in joints]
        return out

    @cached_property
    @in_one_thread
    def _projected(self) -> tuple[list[Array], list[Array]]:
        """(n, 6) twists link by link, and (n, d) rates joint by joint: nearest to the momenta in the mass metric."""
        links, n = self._frames.links, len(self._solution)
        sizes = [6 if link.momentum is None else 0 for link in links] + [one.pair.dim for one in self._joints.values()]
        first = [0, *accumulate(sizes)]
        heavy = [i for i, link in enumerate(links) if link.momentum is not None]
        at = {i: 6 * k for k, i in enumerate(heavy)}
        rows = 7 * len(self._joints)
        known, unknown = np.zeros((n, rows, 6 * len(heavy))), np.zeros((n, rows, first[-1]))
        right = np.zeros((n, rows))
        for k, joint in enumerate(self._joints.values()):
            own = slice(7 * k, 7 * k + 6)
            for link, block in zip((joint.first.link, joint.second.link), self._rows(joint), strict=True):
                if link in at:
                    known[:, own, at[link] : at[link] + 6] += block
                elif link != GROUND:
                    unknown[:, own, first[link] : first[link] + 6] += block
            column = first[len(links) + k]
            unknown[:, own, column : column + joint.pair.dim] = joint.pair.basis
            if (rate := self._prescribed(joint)) is not None:
                unknown[:, 7 * k + 6, column], right[:, 7 * k + 6] = 1.0, rate
        given = [self._velocities(links[i]) for i in heavy]
        stacked = np.hstack([np.zeros((n, 0)), *given])
        roots = [_root(links[i].inertia) for i in heavy]
        u, rest = _nearest(known, unknown, right, stacked, roots)
        split = np.split(rest, first[1:-1], axis=1)
        twists = [u[:, at[i] : at[i] + 6] if i in at else split[i] for i in range(len(links))]
        return twists, split[len(links) :]

    def _rows(self, joint: LinkJoint) -> tuple[Array, Array]:
        """Ad_{I⁻¹}Ad_{o₁⁻¹} and −Ad_{o₂⁻¹}, (n, 6, 6): a joint's relation on the twists of its links."""
        n = len(self._solution)
        relative = included(JointCoupling(joint.pair), self._solution[joint.state.path].reshape(n, joint.pair.dim))
        before = compose(np.broadcast_to(joint.first.offset, (n, 7)), relative)
        after = np.broadcast_to(SE3.adjoint(SE3.inverse(joint.second.offset)), (n, 6, 6))
        return adjoint_inverse(before), -after

    def _prescribed(self, joint: LinkJoint) -> Array | None:
        """(n,) the rates at a joint's port that are prescribed; None where none is, or by a function."""
        problem, port = self._solution.problem, self._frames.wiring.outer.get(joint.rate)
        if problem is None or port is None or joint.pair.dim != 1:
            return None
        signal = problem.signal(port)
        if not signal.effort or not (signal.constant or isinstance(signal.value, MotionLaw)):
            return None
        return np.array([float(signal.at(float(t), {})[0]) for t in self._solution.t])

    def _velocities(self, link: Link) -> Array:
        """(n, 6) twists of the stored momenta of a link."""
        assert link.momentum is not None
        return np.asarray(np.linalg.solve(link.inertia, self._solution[link.momentum.path].T).T, dtype=float)


def _nearest(known: Array, unknown: Array, right: Array, twists: Array, roots: list[Array]) -> tuple[Array, Array]:
    """Twists nearest to the given ones in the mass metric with known·u + unknown·r = right, and such r."""
    inverse = pseudoinverse(unknown, part=CONSTRAINT) if unknown.shape[2] else np.zeros(unknown.shape).mT
    whitened = np.zeros_like(known)
    for i, root in enumerate(roots):
        where = slice(6 * i, 6 * i + 6)
        whitened[:, :, where] = known[:, :, where] @ root
    defect = np.einsum("nij,nj->ni", known, twists) - right
    rest = defect - np.einsum("nij,nj->ni", unknown @ inverse, defect)
    out = twists.copy()
    if roots:
        kept = whitened - unknown @ (inverse @ whitened)
        shift = np.einsum("nij,nj->ni", pseudoinverse(kept, part=CONSTRAINT), rest)
        for i, root in enumerate(roots):
            where = slice(6 * i, 6 * i + 6)
            out[:, where] -= shift[:, where] @ root
    return out, -np.einsum("nij,nj->ni", inverse, np.einsum("nij,nj->ni", known, out) - right)


def _root(inertia: Array) -> Array:
    """(6, 6) symmetric root of the inverse of an inertia, its moments taken without their signs."""
    moments, axes = symmetric_eigen(inertia)
    return np.asarray((axes / np.sqrt(np.abs(moments))) @ axes.T, dtype=float)
