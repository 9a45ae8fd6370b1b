"""Names of a compiled MJCF, generated where they are missing, and its elements without a counterpart."""

from typing import Any, final

import numpy as np

from ephs.mechanics.imports.draft import WORLD, Draft

KINDS = ("free", "spherical", "prismatic", "revolute")


@final
class MjcfNames:
    """Names of bodies and joints by their numbers, and the joints' kinds."""

    def __init__(self, model: Any) -> None:
        given = [model.body(b).name for b in range(model.nbody)]
        joints = [model.joint(j).name for j in range(model.njnt)]
        taken = {name for name in (*given, *joints) if name}
        self.bodies = [WORLD, *(_made(name, f"body_{b}", taken) for b, name in enumerate(given) if b)]
        self.joints = [
            _made(name, f"{self.bodies[int(model.jnt_bodyid[j])]}_joint", taken) for j, name in enumerate(joints)
        ]
        self.kinds = [KINDS[int(kind)] for kind in model.jnt_type]
        self._taken = taken

    def between(self, body: int, joint: int) -> str:
        """A name for the frame after a joint that is not its body's last."""
        return _made("", f"{self.bodies[body]}_after_{self.joints[joint]}", self._taken)


def noted(model: Any, names: MjcfNames, draft: Draft) -> None:
    """Record elements of the compiled model without a counterpart."""

    def dofs(values: Any) -> list[str]:
        moved = np.flatnonzero(np.asarray(values).reshape(model.nv, -1 if model.nv else 1).any(axis=1))
        return list(dict.fromkeys(names.joints[int(model.dof_jntid[k])] for k in moved))

    def joints(values: Any) -> list[str]:
        return [names.joints[j] for j in range(model.njnt) if np.any(values[j])]

    parts = {
        "rotor inertia (armature) of joints with several degrees of freedom": [
            name for name in dofs(model.dof_armature) if names.kinds[names.joints.index(name)] in ("free", "spherical")
        ],
        "damping that is not linear of": dofs(model.dof_dampingpoly),
        "stiffness that is not linear of": joints(model.jnt_stiffnesspoly),
    }
    for what, found in parts.items():
        for name in found:
            draft.leave(what, name)


def _made(name: str, otherwise: str, taken: set[str]) -> str:
    """The name, or a generated unused one."""
    if name:
        return name
    found, count = otherwise, 1
    while found in taken:
        count += 1
        found = f"{otherwise}_{count}"
    taken.add(found)
    return found
