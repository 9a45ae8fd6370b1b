"""The initial value problem of a scene."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.mechanics.constraints.holding import ConfiguredMechanism
from ephs.mechanics.constraints.redundancy import explain
from ephs.mechanics.motion.motion import SceneMotion
from ephs.mechanics.motion.views import view_of
from ephs.mechanics.runs.assembling import check_closed
from ephs.mechanics.runs.pushes import add_to, part_of, scene_signals
from ephs.mechanics.scene.build import (
    drive_ports,
    initial_state,
    scene_inputs,
    scene_names,
    scene_system,
    wrench_port,
)
from ephs.mechanics.scene.document import scene_to_text
from ephs.mechanics.scene.errors import SceneError, fault
from ephs.mechanics.scene.meant import is_shaky
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.state import scale_of
from ephs.operad import Path
from ephs.operad.collector import paused_collector
from ephs.semantics.bundles.bundle import Reference
from ephs.semantics.bundles.errors import AssemblyError
from ephs.semantics.systems.kept import once
from ephs.solve.posing.errors import OptionError, no_model
from ephs.solve.posing.problem import Problem

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

NEAR = 1e-6
"""Difference of a joint's rate to that of its law that counts as rounding of given numbers, relative to these, and to
what the law gains in a second."""


def check_motions(scene: Scene, t0: float) -> None:
    """Refuse a start at t0 s in whose state joints do not move as their motion laws do then.

    Raises
    ------
    OptionError
        It names the joint.
    SceneError
        It names the joint; the run would start at 0.
    """
    for name, joint in scene.all_joints():
        if joint.motion is None:
            continue
        rate, law = float(joint.rate[0]), joint.motion.rate(t0)
        if abs(rate - law) > NEAR * max(abs(rate), abs(law), abs(joint.motion.acceleration(t0))):
            if t0 == 0.0:
                found, who = f"a rate of {rate:.9g}", f"{joint.body1} and {joint.body2}"
                raise SceneError(
                    scene.name, [fault("motion differs", f"joints.{name}.motion", found, motion=f"{law:.9g}", who=who)]
                )
            raise OptionError(
                "t0", t0, f"a time at which the motion of joints.{name} has the rate {rate:.6g} of the initial state, "
                f"not {law:.6g}; simulate from 0, and start from scene.at(solution, {t0:g})",
            )  # fmt: skip


@paused_collector()
def problem_of_scene(
    scene: Scene,
    initial: Mapping[str, "ArrayLike"] | None = None,
    inputs: Mapping[Any, Any] | None = None,
    t0: float = 0.0,
) -> Problem:
    """The initial value problem of a scene; ``initial`` states are those at t0 s."""
    if not isinstance(scene, Scene):
        raise no_model(scene)
    view = view_of(scene)
    forces, wrenches, others = scene_signals(scene, inputs or {}, view)
    system = scene_system(scene, driven=frozenset(forces), wrenches=frozenset(wrenches))
    state = initial_state(scene)
    if initial:
        changed = system.state(initial)
        state |= {Path.of(path): changed[Path.of(path)] for path in initial}
    signals = dict(scene_inputs(scene))
    for name, force in forces.items():
        for port, where in drive_ports(scene.joint(name)):
            extra = part_of(force, where)
            if port in signals and signals[port].effort:
                raise AssemblyError(
                    "input", f"joints.{name}", found="a force", expected="none: its motion is prescribed"
                )
            add_to(signals, port, extra)
    signals |= others
    signals |= {wrench_port(body): wrench for body, wrench in wrenches.items()}
    world = scene.world
    problem = Problem(
        scene.name,
        system,
        system.descriptor(),
        state,
        signals,
        Reference(world.temperature, world.pressure),
        motion=lambda solution: SceneMotion(scene, solution),
        scene=scene,
        document=lambda: once(scene, "text", lambda: scene_to_text(scene)),
        constraints=lambda: ConfiguredMechanism.of(scene),
        dependences=lambda: explain(scene),
        shaky=lambda: is_shaky(scene),
        length=scale_of(scene).length,
        view=view,
        names=scene_names(scene),
    )
    if initial:
        scale, mass = scale_of(scene), sum(body.mass for _, body in scene.all_bodies())
        turning = (mass or 1.0) * scale.rate * scale.length**2
        check_closed(problem, turning / np.array([1.0] * 3 + [scale.length] * 3), t0)
    return problem
