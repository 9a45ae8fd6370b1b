"""All states of a system, and the energies that they hold, at many states of its reduced form.

Poses are quaternions that are continuous along the motion, and bodies are those of the system, not the engine's links.
"""

from typing import Annotated, Final

from ephs.semantics.descriptor.kernel_table import SIGNATURE
from ephs.semantics.linear.dense import copy
from ephs.semantics.spaces import codes, se3
from ephs.semantics.spaces.vectors import add, apply, scale
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Program,
    Real,
    Record,
    Table,
    Vector,
    function,
    integer,
    integers,
    reals,
)

POSE, MOMENTUM, ELEMENT, RELATIVE, ENTROPY = range(5)
"""Source of a state: a link's pose or momentum, a joint's element, a spring's relative pose, an entropy."""


class Walked(Record):
    """A body at its joint of the tree.

    Attributes
    ----------
    parent
        −1 for the ground.
    forward
        1 where the joint is walked from its first to its second body.
    code, dim, q_at, r_at
        Its group, degrees of freedom, and where its element and rates start.
    first, second
        Poses of the joint's frames in its bodies.
    basis
        B (6, 6) in its first ``dim`` columns.
    inertia
        (6, 6) of the body.
    """

    parent = integer()
    forward = integer()
    code = integer()
    dim = integer()
    q_at = integer()
    r_at = integer()
    first = reals(7)
    second = reals(7)
    basis = reals(6, 6)
    inertia = reals(6, 6)


class Ends(Record):
    """A spring between two bodies, −1 for the ground, and poses of its frames in them."""

    one = integer()
    other = integer()
    first = reals(7)
    second = reals(7)


class Source(Record):
    """Source of a state: kind, link, edge or entropy, place and size.

    Attributes
    ----------
    flipped
        1 where a pose has the other of its two quaternions.
    """

    kind = integer()
    number = integer()
    at = integer()
    size = integer()
    flipped = integer()


class StorageRow(Record):
    """A storage: its relation, its number, where its parameters and the places of its states start."""

    law = function(SIGNATURE)
    dims = integers(4)
    number = integer()
    at = integer()
    reads = integer()


def _vector(row: Vector, size: int) -> list[Real]:
    return [row[k] for k in range(size)]


def _write_row(row: Vector, values: list[Real]) -> None:
    for k, x in enumerate(values):
        row[k] = x


def _joint(on: Evaluator, body: Walked, q: Vector) -> list[Real]:
    """Pose of a joint's element."""
    pose = [on.variable(0.0) for _ in range(7)]

    def fill(values: list[Real]) -> None:
        for entry, value in zip(pose, values, strict=True):
            entry.value = value

    def of(k: int) -> Real:
        return q[body.q_at + k]

    def turned() -> None:
        fill([*map(of, range(4)), 0.0, 0.0, 0.0])

    def posed() -> None:
        fill(list(map(of, range(7))))

    def planar() -> None:
        half = 0.5 * of(0)
        fill([on.cos(half), 0.0, 0.0, on.sin(half), of(1), of(2), 0.0])

    def flat() -> None:
        fill(se3.exp(on, _along(on, body, q, body.q_at)))

    def curved() -> None:
        on.when(on.same(body.code, codes.SE3), posed, lambda: on.when(on.same(body.code, codes.SE2), planar, flat))

    on.when(on.same(body.code, codes.SO3), turned, curved)
    return [entry.value for entry in pose]


def _along(on: Evaluator, body: Walked, x: Vector, at: Integer) -> list[Real]:
    """B x of the numbers that start at a place."""
    total = [on.variable(0.0) for _ in range(6)]

    def each_freedom(j: Integer) -> None:
        column = Vector(body.reals, body.real_start + Walked.basis.offset + j, 31)
        for k, entry in enumerate(total):
            entry.value = entry.value + column[6 * k] * x[at + j]

    on.loop(body.dim, each_freedom)
    return [entry.value for entry in total]


def _walk(on: Evaluator, bodies: Table[Walked], q: Vector, r: Vector, poses: Matrix, twists: Matrix) -> None:
    """Write poses in the world and twists of all bodies; the ground's rows are the last."""
    ground = bodies.size
    _write_row(poses.row(ground), [1.0, *[0.0] * 6])
    _write_row(twists.row(ground), [0.0] * 6)

    def each_body(i: Integer) -> None:
        body = bodies[i]
        first, second, joint = body.first, body.second, _joint(on, body, q)
        forward = on.same(body.forward, 1)
        there = se3.compose(on, first, joint)
        ahead = se3.compose(on, there, se3.inverse(second))
        inner = on.select(forward, ahead, se3.inverse(ahead))
        rate = _along(on, body, r, body.r_at)
        own = on.select(forward, se3.adjoint(second, rate), scale(-1.0, se3.adjoint(there, rate)))
        row = on.select(body.parent < 0, ground, body.parent)
        _write_row(poses.row(i), se3.compose(on, _vector(poses.row(row), 7), inner))
        _write_row(twists.row(i), add(se3.adjoint(se3.inverse(inner), _vector(twists.row(row), 6)), own))

    on.loop(bodies.size, each_body)


def _relative(on: Evaluator, ends: Ends, poses: Matrix) -> list[Real]:
    """The pose of a spring's second frame in its first."""
    ground = poses.rows - 1

    def frame(link: Integer, inside: list[Real]) -> list[Real]:
        return se3.compose(on, _vector(poses.row(on.select(link < 0, ground, link)), 7), inside)

    return se3.between(on, frame(ends.one, ends.first), frame(ends.other, ends.second))


def rows(
    on: Evaluator, bodies: Table[Walked], springs: Table[Ends], plan: Table[Source], q: Matrix, r: Matrix, s: Matrix,
    poses: Annotated[Matrix, 7], twists: Annotated[Matrix, 6], x: Matrix,
) -> None:  # fmt: skip
    """Write the states x (rows, size) at rows of elements, rates and entropies; poses and twists are memory."""

    def state(row: Integer, source: Source) -> None:
        out = x.row(row).part(source.at, source.size)

        def posed(pose: list[Real]) -> None:
            other = on.same(source.flipped, 1)
            _write_row(out, [*on.select(other, scale(-1.0, pose[:4]), pose[:4]), *pose[4:]])

        def momentum() -> None:
            _write_row(out, apply(bodies[source.number].inertia, _vector(twists.row(source.number), 6)))

        def entropy() -> None:
            out[0] = s[row, source.number]

        branches = [
            (POSE, lambda: posed(_vector(poses.row(source.number), 7))),
            (MOMENTUM, momentum),
            (ELEMENT, lambda: copy(on, q.row(row).part(source.number, source.size), out)),
            (RELATIVE, lambda: posed(_relative(on, springs[source.number], poses))),
        ]

        def among(place: int) -> None:
            kind, body = branches[place]
            last = place == len(branches) - 1
            on.when(on.same(source.kind, kind), body, entropy if last else lambda: among(place + 1))

        among(0)

    def each_row(row: Integer) -> None:
        _walk(on, bodies, q.row(row), r.row(row), poses, twists)
        on.loop(plan.size, lambda k: state(row, plan[k]))

    on.loop(x.rows, each_row)


def energies(
    on: Evaluator,
    storages: Table[StorageRow],
    reads: Integers,
    parameters: Vector,
    scal: Vector,
    x: Matrix,
    x0: Vector,
    v: Vector,
    e: Vector,
    lam: Vector,
    f: Vector,
    c: Vector,
    jac: Vector,
    work: Vector,
    out: Matrix,
    fault: Integers,
) -> Integer:
    """Write the energies in J of all storages at the states x (rows, size) to out (rows, components).

    ``x0`` … ``work`` are memory of a storage: its states, increments, efforts, multipliers, slopes, energy, and more.

    Returns
    -------
    Integer
        The status of the storage whose number is left in ``fault``, or 0.
    """
    status = on.counter(0)

    def storage(row: Integer, kept: StorageRow) -> None:
        def read(j: Integer) -> None:
            x0[j] = x[row, reads[kept.reads + j]]

        def still(j: Integer) -> None:
            v[j] = 0.0

        dims = Integers(kept.integers, kept.integer_start + StorageRow.dims.offset, 4)
        on.loop(dims[3], read)
        on.loop(dims[2], still)
        given = parameters.part(kept.at, parameters.size - kept.at)
        found = on.reach(kept.law, dims, scal, given, x0, v, e, lam, f, c, jac, work)

        def refuse() -> None:
            status.value = found
            fault[0] = kept.number

        on.when(on.negate(on.same(found, 0)), refuse)
        out[row, kept.number] = c[0]

    def each_row(row: Integer) -> None:
        on.loop(storages.size, lambda i: on.when(on.same(status.value, 0), lambda: storage(row, storages[i])))

    on.loop(x.rows, each_row)
    return status.value


STATES: Final = Program("states", rows=Entry(rows), energies=Entry(energies))
"""Program that makes the records of a run from its states, for all systems."""
