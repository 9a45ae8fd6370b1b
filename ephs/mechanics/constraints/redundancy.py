"""Dependent constraints and unique joint wrenches of a mechanism in one configuration.

A direction that a joint holds is redundant where its row of the constraints lies in the span of the joints before. The
wrenches that balance each other at every body, the left null space of all rows, are what is statically indeterminate.

A universal joint counts as one joint with two degrees of freedom, which says the same as its two revolutes and the
frame between them. A prescribed motion is a constraint of its own, after all joints.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TypeVar, final

import numpy as np

from ephs.mechanics.constraints.directions import (
    Direction,
    NamedAxes,
    NamedPoint,
    describe,
    enumerated,
    name_directions,
)
from ephs.mechanics.constraints.holding import ConfiguredMechanism, GearHold, Hold, redundant
from ephs.mechanics.constraints.plausible import undetermined_bodies
from ephs.mechanics.scene.adjust import close_loops
from ephs.mechanics.scene.kinematics import Scale
from ephs.mechanics.scene.model import Scene
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import least_squares, svd
from ephs.semantics.spaces.rank import CONSTRAINT, NEIGHBOUR, SPANNED, rank_of

AWAY, TRIALS, NEAR = 0.02, 3, 0.2
"""Distance and number of neighbouring configurations compared, and the turn of a direction allowed up to there."""
T = TypeVar("T", "Hold", "Hold | GearHold")
SHOWN = 3
"""Limit on the clauses of a text; further ones are counted."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Dependence:
    """A joint with redundant constraints.

    Attributes
    ----------
    joint
        The (dotted) joint, or "the motion of" one, where a prescribed motion follows from others.
    directions
        A basis of the constraint directions that say nothing new after the joints before; none of a gear.
    on
        Joints before that hold these directions already; none of them can be left out.
    here
        How many of the directions are redundant in this configuration, but not in those near by.
    passing
        Which of the directions these are; empty where the basis does not tell.
    """

    joint: str
    directions: tuple[Direction, ...]
    on: tuple[str, ...]
    here: int = 0
    passing: tuple[Direction, ...] = ()

    def __str__(self) -> str:
        return f"{self.joint} repeats {self.what}"

    @property
    def count(self) -> int:
        """Number of equations that depend on others."""
        return len(self.directions) or 1

    @property
    def what(self) -> str:
        """Redundant joints and their directions, in words."""
        if not self.directions:
            return enumerated(self.on)
        lasting = [d for d in self.directions if d not in self.passing]
        if self.here == len(self.directions):
            return f"{enumerated(self.on)} in this configuration: {describe(self.directions)}"
        text = f"{enumerated(self.on)}: {describe(lasting)}"
        if self.passing:
            return f"{text}, in this configuration {describe(self.passing)} too"
        return text + (f", {self.here} of these only in this configuration" if self.here else "")


def dependences(of: ConfiguredMechanism) -> tuple[Dependence, ...]:
    """Redundancies in a configuration, joint by joint in their order, then gear by gear.

    The numbers of directions add up to the number of constraint equations that depend on others.
    """
    holds, gears = of.holds(of.poses), of.gears(of.poses)
    every = [*holds, *gears]
    found = redundant(every)
    near = _nearby(of, holds, found[: len(holds)])
    out: list[Dependence] = []
    for i, (hold, space) in enumerate(zip(holds, found, strict=False)):
        if not space.shape[1]:
            continue
        on = _needed(holds[:i], hold.rows.T @ space, _loop_lengths(holds[:i], hold))
        directions = _named(of, hold, hold.wrenches @ space, on)
        passing = tuple(d for d in directions if near and _apart(of, d, near[i]) > NEAR)
        here = max(space.shape[1] - near[i].shape[1], 0) if near else 0
        names = tuple(each.name for each in on)
        out.append(Dependence(hold.name, directions, names, here, passing if len(passing) == here else ()))
    for i, gear in enumerate(gears, start=len(holds)):
        if found[i].shape[1]:
            on = _needed(every[:i], gear.rows.T, _loop_lengths(every[:i], gear))
            out.append(Dependence(gear.name, (), tuple(each.name for each in on)))
    return tuple(out)


def explain(scene: Scene) -> str:
    """The scene's dependences and undetermined bodies, as advice for a run that failed; "" where there are none."""
    return "; ".join(filter(None, [in_words(dependences(ConfiguredMechanism.of(scene))), *undetermined_bodies(scene)]))


def in_words(found: Sequence[Dependence]) -> str:
    """Dependences in a sentence, grouped by equal causes; "" where there are none."""
    if not found:
        return ""
    count = sum(each.count for each in found)
    several = f"{count} constraint equations depend" if count > 1 else "1 constraint equation depends"
    named = {each.directions[0].axes.name for each in found if each.directions}
    axes = "" if "" not in named else " (in world axes)" if named == {""} else " (in world axes unless named)"
    clauses: list[str] = []
    for what, members in groupby(found, key=lambda each: each.what):
        names = [each.joint for each in members]
        clauses.append(f"{_few(names)} {'repeats' if len(names) == 1 else 'each repeat'} {what}")
    return f"{several} on others{axes}: {_listed(clauses)}"


def indeterminate(of: ConfiguredMechanism) -> dict[str, Array]:
    """By joint, (6,) whether each component of its wrench (moment, force in the joint frame C2) is indeterminate.

    These are the components that `JointMotion.wrench` gives as NaN.
    """
    out = {name: np.zeros(6, dtype=bool) for name in of.joints}
    holds = of.holds(of.poses)
    if not holds:
        return out
    u, sigma, _ = svd(np.vstack([hold.rows for hold in holds]))
    free = u[:, rank_of(sigma, CONSTRAINT) :]
    loads: dict[str, Array] = {}
    start = 0
    for hold in holds:
        load = hold.wrenches @ free[start : start + len(hold.rows)]
        start += len(hold.rows)
        # a joint transmits constraint wrenches and driving wrenches
        loads[hold.joint] = loads.get(hold.joint, 0.0) + load
    for hold in holds:
        moment, force = loads[hold.joint][:3], loads[hold.joint][3:]
        moment = moment - np.cross(hold.point, force.T).T
        local = np.vstack([hold.rotation.T @ moment, hold.rotation.T @ force])
        out[hold.joint] = np.abs(local).max(axis=1, initial=0.0) > SPANNED
    return out


def wrenches_in_words(found: Mapping[str, Array]) -> str:
    """Joints with unique wrenches, and the indeterminate components of the others, as `indeterminate` found."""
    groups: dict[tuple[bool, ...], list[str]] = {}
    for name, free in found.items():
        if free.any():
            groups.setdefault(tuple(map(bool, free)), []).append(name)
    if not groups:
        return "unique in every joint" if found else "no joints"
    clauses = [f"{_few(names)}: {_components(free)} indeterminate" for free, names in groups.items()]
    rest = len(found) - sum(map(len, groups.values()))
    others = f"; unique in the other {'joint' if rest == 1 else f'{rest} joints'}" if rest else ""
    return f"{_listed(clauses)} (joint axes){others}"


def _needed(before: "Sequence[T]", target: Array, lengths: Sequence[float]) -> "list[T]":
    """Earlier holds whose span contains the columns of the target, reduced greedily, in their order.

    The shortest loops are tried first, as more holds than a loop are seldom needed.
    """
    target = target / np.linalg.norm(target, axis=0)
    sort = sorted(range(len(before)), key=lambda i: (lengths[i], i))
    low, high = 1, len(sort)
    while low < high:
        middle = (low + high) // 2
        enough = _shares([before[i] for i in sort[:middle]], target) is not None
        low, high = (low, middle) if enough else (middle + 1, high)
    kept = sort[:low]
    if shares := _shares([before[i] for i in kept], target):
        kept = [i for i, share in zip(kept, shares, strict=True) if share > SPANNED]
    for i in kept[::-1]:
        fewer = [k for k in kept if k != i]
        if fewer and _shares([before[k] for k in fewer], target):
            kept = fewer
    return [before[i] for i in sorted(kept)]


def _shares(holds: Sequence[Hold | GearHold], target: Array) -> list[float] | None:
    """Coefficients of the target in the holds; None where it is not in their span."""
    matrix = np.vstack([hold.rows for hold in holds]).T
    weights = np.asarray(least_squares(matrix, target, part=CONSTRAINT))
    if np.abs(matrix @ weights - target).max(initial=0.0) > SPANNED:
        return None
    cuts = np.cumsum([len(hold.rows) for hold in holds])[:-1]
    return [float(np.abs(part).max(initial=0.0)) for part in np.split(weights, cuts)]


def _loop_lengths(before: Sequence[Hold | GearHold], hold: Hold | GearHold) -> list[float]:
    """Of each hold before, the length of the shortest way through it from one body of a hold to the other."""
    from_1, from_2 = (_distances(before, start) for start in (hold.body1, hold.body2))
    far = np.inf

    def loop_length(h: Hold | GearHold) -> float:
        return min(
            from_1.get(h.body1, far) + from_2.get(h.body2, far), from_1.get(h.body2, far) + from_2.get(h.body1, far)
        )

    return [loop_length(h) for h in before]


def _distances(holds: Sequence[Hold | GearHold], start: int) -> dict[int, float]:
    """Number of joints between a body and each body reachable from it."""
    beside: dict[int, list[int]] = {}
    for hold in holds:
        beside.setdefault(hold.body1, []).append(hold.body2)
        beside.setdefault(hold.body2, []).append(hold.body1)
    out: dict[int, float] = {}
    front, steps = {start}, 0.0
    while front:
        out |= dict.fromkeys(front, steps)
        front = {there for here in front for there in beside.get(here, ()) if there not in out}
        steps += 1.0
    return out


def _nearby(of: ConfiguredMechanism, holds: Sequence[Hold], found: Sequence[Array]) -> list[Array] | None:
    """Of each hold, the redundant wrenches (6, r) in a configuration near by that has fewer in all; None without one.

    Of several neighbours, one with the fewest is generic. None is found where the mechanism cannot move, or where its
    loops do not close near by.
    """
    least = sum(space.shape[1] for space in found)
    if not least:
        return None
    out = None
    _, sigma, vt = svd(np.vstack([hold.rows for hold in of.holds(of.poses, motions=False)]))
    ways = vt[rank_of(sigma, CONSTRAINT) :]
    links = [replace(link, coordinates=None) for link in of.links]
    rng = np.random.default_rng(0)
    for _ in range(TRIALS if len(ways) else 0):
        step = (rng.standard_normal(len(ways)) @ ways).reshape(-1, 6)
        there = of.moved(step * (AWAY / np.abs(step).max()))
        closed = close_loops(links, there, of.roots, frozenset(), Scale(of.length, 1.0))
        if closed is None:
            continue
        there = of.holds(closed)
        spaces = redundant(there, NEIGHBOUR)
        if sum(space.shape[1] for space in spaces) < least:
            least = sum(space.shape[1] for space in spaces)
            out = [hold.wrenches @ space for hold, space in zip(there, spaces, strict=True)]
    return out


def _apart(of: ConfiguredMechanism, direction: Direction, space: Array) -> float:
    """The sine of the angle between a direction and a space of wrenches about the centre."""
    w = direction.wrench
    w = np.concatenate([(w[:3] - np.cross(of.centre, w[3:])) / of.length, w[3:]])
    w /= np.linalg.norm(w)
    basis = np.linalg.qr(space)[0]
    return float(np.linalg.norm(w - basis @ (basis.T @ w)))


def _named(of: ConfiguredMechanism, hold: Hold, wrenches: Array, on: Sequence[Hold]) -> tuple[Direction, ...]:
    places = [NamedPoint(of.centre + of.length * h.point, "" if h is hold else h.joint) for h in (hold, *on)]
    there = np.vstack([of.length * (wrenches[:3] - np.cross(hold.point, wrenches[3:].T).T), wrenches[3:]])
    return name_directions(there, (NamedAxes(np.eye(3)), NamedAxes(hold.rotation, "joint axes")), places, of.length)


def _components(free: Sequence[bool]) -> str:
    return ", ".join(
        f"{kind} {enumerated(axis for axis, is_free in zip('xyz', which, strict=True) if is_free)}"
        for kind, which in (("force along", free[3:]), ("moment about", free[:3]))
        if any(which)
    )


def _few(names: Sequence[str]) -> str:
    return enumerated([*names[:5], f"{len(names) - 5} more"] if len(names) > 6 else names)


def _listed(clauses: Iterable[str]) -> str:
    said = list(clauses)
    rest = len(said) - SHOWN
    return "; ".join(said if rest <= 1 else [*said[:SHOWN], f"and {rest} more"])
