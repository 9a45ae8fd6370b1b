"""What a start and a step cost when one part fills many boxes: part by part, and of the whole.

The set-up goes from the nested system to the tables that are evaluated. The order of elimination of the whole is found
by its first step; of long chains of constraints that takes minutes, and is left out.
"""

import gc
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks import cells
from benchmarks.condensed import solved_by_parts
from benchmarks.report import Report, table_of
from ephs import Pattern, Reference, System, junction
from ephs import library as lib
from ephs.mechanics import joint, rigid_body
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import Input, descriptor_of
from ephs.solve.equations.model import Model, compile_model
from ephs.solve.methods.natural import Natural

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
    """Least seconds of a processor of several rounds, and how far a step by parts is from one of the whole."""
    system = FAMILIES[family](copies)

    def compiled() -> Model:
        return compile_model(descriptor_of(system), Reference(), _inputs(system))

    model, best = compiled(), np.inf
    for _ in range(ROUNDS):
        gc.collect()
        begin = time.process_time()
        model = compiled()
        best = min(best, time.process_time() - begin)
    row = {"family": family, "copies": copies, "components": model.tables.kind.size, "start": best}
    d = model.descriptor
    x = d.advance(d.pack(system.state()), 1e-3 * np.random.default_rng(1).standard_normal(d.rate_size))
    solved_by_parts(model, x, STEP)  # imports
    begin = time.process_time()
    found = solved_by_parts(model, x, STEP)
    row["condensed"] = time.process_time() - begin
    if model.constraint_rows.size <= LARGEST:
        _stepped(model, x)
        begin = time.process_time()
        end = _stepped(model, x)
        row["step"] = time.process_time() - begin
        row["apart"] = float(np.abs(end - found).max() / np.abs(end).max())
    return row


def _stepped(model: Model, x: Array) -> Array:
    method = Natural(model)
    return method.step(method.init(x), STEP).z[0]


def report() -> Report:
    """A row for each family and number of copies."""
    rows = [measure(family, copies) for family in FAMILIES for copies in COPIES]
    columns = {
        "system": ("family", 1.0), "copies": ("copies", 1.0), "components": ("components", 1.0),
        "set-up [ms]": ("start", 1e3), "step by parts [ms]": ("condensed", 1e3),
        "order and first step [ms]": ("step", 1e3), "apart": ("apart", 1.0),
    }  # fmt: skip
    return Report(table_of(rows, columns), rows)
