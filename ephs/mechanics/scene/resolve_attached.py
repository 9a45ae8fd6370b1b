"""Tables of motors, gears, cylinders, gas springs and actuators, checked and resolved."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ephs.mechanics.scene.attached import ATTACHED, Actuator, Attachment, Gear
from ephs.mechanics.scene.entries import Checked, Document, shown
from ephs.mechanics.scene.errors import Fault, fault, listing, unknown
from ephs.mechanics.scene.model import Joint, Scene, frozen
from ephs.mechanics.scene.resolve import Names, attributes

ROUNDED = 1e-12
"""Difference of initial rates that gears may leave, relative to what is added: theirs are written in decimals."""


def resolve_attached(
    document: Document, scene: Scene, names: Names, faults: list[Fault]
) -> dict[str, dict[str, Attachment]]:
    """The attachments by section, their joints and numbers checked; ``scene`` has the joints."""
    joints = dict(scene.all_joints())
    return {
        section: {
            name: found
            for name, table in document.sections[section].items()
            if (found := _resolved(section, name, table, scene, joints, names, faults)) is not None
        }
        for section in ATTACHED
    }


def _resolved(
    section: str, name: str, table: Checked[Any], scene: Scene, joints: Mapping[str, Joint], names: Names,
    faults: list[Fault],
) -> Attachment | None:  # fmt: skip
    kind: Any = ATTACHED[section]
    entry, key = table.entry, f"{section}.{name}"
    names.check_all(kind, table, key, faults)
    several = kind in (Gear, Actuator)
    if kind is Actuator and table.sound("joints", "tendon"):
        _check_target(key, entry, scene, faults)
    if not table.sound("joints", "joint"):
        return None
    tied = entry.joints if several else [entry.joint]
    of = _joints(kind, key, tied, joints, several=several, faults=faults)
    if table.spoiled:
        return None
    given = attributes(kind, entry, len(tied) or 1)
    if several:
        count = len(tied) - 1 if kind is Gear else len(tied) or 1
        if kind is Actuator and given["ratio"].size == 1:
            given["ratio"] = frozen(np.full(count, given["ratio"][0]))
        if given["ratio"].size != count:
            faults.append(fault("gear ratio", f"{key}.ratio", shown(entry.ratio), count=count))
        elif kind is Gear and not entry.stiffness:
            _check_rates(key, given["ratio"].tolist(), of, faults)
    return kind(name=name, **given)


def _check_target(key: str, entry: Any, scene: Scene, faults: list[Fault]) -> None:
    """Faults of what an actuator acts on, joints aside."""
    known = dict(scene.all_tendons())
    if bool(entry.joints) == (entry.tendon is not None):
        faults.append(fault("actuator target", key, "both" if entry.joints else "neither"))
    elif entry.tendon is not None and entry.tendon not in known:
        faults.append(unknown("tendon", f"{key}.tendon", entry.tendon, known))


def _joints(
    kind: type[Attachment], key: str, tied: list[str], joints: Mapping[str, Joint], *, several: bool,
    faults: list[Fault],
) -> list[Joint]:  # fmt: skip
    """The joints that a table names; faults of those that do not fit."""
    if len(set(tied)) < len(tied):
        faults.append(fault("gear joints", f"{key}.joints", shown(tied)))
    found: list[Joint] = []
    for i, each in enumerate(tied):
        here, known = f"{key}.joints[{i}]" if several else f"{key}.joint", joints.get(each)
        if known is None:
            faults.append(unknown("joint", here, each, joints))
        elif known.dim != 1 or (kind is not Gear and known.motion is not None):
            faults.append(
                fault("gear freedoms" if kind is Gear else "motor joint", here, f"{known.name}, {known.kind}")
            )
        else:
            found.append(known)
    return found


def _check_rates(key: str, ratio: list[float], of: list[Joint], faults: list[Fault]) -> None:
    """A fault where initial rates contradict a rigid gear."""
    if len(of) != len(ratio) + 1:
        return
    first, *others = (float(each.rate[0]) for each in of)
    rest = [by * rate for by, rate in zip(ratio, others, strict=True)]
    if abs(first - sum(rest)) > ROUNDED * sum(map(abs, (first, *rest))):
        found = listing(str(float(each.rate[0])) for each in of)
        faults.append(fault("gear rates", key, found, first=of[0].name, rate=sum(rest)))
