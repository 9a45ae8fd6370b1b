"""Poses of links, joints and frames of an SDF model. Source: the SDFormat specification, "Pose Frame Semantics"."""

from collections.abc import Mapping
from typing import final
from xml.etree.ElementTree import Element

import numpy as np

from ephs.mechanics.imports.draft import pose
from ephs.mechanics.imports.xml import MOST_LEVELS, numbers
from ephs.mechanics.scene.errors import Fault, did_you_mean, fault, listing
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import SE3

MODEL = "__model__"


@final
class Frames:
    """The frames of a model by name; poses are found in the model's frame."""

    def __init__(self, elements: Mapping[str, Element], faults: list[Fault]) -> None:
        self._elements, self._faults = elements, faults
        self._found: dict[str, Array] = {MODEL: pose()}

    def at(self, name: str, key: str, waiting: tuple[str, ...] = ()) -> Array:
        """The pose (7,) of a frame in the model."""
        if name in self._found:
            return self._found[name]
        if len(waiting) > MOST_LEVELS:
            self._faults.append(fault("deep", key, "frames relative to frames, and so on", most=MOST_LEVELS))
            return self._found.setdefault(name, pose())
        if name in waiting or name not in self._elements:
            if name in waiting:
                chain = " → ".join((*waiting[waiting.index(name) :], name))
                self._faults.append(fault("frame cycle", key, f"a cycle of frames {chain}"))
            else:
                hint = did_you_mean(name, self._elements, f"there are: {listing(self._elements)}")
                self._faults.append(fault("unknown frame", key, f'"{name}"', hint=hint))
            self._found[name] = pose()
            return self._found[name]
        element, own = self._elements[name], f"{self._elements[name].tag}s.{name}.pose"
        given = element.find("pose")
        base = "" if given is None else (given.get("relative_to") or given.get("frame") or "")
        if not base:
            base = _default(element)
        whole = SE3.compose(self.at(base, own, (*waiting, name)), read_pose(element, own, self._faults))
        return self._found.setdefault(name, whole)


def read_pose(element: Element, key: str, faults: list[Fault]) -> Array:
    """The numbers of an element's pose, (7,), whatever they are relative to."""
    given = element.find("pose")
    if given is None or not (given.text or "").strip():
        return pose()
    if given.get("rotation_format", "euler_rpy") == "quat_xyzw":
        x = numbers(given.text, 7, key, faults)
        rotation = np.array([x[6], *x[3:6]])
        if not np.linalg.norm(rotation) > 0.0:
            faults.append(fault("direction", key, "a quaternion of zeros"))
            return pose(x[:3])
        return pose(x[:3], rotation)
    x = numbers(given.text, 6, key, faults)
    turns = np.radians(x[3:]) if given.get("degrees", "").strip() in ("true", "1") else np.array(x[3:])
    return pose(x[:3], turns)


def _default(element: Element) -> str:
    """Default reference of a pose: a joint's child, the frame that it is attached to, the model."""
    if element.tag == "joint":
        child = (element.findtext("child") or "").strip()
        return MODEL if child == "world" else child
    return element.get("attached_to") or MODEL if element.tag == "frame" else MODEL
