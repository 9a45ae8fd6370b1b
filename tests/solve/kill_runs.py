"""Kill runs at random moments and let them go on: ``python kill_runs.py FOLDER COUNT SEED``; prints one line a run.

Runs are forked from here, so that what costs is the run and not the start of a process.
"""

import os
import random
import signal
import sys
import time
from pathlib import Path

import numpy as np

import ephs
from ephs.solve.running import journal

ROOT = Path(__file__).resolve().parents[2]
RUNS = (
    {"method": "natural", "step": 5e-4},
    {"method": "rk87", "rtol": 1e-12, "atol": 1e-12},
    {"method": "radau", "rtol": 1e-8},
    {"method": "natural4", "step": 2e-3, "save_at": np.linspace(0.0, 1.0, 333)},
)


def arrays(solution: ephs.Solution) -> list[np.ndarray]:
    """Everything that a run gives but the time that it took."""
    return [solution.t, *solution.states.values(), solution.energy, solution.heat, solution.energy_error]


def killed_after(seconds: float, work) -> int:
    """Fork, work there, and kill it after so many seconds; what ended it, 0 where it had done its work."""
    child = os.fork()
    if not child:
        work()
        os._exit(0)
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    return os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0


def read(file: Path) -> np.ndarray:
    """The times that a killed run left; none where it was killed before it had said whose it is."""
    try:
        return ephs.load_solution(file).t
    except (FileNotFoundError, ephs.OptionError):
        assert not file.exists() or file.stat().st_size < 10_000
        return np.zeros(0)


def main(folder: Path, count: int, seed: int) -> int:
    """Runs that were killed are read, then go on; both must be what an undisturbed run gives."""
    journal.EVERY = 0.005
    draw = random.Random(seed)
    scene = ephs.load(ROOT / "scenes/slider-crank.toml")
    known: dict[int, tuple[list[np.ndarray], float]] = {}
    wrong = 0
    for number in range(count):
        kind = number % len(RUNS)
        options, file = RUNS[kind], folder / f"run-{number}.journal"

        def work(file=file, options=options) -> ephs.Solution:
            return ephs.simulate(scene, 1.0, journal=file, **options)

        if kind not in known:
            work(folder / f"first-{kind}.journal")
            begin = time.perf_counter()  # how long a run takes here, so that the moments to kill it lie within it
            known[kind] = arrays(ephs.simulate(scene, 1.0, **options)), 1.5 * (time.perf_counter() - begin)
        whole, spent = known[kind]
        ended = killed_after(draw.uniform(0.0, spent), work)
        there = read(file)
        prefix = np.array_equal(there, whole[0][: there.size])
        same = all(np.array_equal(a, b) for a, b in zip(whole, arrays(work()), strict=True))
        wrong += not (prefix and same)
        print(options["method"], ended, there.size, whole[0].size, prefix, same, flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])))
