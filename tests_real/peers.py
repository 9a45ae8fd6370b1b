"""Model files of other programs, read and compared with MuJoCo or Pinocchio: `make peers`, `make peers OF="FOLDER …"`.

Files are those of installed packages that have models, or those of the folders given, and none is kept here. Each falls
into one class: equal accelerations at drawn states; refused with a reason; different with a reason, which is a line of
what is not modelled; different without a reason, which is a fault of the import; refused by the peer itself; without a
peer. Limits, contacts, dry friction and equality constraints are left out on both sides: they are soft in MuJoCo.
"""

import argparse
import sys
import warnings
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

import ephs
from ephs.semantics.spaces import SO3
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from tests.mechanics.imports.pinocchio_robots import compare, robot

PACKAGES = ("mujoco", "dm_control", "gymnasium", "gymnasium_robotics", "example_robot_data", "robot_descriptions")
"""Packages that have models, if they are installed."""
EQUAL, REFUSED, REASON, WRONG, PEER, ALONE = CLASSES = (
    "equal", "refused", "different with a reason", "different without a reason", "refused by the peer",
    "without a peer",
)  # fmt: skip
TOLERANCE = 1e-8
"""Largest difference of accelerations, relative to the largest, beside rounding times the condition of the inertia."""
STATES, MOST_JOINTS = 3, 150
ASIDE = (
    "contacts", "limits of", "range of tendons", "sensors", "keyframe", "shapes", "softness", "equality constraints",
    "inactive equality", "activation of", "height fields", "limit/velocity", "renamed", "solref", "solimp", "margin",
)  # fmt: skip
"""Beginnings of notes that do not concern what is compared."""


def files(folders: list[Path]) -> Iterator[tuple[str, Path]]:
    """The model files below folders, each with the name of its folder."""
    for folder in folders:
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".urdf", ".sdf") or (path.suffix == ".xml" and _root(path) == "mujoco"):
                yield folder.name, path


def _root(path: Path) -> str:
    try:
        return next(ElementTree.iterparse(path, ("start",)))[1].tag
    except (ElementTree.ParseError, StopIteration, OSError):
        return ""


def judged(path: Path) -> tuple[str, str]:
    """The class of a file, and the reason."""
    urdf, mjcf = path.suffix == ".urdf", path.suffix == ".xml"
    peer = None
    try:
        peer = robot(path, "fixed") if urdf else mujoco.MjModel.from_xml_path(str(path)) if mjcf else None
    except (ValueError, RuntimeError) as error:
        return PEER, str(error).splitlines()[0]
    try:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            scene = ephs.load(path)
    except ephs.SceneError as error:
        return REFUSED, str(error.faults[0])
    lines = [line for each in said if isinstance(each.message, ephs.ModelWarning) for line in each.message.lines]
    left = [line for line in lines if not line.removeprefix("not modelled: ").startswith(ASIDE)]
    if peer is None:
        return ALONE, ""
    if len(scene.joints) > MOST_JOINTS:
        return REFUSED, f"left out here: more than {MOST_JOINTS} joints take minutes to compile"
    if not peer.nv:
        return EQUAL, "nothing moves"
    try:
        apart = compare(scene, peer, np.random.default_rng(7), STATES) if urdf else _apart(scene, peer)
    except ephs.SimulationError as error:
        return REFUSED, f"motion: {error}".splitlines()[0]
    if apart <= TOLERANCE:
        return EQUAL, ""
    if mjcf:  # what is named is switched off in the peer: is it the reason?
        peer.opt.density = peer.opt.viscosity = 0.0
        peer.actuator_forcelimited[:] = peer.jnt_actfrclimited[:] = 0
        peer.body_gravcomp[:] = 0.0
        left = left if _apart(scene, peer) <= TOLERANCE else [line for line in left if not _switched(line)]
    return (REASON, "; ".join(line[:80] for line in left)) if left else (WRONG, f"accelerations differ by {apart:.1e}")


def _switched(line: str) -> bool:
    return line.removeprefix("not modelled: ").startswith(("options: ", "forcerange", "actuatorfrcrange", "gravcomp"))


def _apart(scene: ephs.Scene, model: mujoco.MjModel) -> float:
    """Largest difference of accelerations at drawn states, relative to the largest, beyond rounding."""
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data, rng, worst = mujoco.MjData(model), np.random.default_rng(7), 0.0
    tree = list(scene.joints)[: sum(max(1, int(count)) for count in model.body_jntnum[1:])]
    moving = [name for name in tree if scene.joints[name].kind != "fixed"]
    if len(moving) != model.njnt:
        return np.inf  # a hinge and a slide that are one screw
    joints = {name: replace(scene.joints[name], dry=None, motion=None) for name in tree}
    gears = {name: gear for name, gear in scene.gears.items() if gear.stiffness}
    dynamics = ephs.dynamics(replace(scene, joints=joints, gears=gears))
    for _ in range(STATES):
        mujoco.mj_resetData(model, data)
        coordinates, rates = defaultdict(np.ndarray), {}
        for j, name in enumerate(moving):
            q, v, d = int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j]), scene.joints[name].dim
            x, u = 0.5 * rng.standard_normal(d), rng.standard_normal(d)
            coordinates[name], rates[name] = x, u
            if d == 6:
                start, turn = data.qpos[q + 3 : q + 7].copy(), SO3.exp(x[:3])
                data.qpos[q : q + 3] += quaternion_to_matrix(start) @ x[3:]
                data.qpos[q + 3 : q + 7] = SO3.compose(start, turn)
                data.qvel[v : v + 3] = quaternion_to_matrix(data.qpos[q + 3 : q + 7]) @ u[3:]
                data.qvel[v + 3 : v + 6] = u[:3]
            elif d == 3:
                data.qpos[q : q + 4] = SO3.compose(data.qpos[q : q + 4].copy(), SO3.exp(x))
                data.qvel[v : v + 3] = u
            else:
                data.qpos[q] += x[0]
                data.qvel[v] = u[0]
        mujoco.mj_forward(model, data)
        found = dynamics.acceleration(dynamics.state(coordinates, rates))
        expected, own = data.qacc.copy(), np.zeros(model.nv)
        for j, name in enumerate(moving):
            q, v, a = int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j]), found[name]
            if len(a) == 6:
                u = rates[name]
                a = np.array(
                    [*(quaternion_to_matrix(data.qpos[q + 3 : q + 7]) @ (a[3:] + np.cross(u[:3], u[3:]))), *a[:3]]
                )
            own[v : v + len(a)] = a
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        rounding = 100.0 * np.finfo(float).eps * (float(np.linalg.cond(mass)) if model.nv else 1.0)
        worst = max(
            worst, np.abs(own - expected).max(initial=0.0) / (np.abs(expected).max(initial=0.0) or 1.0) - rounding
        )
    return worst


def main() -> int:
    """Print the table, the reasons, and every file that is different without one; 1 if there is such a file."""
    mujoco.set_mju_user_warning(lambda _: None)  # otherwise it writes a log file to the working directory
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="*", type=Path, help="folders with models; those of packages unless given")
    given = parser.parse_args().folders
    places = [find_spec(package) for package in PACKAGES]
    found = given or [Path(place.submodule_search_locations[0]) for place in places if place and place.origin]
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for folder, path in files(found):
        kind, reason = judged(path)
        counts[f"{folder} {path.suffix}"][kind] += 1
        print(f"{kind:28} {path.name}: {reason}", flush=True)
    print("\n| models | " + " | ".join(CLASSES) + " |\n| --- |" + " --- |" * len(CLASSES))
    for name, row in counts.items():
        print(f"| {name} | " + " | ".join(str(row[kind]) for kind in CLASSES) + " |")
    return int(any(row[WRONG] for row in counts.values()))


if __name__ == "__main__":
    sys.exit(main())
