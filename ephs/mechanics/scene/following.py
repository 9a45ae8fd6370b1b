"""States that follow from coordinates and rates of joints: joints tied by gears, stretches of belts and tendons.

A gear ties rates; what it says of coordinates is that they keep their distance from it. So a scene in another state has
the offsets of its gears as before, and belts are stretched by what their joints moved.
"""

from collections.abc import Mapping

import numpy as np

from ephs.mechanics.scene.gears import Gear
from ephs.mechanics.scene.model import Scene
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import pseudoinverse


def tied(scene: Scene, now: Mapping[str, Array], given: Mapping[str, Array]) -> dict[str, Array]:
    """The given numbers of joints, coordinates or rates, (d,) each, and those of joints that rigid gears tie to them.

    ``now`` has those of all joints. Where gears leave a choice, it is the least change.
    """
    rows = [
        dict(zip(gear.joints, [1.0, *(-x for x in gear.ratio)], strict=True))
        for _, gear in scene.every("gears")
        if not gear.stiffness
    ]
    out, known = dict(given), set(given)
    while moved := [row for row in rows if not known.isdisjoint(row) and not known.issuperset(row)]:
        free = sorted({name for row in moved for name in row} - known)
        matrix = np.array([[row.get(name, 0.0) for name in free] for row in moved])
        change = [sum(x * float((out[j] - now[j])[0]) for j, x in row.items() if j in known) for row in moved]
        for name, step in zip(free, -pseudoinverse(matrix) @ change, strict=True):
            out[name] = now[name] + step
        known |= set(free)
    return out


def has_stretches(scene: Scene) -> bool:
    """Whether belts or tendons store how far they are stretched."""
    belts = any(gear.stiffness for _, gear in scene.every("gears"))
    return belts or any(tendon.stiffness for _, tendon in scene.all_tendons())


def stretched(gear: Gear, path: str, before: Mapping[str, Array], after: Mapping[str, Array]) -> Gear:
    """A belt whose joints, of names after ``path``, moved between coordinates (d,)."""
    if not gear.stiffness:
        return gear
    moved = [float((after[path + name] - before[path + name])[0]) for name in gear.joints]
    return gear.changed(stretch=gear.stretch + moved[0] - float(np.dot(gear.ratio, moved[1:])))
