"""Robots of gymnasium that fall onto a floor, and scenes of contact: time, balance of energy and overlap, by all.

All read the same models. Contact laws differ, so that motions are not compared digit by digit: each is held against a
refined run of its own, in the places of bodies at twenty times: what rests at the end may have moved wrongly before.
Errors in contact depend on where in a step surfaces meet, so they are medians over runs under slightly different
gravity. Beside that stand processor time, the share of the energy that has no place in the balance, and how deep bodies
sink. MuJoCo runs at the step of the file, and at shorter ones: what its error is in the time that `ephs` takes lies
between. The time of steps is that of the calls of compiled code, with the set-up of
derivatives; all else of a run is its start.
"""

import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import ephs
from benchmarks import contact_drake
from benchmarks.peers.mujoco import silent
from benchmarks.report import Report, table_of
from benchmarks.touching import SCENES
from ephs.mechanics.methods.marching import March
from ephs.mechanics.scene.parameters import varied

MODELS = ("hopper", "half_cheetah", "ant", "walker2d", "humanoid")
UNTIL = 0.5
"""End of robots in s."""
TOLERANCES = ((1e-1, 1e-3), (1e-2, 1e-4), (2e-3, 1e-4), (1e-3, 1e-5), (1e-2, 1e-8))
"""rtol and atol: near rest, errors are allowed by the latter."""
REFINED = 1e-7
"""Tolerance of the refined run."""
SHORTER = (1, 2, 4, 8, 16)
"""Parts of the file's step that MuJoCo takes."""
FINER = 128
"""The part that its refined run takes."""
TIMES = 20
"""Number of times of a run at which places are compared."""
GRAVITIES = (0.98, 0.99, 1.0, 1.01, 1.02)
"""Factors of gravity of the runs whose median error counts."""
REPEATS = 3
COLUMNS = {
    "model": ("model", 1.0),
    "by": ("by", 1.0),
    "steps": ("steps", 1.0),
    "start [ms]": ("start", 1e3),
    "time [ms]": ("seconds", 1e3),
    "times MuJoCo": ("ratio", 1.0),
    "error [mm]": ("error", 1e3),
    "MuJoCo's in this time [mm]": ("rival", 1e3),
    "energy without a place": ("lost", 1.0),
    "deepest overlap [mm]": ("overlap", 1e3),
}


def report() -> Report:
    """Run every model by `ephs`, by MuJoCo, and scenes of contact by Drake where it is installed."""
    rows: list[dict[str, Any]] = []
    for file, scene in robots(MODELS):
        rows += _beside(file.stem, scene, file.read_text(encoding="utf-8"), UNTIL)
    if not rows:
        return Report("gymnasium is not installed", [])
    with tempfile.TemporaryDirectory() as here:
        for made in SCENES:
            given, file = made(), Path(here) / "scene.toml"
            file.write_text(given.scene, encoding="utf-8")
            rows += _beside(given.name, ephs.load(file), given.mjcf, given.until)
    return Report(table_of(rows, COLUMNS), rows)


def robots(names: Sequence[str]) -> Iterator[tuple[Path, Any]]:
    """Files and scenes, with contacts, of gymnasium's robots; none where it is not installed."""
    found = find_spec("gymnasium")
    folder = next(iter((found and found.submodule_search_locations) or ()), None)
    for name in names if folder is not None else ():
        file = Path(folder or "") / "envs" / "mujoco" / "assets" / f"{name}.xml"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield file, ephs.load(file, contact=True)


def _beside(name: str, scene: Any, mjcf: str, until: float) -> list[dict[str, Any]]:
    others, times = _mujoco(mjcf, until)
    rows = [*_ours(scene, until, times), *contact_drake.beside(name, mjcf, times, REPEATS)]
    reached = np.log([[other["seconds"], other["error"]] for other in others]).T
    for row in rows:
        row["rival"] = float(np.exp(np.interp(np.log(row["seconds"]), *reached, left=np.nan, right=np.nan)))
    least = others[0]["seconds"]
    return [{"model": name, "ratio": row["seconds"] / least, "rival": np.nan, **row} for row in [*rows, *others]]


def _least(run: Callable[[], Any]) -> float:
    """Processor time in s of the fastest of some runs; of one where that takes long."""
    return min(_times(run))


def _times(run: Callable[[], Any]) -> list[float]:
    found: list[float] = []
    while len(found) < REPEATS and sum(found) < 1.0:
        start = time.process_time()
        run()
        found.append(time.process_time() - start)
    return found


@contextmanager
def _advancing() -> Iterator[list[float]]:
    """Processor times in s of the calls that take steps."""
    found, advance = list[float](), March.advance

    def timed(self: March, steps: int) -> bool:
        start = time.process_time()
        try:
            return advance(self, steps)
        finally:
            found.append(time.process_time() - start)

    March.advance = timed
    try:
        yield found
    finally:
        March.advance = advance


def _ours(scene: Any, until: float, times: Any) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    weight, fine = scene.world.gravity[2], {"rtol": REFINED, "atol": 1e-2 * REFINED}
    several = [varied(scene, {"world.gravity[2]": factor * weight}) for factor in GRAVITIES]
    exact = [_places(one, times, fine) for one in several]
    for rtol, atol in TOLERANCES:
        options: dict[str, Any] = {"rtol": rtol, "atol": atol, "audit": "off"}
        sol = ephs.simulate(scene, until, **options)  # compiles
        runs: list[tuple[float, float]] = []  # steps, all else

        def run(options: dict[str, Any] = options, runs: list[tuple[float, float]] = runs) -> None:
            begin = time.process_time()
            with _advancing() as found:
                ephs.simulate(scene, until, save_at=np.array([until]), **options)
            runs.append((sum(found), time.process_time() - begin - sum(found)))

        _times(run)
        places = [_places(one, times, options) for one in several]
        deepest = max(0.0, *(-float(sol.contact(each).gap.min()) for each, _ in scene.all_contacts()))
        rows.append({
            "by": f"{sol.stats['method']}, {rtol:g}, {atol:g}", "steps": int(sol.stats["steps"]),
            "start": min(other for _, other in runs), "seconds": min(steps for steps, _ in runs),
            "error": _median(places, exact), "lost": float(np.abs(sol.energy_error).max()), "overlap": deepest,
        })  # fmt: skip
    return rows


def _places(scene: Any, times: Any, options: dict[str, Any]) -> Any:
    """(bodies, times, 3)."""
    sol = ephs.simulate(scene, times[-1], save_at=times, **{**options, "audit": "off"})
    return np.array([sol.body(name).position for name, _ in scene.all_bodies()])


def _median(runs: list[Any], exact: list[Any]) -> float:
    """Over runs, of the largest error of a body's place."""
    return float(np.median([np.linalg.norm(one - other, axis=2).max() for one, other in zip(runs, exact, strict=True)]))


def _mujoco(text: str, until: float) -> tuple[list[dict[str, Any]], Any]:
    """Rows of the table, and the times in s, of whole steps, at which places are compared."""
    mujoco: Any = import_module("mujoco")
    mujoco.set_mju_user_warning(silent)  # else it writes a log file into the working folder

    def made() -> tuple[Any, Any]:
        model = mujoco.MjModel.from_xml_string(text)
        model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        data = mujoco.MjData(model)
        again(model, data)
        return model, data

    def again(model: Any, data: Any) -> None:
        mujoco.mj_resetData(model, data)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)

    model, data = made()
    first, step, weight = float(sum(data.energy)), model.opt.timestep, model.opt.gravity.copy()
    steps = round(until / step)
    kept = np.unique(np.round(np.linspace(0, steps, TIMES + 1)).astype(int)[1:])

    def run(finer: int, factor: float = 1.0, after: Callable[[int], None] = lambda _: None) -> float:
        """Processor time of all steps; ``after`` is called with the number of the file's steps taken."""
        model.opt.gravity[:], model.opt.timestep = factor * weight, step / finer
        again(model, data)
        start = time.process_time()
        for taken in range(1, steps + 1):
            for _ in range(finer):
                mujoco.mj_step(model, data)
            after(taken)
        return time.process_time() - start

    def places(finer: int) -> list[Any]:
        found: list[Any] = []
        for factor in GRAVITIES:
            run(finer, factor, lambda taken: found.append(np.array(data.xpos)) if taken in kept else None)
        return list(np.split(np.array(found), len(GRAVITIES)))

    exact, start, rows = places(FINER), _least(made), list[dict[str, Any]]()
    for finer in SHORTER:
        energies, deep = list[float](), [0.0]

        def look(_: int, energies: list[float] = energies, deep: list[float] = deep) -> None:
            energies.append(float(sum(data.energy)))
            deep.append(-float(data.contact.dist.min(initial=0.0)))

        run(finer, after=look)
        gross = max(abs(energy - first) for energy in energies) + abs(first)
        rows.append({
            "by": f"MuJoCo, step/{finer}", "steps": finer * steps, "start": start,
            "seconds": min(run(finer) for _ in range(REPEATS)), "error": _median(places(finer), exact),
            "lost": abs(first - energies[-1]) / gross, "overlap": max(deep),
        })  # fmt: skip
    return rows, np.append(step * kept[:-1], until)
