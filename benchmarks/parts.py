"""What set-up costs when one part fills many boxes: numbered once a kind, and flattened, in the same process.

The set-up goes from the nested system to the tables that are evaluated. The order of elimination is found by the first
step, from the same tables in both cases; of long chains of constraints that takes minutes, and is left out.
"""

import gc
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks import cells
from benchmarks.report import Report, table_of
from ephs import Pattern, Reference, System, junction
from ephs import library as lib
from ephs.mechanics import joint, rigid_body
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import Input, assemble
from ephs.solve.methods.condensed import solved_by_parts
from ephs.solve.methods.natural import Natural
from ephs.solve.model import Model, compile_model

__all__ = ["measure", "report"]

COPIES = (10, 100, 1_000)
ROUNDS = 5
STEP = 1e-4
LARGEST = 1_000
"""Constraint equations with which steps are taken."""


def chain(part: System, count: int, ports: tuple[str, str]) -> System:
    """Copies of a part one behind the other, both ends open."""
    quantity = part.interface[ports[0]].quantity
    names = [f"j{i}" for i in range(count + 1)]
    junctions = {name: junction(quantity, exposed=name in (names[0], names[-1])) for name in names}
    boxes = {f"c{i}": dict(zip(ports, names[i : i + 2], strict=True)) for i in range(count)}
    return System.of(Pattern(junctions, boxes), dict.fromkeys(boxes, part))


def wall(count: int) -> System:
    """Layers of a wall: a heat capacity between two conductances."""
    layer = Pattern.from_text(
        "a: entropy, exposed; b: entropy, exposed; m: entropy; in(s1=a, s2=m); cap(s=m); out(s1=m, s2=b)"
    )
    filled = layer({
        "in": lib.heat_transfer(h=2.0), "cap": lib.thermal_capacity(c1=293.15 * 20.0, c2=20.0),
        "out": lib.heat_transfer(h=3.0),
    })  # fmt: skip
    return chain(filled, count, ("a", "b"))


def links(count: int) -> System:
    """Bodies, each on a revolute joint with friction to the one before."""
    link = Pattern.from_text(
        "before: body_momentum, exposed; p: body_momentum, exposed; body(p); joint(p1=before, p2=p)"
    )
    return chain(
        link(body=rigid_body(1.0, [0.1, 0.2, 0.3]), joint=joint("revolute", friction=0.1)), count, ("before", "p")
    )


def walls(count: int) -> System:
    """Walls of ten layers each, one behind the other: parts of parts."""
    return chain(wall(10), count // 10, ("j0", "j10"))


FAMILIES: dict[str, Callable[[int], System]] = {
    "RLC ladder": cells.ladder, "wall": wall, "walls of ten": walls, "bodies and joints": links,
}  # fmt: skip


def _inputs(system: System) -> dict[Path, Input]:
    ends = [(path, port.quantity.space.dim) for path, port in system.interface.items()]
    return {path: Input(np.zeros(dim), i == 0) for i, (path, dim) in enumerate(ends)}


def measure(family: str, copies: int) -> dict[str, Any]:
    """Least seconds of a processor of several rounds, both ways in turn; and how far a step differs."""
    system = FAMILIES[family](copies)
    ways = {"parts": system.descriptor, "flat": lambda: assemble(system.flatten())}
    best, models = dict.fromkeys(ways, np.inf), dict[str, Model]()
    for _ in range(ROUNDS):
        for way, make in ways.items():
            gc.collect()
            begin = time.process_time()
            models[way] = compile_model(make(), Reference(), _inputs(system))
            best[way] = min(best[way], time.process_time() - begin)
    row = {
        "family": family, "copies": copies, "components": models["flat"].tables.kind.size, **best,
        "ratio": best["parts"] / best["flat"],
    }  # fmt: skip
    d = models["flat"].descriptor
    x = d.advance(d.pack(system.state()), 1e-3 * np.random.default_rng(1).standard_normal(d.rate_size))
    solved_by_parts(models["parts"], x, STEP)  # imports
    begin = time.process_time()
    found = solved_by_parts(models["parts"], x, STEP)
    row["condensed"] = time.process_time() - begin
    if models["flat"].constraint_rows.size <= LARGEST:
        _stepped(models["flat"], x)
        begin = time.process_time()
        ends = {way: _stepped(model, x) for way, model in models.items()}
        row["step"] = (time.process_time() - begin) / len(ends)
        row["difference"] = float(np.abs(ends["parts"] - ends["flat"]).max())
        row["apart"] = float(np.abs(ends["flat"] - found).max() / np.abs(ends["flat"]).max())
    return row


def _stepped(model: Model, x: Array) -> Array:
    method = Natural(model)
    return method.step(method.init(x), STEP).z


def report() -> Report:
    """A row for each family and number of copies."""
    rows = [measure(family, copies) for family in FAMILIES for copies in COPIES]
    columns = {
        "system": ("family", 1.0), "copies": ("copies", 1.0), "components": ("components", 1.0),
        "by kinds [ms]": ("parts", 1e3), "flattened [ms]": ("flat", 1e3), "ratio": ("ratio", 1.0),
        "step by parts [ms]": ("condensed", 1e3), "order and first step [ms]": ("step", 1e3),
        "flattened, apart": ("difference", 1.0), "by parts, apart": ("apart", 1.0),
    }  # fmt: skip
    return Report(table_of(rows, columns), rows)
