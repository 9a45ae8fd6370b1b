"""Record of the reads of a compiled MJCF's arrays.

Unread attributes of MuJoCo's specification are named, where they differ from their defaults.
"""

from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from typing import Any, final

import numpy as np

from ephs.mechanics.imports.draft import Draft

_PREFIXES = {
    "body": "bodies", "jnt": "joints", "dof": "joints", "geom": "geoms", "pair": "pairs", "tendon": "tendons",
    "actuator": "actuators", "eq": "equalities",
}  # fmt: skip
"""Beginnings of the names of a compiled model's arrays -> kinds of elements of the specification."""
_ATTRIBUTES = {
    "body_mass": "mass explicitinertial", "body_inertia": "inertia fullinertia", "body_quat": "quat alt",
    "body_iquat": "iquat ialt", "body_gravcomp": "gravcomp",
    "jnt_solref": "solref_limit", "jnt_solimp": "solimp_limit", "jnt_stiffness": "stiffness springdamper",
    "dof_solref": "solref_friction", "dof_solimp": "solimp_friction", "qpos0": "ref", "qpos_spring": "springref",
    "geom_quat": "quat alt", "geom_size": "size fromto meshname hfieldname fitscale",
    "pair_dim": "condim", "pair_geom1": "geomname1", "pair_geom2": "geomname2",
    "tendon_num": "path", "tendon_lengthspring": "springlength",
    "actuator_trnid": "target", "actuator_ctrlrange": "ctrlrange inheritrange ctrlspec",
    "eq_active0": "active", "eq_obj1id": "name1", "eq_obj2id": "name2",
}  # fmt: skip
"""Arrays -> attributes that they are compiled from, unless these have their names."""
_BOOKS = "name classname info id signature group userdata parent frame compiler plugin rgba material default"
_PLAIN = {
    "bodies": "childclass simple fuse sleep",
    "joints": "align",
    # mass and shape of geoms are compiled into their bodies' inertias; fluid_* acts in a medium, which is noted
    "geoms": "mass density typeinertia fluid_ellipsoid fluid_coefs castshadow",
    "pairs": "",
    "tendons": "width",
    "actuators": "lengthrange type",
    "equalities": "",
    "options": "timestep integrator jacobian cone solver iterations tolerance ls_iterations ls_tolerance "
    "noslip_iterations noslip_tolerance ccd_iterations ccd_tolerance sdf_iterations sdf_initpoints sleep_tolerance "
    "magnetic o_margin o_solref o_solimp o_friction",
}
"""Attributes without an effect on motion."""
_SWITCHES = {"range": "limited", "actfrcrange": "actfrclimited", "forcerange": "forcelimited",
             "ctrlrange": "ctrllimited", "actrange": "actlimited"}  # fmt: skip
"""Ranges, and what says whether they hold."""
_IDLE = "ENERGY", "FWDINV", "INVDISCRETE", "SLEEP"
"""Enabled flags without an effect on motion."""
_WORDS = {"actfrcrange": "actuatorfrcrange", "actgravcomp": "actuatorgravcomp"}
"""Attributes that have other names in files."""
SOFT_STOPS = ("solref_limit", "solimp_limit", "margin")
SOFT_DRY = ("solref_friction", "solimp_friction")
_ENUMS = "mujoco._enums"
TORQUE_SCALE = 10
"""Place of `torquescale` in the numbers of a weld."""


@final
class Compiled:
    """A compiled model, of which each array records for which elements it is read.

    Attributes
    ----------
    raw
        MuJoCo's own model; what is read of it is not recorded.
    """

    def __init__(self, spec: Any, raw: Any, draft: Draft) -> None:
        mujoco: Any = import_module("mujoco")
        self.raw, self._draft = raw, draft
        blank = mujoco.MjSpec()
        body = blank.worldbody.add_body()
        plain = {
            "bodies": body, "joints": body.add_joint(), "geoms": body.add_geom(), "pairs": blank.add_pair(),
            "tendons": blank.add_tendon(), "actuators": blank.add_actuator(), "equalities": blank.add_equality(),
        }  # fmt: skip
        self._given = {
            (kind, int(one.id)): _given(one, default, kind)
            for kind, default in plain.items()
            for one in getattr(spec, kind)
        } | {("options", 0): _given(spec.option, blank.option, "options")}
        self._seen: set[tuple[str, int, str]] = set()
        self._names: dict[tuple[str, int], str] = {("options", 0): ""}
        at = np.zeros(raw.nq, dtype=int)
        for j in range(raw.njnt):
            at[int(raw.jnt_qposadr[j]) :] = j
        self._joint_at: Mapping[str, Any] = {"dof": raw.dof_jntid, "qpos": at}

    def __getattr__(self, field: str) -> Any:
        value = getattr(self.raw, field)
        prefix = "qpos" if field.startswith("qpos") else field.partition("_")[0]
        kind = "joints" if prefix == "qpos" else _PREFIXES.get(prefix)
        if field == "opt":
            return _Options(value, lambda word: self._seen.add(("options", 0, word)))
        if kind is None or not isinstance(value, np.ndarray):
            return value
        words = _ATTRIBUTES.get(field, field.partition("_")[2]).split()
        at = self._joint_at.get(prefix)

        def note(numbers: Any, column: Any) -> None:
            found = ["torquescale"] if field == "eq_data" and column == TORQUE_SCALE else words
            for number in np.ravel(numbers if at is None else at[numbers]).tolist():
                self._seen.update((kind, number, word) for word in found)

        return _KeyedRows(value, note)

    def pass_by(self, kind: str, number: int, *words: str) -> None:
        """Let attributes of an element be, or all of it: they have no effect, or a note of their own."""
        self._seen.update((kind, number, word) for word in words or self._given[kind, number])

    def name(self, kind: str, number: int, name: str) -> None:
        """Name an element in notes of what is not read of it."""
        self._names[kind, number] = name

    def leave_unread(self) -> None:
        """Record the attributes of each element that were not read."""
        for (kind, number), words in self._given.items():
            name = self._names.get((kind, number), f"number {number}")
            for word in words:
                if (kind, number, word) not in self._seen:
                    told = _WORDS.get(word, word.replace("_", ""))
                    what, which = ("options", word) if kind == "options" else (f"{told} of {kind}", name)
                    self._draft.leave(what, which)


@final
class _KeyedRows:
    """An array that tells which rows are read, and which column where it is one."""

    def __init__(self, values: Any, note: Callable[[Any, Any], None]) -> None:
        self._values, self._note = values, note

    def __getitem__(self, where: Any) -> Any:
        row, column = where if isinstance(where, tuple) else (where, None)
        self._note(np.arange(len(self._values))[row], column if isinstance(column, int) else None)
        return self._values[where]

    def __len__(self) -> int:
        return len(self._values)

    def __iter__(self) -> Iterator[Any]:
        return iter(self[:])

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        return np.array(self[:], dtype=dtype)


@final
class _Options:
    """Options that tell which of them are read."""

    def __init__(self, values: Any, note: Callable[[str], None]) -> None:
        self._values, self._note = values, note

    def __getattr__(self, word: str) -> Any:
        self._note(word)
        return getattr(self._values, word)


def disabled(model: Any, *flags: str) -> bool:
    """Whether one of the flags is disabled in a model's options."""
    bits: Any = import_module("mujoco").mjtDisableBit
    return any(model.opt.disableflags & int(getattr(bits, f"mjDSBL_{flag}")) for flag in flags)


def _given(element: Any, plain: Any, kind: str) -> tuple[str, ...]:
    """Attributes of an element that may have an effect and differ from their defaults."""
    mujoco: Any = import_module("mujoco")
    off = mujoco.mjtLimited.mjLIMITED_FALSE
    idle = sum(int(getattr(mujoco.mjtEnableBit, f"mjENBL_{flag}")) for flag in _IDLE)
    passed = {*_PLAIN[kind].split(), *_BOOKS.split(), *_SWITCHES.values()}
    found: list[str] = []
    for key in dir(element):
        value = None if key in passed or key.startswith("_") else getattr(element, key)
        if not isinstance(value, (bool, int, float, str, np.ndarray)) and type(value).__module__ != _ENUMS:
            continue
        switch, value, default = _SWITCHES.get(key), np.array(value), np.array(getattr(plain, key))
        if key == "enableflags":
            value &= ~idle
        if key == "wind" and not (element.density or element.viscosity):
            value[:] = 0.0
        if kind == "equalities" and key == "data":
            if value[TORQUE_SCALE] != default[TORQUE_SCALE]:
                found.append("torquescale")
            value[TORQUE_SCALE] = default[TORQUE_SCALE]
        if not np.array_equal(value, default) and not (switch and getattr(element, switch) == off):
            found.append(key)
    return tuple(found)
