"""Joints at which loops are cut, and gears: their relative motion, the rows that close them, how far they are open.

A cut joint lets twists B r pass in its second frame; a row n of the complement, n·B = 0, forbids one. With the twists
u₁, u₂ of both links in that frame and the relative one u = u₂ − u₁, its acceleration is u̇₂ − u̇₁ + [u, u₁]. In world
axes the row is one covector, of opposite signs, for both its links.

A gear forbids Σ gᵢ rᵢ ≠ 0 of the rates of some joints. It is one row, to which each of its joints adds gᵢ (BᵢᵀBᵢ)⁻¹Bᵢᵀ
in its own second frame: a cut joint without degrees of freedom, whose element is that of the joint, and which is open
where the element is not the one at which the gear meshes.
"""

from collections.abc import Callable

from ephs.mechanics.road.charts import TIE, Chart, GroupKind, of_joints, visit_kind
from ephs.mechanics.road.needs import NO_INTEGERS
from ephs.mechanics.road.records import LinkPlace
from ephs.mechanics.road.tree import shift, shift_back, turned
from ephs.semantics.spaces import codes, se3, so3
from ephs.semantics.spaces.se3 import bracket
from ephs.semantics.spaces.staged_groups import STAGED
from ephs.semantics.spaces.vectors import (
    Entries,
    Rows,
    add,
    apply,
    apply_transposed,
    combine,
    dot,
    product,
    scale,
    sub,
    transposed,
)
from ephs.semantics.stage import (
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Real,
    Record,
    Table,
    Variable,
    Vector,
    integer,
    real,
    reals,
)


class Cut(Record):
    """A cut joint.

    Attributes
    ----------
    first, second
        Links of its bodies, −1 for the ground.
    code, dim, q_at, size, v_at
        As in `Chart`; a joint of a gear has the code `TIE`, no degrees of freedom, and a size of 1.
    row, rows
        Its first row, and how many; those of the joints of a gear are the same.
    end
        Where the places of its rows on its two links are.
    inner_turn, inner_at
        Its first frame in the first link's.
    outer_turn, outer_at
        Its second frame in the second link's.
    basis
        B (6, 6) in its first ``dim`` columns.
    left
        (BᵀB)⁻¹Bᵀ in its first ``dim`` rows.
    normal
        (6, 6): its rows.
    start
        The element at which a gear meshes.
    """

    first = integer()
    second = integer()
    code = integer()
    dim = integer()
    q_at = integer()
    size = integer()
    v_at = integer()
    row = integer()
    rows = integer()
    end = integer()
    inner_turn = reals(3, 3)
    inner_at = reals(3)
    outer_turn = reals(3, 3)
    outer_at = reals(3)
    basis = reals(6, 6)
    left = reals(6, 6)
    normal = reals(6, 6)
    start = real()


class Relative(Record):
    """Motion of a cut joint's second frame: pose in its first frame, frame in the world, relative twist in its axes.

    ``change`` is the twist's derivative at the accelerations that the links' places have.
    """

    pose = reals(7)
    turn = reals(3, 3)
    at = reals(3)
    twist = reals(6)
    change = reals(6)


def place_of(on: Evaluator, places: Matrix, link: Integer) -> LinkPlace:
    """Row of a link; the ground's is the last."""
    row = on.select(link < 0, places.rows - 1, link)
    return LinkPlace(NO_INTEGERS, 0, places.cells, places.start + row * places.columns)


def motion_of(motion: Matrix, i: Integer) -> Relative:
    """Row of a cut joint."""
    return Relative(NO_INTEGERS, 0, motion.cells, motion.start + i * motion.columns)


def frame_on(place: LinkPlace, turn: Rows, at: Entries) -> tuple[Rows, list[Real]]:
    """A frame in the world, given in that of a link."""
    return product(place.turn, turn), add(place.at, apply(place.turn, at))


def pose_of(on: Evaluator, first: tuple[Rows, Entries], second: tuple[Rows, Entries]) -> list[Real]:
    """The pose (7,) of a frame in another one, of which the world's axes are known."""
    turn = product(transposed(first[0]), second[0])
    return [*so3.quaternion(on, turn), *apply_transposed(first[0], sub(second[1], first[1]))]


def twist_of(near: LinkPlace, far: LinkPlace, turn: Rows, at: Entries) -> list[Real]:
    """The far link's twist relative to the near one, in the axes of a frame in the world."""
    return turned(transposed(turn), sub(shift(far.twist, sub(at, far.at)), shift(near.twist, sub(at, near.at))))


def _each_row(on: Evaluator, cut: Cut, body: Callable[[Integer, Integer, list[Real]], None]) -> None:
    """Call body(row, place in ``end``, n) for the rows of a cut joint."""

    def each_row(j: Integer) -> None:
        normal = Vector(cut.reals, cut.real_start + Cut.normal.offset + 6 * j, 6)
        body(cut.row + j, cut.end + 2 * j, [normal[k] for k in range(6)])

    on.loop(cut.rows, each_row)


def _clear(on: Evaluator, value: Matrix) -> None:
    def each_row(a: Integer) -> None:
        value[a, 0] = 0.0

    on.loop(value.rows, each_row)


def _pose(on: Evaluator, kind: GroupKind, cut: Cut, q: Vector) -> list[Real]:
    """Pose of an element of a joint."""
    x = [q[cut.q_at + k] for k in range(kind.size)]
    if kind.code == codes.SO3:
        return [*x, 0.0, 0.0, 0.0]
    if kind.code == codes.SE3:
        return x
    if kind.code == codes.SE2:
        half = 0.5 * x[0]
        return [on.cos(half), 0.0, 0.0, on.sin(half), x[1], x[2], 0.0]
    columns = transposed(cut.basis)[: kind.dim]
    return se3.exp(on, combine(columns, x) if kind.dim else [0.0] * 6)


def _gap(on: Evaluator, kind: GroupKind, cut: Cut, motion: Relative, q: Vector) -> list[Real]:
    """log of the pose that is from the one that the joint's element stands for; of a gear, how far a joint is from
    where it meshes."""
    if kind.code == TIE:
        return scale(q[cut.q_at] - cut.start, transposed(cut.basis)[0])
    return se3.increment(on, _pose(on, kind, cut, q), motion.pose)


def rows(
    on: Evaluator, cuts: Table[Cut], places: Matrix, motions: Matrix, end: Integers, value: Matrix, covector: Matrix
) -> None:
    """Write relative motions, targets of rows, and rows on links, to what the outward sweep found.

    Parameters
    ----------
    places
        (links + 1, …): rows of links and the ground that begin with `LinkPlace`.
    motions
        (cuts, 31): receives `Relative`, but for poses.
    end
        The slots of rows on links: see `Cut.end`.
    value, covector
        Targets go to the first column of ``value``; rows are added to ``covector``.
    """

    def grow(slot: Integer, by: list[Real]) -> None:
        for k in range(6):
            covector[slot, k] = covector[slot, k] + by[k]

    def each_cut(i: Integer) -> None:
        cut, motion = cuts[i], motion_of(motions, i)
        near, far = place_of(on, places, cut.first), place_of(on, places, cut.second)
        turn, at = frame_on(far, cut.outer_turn, cut.outer_at)
        motion.turn, motion.at = turn, at
        before, beyond, inside = sub(at, near.at), sub(at, far.at), transposed(turn)
        first = shift(near.twist, before)
        twist = sub(shift(far.twist, beyond), first)
        bias = sub(shift(add(far.bias, far.change), beyond), shift(add(near.bias, near.change), before))
        total = turned(inside, add(bracket(twist, first), bias))
        motion.twist, motion.change = turned(inside, twist), total

        def row(a: Integer, e: Integer, normal: list[Real]) -> None:
            value[a, 0] = value[a, 0] - dot(normal, total)
            covector = turned(turn, normal)
            grow(end[e + 1], shift_back(covector, beyond))
            grow(end[e], scale(-1.0, shift_back(covector, before)))

        _each_row(on, cut, row)

    _clear(on, value)
    on.loop(cuts.size, each_cut)


def poses(on: Evaluator, cuts: Table[Cut], places: Matrix, motions: Matrix) -> None:
    """Write poses of second frames in first ones, where `rows` has been."""

    def each_cut(i: Integer) -> None:
        cut, motion = cuts[i], motion_of(motions, i)
        inner = frame_on(place_of(on, places, cut.first), cut.inner_turn, cut.inner_at)
        motion.pose = pose_of(on, inner, (motion.turn, motion.at))

    on.loop(cuts.size, each_cut)


def fit(on: Evaluator, kinds: tuple[GroupKind, ...], cuts: Table[Cut], motions: Matrix, q: Vector) -> None:
    """Move the cut joints' elements to where their bodies put them."""

    def each_cut(i: Integer) -> None:
        cut, motion = cuts[i], motion_of(motions, i)

        def with_kind(kind: GroupKind) -> None:
            def closer(_: Integer) -> None:
                log, left = _gap(on, kind, cut, motion, q), cut.left
                change = [dot(left[j], log) for j in range(kind.dim)]
                element = [q[cut.q_at + k] for k in range(kind.size)]
                for k, x in enumerate(STAGED[kind.code].retract(on, element, change)):
                    q[cut.q_at + k] = x

            if kind.dim:
                on.loop(3 if kind.dim > 1 or kind.code != codes.VECTOR else 2, closer)

        visit_kind(on, kinds, cut.code, cut.dim, with_kind)

    on.loop(cuts.size, each_cut)


def gaps(
    on: Evaluator, kinds: tuple[GroupKind, ...], cuts: Table[Cut], motions: Matrix, q: Vector, value: Matrix
) -> Real:
    """Write targets that close the joints in one step of Newton's method; return how far they are open (m, rad)."""
    worst = on.variable(0.0)

    def each_cut(i: Integer) -> None:
        cut, motion = cuts[i], motion_of(motions, i)

        def with_kind(kind: GroupKind) -> None:
            log = _gap(on, kind, cut, motion, q)

            def row(a: Integer, e: Integer, normal: list[Real]) -> None:
                value[a, 0] = value[a, 0] - dot(normal, log)

            _each_row(on, cut, row)

        visit_kind(on, kinds, cut.code, cut.dim, with_kind)

    _clear(on, value)
    on.loop(cuts.size, each_cut)
    on.loop(value.rows, lambda a: _widen(on, worst, value[a, 0]))
    return worst.value


def _widen(on: Evaluator, worst: Variable[Real], x: Real) -> None:
    """Keep the largest size; NaN stays."""
    size = on.absolute(x)
    worst.value = on.select(size <= worst.value, worst.value, size)


def relative_rates(on: Evaluator, cuts: Table[Cut], motions: Matrix, value: Matrix) -> None:
    """Write targets that take the cut joints' forbidden velocities away, where `rows` has been."""

    def each_cut(i: Integer) -> None:
        twist = motion_of(motions, i).twist

        def row(a: Integer, e: Integer, normal: list[Real]) -> None:
            value[a, 0] = value[a, 0] - dot(normal, twist)

        _each_row(on, cuts[i], row)

    _clear(on, value)
    on.loop(cuts.size, each_cut)


def across(on: Evaluator, cuts: Table[Cut], places: Matrix, motions: Matrix, value: Matrix) -> None:
    """Write targets that take the links' accelerations, as changes of their twists, back across the constraints."""

    def change(link: Integer, at: Entries) -> list[Real]:
        place = place_of(on, places, link)
        return shift(place.change, sub(at, place.at))

    def each_cut(i: Integer) -> None:
        cut, motion = cuts[i], motion_of(motions, i)
        at = motion.at
        moved = turned(transposed(motion.turn), sub(change(cut.second, at), change(cut.first, at)))

        def row(a: Integer, e: Integer, normal: list[Real]) -> None:
            value[a, 0] = value[a, 0] - dot(normal, moved)

        _each_row(on, cut, row)

    _clear(on, value)
    on.loop(cuts.size, each_cut)


def velocities(
    on: Evaluator, kinds: tuple[GroupKind, ...], charts: Table[Chart], cuts: Table[Cut], motions: Matrix, v: Vector,
    r: Vector, out: Vector,
) -> None:  # fmt: skip
    """v̇ = dexp⁻¹(v) r of all joints, that of cut ones from their relative motions, into ``out``."""

    def each_chart(i: Integer) -> None:
        chart = charts[i]

        def with_kind(kind: GroupKind) -> None:
            rates = [on.variable(0.0) for _ in range(kind.dim)]

            def on_tree() -> None:
                for j, rate in enumerate(rates):
                    rate.value = r[chart.r_at + j]

            def on_cut() -> None:
                left, twist = cuts[chart.cut].left, motion_of(motions, chart.cut).twist
                for j, rate in enumerate(rates):
                    rate.value = dot(left[j], twist)

            on.when(chart.cut < 0, on_tree, on_cut)
            found = [rate.value for rate in rates]
            group = STAGED[kind.code]
            if not group.abelian:
                found = apply(group.dexp_left_inv(on, [v[chart.v_at + j] for j in range(kind.dim)]), found)
            for j, x in enumerate(found):
                out[chart.v_at + j] = x

        visit_kind(on, of_joints(kinds), chart.code, chart.dim, with_kind)

    on.loop(charts.size, each_chart)
