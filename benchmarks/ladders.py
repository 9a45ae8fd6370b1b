"""Networks by `radau` beside SUNDIALS IDA at equal error: a ladder of coils, a wall and a plate of heat capacities.

IDA (package scikit-sundae, if it is installed) has the equations written by hand as array expressions, with a banded
Jacobian, and counts no heat, entropy or balance; its own run at 1e-10 is the reference of both. Seconds are of the
processor, of the integration alone; each network is measured in a process of its own.
"""

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

import ephs
from benchmarks.cells import CHARGE, FLUX, RESISTANCE, conducting, ladder
from benchmarks.process import run
from benchmarks.report import Report, table_of
from ephs import System

__all__ = ["NETWORKS", "measure", "report"]

Array = NDArray[np.float64]
LIMIT = 600.0
SIZES = (100, 1024, 10_000)
TARGETS = (1e-3, 1e-5)
OWN, OTHER = (1e-2, 1e-3, 1e-4, 1e-5), (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
TIGHT = 1e-10
CAPACITY, HOT = 10.0, 0.5
"""Of a cell in J/K, and the entropy of the hot one in J/K above that at 293.15 K, where it is 0."""


@final
@dataclass(frozen=True, slots=True)
class Network:
    """A network of some cells, its run, and its equations by hand.

    Parameters
    ----------
    build, given
        The system of some cells, and what `ephs.simulate` takes besides.
    until, size
        End in s, and the size of states, of which tolerances are parts.
    read
        What is compared, from a solution.
    residual, start, width
        Equations of IDA, states and rates at the start, and the half width of the Jacobian, all of some cells.
    compared
        What is compared, from IDA's states.
    """

    build: Callable[[int], System]
    given: dict[str, Any]
    until: float
    size: float
    read: Callable[[ephs.Solution, int], Array]
    residual: Callable[[int], Callable[..., None]]
    start: Callable[[int], tuple[Array, Array]]
    width: Callable[[int], int]
    compared: Callable[[Array], Array]


def _coils(cells: int) -> Callable[..., None]:
    def residual(_t: float, y: Any, yp: Any, res: Any) -> None:
        q, b = y[0::2], y[1::2]  # each cell's coil feeds its capacitor, and the next cell's coil takes from it
        current = b / FLUX
        before = np.concatenate([[1.0], q[:-1] / CHARGE])
        res[0::2] = yp[0::2] - current + np.append(current[1:], 0.0)
        res[1::2] = yp[1::2] - before + q / CHARGE + RESISTANCE * current

    return residual


def _coils_at_rest(cells: int) -> tuple[Array, Array]:
    rates = np.zeros(2 * cells)
    rates[1] = 1.0
    return np.zeros(2 * cells), rates


def _conduction(rows: Callable[[int], int]) -> Callable[[int], Callable[..., None]]:
    def of(cells: int) -> Callable[..., None]:
        shape = rows(cells), cells // rows(cells)

        def residual(_t: float, y: Any, yp: Any, res: Any) -> None:
            res[:] = yp - _warming(y.reshape(shape)).ravel()

        return residual

    return of


def _warming(temperature: Array) -> Array:
    flow = np.zeros_like(temperature)
    for axis in (0, 1):
        passed = np.diff(temperature, axis=axis)
        first, last = [slice(None)] * 2, [slice(None)] * 2
        first[axis], last[axis] = slice(None, -1), slice(1, None)
        flow[tuple(first)] += passed
        flow[tuple(last)] -= passed
    return flow / CAPACITY


def _hot(rows: Callable[[int], int]) -> Callable[[int], tuple[Array, Array]]:
    def of(cells: int) -> tuple[Array, Array]:
        above = np.zeros(cells)
        above[0] = 293.15 * math.expm1(HOT / CAPACITY)
        return above, _warming(above.reshape(rows(cells), -1)).ravel()

    return of


def _heat(rows: Callable[[int], int], until: float) -> Network:
    def temperatures(sol: ephs.Solution, cells: int) -> Array:
        columns = cells // rows(cells)
        entropy = np.array([sol[f"n{k // columns}_{k % columns}.s"][-1] for k in range(cells)])
        return 293.15 * np.expm1(entropy / CAPACITY)

    return Network(
        lambda cells: conducting(rows(cells), cells // rows(cells)), {"initial": {"n0_0.s": HOT}}, until, HOT,
        temperatures, _conduction(rows), _hot(rows), lambda cells: 1 if rows(cells) == 1 else cells // rows(cells),
        lambda y: y,
    )  # fmt: skip


NETWORKS = {
    "ladder": Network(
        ladder, {"inputs": {"q0": {"effort": 1.0}}}, 1e-3, CHARGE,
        lambda sol, cells: np.array([sol[f"c{k}.cap.q"][-1] for k in range(cells)]),
        _coils, _coils_at_rest, lambda _: 2, lambda y: y[0::2],
    ),
    "wall": _heat(lambda _: 1, 2000.0),
    "plate": _heat(math.isqrt, 500.0),
}  # fmt: skip


def _ida(network: Network, cells: int, rtol: float) -> tuple[float, Array]:
    from sksundae.ida import IDA

    width = network.width(cells)
    solver = IDA(
        network.residual(cells), rtol=rtol, atol=1e-3 * rtol * network.size, linsolver="band", lband=width,
        uband=width, max_num_steps=100_000,
    )  # fmt: skip
    begin = time.process_time()
    found = solver.solve(np.array([0.0, network.until]), *network.start(cells))
    return time.process_time() - begin, network.compared(found.y[-1])


def measure(name: str, cells: int) -> dict[str, Any]:
    """Least seconds to the targets of both, a step of ours in s, and its exponent's data."""
    network = NETWORKS[name]
    system, size = network.build(cells), network.size
    time.perf_counter = time.process_time  # what statistics of a run then say is of the processor
    own: list[tuple[float, float]] = []
    _, exact = _ida(network, cells, TIGHT)
    scale, step, setup = float(np.abs(exact).max()), math.nan, 0.0
    ephs.simulate(network.build(4), network.until / 100.0, method="radau", rtol=1e-2, atol=1e-2 * size, **network.given)
    for rtol in OWN:
        begin = time.process_time()
        sol = ephs.simulate(
            system, network.until, method="radau", rtol=rtol, atol=1e-3 * rtol * size, save_at=[network.until],
            audit="off", **network.given,
        )  # fmt: skip
        spent = float(sol.stats["integrate_s"])
        setup = setup or time.process_time() - begin - spent
        own.append((spent, float(np.abs(network.read(sol, cells) - exact).max()) / scale))
        step = spent / sol.stats["steps"]
    others = [_ida(network, cells, rtol) for rtol in OTHER]
    both = {"own": own, "ida": [(spent, float(np.abs(y - exact).max()) / scale) for spent, y in others]}
    row: dict[str, Any] = {"network": name, "cells": cells, "step": step, "setup": setup}
    for target in TARGETS:
        least = {key: min((s for s, off in runs if off <= target), default=math.nan) for key, runs in both.items()}
        row |= {f"{key} {target:.0e}": value for key, value in least.items()}
        row[f"ratio {target:.0e}"] = least["own"] / least["ida"]
    return row


def report(_out: Path | None = None, names: Iterable[str] = tuple(NETWORKS)) -> Report:
    """A row a network and size; the exponent of a step from the last size but one to the last."""
    if find_spec("sksundae") is None:
        return Report("scikit-sundae is not installed: nothing was measured.", [])
    rows: list[dict[str, Any]] = []
    for name in names:
        for cells in SIZES:
            found = run(f"benchmarks.ladders:measure({name!r}, {cells})", LIMIT, {"network": name, "cells": cells})
            before = rows[-1].get("step") if rows and rows[-1]["network"] == name else None
            if before and found.get("step"):
                found["exponent"] = math.log(found["step"] / before) / math.log(cells / rows[-1]["cells"])
            rows.append(found)
    columns: dict[str, tuple[str, float]] = {"network": ("network", 1.0), "cells": ("cells", 1.0)}
    for target in TARGETS:
        for words, key, unit in (("radau", "own", " [s]"), ("IDA", "ida", " [s]"), ("ratio", "ratio", "")):
            columns[f"{words} to {target:.0e}{unit}"] = (f"{key} {target:.0e}", 1.0)
    columns |= {"set up [s]": ("setup", 1.0), "a step [ms]": ("step", 1e3), "exponent": ("exponent", 1.0)}
    return Report(table_of(rows, columns), rows)
