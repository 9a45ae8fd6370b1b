"""Correction of mechanisms that are movable up to the rounding of a file's numbers.

The axes of a planar four-bar that are parallel to nine digits lock it, if taken at their word: its constraints are of
full rank by 1e-9. Decided by theory: singular values that are small but not rounding belong to motions along which the
joints hardly open. Where they stay closed to the tolerance of assembly along a finite motion, the mechanism is movable,
and the joints' frames are moved, by less than that, to where it is so exactly; that is said. Where they open by more,
but far less than the motion, methods would disagree: those that decide rank generously would move it, others lock it.
It is refused. Where they open with the motion, it is a mechanism near a singular configuration, and as it is.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from ephs.mechanics.scene.adjust import across_rows, constraints, project_velocities
from ephs.mechanics.scene.errors import Fault, fault
from ephs.mechanics.scene.kinematics import AssemblyJoint, Scale, elements, largest_gap
from ephs.mechanics.scene.model import Scene, frozen, mapped
from ephs.mechanics.scene.state import Snapshot, rebuilt
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.decompositions import least_squares, singular_values, svd
from ephs.semantics.spaces.rank import ASSEMBLY, EXPLICIT, REGULAR, rank_of
from ephs.solve.running.threads import in_one_thread

STRIDE, STRIDES = 0.2, 5
"""Steps of the finite motion that is tried, in rad or parts of the mechanism's length, and their number each way."""
LARGEST = 60
"""Number of bodies above which this is not examined: the cost is cubic."""
ROUNDS = 4
SHAKEN, LEFT = 40, 0.05
"""Iterations that close joints after a step, and the part of it that is left where it was along a finite motion."""
ROUNDING = 10.0 * REGULAR
"""Singular values of a mechanism that moves exactly, beside the largest: of some tens of rows, 8 n ε."""


@in_one_thread
def as_meant(scene: Scene) -> tuple[Scene, str, list[Fault]]:
    """The scene with the frames of its joints where they let it move, what was done in words, and what is refused."""
    now = Snapshot.of(scene)
    if len(now.bodies) > LARGEST or len(now.links) <= len(now.bodies):  # no loop
        return scene, "", []
    scale, links = now.scale(scene.world.gravity), now.links
    _, sigma, vt = svd(_matrix(links, now.poses, scale))
    low, high = rank_of(sigma, EXPLICIT), rank_of(sigma, ROUNDING)
    if low == high:
        return scene, "", []
    ways = [sign * way for way in vt[low:high] for sign in (1.0, -1.0)]
    there = [poses for way in ways for poses in _followed(links, now.poses, way, low, scale)]
    if not there:
        return scene, "", []
    opened = max(largest_gap(links, poses, elements(links, poses), scale) for poses in there)
    moved = _movable(links, [now.poses, *there], scale) if opened <= ASSEMBLY else None
    if moved is None:
        worst = _stiffest(links, now.poses, vt[low:high], scale)
        text = f"a mechanism that moves if its joints open by {opened:.1g} of its length, {scale.length:.3g} m"
        return scene, "", [fault("nearly movable", f"joints.{worst}", text, limit=f"{ASSEMBLY:.0g}")]
    exact, poses = moved
    xs = elements(exact, poses)
    twists = project_velocities(exact, poses, now.twists, now.roots(), frozenset(), scale)
    shifts = [SE3.log(SE3.compose(SE3.inverse(a.frame2), b.frame2)) for a, b in zip(links, exact, strict=True)]
    by = float(np.abs(shifts).max())
    frames = {link.name: link.frame2 for link in exact}
    framed = mapped(scene, {"joints": lambda path, j: replace(j, frame2=frozen(frames[path + j.name]))})
    out = rebuilt(framed, now, poses, now.twists if twists is None else twists, xs)
    return out, f"joint frames are moved by up to {by:.1g} m or rad, so that the mechanism moves as it is meant to", []


@in_one_thread
def is_shaky(scene: Scene) -> bool:
    """Whether a mechanism's velocities are of first order only: along none of them it comes to another configuration.

    So it is of two bars in line between two fixed pins: its middle has a velocity, and no place to go.
    """
    now = Snapshot.of(scene)
    if len(now.bodies) > LARGEST or len(now.links) <= len(now.bodies):  # no loop
        return False
    scale, links = now.scale(scene.world.gravity), now.links
    _, sigma, vt = svd(_matrix(links, now.poses, scale))
    free = vt[rank_of(sigma, EXPLICIT) :]
    sums = [one + two for one, two in combinations(free, 2)]
    return len(free) > 0 and not any(
        _comes_away(links, now.poses, sign * way, scale) for way in (*free, *sums) for sign in (1.0, -1.0)
    )


def _comes_away(links: Sequence[AssemblyJoint], poses: Array, way: Array, scale: Scale) -> bool:
    """Whether joints close again near by, after a step along a velocity, elsewhere than before it.

    Back to where bars were in line the gap falls by a half from one iteration to the next.
    """
    unit = np.array([1.0] * 3 + [scale.length] * 3)
    there = _stepped(poses, STRIDE / np.abs(way).max() * way, scale)
    for _ in range(SHAKEN):
        there = _stepped(there, -_solved(links, there, scale), scale)
    moves = [SE3.log(SE3.compose(SE3.inverse(a), b)) / unit for a, b in zip(poses, there, strict=True)]
    return bool(np.abs(moves).max() > LEFT * STRIDE)


def _matrix(links: Sequence[AssemblyJoint], poses: Array, scale: Scale) -> Array:
    """Constraint rows of the joints on all bodies' twists, lengths relative to the mechanism's."""
    return _equations(links, poses, scale)[0]


def _equations(links: Sequence[AssemblyJoint], poses: Array, scale: Scale) -> tuple[Array, Array]:
    """The same, and by how much the joints are open."""
    return constraints(links, poses, elements(links, poses), _roots(poses, scale), frozenset(), scale)


def _roots(poses: Array, scale: Scale) -> Array:
    return np.tile(np.diag([1.0] * 3 + [scale.length] * 3), (len(poses), 1, 1))


def _rows(links: Sequence[AssemblyJoint], poses: Array, scale: Scale) -> Iterator[tuple[Array, Array]]:
    """By joint the covectors (6, k) on its relative twist, and their rows on the bodies."""
    for link, x in zip(links, elements(links, poses), strict=True):
        yield across_rows(link, x, _roots(poses, scale), scale)


def _followed(links: Sequence[AssemblyJoint], poses: Array, way: Array, rank: int, scale: Scale) -> list[Array]:
    """Configurations along a motion of which the joints allow nearly all, as close as they can be had.

    It ends where the mechanism goes back as its joints close, where they stay open, or where more than ``rank``
    equations count: there it was near a singular configuration.
    """
    out: list[Array] = []
    unit = np.array([1.0] * 3 + [scale.length] * 3)
    for _ in range(STRIDES):
        start = poses
        poses = _stepped(poses, STRIDE / np.abs(way).max() * way, scale)
        for _ in range(ROUNDS + 2):
            poses = _stepped(poses, -_solved(links, poses, scale), scale)
        _, sigma, vt = svd(_matrix(links, poses, scale))
        moves = [SE3.log(SE3.compose(SE3.inverse(a), b)) / unit for a, b in zip(start, poses, strict=True)]
        opened = largest_gap(links, poses, elements(links, poses), scale) > EXPLICIT * STRIDE
        if opened or rank_of(sigma, EXPLICIT) > rank or not np.abs(moves).max() > 0.5 * STRIDE:
            break
        out.append(poses)
        rest = vt[rank:]
        way = rest.T @ (rest @ way)
        if not np.abs(way).max() > 0.1 * np.abs(vt[rank]).max():
            break
    return out


def _solved(links: Sequence[AssemblyJoint], poses: Array, scale: Scale) -> Array:
    """The change that closes joints best, along all that they clearly forbid."""
    return np.asarray(least_squares(*_equations(links, poses, scale), part=EXPLICIT), dtype=np.float64)


def _stepped(poses: Array, change: Array, scale: Scale) -> Array:
    steps = change.reshape(-1, 6) * np.array([1.0] * 3 + [scale.length] * 3)
    return np.array([SE3.normalise(SE3.retract(q, v)) for q, v in zip(poses, steps, strict=True)])


def _movable(
    links: Sequence[AssemblyJoint], configurations: list[Array], scale: Scale
) -> tuple[tuple[AssemblyJoint, ...], Array] | None:
    """Links whose second frames let all these configurations close, and the first of these, closed; None without."""
    n, m = configurations[0].shape[0], len(links)
    unit = np.array([1.0] * 3 + [scale.length] * 3)
    for _ in range(ROUNDS):
        blocks: list[Array] = []
        errors: list[Array] = []
        for k, poses in enumerate(configurations):
            for j, (covectors, rows) in enumerate(_rows(links, poses, scale)):
                block = np.zeros((rows.shape[0], 6 * m + 6 * n * len(configurations)))
                block[:, 6 * j : 6 * j + 6] = covectors.T * unit
                block[:, 6 * m + 6 * n * k : 6 * m + 6 * n * (k + 1)] = rows
                blocks.append(block)
            errors.append(_equations(links, poses, scale)[1])
        found = least_squares(np.vstack(blocks), np.concatenate(errors), part=EXPLICIT)
        change: Array = -np.asarray(found, dtype=np.float64)
        links = tuple(
            replace(link, frame2=SE3.normalise(SE3.retract(link.frame2, unit * step)))
            for link, step in zip(links, change[: 6 * m].reshape(m, 6), strict=True)
        )
        shifts = change[6 * m :].reshape(len(configurations), -1)
        configurations = [_stepped(poses, shift, scale) for poses, shift in zip(configurations, shifts, strict=True)]
    gaps = [largest_gap(links, poses, elements(links, poses), scale) for poses in configurations]
    sigma = singular_values(_matrix(links, configurations[0], scale))
    if max(gaps) > 10.0 * ROUNDING or rank_of(sigma, EXPLICIT) != rank_of(sigma, ROUNDING):
        return None
    return tuple(links), configurations[0]


def _stiffest(links: Sequence[AssemblyJoint], poses: Array, ways: Array, scale: Scale) -> str:
    """The joint with the largest residual along these motions."""
    opened = [float(np.abs(rows @ ways.T).max(initial=0.0)) for _, rows in _rows(links, poses, scale)]
    return links[int(np.argmax(opened))].name
