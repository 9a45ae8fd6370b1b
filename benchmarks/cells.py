"""How cost grows with repetition: an RLC ladder and a thermal grid of 10² to 10⁴ cells, and SUNDIALS IDA on the ladder.

IDA (package scikit-sundae, if it is installed) solves the ladder's equations written by hand, with a banded Jacobian
given; it is the nearest peer in kind. Each row is measured in a process of its own, after one that fills the caches.
"""

import math
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import ephs
from benchmarks.process import run
from ephs import Pattern, System, junction
from ephs import library as lib
from ephs import quantity as Q

LIMIT = 600.0
"""Seconds for a row."""
SIZES = (100, 1_000, 10_000)
CHARGE, FLUX, RESISTANCE = 1e-6, 1e-3, 1.0  # farad, henry, ohm of a cell
STEP, STEPS = 1e-6, 50


def ladder(cells: int) -> System:
    """Cells of a coil with its resistance in series and a capacitor across, driven at one end; one environment."""
    reversed_coupling = ephs.gyrator({"q": Q.charge, "b": Q.flux_linkage}, [[0.0, -1.0], [1.0, 0.0]], name="emc")
    cell = Pattern.from_text(
        "q: charge, exposed; b: flux_linkage; out: charge, exposed; s: entropy, exposed;"
        "left(q, b); right(q=out, b); coil(b); res(b, s); cap(q=out)"
    )(
        left=lib.emc(),
        right=reversed_coupling,
        coil=lib.inductor(l=FLUX),
        res=lib.resistor(r=RESISTANCE),
        cap=lib.capacitor(c=CHARGE),
    )
    names = [f"q{k}" for k in range(cells + 1)]
    junctions = {name: junction(Q.charge, exposed=name == "q0") for name in names} | {"s": junction(Q.entropy)}
    boxes = {f"c{k}": {"q": names[k], "out": names[k + 1], "s": "s"} for k in range(cells)}
    pattern = Pattern(junctions, boxes | {"env": {"s": "s"}})
    return pattern({box: cell for box in boxes} | {"env": lib.environment()})


def grid(cells: int) -> System:
    """A square of heat capacities."""
    return conducting(math.isqrt(cells), math.isqrt(cells))


def conducting(rows: int, columns: int) -> System:
    """Heat capacities in rows, each conducting to its right and to its lower neighbour."""
    node = lib.thermal_capacity(c1=293.15 * 10.0, c2=10.0)
    junctions = {f"s{i}_{j}": junction(Q.entropy) for i in range(rows) for j in range(columns)}
    boxes: dict[str, dict[str, str]] = {f"n{i}_{j}": {"s": f"s{i}_{j}"} for i in range(rows) for j in range(columns)}
    fillings: dict[str, Any] = dict.fromkeys(boxes, node)
    link = lib.heat_transfer(h=1.0)
    for i in range(rows):
        for j in range(columns):
            for name, k, m in (("right", i, j + 1), ("down", i + 1, j)):
                if k < rows and m < columns:
                    boxes[f"{name}{i}_{j}"] = {"s1": f"s{i}_{j}", "s2": f"s{k}_{m}"}
                    fillings[f"{name}{i}_{j}"] = link
    return Pattern(junctions, boxes)(fillings)


CASES = {
    "ladder": (ladder, {"q0": {"effort": 1.0}}, {}, STEP),
    "grid": (grid, None, {"n0_0.s": 0.5}, 1.0),
}


def measure(name: str, cells: int) -> dict[str, float]:
    """Seconds to build, to set up, and for a step; the energy error of the run."""
    make, inputs, initial, step = CASES[name]
    start = time.perf_counter()
    system = make(cells)
    built = time.perf_counter() - start
    start = time.perf_counter()
    sol = ephs.simulate(system, STEPS * step, initial=initial, inputs=inputs, step=step)
    whole = time.perf_counter() - start
    steps = sol.stats["integrate_s"]
    return {"build": built, "setup": whole - steps, "step": steps / STEPS, "energy": float(sol.energy_error.max())}


def contest(cells: int) -> dict[str, float]:
    """The ladder by the natural method and by IDA: seconds, and largest error of a charge relative to the largest.

    IDA has the equations written by hand, 2·cells of them, and a banded Jacobian; its own run at 1e-9 is the reference.
    """
    from sksundae.ida import IDA

    def residual(_t: float, y: Any, yp: Any, res: Any) -> None:
        q, b = y[0::2], y[1::2]  # each cell's coil feeds its capacitor, and the next cell's coil takes from it
        current = b / FLUX
        before = np.concatenate([[1.0], q[:-1] / CHARGE])
        res[0::2] = yp[0::2] - current + np.append(current[1:], 0.0)
        res[1::2] = yp[1::2] - before + q / CHARGE + RESISTANCE * current

    def solve(rtol: float) -> tuple[float, Any]:
        y0, yp0 = np.zeros(2 * cells), np.zeros(2 * cells)
        yp0[1] = 1.0
        solver = IDA(residual, rtol=rtol, atol=1e-6 * rtol, linsolver="band", lband=2, uband=2)
        start = time.perf_counter()
        found = solver.solve(np.array([0.0, STEPS * STEP]), y0, yp0)
        return time.perf_counter() - start, found.y[-1][0::2]

    _, exact = solve(1e-9)
    ida, rough = solve(1e-6)
    sol = ephs.simulate(ladder(cells), STEPS * STEP, inputs={"q0": {"effort": 1.0}}, step=STEP)
    own = np.array([sol[f"c{k}.cap.q"][-1] for k in range(cells)])
    size = np.abs(exact).max()
    return {
        "ida": ida,
        "natural": sol.stats["integrate_s"],
        "ida error": float(np.abs(rough - exact).max() / size),
        "natural error": float(np.abs(own - exact).max() / size),
    }


def _run(call: str) -> dict[str, float]:
    keys = ("build", "setup", "step", "energy", "ida", "natural", "ida error", "natural error")
    return run(f"benchmarks.cells:{call}", LIMIT, dict.fromkeys(keys, math.nan))


def table(_out: Path | None = None) -> str:
    """Measure all; a Markdown table."""
    lines = ["| system | cells | build [s] | set up [s] | a step [ms] | energy error |", "| --- " * 6 + "|"]
    for name in CASES:
        _run(f"measure({name!r}, 100)")
        rows = {cells: _run(f"measure({name!r}, {cells})") for cells in SIZES}
        for cells, row in rows.items():
            lines.append(
                f"| {name} | {cells} | {row['build']:.2f} | {row['setup']:.2f} | {1e3 * row['step']:.3f} |"
                f" {row['energy']:.1e} |"
            )
        slope = math.log(rows[SIZES[-1]]["step"] / rows[SIZES[-2]]["step"]) / math.log(SIZES[-1] / SIZES[-2])
        lines.append(f"| {name} | exponent | | | {slope:.2f} | |")
    if find_spec("sksundae") is None:
        lines.append("\nscikit-sundae is not installed: no peer was measured.")
        return "\n".join(lines)
    title = "| cells, 50 µs of motion | natural, 50 steps [s] | its error | IDA, rtol 1e-6 [s] | its error | ratio |"
    lines += ["", title, "| --- " * 6 + "|"]
    for cells in SIZES:
        row = _run(f"contest({cells})")
        lines.append(
            f"| {cells} | {row['natural']:.3f} | {row['natural error']:.1e} | {row['ida']:.3f} |"
            f" {row['ida error']:.1e} | {row['natural'] / row['ida']:.2f} |"
        )
    return "\n".join(lines)
