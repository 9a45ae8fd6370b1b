"""Likely mistakes in a valid scene, and massless bodies of undetermined motion.

Likely mistakes are locked mechanisms, gears that hold joints still, missing meshes, and lengths or masses as far from
all others as millimetres from metres, or grams from kilograms.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from ephs.mechanics.constraints.directions import enumerated
from ephs.mechanics.constraints.holding import ConfiguredMechanism
from ephs.mechanics.scene.model import Scene
from ephs.semantics.spaces.decompositions import svd
from ephs.semantics.spaces.rank import CONSTRAINT, SPANNED, rank_of

LONG, HEAVY, MASSLESS = 100.0, 1e3, 1e6
"""Length and mass of a body, relative to the largest of all others, above which a unit may be wrong; and where the
others are meant to be massless."""
LARGEST = 60
"""Number of bodies above which motions are not examined: the cost is cubic."""


def doubts(scene: Scene) -> tuple[str, ...]:
    """Likely mistakes of a scene, a sentence each."""
    return (*_files(scene), *_units(scene), *_motionless(scene))


def _files(scene: Scene) -> Iterator[str]:
    """Missing meshes."""
    for name, body in scene.all_bodies():
        for shape in filter(None, (body.shape, *body.shapes)):
            if "mesh" in shape and not Path(str(shape["mesh"])).is_file():
                yield f"bodies.{name}: there is no file {Path(str(shape['mesh'])).name}; a stand-in is drawn"


def _units(scene: Scene) -> Iterator[str]:
    """Lengths and masses far beyond all others."""
    arms = {name: 0.0 for name, _ in scene.all_bodies()}
    for _, joint in scene.all_joints():
        for body, frame in ((joint.body1, joint.frame1), (joint.body2, joint.frame2)):
            if body in arms:
                arms[body] = max(arms[body], float(np.linalg.norm(frame[4:])))
    for name, length, rest in _beyond(arms, LONG, np.inf):
        yield (
            f"bodies.{name}: a joint lies {length:.3g} m from its centre of mass, of all other bodies at most "
            f"{rest:.3g} m; lengths are in m"
        )
    for name, mass, rest in _beyond({name: body.mass for name, body in scene.all_bodies()}, HEAVY, MASSLESS):
        yield f"bodies.{name}: {mass:.3g} kg, all other bodies at most {rest:.3g} kg; masses are in kg"


def _beyond(sizes: Mapping[str, float], least: float, most: float) -> Iterator[tuple[str, float, float]]:
    """Name and size of the largest, and the next size, where their ratio lies between the bounds."""
    order = sorted(sizes, key=lambda name: sizes[name])
    if len(order) > 1:
        size, rest = (sizes[name] for name in order[-1:-3:-1])
        if least * rest < size < most * rest:
            yield order[-1], size, rest


def _motionless(scene: Scene) -> Iterator[str]:
    """Gears that hold joints still, and a mechanism that cannot move."""
    of = ConfiguredMechanism.of(scene)
    links, gears = of.links, of.gears(of.poses)
    if len(of.poses) > LARGEST or not (gears or len(links) > len(of.poses)):
        return  # trees without gears can move
    holds = of.holds(of.poses, motions=False)
    size = 6 * len(of.poses)
    before, after = (
        _null(np.vstack([np.zeros((0, size)), *(hold.rows for hold in rows)])) for rows in (holds, (*holds, *gears))
    )
    rates = {name: rate for gear in gears for name, rate in gear.rates.items()}
    still = [name for name, rate in rates.items() if _moves(rate, before) and not _moves(rate, after)]
    if still:
        names = [gear.name for gear in gears if set(gear.rates) & set(still)]
        verb = "contradict each other: together they hold" if len(names) > 1 else "holds"
        yield f"{enumerated(names)} {verb} {enumerated(still)} still"
    free = [link.name for link in links if link.coupling.basis(link.coupling.identity()).shape[1]]
    if free and not after.shape[1] and all(link.motion is None for link in links):
        yield f"the mechanism is locked: {enumerated(free[:5])} cannot move, although nothing prescribes a motion"


def undetermined_bodies(scene: Scene) -> Iterator[str]:
    """Massless bodies that can move while all others rest, so that their motion is undetermined; a sentence each."""
    of, bodies = ConfiguredMechanism.of(scene), list(scene.all_bodies())
    if all(body.mass > 0.0 for _, body in bodies):
        return
    size = 6 * len(bodies)
    resting = np.repeat([body.mass > 0.0 for _, body in bodies], 6)
    holds = [hold.rows for hold in (*of.holds(of.poses), *of.gears(of.poses))]
    ways = _null(np.vstack([np.eye(size)[resting], *holds]))
    for i, (name, _) in enumerate(bodies):
        if np.abs(ways[6 * i : 6 * i + 6]).max(initial=0.0) > SPANNED:
            joints = [(each, joint.kind) for each, joint in scene.all_joints() if name in (joint.body1, joint.body2)]
            if [kind for _, kind in joints] == ["spherical", "spherical"]:
                ends = enumerated(each for each, _ in joints)
                yield (
                    f"{name} has no mass and can spin about its own axis, through {ends}; a ball and a universal "
                    f"joint hold it"
                )
            else:
                yield f"{name} has no mass and can move while all bodies with mass rest; hold it, or give it mass"


def _null(rows: np.ndarray) -> np.ndarray:
    """Basis of the twists that constraints allow."""
    if not rows.size:
        return np.eye(rows.shape[1])
    _, sigma, vt = svd(rows)
    return vt[rank_of(sigma, CONSTRAINT) :].T


def _moves(rate: np.ndarray, ways: np.ndarray) -> bool:
    return float(np.abs(rate @ ways).max(initial=0.0)) > SPANNED
