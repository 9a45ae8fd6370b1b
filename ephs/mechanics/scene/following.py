"""States that follow from coordinates and rates of joints: joints tied by gears, stretches of belts and tendons.

A gear ties rates; what it says of coordinates is that they keep their distance from it. So a scene in another state has
the offsets of its gears as before, and belts are stretched by what their joints moved.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ephs.mechanics.scene.attached import Attachment, Cylinder, GasSpring, Gear, Motor
from ephs.mechanics.scene.model import Scene, frozen
from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.semantics.spaces.decompositions import pseudoinverse


def tied(scene: Scene, now: Mapping[str, Array], given: Mapping[str, Array]) -> dict[str, Array]:
    """The given numbers of joints, coordinates or rates, (d,) each, and those of joints that rigid gears tie to them.

    ``now`` has those of all joints. Where gears leave a choice, it is the least change.
    """
    rows = [
        dict(zip(gear.joints, [1.0, *(-x for x in gear.ratio.tolist())], strict=True))
        for _, _, gear in scene.all_attachments()
        if isinstance(gear, Gear) and not gear.stiffness
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
    belts = any(isinstance(each, Gear) and each.stiffness for _, _, each in scene.all_attachments())
    return belts or any(tendon.stiffness for _, tendon in scene.all_tendons())


def stretched(gear: Gear, path: str, before: Mapping[str, Array], after: Mapping[str, Array]) -> Gear:
    """A belt whose joints, of names after ``path``, moved between coordinates (d,)."""
    if not gear.stiffness:
        return gear
    moved = [float((after[path + name] - before[path + name])[0]) for name in gear.joints]
    return replace(gear, stretch=gear.stretch + moved[0] - float(gear.ratio @ moved[1:]))


def attachment_at(of: Attachment, at: Path, states: Mapping[Path, Array]) -> Attachment:
    """An attachment in the states of the system of its scene, in which it has the box ``at``."""

    def of_state(path: str) -> float:
        return float(np.ravel(states[Path([*at, *path.split(".")])])[0])

    changed: dict[str, Any] = {}
    match of:
        case Gear():
            if of.stiffness:
                changed["stretch"] = of_state("spring.q")
        case Motor():
            if of.inductance:
                changed["current"] = of_state("coil.b") / of.inductance
        case Cylinder():
            travel = of_state("oil.q")
            held = np.array([of_state("oil.v_a"), of_state("oil.v_b")]) - of.area * [travel, -travel]
            changed |= {"travel": travel, "initial_pressure": frozen(of.bulk * (held - of.volume) / of.volume)}
        case GasSpring():
            volume, heats = of_state("gas.v"), 1.0 / (of.gamma - 1.0)
            capacity = heats * of.pressure * of.volume / of.temperature
            hot = of.temperature * (of.volume / volume) ** (of.gamma - 1.0) * np.exp(of_state("gas.s") / capacity)
            changed = {"volume": volume, "temperature": float(hot), "pressure": float(capacity * hot / heats / volume)}
        case _:
            pass
    made: Any = of
    return replace(made, **changed) if changed else of
