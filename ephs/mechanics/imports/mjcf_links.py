"""Equality constraints of a compiled MJCF: lower pairs close loops, others lock joints or couple two."""

from collections.abc import Collection
from dataclasses import dataclass
from importlib import import_module
from typing import Any, final

import numpy as np

from ephs.mechanics.imports.draft import Draft, pose
from ephs.mechanics.imports.mjcf_keys import TORQUE_SCALE, disabled
from ephs.mechanics.imports.mjcf_names import MjcfNames

ROUNDED_COSINE = 1e-12
"""Tolerance of the cosine between equal axes: unit vectors round by less."""


@final
@dataclass(frozen=True, slots=True)
class Thread:
    """A hinge and a slide of one body along one axis, whose coordinates are in a fixed ratio: a screw.

    ``pitch`` in m/rad about the hinge's axis; the numbers of the two joints and of the equality.
    """

    hinge: int
    slide: int
    pitch: float
    equality: int


def screws(model: Any, names: MjcfNames) -> dict[int, Thread]:
    """The screws of a model, by the number of the first of their two joints."""
    mujoco: Any = import_module("mujoco")
    found: dict[int, Thread] = {}
    for e in range(model.neq):
        first, second = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
        if int(model.eq_type[e]) != mujoco.mjtEq.mjEQ_JOINT or second < 0 or not _active(model, e):
            continue
        ends = {names.kinds[j]: j for j in (first, second)}
        ratio, near = float(model.eq_data[e, 1]), abs(first - second) == 1
        same = near and model.jnt_bodyid[first] == model.jnt_bodyid[second] and set(ends) == {"revolute", "prismatic"}
        if not same or not ratio or np.any(model.eq_data[e, [0, 2, 3, 4]]) or min(first, second) in found:
            continue
        hinge, slide = ends["revolute"], ends["prismatic"]
        cosine = float(model.jnt_axis[hinge] @ model.jnt_axis[slide])
        if abs(abs(cosine) - 1.0) < ROUNDED_COSINE and not model.jnt_stiffness[slide]:
            pitch = (ratio if first == slide else 1.0 / ratio) * round(cosine)
            found[min(first, second)] = Thread(hinge, slide, pitch, e)
    return found


def loops(model: Any, names: MjcfNames, threads: Collection[Thread], draft: Draft) -> None:
    """A spherical joint for a ``connect``, a fixed one for a ``weld``; a joint that is held at a value gets the rate 0,
    one that follows another in a constant ratio a gear.

    Others but those of screws are noted. They are rigid here, soft in MuJoCo.
    """
    mujoco: Any = import_module("mujoco")
    kinds, sites = mujoco.mjtEq, mujoco.mjtObj.mjOBJ_SITE
    screwed, merged = {thread.equality for thread in threads}, {thread.slide for thread in threads}
    for e in range(model.neq):
        kind, data = int(model.eq_type[e]), np.array(model.eq_data[e])
        first, second = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
        lone = kind == kinds.mjEQ_JOINT and not merged & {first, second}
        name = model.raw.equality(e).name or f"equality_{e + 1}"
        model.name("equalities", e, name)
        model.pass_by("equalities", e, "solref", "solimp")  # softness, which is noted
        if e in screwed:
            draft.leave("softness of equality constraints", name)
        elif not _active(model, e):
            draft.leave("inactive equality constraints", name)
            model.pass_by("equalities", e)
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            if int(model.eq_objtype[e]) == sites:
                ends = [
                    (int(model.site_bodyid[s]), pose(model.site_pos[s], model.site_quat[s])) for s in (first, second)
                ]
            elif kind == kinds.mjEQ_CONNECT:
                ends = [(first, pose(data[:3])), (second, pose(data[3:6]))]
            else:
                ends = [(first, pose(data[3:6], data[6:10])), (second, pose(data[:3]))]
            turns = kind == kinds.mjEQ_CONNECT or model.eq_data[e, TORQUE_SCALE] == 0.0
            pair = "spherical" if turns else "fixed"
            (b1, at1), (b2, at2) = ends
            draft.joint(name, pair, names.bodies[b1], names.bodies[b2], at1, at2, {})
            draft.leave("softness of equality constraints", name)
        elif lone and second < 0 and not data[0]:
            draft.hold(names.joints[first])
            draft.leave("softness of equality constraints", name)
        elif lone and second >= 0 and _in_ratio(names, (first, second), data):
            draft.gear(name, names.joints[first], names.joints[second], data[1])
            draft.leave("softness of equality constraints", name)
        else:
            draft.leave("equality constraints that are neither lower pairs nor constant ratios", name)
            model.pass_by("equalities", e)


def _active(model: Any, e: int) -> bool:
    return bool(model.eq_active0[e]) and not disabled(model, "EQUALITY", "CONSTRAINT")


def _in_ratio(names: MjcfNames, joints: tuple[int, int], data: Any) -> bool:
    """Whether the coordinates of two joints with one degree of freedom are in a constant ratio."""
    return not np.any(data[[0, 2, 3, 4]]) and all(names.kinds[j] in ("revolute", "prismatic") for j in joints)
