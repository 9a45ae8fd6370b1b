"""Models of an SDF within each other, and the poses of their links, joints and frames.

Source: the SDFormat specification, "Pose Frame Semantics" and "Model Composition". A name ``inner::link`` is that of a
link in a model within; ``__model__`` is a model's own frame, and as an end of a joint its canonical link.
"""

from typing import final

import numpy as np

from ephs.mechanics.imports.draft import WORLD, pose
from ephs.mechanics.imports.elements import named
from ephs.mechanics.imports.file_element import FileElement
from ephs.mechanics.imports.xml import MOST_LEVELS, numbers
from ephs.mechanics.scene.errors import Fault, did_you_mean, fault, listing
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3

MODEL, GROUND, INSIDE = "__model__", "world", "::"
_TRUE = ("true", "1")
End = tuple["Scope", str] | None
"""A link by its model and its name there; None for the world."""


@final
class Scope:
    """A model, or the world, with the models in it.

    Parameters
    ----------
    prefix
        Of the names of its links and joints in the scene.
    holds
        Whether it is static, by itself or by a model around it.
    """

    def __init__(
        self, element: FileElement, parent: "Scope | None", prefix: str, grounded: bool, faults: list[Fault]
    ) -> None:
        self.element, self.parent, self.prefix, self.grounded = element, parent, prefix, grounded
        self._faults = faults
        self.name = element.get("name") or ""
        self._canonical_link = element.get("canonical_link") or ""
        self.holds = is_true(element, "static") or (parent is not None and parent.holds)
        self.links, self.joints, self.frames = (named(element, tag, faults) for tag in ("link", "joint", "frame"))
        own = MODEL if parent is not None else GROUND
        self._attached = {name: frame.get("attached_to") or own for name, frame in self.frames.items()}
        self.models: dict[str, Scope] = {}
        for name, model in (named(element, "model", faults) if parent is not None else {}).items():
            self.models[name] = Scope(model, self, f"{prefix}{name}{INSIDE}", grounded, faults)
        self._found: dict[str, Array] = {own: pose()}

    def everything(self) -> list["Scope"]:
        """The model and those in it."""
        return [self, *(each for model in self.models.values() for each in model.everything())]

    def place(self) -> Array:
        """The pose (7,) of the model's frame in the world."""
        if self.parent is None:
            return pose()
        return SE3.compose(self.parent.place(), self.parent.at(self.name, f"{self.key('models')}.pose"))

    def key(self, section: str, name: str = "") -> str:
        """The place of a link, joint or frame in messages."""
        whole = f"{self.prefix}{name}" if name else self.prefix.removesuffix(INSIDE)
        return f"{section}.{whole}" if whole else section

    def link_pose(self, name: str) -> Array:
        """The pose (7,) of a link in the world."""
        return SE3.compose(self.place(), self.at(name, f"{self.key('links', name)}.pose"))

    def at(self, name: str, key: str, waiting: tuple[str, ...] = ()) -> Array:
        """The pose (7,) of a frame in the model's."""
        if name in self._found:
            return self._found[name]
        outer, _, inner = name.partition(INSIDE)
        if inner and outer in self.models and name not in self._elements():
            there = self.models[outer].at(inner, key)
            return self._found.setdefault(name, SE3.compose(self.at(outer, key, waiting), there))
        if len(waiting) > MOST_LEVELS:
            self._faults.append(fault("deep", key, "frames relative to frames, and so on", most=MOST_LEVELS))
            return self._found.setdefault(name, pose())
        known = self._elements()
        if name in waiting or name not in known:
            if name in waiting:
                chain = " → ".join((*waiting[waiting.index(name) :], name))
                self._faults.append(fault("frame cycle", key, f"a cycle of frames {chain}"))
            else:
                hint = did_you_mean(name, known, f"there are: {listing(known)}")
                self._faults.append(fault("unknown frame", key, f'"{name}"', hint=hint))
            return self._found.setdefault(name, pose())
        element, own = known[name], f"{self.key(f'{known[name].tag}s', name)}.pose"
        base = _base(element) or self._default(name, element)
        whole = SE3.compose(self.at(base, own, (*waiting, name)), read_pose(element, own, self._faults))
        if name in self.models and (frame := element.get("placement_frame")):
            placed = self.models[name].at(frame, f"{self.models[name].key('models')}.placement_frame")
            whole = SE3.compose(whole, SE3.inverse(placed))
        return self._found.setdefault(name, whole)

    def link_of(self, name: str, key: str, depth: int = 0) -> "End":
        """The link that a name of a joint's end stands for, with its model; None for the world, or with a fault."""
        known = self._elements()
        if name in self.links:
            return self, name
        if depth > MOST_LEVELS:
            self._faults.append(fault("deep", key, "frames attached to frames, and so on", most=MOST_LEVELS))
        if name == GROUND or depth > MOST_LEVELS:
            return None
        outer, _, inner = name.partition(INSIDE)
        if name == MODEL and self.parent is not None:
            return self._canonical(key, depth)
        if name in self.models:
            return self.models[name].link_of(MODEL, key, depth + 1)
        if inner and outer in self.models:
            return self.models[outer].link_of(inner, key, depth + 1)
        if name in self.frames:
            return self.link_of(self._attached[name], key, depth + 1)
        if name in self.joints:
            return self.link_of((self.joints[name].findtext("child") or "").strip(), key, depth + 1)
        hint = did_you_mean(name, known, f"there are: {listing(known)}")
        self._faults.append(fault("unknown link", key, f'"{name}"' if name else "nothing", hint=hint))
        return None

    def _canonical(self, key: str, depth: int) -> "End":
        if self._canonical_link:
            return self.link_of(self._canonical_link, key, depth + 1)
        if self.links:
            return self, next(iter(self.links))
        for model in self.models.values():
            return model.link_of(MODEL, key, depth + 1)
        self._faults.append(fault("no link", self.key("models"), "none"))
        return None

    def _elements(self) -> dict[str, FileElement]:
        return {**{k: m.element for k, m in self.models.items()}, **self.frames, **self.joints, **self.links}

    def _default(self, name: str, element: FileElement) -> str:
        """Default reference of a pose: a joint's child, the frame that it is attached to, the model."""
        own = MODEL if self.parent is not None else GROUND
        if element.tag == "joint":
            child = _end(element, "child")
            return own if child == GROUND else child
        return self._attached[name] if element.tag == "frame" else own


def world_of(root: FileElement, faults: list[Fault]) -> Scope:
    """The world of a file with its models. A model that moves alone gives its links no prefix; static ones beside
    others that move are the ground."""
    worlds = root.findall("world")
    whole = Scope(worlds[0] if worlds else root, None, "", False, faults)
    models = named(whole.element, "model", faults)
    moving = [name for name, model in models.items() if not is_true(model, "static")] or list(models)
    if not models or len(worlds) > 1 or (worlds and root.has("model")):
        found = f"{len(worlds)} worlds and {len(root.findall('model'))} models beside them" if models else "none"
        faults.append(fault("one model", "model", found))
    for name, model in models.items():
        prefix = f"{name}_" if name not in moving else f"{name}{INSIDE}" if len(moving) > 1 else ""
        whole.models[name] = Scope(model, whole, prefix, name not in moving, faults)
    return whole


def joint_ends(scope: Scope, name: str) -> tuple["End", "End"]:
    """The links of a joint, parent and child; None for the world."""
    ends = [
        scope.link_of(_end(scope.joints[name], end), f"{scope.key('joints', name)}.{end}")
        for end in ("parent", "child")
    ]
    first, second = (None if end is None or end[0].grounded else end for end in ends)
    return first, second


def global_name(end: "End") -> str:
    """The name of a link in the draft."""
    return WORLD if end is None else f"{end[0].prefix}{end[1]}"


def is_true(element: FileElement, word: str) -> bool:
    """Whether a child says true."""
    return (element.findtext(word) or "").strip().lower() in _TRUE


def read_pose(element: FileElement, key: str, faults: list[Fault]) -> Array:
    """The numbers of an element's pose, (7,), whatever they are relative to; ``<origin pose=…>`` in SDF 1.0."""
    given = element.find("pose")
    older = element.find("origin") if given is None else None
    text = (older.get("pose") if older is not None else None) if given is None else given.text
    if not (text or "").strip():
        return pose()
    if given is not None and (given.get("rotation_format") or "euler_rpy") == "quat_xyzw":
        x = numbers(text, 7, key, faults)
        rotation = np.array([x[6], *x[3:6]])
        if not np.linalg.norm(rotation) > 0.0:
            faults.append(fault("direction", key, "a quaternion of zeros"))
            return pose(x[:3])
        return pose(x[:3], rotation)
    x = numbers(text, 6, key, faults)
    degrees = given is not None and (given.get("degrees") or "").strip().lower() in _TRUE
    return pose(x[:3], np.radians(x[3:]) if degrees else np.array(x[3:]))


def _base(element: FileElement) -> str:
    given = element.find("pose")
    return "" if given is None else (given.get("relative_to") or given.get("frame") or "")


def _end(joint: FileElement, end: str) -> str:
    """The name of an end of a joint; in SDF 1.0 it is an attribute ``link``."""
    given = joint.find(end)
    return "" if given is None else ((given.text or "").strip() or given.get("link") or "")
