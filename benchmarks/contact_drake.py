"""Scenes of contact by Drake, if its wheel is installed: discrete steps of the same MJCF.

Drake ignores the file's step and the rates of key frames, which are given here; of springs and other details of the
gripper and the robots, too, which are left out. Its error is held against a refined run of its own, as those of all.
"""

import time
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any
from xml.etree import ElementTree

import numpy as np

STEP, FINER = 1e-3, 16
"""Step in s, Drake's usual one, and the part of it that the refined run takes."""
SCENES = {"stack of ten", "ten boxes", "50 balls", "wheel"}


def beside(name: str, mjcf: str, times: Any, repeats: int) -> list[dict[str, Any]]:
    """A row of the table of `benchmarks.contact`, or none; places are compared at these times in s."""
    if find_spec("pydrake") is None or name not in SCENES:
        return []
    runs = [_ran(mjcf, times, STEP) for _ in range(repeats)]
    exact = _ran(mjcf, times, STEP / FINER)["places"]
    best = min(runs, key=lambda one: one["seconds"])
    return [{
        "by": "Drake", "steps": round(times[-1] / STEP), "start": best["start"], "seconds": best["seconds"],
        "error": float(np.linalg.norm(best["places"] - exact, axis=2).max()), "lost": best["lost"], "overlap": np.nan,
    }]  # fmt: skip


def _ran(mjcf: str, times: Any, step: float) -> dict[str, Any]:
    drake: Any = import_module("pydrake.all")
    begin = time.process_time()
    builder = drake.DiagramBuilder()
    plant, _ = drake.AddMultibodyPlantSceneGraph(builder, step)
    drake.Parser(plant).AddModelsFromString(mjcf.replace("<mujoco>", '<mujoco model="scene">', 1), "xml")
    plant.Finalize()
    simulator = drake.Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    bodies = [plant.get_body(drake.BodyIndex(i)) for i in range(1, plant.num_bodies())]
    key = ElementTree.fromstring(mjcf).find("keyframe/key")
    _set_rates(
        drake, plant, context, bodies, [float(x) for x in key.get("qvel", "").split()] if key is not None else []
    )
    simulator.Initialize()
    start = time.process_time() - begin

    def energy() -> float:
        return float(plant.CalcPotentialEnergy(context) + plant.CalcKineticEnergy(context))

    first, seconds, places = energy(), 0.0, list[Any]()
    for until in times:
        begin = time.process_time()
        simulator.AdvanceTo(until)
        seconds += time.process_time() - begin
        places.append([plant.EvalBodyPoseInWorld(context, body).translation() for body in bodies])
    last = energy()
    return {
        "start": start, "seconds": seconds, "lost": abs(last - first) / (abs(last - first) + abs(first)),
        "places": np.array(places),
    }  # fmt: skip


def _set_rates(drake: Any, plant: Any, context: Any, bodies: Sequence[Any], rates: Sequence[float]) -> None:
    """MuJoCo's rates: of a free body its velocity in the world, then its angular velocity in the body."""
    at = 0
    for body in bodies:
        if not body.is_floating_base_body():
            at += 1  # a slide
            continue
        velocity, turn = np.array(rates[at : at + 3]), np.array(rates[at + 3 : at + 6])
        pose = plant.EvalBodyPoseInWorld(context, body)
        plant.SetFreeBodySpatialVelocity(
            context, body, drake.SpatialVelocity(pose.rotation().matrix() @ turn, velocity)
        )
        at += 6
