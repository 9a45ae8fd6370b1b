"""Forces on a scene's joints, bodies and markers, as users give them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ephs.mechanics.build import component_path
from ephs.mechanics.scene.model import Marker, Scene
from ephs.mechanics.signals import signal
from ephs.mechanics.solve.problem import Signal
from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.semantics.errors import AssemblyError
from ephs.semantics.spaces.rotations import quaternion_to_matrix

__all__ = ["part_of", "scene_signals", "sum_of"]


def part_of(whole: Signal, where: slice) -> Signal:
    """Some of a signal's numbers."""
    if whole.constant:
        return Signal(whole.at(0.0, {})[where])
    return Signal(lambda t, state: whole.at(t, state)[where])


def sum_of(one: Signal, other: Signal) -> Signal:
    """The sum of two signals."""
    if one.constant and other.constant:
        return Signal(one.at(0.0, {}) + other.at(0.0, {}))
    return Signal(lambda t, state: one.at(t, state) + other.at(t, state))


def scene_signals(scene: Scene, inputs: Mapping[str, Any]) -> tuple[dict[str, Signal], dict[str, Signal]]:
    """Forces on joints and wrenches on bodies, by name, of what a user gives by joint, body and marker.

    Raises
    ------
    AssemblyError
        There is no such joint, body or marker.
    """
    forces: dict[str, Signal] = {}
    wrenches: dict[str, Signal] = {}
    joints, bodies, markers = dict(scene.all_joints()), dict(scene.all_bodies()), dict(scene.all_markers())
    for key, value in inputs.items():
        kind, _, name = key.partition(".")
        if kind == "joints" and name in joints:
            forces[name] = signal(value, effort=False, name=key, size=joints[name].dim)
        elif kind == "bodies" and name in bodies:
            given = signal(value, effort=False, name=key, size=6)
            wrenches[name] = sum_of(wrenches[name], given) if name in wrenches else given
        elif kind == "markers" and name in markers and markers[name].body in bodies:
            given = signal(value, effort=False, name=key, size=3)
            body, push = markers[name].body, _at_marker(markers[name], given)
            wrenches[body] = sum_of(wrenches[body], push) if body in wrenches else push
        else:
            known = (
                [f"joints.{n}" for n in joints] + [f"bodies.{n}" for n in bodies] + [f"markers.{n}" for n in markers]
            )
            raise AssemblyError("unknown-input", key, expected=", ".join(known))
    return forces, wrenches


def _at_marker(marker: Marker, force: Signal) -> Signal:
    """A force in world axes at a marker as a wrench in the body's frame."""
    pose = component_path("bodies", marker.body) / "pe" / "q"

    def wrench(t: float, state: Mapping[Path, Array]) -> Array:
        own = quaternion_to_matrix(state[pose][:4]).T @ force.at(t, state)
        return np.concatenate([np.cross(marker.at, own), own])

    return Signal(wrench)
