"""Ledgers and states that solution files omit and readers compute: zero ledgers, relative poses of contact points.

The relative pose of a contact point follows from the poses of its bodies up to rounding. A file has the difference,
which is zero or a few last bits, so that readers return the same bits.
"""

from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.problem import Problem
from ephs.solve.result.dataset import Content, DatasetVariable
from ephs.solve.result.ledger import Ledgers, ledgers
from ephs.solve.result.record import RunRecord

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

REST = "relative_pose_rest"
"""Name of the variable with what is left of relative poses, (n, 6, poses)."""
ROTATION, PLACE = slice(0, 3), slice(3, 6)
AXES = ("rx", "ry", "rz", "x", "y", "z")
SAYS = "relative poses of points of contact less those that follow from the bodies, and from points before them"

Follows = Iterable[tuple[Path, Path | None, Array]]
"""Poses that follow from those of bodies: their path, a path before with the same rotation if any, and place (n, 3)."""


def shortened(solution: "Solution", found: Content) -> Content:
    """The content without what `restored` finds again, bit by bit."""
    if not found.attributes["model"] or solution.motion is None or not len(solution):
        return found
    books = {field.name for field in fields(Ledgers)}
    variables = {
        name: variable
        for name, variable in found.variables.items()
        if ":" not in name or name.partition(":")[0] not in books or not _is_zero(variable.values)
    }
    rest: dict[Path, Array] = {}
    for path, like, place in solution.motion.contact_poses():
        values, guess = solution.states[path], _guess(solution.states, like, place)
        with np.errstate(all="ignore"):  # states of failed runs may be infinite
            left = values - guess
            again = guess + left
        if again.tobytes() == values.tobytes():
            rest[path] = left
            del variables[f"state:{path}"]
    if rest:
        axes = ("relative pose component", AXES), ("relative pose", tuple(map(str, rest)))
        variables[REST] = DatasetVariable(np.stack(list(rest.values()), axis=2), "rad, rad, rad, m, m, m", SAYS, axes)
    return replace(found, variables=variables)


def restored(states: Mapping[Path, Array], rest: Mapping[Path, Array], poses: Follows) -> dict[Path, Array]:
    """The states with those that were left out.

    Raises
    ------
    KeyError
        A state that another one follows from is missing, or what is left is of no pose that follows.
    """
    out, unknown = dict(states), set(rest)
    for path, like, place in poses:
        if path in rest:
            with np.errstate(all="ignore"):
                out[path] = _guess(out, like, place) + rest[path]
            unknown.discard(path)
    if unknown:
        raise KeyError(str(min(unknown)))
    return out


def with_zeros(found: Ledgers, problem: Problem, n: int) -> Ledgers:
    """The ledgers of n instants with those of a problem's components that are not there."""
    d, zero = problem.descriptor, np.zeros(n)
    zero.flags.writeable = False
    shape = ledgers(
        problem, RunRecord(np.zeros(0), np.zeros((0, d.point_size)), np.zeros((0, len(d.components))), _NOTHING)
    )
    books = {
        field.name: {path: getattr(found, field.name).get(path, zero) for path in book}
        for field in fields(Ledgers)
        if isinstance(book := getattr(shape, field.name), Mapping)
    }
    return replace(found, **books)


_NOTHING = np.zeros((0, 5))


def _is_zero(values: Array) -> bool:
    """Whether all bits are."""
    return not (values.any() or np.signbit(values).any())


def _guess(states: Mapping[Path, Array], like: Path | None, place: Array) -> Array:
    """A pose (n, 6) with the rotation of another one, or none, at a place."""
    out = np.zeros((len(place), len(AXES)))
    if like is not None:
        out[:, ROTATION] = states[like][:, ROTATION]
    out[:, PLACE] = place
    return out
