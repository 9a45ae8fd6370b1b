"""Equality constraints of a compiled MJCF: those that are lower pairs close loops or hold joints."""

from importlib import import_module
from typing import Any

import numpy as np

from ephs.mechanics.imports.draft import Draft, pose
from ephs.mechanics.imports.mjcf_names import Names

__all__ = ["loops"]


def loops(model: Any, names: Names, draft: Draft) -> None:
    """A spherical joint for a ``connect``, a fixed one for a ``weld``; a joint that is held at a value gets the rate 0.

    Others are noted. They are rigid here, soft in MuJoCo.
    """
    mujoco: Any = import_module("mujoco")
    kinds, sites = mujoco.mjtEq, mujoco.mjtObj.mjOBJ_SITE
    for e in range(model.neq):
        kind, data = int(model.eq_type[e]), np.array(model.eq_data[e])
        first, second = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
        name = model.equality(e).name or f"equality_{e + 1}"
        if not model.eq_active0[e]:
            draft.leave("inactive equality constraints", name)
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            if int(model.eq_objtype[e]) == sites:
                ends = [
                    (int(model.site_bodyid[s]), pose(model.site_pos[s], model.site_quat[s])) for s in (first, second)
                ]
            elif kind == kinds.mjEQ_CONNECT:
                ends = [(first, pose(data[:3])), (second, pose(data[3:6]))]
            else:
                ends = [(first, pose(data[3:6], data[6:10])), (second, pose(data[:3]))]
            pair = "spherical" if kind == kinds.mjEQ_CONNECT else "fixed"
            (b1, at1), (b2, at2) = ends
            draft.joint(name, pair, names.bodies[b1], names.bodies[b2], at1, at2, {})
            draft.leave("softness of equality constraints", name)
        elif kind == kinds.mjEQ_JOINT and second < 0 and not data[0]:
            draft.hold(names.joints[first])
            draft.leave("softness of equality constraints", name)
        else:
            draft.leave("equality constraints that are no lower pairs", name)
