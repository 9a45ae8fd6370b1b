"""Constraints beside losses: rows J that rates obey, and the multipliers that keep what losses change on them."""

from typing import TYPE_CHECKING

from ephs.mechanics.road.rows import TARGET
from ephs.mechanics.tree.engine.motion import Mechanism
from ephs.semantics.linear.dense import backward, cholesky, clear, copy, dot, forward, subtract
from ephs.semantics.linear.skyline import skyline_solve
from ephs.semantics.stage import Evaluator, Integer, Vector, staged
from ephs.solve.march.records import Status

if TYPE_CHECKING:
    from ephs.mechanics.tree.engine.drags import Drags


@staged
def constrain(on: Evaluator, drags: "Drags", motion: Mechanism, q: Vector) -> None:
    """Write the rows J at q."""
    led, unit, targets = drags.led.size, drags.sign, motion.work.value

    def lead(k: Integer) -> None:
        clear(on, drags.held.row(k))
        drags.held[k, drags.row_of[drags.led[k]]] = 1.0

    def column(j: Integer) -> None:
        def entry(a: Integer) -> None:
            drags.held[led + a, drags.row_of[j]] = -targets[a, TARGET]

        unit[j] = 1.0
        motion.stray(on, unit)
        unit[j] = 0.0
        on.loop(targets.rows, entry)

    clear(on, unit)
    on.loop(led, lead)
    if motion.looped:
        on.loop(unit.size, column)


@staged
def among(on: Evaluator, drags: "Drags") -> Integer:
    """Factorise J (M + w D)⁻¹ Jᵀ; return a status."""

    def row(a: Integer) -> None:
        bent = drags.bent.row(a)

        def entry(b: Integer) -> None:
            drags.among[a, b] = dot(on, drags.held.row(b), bent)

        copy(on, drags.held.row(a), bent)
        skyline_solve(on, drags.mass, drags.first, bent)
        on.loop(a + 1, entry)

    on.loop(drags.held.rows, row)
    return on.select(cholesky(on, drags.among, drags.among) > 0, int(Status.UNSETTLED), 0)


@staged
def pull(on: Evaluator, drags: "Drags", motion: Mechanism, out: Vector) -> None:
    """Take out of accelerations what is across the constraints; add the power of prescribed motions by that."""
    pulled, part, power = drags.pulled, drags.part, motion.summed + (motion.tables.node.size + 1)

    def each_entry(a: Integer) -> None:
        pulled[a] = dot(on, drags.held.row(a), part)

    def hold(a: Integer) -> None:
        subtract(on, pulled[a], drags.bent.row(a), part)

    def lead(k: Integer) -> None:
        out[power] = out[power] + pulled[k] * drags.reached[drags.led[k]]

    on.loop(pulled.size, each_entry)
    forward(on, drags.among, pulled)
    backward(on, drags.among, pulled)
    on.loop(pulled.size, hold)
    on.loop(drags.led.size, lead)
