"""Tendons of a scene file, checked and resolved; their systems, ports and states at the start."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from ephs.mechanics.elements.tendon import tendon
from ephs.mechanics.scene.actuators import Actuator
from ephs.mechanics.scene.entries import Checked, Document, shown
from ephs.mechanics.scene.errors import Fault, fault
from ephs.mechanics.scene.flexible import Tendon
from ephs.mechanics.scene.model import ENVIRONMENT, GROUND, frozen
from ephs.mechanics.scene.resolve import Names
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3, translation
from ephs.semantics.spaces.rank import ASSEMBLY
from ephs.semantics.systems.system import System


def resolve_tendons(
    document: Document, poses: Mapping[str, Array], names: Names, faults: list[Fault]
) -> dict[str, Tendon]:
    """The tendons of a file; ``poses`` (7,) of all bodies where they start."""
    found: dict[str, Tendon] = {}
    for name, table in document.sections["tendons"].items():
        count = len(faults)
        _check(name, table, names, faults)
        if len(faults) == count and not table.spoiled:
            found[name] = _resolved(name, table.entry, poses, faults)
    return found


def _check(name: str, table: Checked[Any], names: Names, faults: list[Fault]) -> None:
    entry, key = table.entry, f"tendons.{name}"
    names.check_all(Tendon, table, key, faults)
    if table.sound("slack", "damping") and entry.slack and entry.damping:
        faults.append(fault("slack damping", f"{key}.damping", entry.damping))
    if not table.sound("bodies", "points"):
        return
    if len(entry.points) != len(entry.bodies):
        faults.append(fault("tendon points", f"{key}.points", len(entry.points), count=len(entry.bodies)))
    if all(one == two for one, two in pairwise(entry.bodies)):
        faults.append(fault("tendon bodies", f"{key}.bodies", shown(entry.bodies)))


def _resolved(name: str, entry: Any, poses: Mapping[str, Array], faults: list[Fault]) -> Tendon:
    places = [_place(body, np.array(at), poses) for body, at in zip(entry.bodies, entry.points, strict=True)]
    lengths = [float(np.linalg.norm(two - one)) for one, two in pairwise(places)]
    whole = sum(lengths)
    for i, length in enumerate(lengths):
        if length <= ASSEMBLY * whole and entry.bodies[i] != entry.bodies[i + 1]:
            faults.append(
                fault("same ends", f"tendons.{name}.points[{i + 1}]", "where the point before is at the start")
            )
    return Tendon(
        name, tuple(entry.bodies), frozen(entry.points), entry.stiffness,
        whole if entry.length is None else entry.length, entry.damping, entry.slack, entry.heat,
    )  # fmt: skip


def _place(body: str, at: Array, poses: Mapping[str, Array]) -> Array:
    return at if body == GROUND else SE3.compose(poses[body], translation(at))[4:]


def pulls(
    document: Document, actuators: Mapping[str, Any], tendons: Mapping[str, Tendon], faults: list[Fault]
) -> dict[str, Actuator]:
    """For each tendon an actuator of its name whose control is the tension."""
    for name, of in actuators.items():
        if name in tendons and of.tendon != name:
            faults.append(fault("collision", f"actuators.{name}", shown(name), other=f"the tendon {name}"))
    own = [name for name in tendons if name not in document.sections["actuators"]]
    return {name: Actuator(tendon=name, ratio=[-1.0]).called(name) for name in own}


# ---- systems -----------------------------------------------------------------------------------------------------


def tendon_system(of: Tendon) -> System:
    """A tendon's system."""
    points = [(one[1], two[1]) for one, two in of.segments]
    heat = of.heat != ENVIRONMENT
    return tendon(points, of.stiffness, of.length - of.inside, of.damping, slack=of.slack, heat=heat)


def tendon_ports(of: Tendon) -> dict[str, str]:
    """Port of a tendon's system -> the body whose momentum it carries."""
    ends = [(one[0], two[0]) for one, two in of.segments]
    return {f"{side}{k}": body for k, pair in enumerate(ends, 1) for side, body in zip("ab", pair, strict=True)}


def tendon_starts(of: Tendon, poses: Mapping[str, Array]) -> dict[str, Array]:
    """States of a tendon's system by their paths in it, of bodies at poses (7,), the ground among them."""
    out: dict[str, Array] = {}
    length = 0.0
    for k, ends in enumerate(of.segments, 1):
        one, two = (SE3.compose(poses[body], translation(at)) for body, at in ends)
        out[f"segment{k}.pe.q_r"] = SE3.normalise(SE3.compose(SE3.inverse(one), two))
        length += float(np.linalg.norm(two[4:] - one[4:]))
    if of.stiffness:
        out["spring.q"] = np.array([length])
    if of.damping and of.heat == ENVIRONMENT:
        out["env.s"] = np.zeros(1)
    return out
