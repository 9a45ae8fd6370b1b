"""Moves of states along increments, in compiled steps."""

from ephs.semantics.spaces import codes
from ephs.semantics.spaces.staged_groups import STAGED
from ephs.semantics.stage import Evaluator, Integer, Real, Vector, staged
from ephs.solve.methods.places import each_row
from ephs.solve.methods.records import Columns, StateRecord


def tighten(q: Vector) -> None:
    """Bring a quaternion that is off by rounding back to unit length."""
    entries = [q[i] for i in range(4)]
    a, b, c, d = entries
    factor = 1.5 - 0.5 * (a * a + b * b + c * c + d * d)
    for i, entry in enumerate(entries):
        q[i] = entry * factor


def somewhere(on: Evaluator, vector: Vector) -> Vector:
    """The same memory, at a place that is not known while staging: functions of their own are emitted once for all."""
    return Vector(vector.cells, vector.start + on.counter(0).value, vector.size)


@staged
def retract(on: Evaluator, code: Integer, x: Vector, v: Vector, out: Vector) -> None:
    """x·exp(v) of a group, which may be x's own place."""

    def vectors() -> None:
        def each_entry(i: Integer) -> None:
            out[i] = x[i] + v[i]

        on.loop(v.size, each_entry)

    def group(number: int, size: int, dim: int) -> None:
        def point() -> None:
            found = STAGED[number].retract(on, [x[i] for i in range(size)], [v[i] for i in range(dim)])
            for i, entry in enumerate(found):
                out[i] = entry

        on.when(on.same(code, number), point)

    on.when(on.same(code, codes.VECTOR), vectors)
    for number, size, dim in ((codes.SO3, 4, 3), (codes.SE2, 3, 3), (codes.SE3, 7, 6), (codes.SO3xR3, 7, 6)):
        group(number, size, dim)


def move_states(on: Evaluator, t: Columns, x: Vector, h: Real, rates: Vector, v: Vector) -> None:
    """Move all states, in place, by h times their rates; v is scratch for one of them."""

    def state(row: StateRecord, _: Integer) -> None:
        point = x.part(row.at, row.size)

        def increment(j: Integer) -> None:
            v[j] = h * rates[row.rate + j]

        on.loop(row.dim, increment)
        retract(on, row.code, point, somewhere(on, v).part(0, row.dim), point)
        flat = on.either(on.same(row.code, codes.VECTOR), on.same(row.code, codes.SE2))
        on.when(on.negate(flat), lambda: tighten(point))

    each_row(on, StateRecord, t.states, state)
