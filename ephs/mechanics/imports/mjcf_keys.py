"""Attributes of MJCF that the reader does not use: those of MuJoCo's specification that differ from their defaults."""

from collections.abc import Container, Mapping
from dataclasses import dataclass
from enum import Enum
from importlib import import_module
from typing import Any, final

import numpy as np

from ephs.mechanics.imports.draft import Draft

_BOOKS = "name classname info id signature group userdata parent frame compiler plugin rgba material"
# Attributes with an effect on the scene, or with a note of their own; those of MuJoCo's solver and of pictures.
_KNOWN = {
    "bodies": "pos quat alt childclass mass inertia ipos iquat ialt fullinertia explicitinertial simple fuse sleep",
    "joints": "type pos axis ref align range limited stiffness springref springdamper damping armature frictionloss",
    "geoms": "type pos quat alt size fromto mass density typeinertia meshname hfieldname fitscale fluid_ellipsoid "
    "fluid_coefs contype conaffinity condim friction priority solref solmix castshadow",
    "pairs": "geomname1 geomname2 condim friction solref",
    "tendons": "path stiffness damping springlength width",
    "actuators": "trntype target refsite slidersite cranklength gear gaintype gainprm biastype biasprm dyntype dynprm "
    "actdim actearly actrange actlimited ctrlrange ctrllimited ctrlspec inheritrange lengthrange type",
    "options": "gravity disableflags enableflags disableactuator timestep integrator jacobian cone solver iterations "
    "tolerance ls_iterations ls_tolerance noslip_iterations noslip_tolerance ccd_iterations ccd_tolerance "
    "sdf_iterations sdf_initpoints sleep_tolerance magnetic o_margin o_solref o_solimp o_friction",
}  # fmt: skip
_SWITCHES = {"range": "limited", "actfrcrange": "actfrclimited", "forcerange": "forcelimited"}
"""Ranges, and what says whether they hold."""
_WORDS = {"actfrcrange": "actuatorfrcrange", "actgravcomp": "actuatorgravcomp"}
"""Attributes that have other names in files."""
SOFT_STOPS = ("solref_limit", "solimp_limit", "margin")
SOFT_DRY = ("solref_friction", "solimp_friction")


@final
@dataclass(frozen=True, slots=True)
class Keys:
    """Unused attributes with an effect in MuJoCo, by kind of element and number in the compiled model."""

    unused: Mapping[tuple[str, int], tuple[str, ...]]
    draft: Draft

    @staticmethod
    def of(spec: Any, draft: Draft) -> "Keys":
        """The attributes of a compiled specification."""
        mujoco: Any = import_module("mujoco")
        blank = mujoco.MjSpec()
        body = blank.worldbody.add_body()
        plain = {
            "bodies": body, "joints": body.add_joint(), "geoms": body.add_geom(), "pairs": blank.add_pair(),
            "tendons": blank.add_tendon(), "actuators": blank.add_actuator(),
        }  # fmt: skip
        found = {
            (kind, int(one.id)): _unused(one, default, _KNOWN[kind])
            for kind, default in plain.items()
            for one in getattr(spec, kind)
        }
        return Keys(found | {("options", 0): _unused(spec.option, blank.option, _KNOWN["options"])}, draft)

    def note(self, kind: str, number: int, name: str, but: Container[str] = ()) -> None:
        """Record the unused attributes of an element."""
        for key in self.unused[kind, number]:
            if key not in but:
                self.draft.leave(f"{_WORDS.get(key, key.replace('_', ''))} of {kind}", name)

    def note_options(self) -> None:
        """Record the unused options, such as the forces of a medium."""
        for key in self.unused["options", 0]:
            self.draft.leave("options", key)


def disabled(model: Any, *flags: str) -> bool:
    """Whether one of the flags is disabled in a model's options."""
    bits: Any = import_module("mujoco").mjtDisableBit
    return any(model.opt.disableflags & int(getattr(bits, f"mjDSBL_{flag}")) for flag in flags)


def _unused(element: Any, plain: Any, known: str) -> tuple[str, ...]:
    off = import_module("mujoco").mjtLimited.mjLIMITED_FALSE
    passed = {*known.split(), *_BOOKS.split(), *_SWITCHES.values()}
    found: list[str] = []
    for key in dir(element):
        value = None if key in passed or key.startswith("_") else getattr(element, key)
        if not isinstance(value, (bool, int, float, str, Enum, np.ndarray)):
            continue
        switch = _SWITCHES.get(key)
        same = np.array_equal(np.asarray(value), np.asarray(getattr(plain, key)))
        if not same and not (switch and getattr(element, switch) == off):
            found.append(key)
    return tuple(found)
