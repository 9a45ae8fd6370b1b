"""The tables of a scene file in the making: links with their own frames become bodies at their centres of mass."""

from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from ephs.mechanics.scene.errors import Fault, legible
from ephs.mechanics.scene.geometry import frame_rotation
from ephs.mechanics.scene.model import ENVIRONMENT, GROUND
from ephs.mechanics.scene.text import MESHES
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rank import DIRECTION
from ephs.semantics.spaces.rotations import quaternion_to_matrix

LONGEST_NAME = 200
SECTIONS = "bodies", "joints", "springs", "gears", "actuators", "tendons", "surfaces", "contacts"
"""Tables of models, in the order of files."""
WORLD = ""
"""Name of the ground in joints: no link has it."""
UNLIMITED = 1e15
"""Limits from this size on are none: SDF writes 1e16."""
_SCHEMES = ("package://", "model://", "file://")


@final
class Draft:
    """Collects bodies, joints, faults, and elements of a model without a counterpart.

    Links are known by their names in the model; their names in the scene are the same, but for dots and blanks.
    Poses are (7,), of what is given in a link's own frame. Limits and surfaces are kept where ``contact`` says so.
    """

    def __init__(self, name: str, folder: Path, faults: list[Fault], *, contact: bool = False) -> None:
        self.name, self.folder, self.faults, self.contact = name, folder, faults, contact
        self._tables: dict[str, dict[str, dict[str, Any]]] = {section: {} for section in SECTIONS}
        self.gravity: list[float] | None = None
        self._names: dict[str, str] = {WORLD: GROUND}
        self._joint_names: dict[str, str] = {}
        self._centres: dict[str, Array] = {WORLD: np.zeros(3)}
        self._left: dict[str, dict[str, None]] = {}
        self._renamed: list[str] = []
        self._alike: dict[str, int] = {}

    def leave(self, what: str, name: str) -> None:
        """Record an element without a counterpart in scenes."""
        self._left.setdefault(what, {})[name] = None

    def rename(self, name: str, other: str) -> None:
        """Note that something has another name in the scene."""
        self._renamed.append(f"{name} → {other}")

    def left(self) -> list[str]:
        """A line for each kind of omitted elements, and one for names that are invalid in scenes."""
        lines = [f"not modelled: {what}: {', '.join(map(legible, names))}" for what, names in self._left.items()]
        renamed = [f"renamed, as scenes want it: {', '.join(map(legible, self._renamed))}"] if self._renamed else []
        return lines + renamed

    def body(
        self,
        link: str,
        mass: float = 0.0,
        inertia: ArrayLike = 0.0,
        centre: ArrayLike = (0.0, 0.0, 0.0),
        place: Array | None = None,
    ) -> str:
        """A body: inertia (3, 3) about its centre of mass in the link's axes; ``place`` (7,) of the link in the world,
        unless a joint says it. Returns its name in the scene."""
        self._centres[link] = np.asarray(centre, dtype=float)
        t = np.broadcast_to(np.asarray(inertia, dtype=float), (3, 3))
        entries = _plain([t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2]])
        entry: dict[str, Any] = {"mass": float(mass), "inertia": entries if any(entries[3:]) else entries[:3]}
        if place is not None:
            entry |= _placed(self._at(link, place, inverse=False))
        self._names[link] = self._add("bodies", link, entry)
        return self._names[link]

    def frame_without_mass(self, name: str) -> str:
        """A body without mass between two joints; returns its name in the draft."""
        self.body(name)
        return name

    def joint(
        self, name: str, kind: str, first: str, second: str, at1: Array, at2: Array, entries: Mapping[str, Any]
    ) -> None:
        """A joint of two links, its frames (7,) in theirs; ``entries`` are further keys of its table."""
        frames = {"frame1": _placed(self._at(first, at1)), "frame2": _placed(self._at(second, at2))}
        more = {key: value for key, value in entries.items() if np.any(value)}
        self._joint_names[name] = self._add(
            "joints", name, {"type": kind, "bodies": [self._names[first], self._names[second]], **frames, **more}
        )

    def dry(self, name: str, force: float, freedoms: int) -> dict[str, Any]:
        """Entries of dry friction; a note of it where the joint has several freedoms."""
        if force and freedoms != 1:
            self.leave("dry friction of joints with several degrees of freedom", name)
        return {"dry": {"coulomb": float(force)}} if force and freedoms == 1 else {}

    def limit(self, name: str, lower: float, upper: float, **law: float) -> None:
        """Add stops to a joint of one degree of freedom, with keys of their law, or a note of its limits."""
        sides = [float(value) if abs(value) < UNLIMITED else np.nan for value in (lower, upper)]
        if np.all(np.isnan(sides)):
            return
        if not self.contact or lower >= upper:
            self.leave("limits of", name)
        else:
            self._joint(name).update(limits=sides, **law)

    def surface(self, link: str, name: str, kind: str, value: Any, place: Array, **law: Any) -> str:
        """A surface of a link, with keys of its table; returns its name in the scene."""
        size, at = {} if kind == "plane" else _plain(value), _placed(self._at(link, place))
        return self._add("surfaces", name, {"body": self._names[link], "shape": {kind: size}, **at, **law})

    @property
    def mass(self) -> float:
        """Mass of all bodies so far, kg."""
        return sum(body["mass"] for body in self._tables["bodies"].values())

    def touch(self, surfaces: tuple[str, str], law: Mapping[str, float]) -> None:
        """A contact of two surfaces."""
        self._add("contacts", "_".join(surfaces), {"surfaces": list(surfaces), **law})

    def hold(self, name: str) -> None:
        """Lock a joint of one degree of freedom."""
        entries = self._joint(name)
        for key in ("armature", "dry", "limits", "limit_stiffness", "limit_loss"):
            entries.pop(key, None)
        entries["motion"] = {"rate": 0.0}

    def gear(self, name: str, first: str, second: str, ratio: float, start: float = 0.0) -> None:
        """Couple the rate of a joint of one degree of freedom to another's, times the ratio, from its start on."""
        joints = [self._joint_names[first], self._joint_names[second]]
        if start:
            self._joint(first)["coordinate"] = start
        if ratio:
            self._add("gears", name, {"joints": joints, "ratio": float(ratio)})
        else:
            self.hold(first)

    def knows(self, name: str) -> bool:
        """Whether a free joint has this name."""
        return name in self._joint_names and "motion" not in self._joint(name)

    def pull(self, name: str, stiffness: float, rest: float, damping: float) -> None:
        """Add a spring and friction to a joint of one degree of freedom."""
        entries = self._joint(name)
        before, whole = entries.get("stiffness", 0.0), entries.get("stiffness", 0.0) + stiffness
        if stiffness:
            entries["rest"] = (before * entries.get("rest", 0.0) + stiffness * rest) / whole
            entries["stiffness"] = whole
        if damping:
            entries["friction"] = entries.get("friction", 0.0) + damping

    def belt(
        self, name: str, joints: Sequence[str], ratio: Sequence[float], stiffness: float, damping: float, stretch: float
    ) -> None:
        """A spring and a damper along a sum of coordinates of joints with one degree of freedom; numbers of the
        first.
        """
        numbers = {"stiffness": stiffness, "damping": damping, "stretch": stretch}
        named = [self._joint_names[each] for each in joints]
        self._add("gears", name, {"joints": named, "ratio": list(map(float, ratio)), **numbers})

    def spring(
        self, name: str, links: tuple[str, str], at: tuple[Array, Array], stiffness: float, length: float,
        damping: float,
    ) -> None:  # fmt: skip
        """A spring and a damper between two points (3,), each in its link's frame."""
        one, other = self._points(links, at)
        numbers = {"stiffness": stiffness, "length": length, "damping": damping}
        self._add(
            "springs", name, {"bodies": [self._names[link] for link in links], "at1": one, "at2": other, **numbers}
        )

    def tendon(self, name: str, links: Sequence[str], points: Sequence[Array], **numbers: Any) -> str:
        """A tendon through points (3,), each in its link's frame; its name."""
        bodies = [self._names[link] for link in links]
        return self._add("tendons", name, {"bodies": bodies, "points": self._points(links, points), **numbers})

    def actuate(
        self, name: str, ratio: Mapping[str, float] | float, limits: Sequence[float] | None, tendon: str = ""
    ) -> None:
        """A control that acts as forces on joints of one degree of freedom, or on the length of a tendon."""
        found: dict[str, Any] = {"tendon": tendon, "ratio": ratio}
        if isinstance(ratio, Mapping):
            found = {"joints": [self._joint_names[each] for each in ratio], "ratio": list(map(float, ratio.values()))}
        bounded = limits is not None and bool(np.all(np.isfinite(limits)))
        more = {"limits": _plain(limits)} if limits is not None and bounded else {}
        self._add("actuators", name, found | more, self._tables["tendons"].keys() - {tendon})

    def driven(self, joint: str) -> bool:
        """Whether an actuator acts on a joint."""
        own = self._joint_names[joint]
        return any(own in actuator.get("joints", ()) for actuator in self._tables["actuators"].values())

    def shape(self, link: str, kind: str, value: Any, place: Array, **more: Any) -> None:
        """Something to draw on a link."""
        if kind != "mesh" and not np.all(np.asarray(value, dtype=float) > 0.0):
            self.leave("shapes without size", self._names[link])
            return
        seen = {key: v for key, v in _placed(self._at(link, place)).items() if np.any(np.array(v) != _REST[key])}
        table = {kind: value if kind == "mesh" else _plain(value), **more, **seen}
        self._tables["bodies"][self._names[link]].setdefault("shapes", []).append(table)

    def mesh(self, link: str, file: str, place: Array, scale: Sequence[float] = (1.0, 1.0, 1.0)) -> None:
        """A mesh for pictures, if it is in the model's folder."""
        inside = self.file_inside(file)
        if inside is None or inside.suffix.lower() not in MESHES:
            self.leave("meshes that are no readable file in the model's folder", file)
            return
        folder = self.folder.resolve()
        more = {} if list(scale) == [1.0, 1.0, 1.0] else {"scale": _plain(scale)}
        self.shape(link, "mesh", inside.relative_to(folder).as_posix(), place, **more)

    def file_inside(self, name: str) -> Path | None:
        """The file of a name or address, if it is in the model's folder."""
        scheme = next((s for s in _SCHEMES if name.startswith(s)), "")
        rest = name[len(scheme) :]
        if scheme in ("package://", "model://"):
            rest = rest.partition("/")[2]
        try:
            file, folder = (self.folder / rest).resolve(), self.folder.resolve()
            return file if file.is_relative_to(folder) and file.is_file() else None
        except (OSError, ValueError):  # a name that no file can have
            return None

    def document(self, mode: str = "warn") -> dict[str, Any]:
        """The tables."""
        world = {} if self.gravity is None else {"world": {"gravity": _plain(self.gravity)}}
        return {
            "format": 1,
            "name": "".join("_" if c in "/\\" or not c.isprintable() else c for c in self.name[:LONGEST_NAME]).strip(
                ". "
            )
            or "model",
            **world,
            "assembly": {"inertia": mode},
            **{key: tables for key, tables in self._tables.items() if tables or key in ("bodies", "joints")},
        }

    def _joint(self, name: str) -> dict[str, Any]:
        """Table of a joint."""
        return self._tables["joints"][self._joint_names[name]]

    def _points(self, links: Sequence[str], points: Sequence[Array]) -> list[Any]:
        """Points (3,), each in its link's frame, from the links' centres of mass."""
        return [_plain(self._at(link, pose(x))[4:]) for link, x in zip(links, points, strict=True)]

    def _add(self, section: str, name: str, table: dict[str, Any], others: Container[str] = ()) -> str:
        """Add a table under a valid and unused name, which others do not have either; returns the name."""
        own = self._own(name, self._tables[section], others)
        self._tables[section][own] = table
        return own

    def _at(self, link: str, place: Array, *, inverse: bool = True) -> Array:
        """From the link's frame to the one at its centre of mass, or its pose in the world."""
        if not inverse:
            return SE3.compose(place, np.concatenate([_ONE, self._centres[link]]))
        return np.concatenate([place[:4], place[4:] - self._centres[link]])

    def _own(self, name: str, taken: Container[str], others: Container[str]) -> str:
        """A valid and unused name for scene files."""
        letters = ("_" if c == "." or c.isspace() or not c.isprintable() else c for c in name[:LONGEST_NAME])
        stem = "".join(letters) or "unnamed"
        if stem.startswith("~"):
            stem = "_" + stem[1:]
        if stem in (GROUND, ENVIRONMENT):
            stem += "_"
        found, count = stem, self._alike.get(stem, 1)
        while found in taken or found in others:
            count += 1
            found = f"{stem[: LONGEST_NAME - 10]}_{count}"
        self._alike[stem] = count
        if found != name:
            self.rename(name, found)
        return found


_ONE = np.array([1.0, 0.0, 0.0, 0.0])
_REST = {"position": np.zeros(3), "rotation": _ONE}


def pose(position: ArrayLike = (0.0, 0.0, 0.0), rotation: ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> Array:
    """The pose (7,) of a position and a quaternion (4,), or roll, pitch and yaw (3,) about fixed axes."""
    given = np.asarray(rotation, dtype=float)
    if given.shape == (3,):
        roll, yaw_pitch = _turn(0, given[0]), SE3.compose(_turn(2, given[2]), _turn(1, given[1]))
        given = SE3.compose(yaw_pitch, roll)[:4]
    return np.concatenate([given / np.linalg.norm(given), np.asarray(position, dtype=float)])


def along(axis: ArrayLike, place: Array | None = None) -> Array | None:
    """A frame (7,) at ``place`` whose z axis is a direction there; None where the direction is none."""
    given = np.asarray(axis, dtype=float)
    size = float(np.linalg.norm(given))
    rotation = frame_rotation(given / size) if size > DIRECTION else None
    if rotation is None:
        return None
    turned = np.concatenate([rotation, np.zeros(3)])
    return turned if place is None else SE3.compose(place, turned)


def turned_tensor(rotation: Array, tensor: ArrayLike) -> Array:
    """A tensor (3, 3) in the axes in which its own have this rotation (4,)."""
    r = quaternion_to_matrix(rotation)
    t = np.asarray(tensor, dtype=float)
    found = r @ t @ r.T if np.any(rotation != _ONE) else t
    return 0.5 * (found + found.T)


def _turn(axis: int, angle: float) -> Array:
    out = np.zeros(7)
    out[0], out[1 + axis] = np.cos(0.5 * angle), np.sin(0.5 * angle)
    return out


def _placed(place: Array) -> dict[str, list[float]]:
    return {"position": _plain(place[4:]), "rotation": _plain(place[:4])}


def _plain(values: ArrayLike) -> Any:
    """Python's own numbers, without negative zeros."""
    return (np.asarray(values, dtype=float) + 0.0).tolist()
