"""Robots of gymnasium that fall onto a floor: time, balance of energy and overlap, here and by MuJoCo.

Both read the same file. Their contact models differ, so that motions are not compared digit by digit: each is held
against a refined run of its own, in the places of bodies at the end. Beside that stand the processor time of the run,
the share of the energy that has no place in the balance, and how deep bodies sink. MuJoCo runs at the step of the file.
"""

import time
import warnings
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import ephs
from benchmarks.report import Report, table_of
from ephs.show.charts.peer_mujoco import silent

MODELS = ("hopper", "half_cheetah", "ant", "walker2d")
UNTIL = 0.5
TOLERANCES = (1e-1, 1e-2, 1e-3)
REFINED = 1e-8
"""Tolerance of the refined run."""
FINER = 64
"""Part of MuJoCo's step that its refined run takes."""
COLUMNS = {
    "model": ("model", 1.0),
    "by": ("by", 1.0),
    "steps": ("steps", 1.0),
    "time [s]": ("seconds", 1.0),
    "times MuJoCo": ("ratio", 1.0),
    "error [mm]": ("error", 1e3),
    "energy without a place": ("lost", 1.0),
    "deepest overlap [mm]": ("overlap", 1e3),
}


def report() -> Report:
    """Run every model by both."""
    found = find_spec("gymnasium")
    if found is None or not found.submodule_search_locations:
        return Report("gymnasium is not installed", [])
    folder = Path(found.submodule_search_locations[0]) / "envs" / "mujoco" / "assets"
    rows: list[dict[str, Any]] = []
    for name in MODELS:
        other = _mujoco(folder / f"{name}.xml")
        rows += [{"model": name, **row, "ratio": row["seconds"] / other["seconds"]} for row in _ours(folder, name)]
        rows.append({"model": name, **other, "ratio": 1.0})
    return Report(table_of(rows, COLUMNS), rows)


def _ours(folder: Path, name: str) -> list[dict[str, Any]]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = ephs.load(folder / f"{name}.xml", contact=True)
    rows: list[dict[str, Any]] = []
    exact = _places(scene, ephs.simulate(scene, UNTIL, rtol=REFINED, atol=1e-2 * REFINED, audit="off"))
    for rtol in TOLERANCES:
        options: dict[str, Any] = {"rtol": rtol, "atol": 1e-2 * rtol, "audit": "off"}
        ephs.simulate(scene, UNTIL, **options)  # compiles
        start = time.process_time()
        sol = ephs.simulate(scene, UNTIL, **options)
        seconds = time.process_time() - start
        error = float(np.linalg.norm(_places(scene, sol) - exact, axis=1).max())
        deepest = max(0.0, *(-float(sol.contact(each).gap.min()) for each, _ in scene.all_contacts()))
        rows.append(
            {
                "by": f"auto, rtol {rtol:g}", "steps": int(sol.stats["steps"]), "seconds": seconds, "error": error,
                "lost": float(np.abs(sol.energy_error).max()), "overlap": deepest,
            }
        )  # fmt: skip
    return rows


def _places(scene: Any, sol: Any) -> Any:
    """(bodies, 3) at the end."""
    return np.array([sol.body(name).position[-1] for name, _ in scene.all_bodies()])


def _mujoco(file: Path) -> dict[str, Any]:
    mujoco: Any = import_module("mujoco")
    mujoco.set_mju_user_warning(silent)  # else it writes a log file into the working folder
    model = mujoco.MjModel.from_xml_path(str(file))
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    first, energies, deepest, steps = float(sum(data.energy)), list[float](), 0.0, round(UNTIL / model.opt.timestep)
    start = time.process_time()
    for _ in range(steps):
        mujoco.mj_step(model, data)
    seconds = time.process_time() - start
    mujoco.mj_resetData(model, data)
    for _ in range(steps):
        mujoco.mj_step(model, data)
        energies.append(float(sum(data.energy)))
        deepest = max(deepest, -float(data.contact.dist.min(initial=0.0)))
    places, step = np.array(data.xpos), model.opt.timestep
    mujoco.mj_resetData(model, data)
    model.opt.timestep = step / FINER
    for _ in range(FINER * steps):
        mujoco.mj_step(model, data)
    error = float(np.linalg.norm(places - data.xpos, axis=1).max())
    lost = abs(first - energies[-1])
    gross = max(abs(energy - first) for energy in energies) + abs(first)
    return {
        "by": "MuJoCo",
        "steps": steps,
        "seconds": seconds,
        "error": error,
        "lost": lost / gross,
        "overlap": deepest,
    }
