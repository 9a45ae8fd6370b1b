"""Actuators and tendons of a compiled MJCF.

An actuator's force on its length l is gain · control + b₀ + b₁ l + b₂ dl/dt. The first term is an actuator of the
scene; the others are a spring, friction, and a constant force on its joints or along its tendon.
"""

from dataclasses import dataclass
from importlib import import_module
from typing import Any, final

import numpy as np

from ephs.mechanics.imports.draft import Draft
from ephs.mechanics.imports.mjcf_keys import SOFT_DRY, SOFT_STOPS, Compiled, disabled
from ephs.mechanics.imports.mjcf_names import MjcfNames
from ephs.mechanics.imports.mjcf_routes import Route, route_of

GROUPS = 31
"""Groups of actuators that options can disable."""


@final
@dataclass(frozen=True, slots=True)
class Line:
    """A length Σ coefficient · coordinate: the numbers of the joints, and its value at the reference configuration."""

    joints: tuple[int, ...]
    coefficients: tuple[float, ...]
    length: float


def tendons(model: Compiled, names: MjcfNames, draft: Draft) -> dict[int, str]:
    """Springs and dampers of fixed tendons, and of those from site to site; number -> name of the scene's tendons."""
    found: dict[int, str] = {}
    for t in range(model.ntendon):
        name, line, route = _named(model, t), _of_tendon(model, t), route_of(model, t)
        stiffness, damping = (float(x[t].flat[0]) for x in (model.tendon_stiffness, model.tendon_damping))
        stiffness = 0.0 if disabled(model, "SPRING") else stiffness
        damping = 0.0 if disabled(model, "DAMPER") else damping
        low, high = model.tendon_lengthspring[t].tolist()
        slack = route is not None and low == 0.0 < high
        taut = stiffness if low == high or slack else 0.0
        if route is None:
            known = _pull(name, line, taut, low, damping, names, draft)
        else:
            made = route.pull(name, taut, high, damping, names, draft, slack=slack and bool(taut))
            known = made is not None
            found |= {t: made} if made else {}
        if not known:
            draft.leave("tendons", name)
        if np.any(model.tendon_stiffnesspoly[t]):
            draft.leave("stiffness that is not linear of", name)
        if np.any(model.tendon_dampingpoly[t]):
            draft.leave("damping that is not linear of", name)
        if stiffness and not taut:
            draft.leave("slack of", name)
        model.name("tendons", t, name)
        model.pass_by("tendons", t, *SOFT_STOPS, *SOFT_DRY)
    return found


def actuators(model: Compiled, names: MjcfNames, ropes: dict[int, str], draft: Draft) -> None:
    """Actuators on joints with one degree of freedom and on tendons; ``ropes``: number -> name of the scene's tendons,
    to which those are added that are needed.
    """
    mujoco: Any = import_module("mujoco")
    through, gains, biases, dynamics = mujoco.mjtTrn, mujoco.mjtGain, mujoco.mjtBias, mujoco.mjtDyn
    for a in range(model.nu):
        name = str(model.actuator(a).name) or f"actuator_{a + 1}"
        group = int(model.actuator_group[a])
        if disabled(model, "ACTUATION") or (0 <= group < GROUPS and model.opt.disableactuator >> group & 1):
            draft.leave("disabled actuators", name)
            model.pass_by("actuators", a)
            continue
        kind, target, gear = int(model.actuator_trntype[a]), int(model.actuator_trnid[a, 0]), model.actuator_gear[a]
        lawful = (
            int(model.actuator_gaintype[a]) == gains.mjGAIN_FIXED
            and int(model.actuator_biastype[a]) in (biases.mjBIAS_NONE, biases.mjBIAS_AFFINE)
            and int(model.actuator_dyntype[a])
            in (dynamics.mjDYN_NONE, dynamics.mjDYN_FILTER, dynamics.mjDYN_FILTEREXACT)
        )
        line: Line | None = None
        route: Route | None = None
        if kind in (through.mjTRN_JOINT, through.mjTRN_JOINTINPARENT):
            if names.kinds[target] in ("revolute", "prismatic"):
                line = Line((target,), (1.0,), float(model.qpos0[model.jnt_qposadr[target]]))
        elif kind == through.mjTRN_TENDON:
            line, route = _of_tendon(model, target), route_of(model, target)
        known = route is not None or (line is not None and all(draft.knows(names.joints[j]) for j in line.joints))
        if not lawful or not known:
            draft.leave("actuators", name)
            model.pass_by("actuators", a)
            continue
        by = float(gear[0])
        if line is not None:
            line = Line(line.joints, tuple(by * x for x in line.coefficients), by * line.length)
        affine, bias = int(model.actuator_biastype[a]) == biases.mjBIAS_AFFINE, model.actuator_biasprm[a]
        constant, by_length, by_rate = (float(x) if affine else 0.0 for x in bias[:3])
        rest = -constant / by_length if by_length else 0.0
        if route is None:
            sprung = _pull(name, line, -by_length, rest, -by_rate, names, draft)
        else:
            spring = (-by_length * by**2, rest / by if by else 0.0, -by_rate * by**2)
            sprung = route.pull(f"{name}_bias", *spring, names, draft) is not None
        if not sprung or (constant and not by_length):
            draft.leave("bias of", name)
        gain = float(model.actuator_gainprm[a, 0])
        clamped, reach = model.actuator_ctrllimited[a], model.actuator_ctrlrange[a].tolist()
        limits = reach if clamped and not disabled(model, "CLAMPCTRL") else None
        if limits is not None and not limits[0] <= 0.0 <= limits[1]:
            draft.leave("force without a control, since its range lacks 0, of", name)
        if route is not None:
            if target not in ropes:
                ropes[target] = route.tendon(_named(model, target), names, draft)
            draft.actuate(name, gain * by / route.divisor, limits, ropes[target])
        elif line is not None:
            shares = {names.joints[j]: gain * x for j, x in zip(line.joints, line.coefficients, strict=True)}
            draft.actuate(name, shares, limits)
        model.name("actuators", a, name)
        if int(model.actuator_dyntype[a]) != dynamics.mjDYN_NONE:
            draft.leave("activation of", name)
            model.pass_by("actuators", a, "dynprm", "actdim", "actearly", "actrange")


def _named(model: Any, t: int) -> str:
    return str(model.tendon(t).name) or f"tendon_{t + 1}"


def _of_tendon(model: Any, t: int) -> Line | None:
    """The length of a fixed tendon over joints with one degree of freedom; None for other tendons."""
    mujoco: Any = import_module("mujoco")
    first, count = int(model.tendon_adr[t]), int(model.tendon_num[t])
    every = range(first, first + count)
    if any(int(model.wrap_type[w]) != mujoco.mjtWrap.mjWRAP_JOINT for w in every):
        return None
    joints = tuple(int(model.wrap_objid[w]) for w in every)
    coefficients = tuple(float(model.wrap_prm[w]) for w in every)
    at = (float(model.qpos0[int(model.jnt_qposadr[j])]) for j in joints)
    return Line(joints, coefficients, sum(c * q for c, q in zip(coefficients, at, strict=True)))


def _pull(
    name: str, line: Line | None, stiffness: float, rest: float, damping: float, names: MjcfNames, draft: Draft
) -> bool:
    """A spring and a damper along a length; whether the scene has them."""
    if line is None or not all(draft.knows(names.joints[j]) for j in line.joints):
        return False
    if not (stiffness or damping):
        return True
    if stiffness < 0.0 or damping < 0.0 or not line.coefficients[0]:
        return False
    first, *others = line.coefficients
    scale, stretch = first * first, (line.length - rest) / first
    joints = [names.joints[j] for j in line.joints]
    if not others:
        draft.pull(joints[0], scale * stiffness, -stretch, scale * damping)
        return True
    if not stiffness:
        return False
    draft.belt(name, joints, [-x / first for x in others], scale * stiffness, scale * damping, stretch)
    return True
