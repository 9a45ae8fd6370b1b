"""Relative poses as components meet them: the one of a spring, or all of an energy of several; and pulls along them."""

from ephs.mechanics.road.cuts import Relative, frame_on, place_of, pose_of, twist_of
from ephs.mechanics.road.needs import NO_INTEGERS
from ephs.mechanics.road.tree import shift_back, turned
from ephs.mechanics.tree.sweeps.acting import Acting, CompiledComponent, Tables, Work
from ephs.mechanics.tree.sweeps.expanding import About
from ephs.semantics.spaces import se3
from ephs.semantics.spaces.vectors import dot, scale, sub
from ephs.semantics.stage import Evaluator, Integer, Integers, Matrix, Real, Vector


def dims_of(tables: Tables, component: Integer) -> Integers:
    """(4,) the dimensions of a component."""
    row = tables.component[component]
    return Integers(row.integers, row.integer_start + CompiledComponent.dims.offset, 4)


def meet(
    on: Evaluator, tables: Tables, work: Work, read: About | None, component: Integer, pose: list[Real], place: Integer
) -> None:
    """Write a pose to the states of its component, as the one with this place among them.

    To a component that is expanded about a point goes the increment from that point.
    """
    into, at = work.x, 7 * place
    if read is not None:
        state = read.expanded(component, dims_of(tables, component)).state
        pose, into = se3.increment(on, [state[at + k] for k in range(7)], pose), read.local
        at = 6 * place
    for k, x in enumerate(pose):
        into[at + k] = x


def gather(on: Evaluator, tables: Tables, work: Work, read: About | None, edge: Acting, number: Integer) -> None:
    """Write the relative poses of an edge with this number and of the next ones to the states of their component."""
    places = work.places(tables)

    def each_pose(k: Integer) -> None:
        one = tables.acting[number + k]
        near, far = place_of(on, places, one.first), place_of(on, places, one.second)
        inner, outer = frame_on(near, one.inner_turn, one.inner_at), frame_on(far, one.outer_turn, one.outer_at)
        meet(on, tables, work, read, edge.several, pose_of(on, inner, outer), k)

    on.loop(edge.poses, each_pose)


def rates_of_several(on: Evaluator, tables: Tables, work: Work, edge: Acting, number: Integer, out: Vector) -> None:
    """Write the rates of the relative poses of an edge with this number and of the next ones that friction resists."""
    places = work.places(tables)

    def each_pose(k: Integer) -> None:
        one = tables.acting[number + k]
        near, far = place_of(on, places, one.first), place_of(on, places, one.second)
        turn, at = frame_on(far, one.outer_turn, one.outer_at)
        rates_along(on, one, twist_of(near, far, turn, at), out.part(6 * k, 6))

    on.loop(edge.resisted, each_pose)


def pull_several(on: Evaluator, tables: Tables, work: Work, edge: Acting, number: Integer, flows: Vector) -> None:
    """Pull against flows along the relative poses of an edge with this number and of the next ones."""

    def each_pose(k: Integer) -> None:
        one, pull = tables.acting[number + k], on.scratch(6)
        motion = Relative(NO_INTEGERS, 0, on.scratch(Relative.real_width).cells, 0)
        far = place_of(on, work.places(tables), one.second)
        motion.turn, motion.at = frame_on(far, one.outer_turn, one.outer_at)
        for j in range(6):
            pull[j] = -flows[6 * k + j]
        pull_links(on, tables, work, one, motion, pull)

    on.loop(edge.poses, each_pose)


def left_row(edge: Acting, j: Integer) -> list[Real]:
    """A row of (BᵀB)⁻¹Bᵀ of an edge."""
    row = Vector(edge.reals, edge.real_start + Acting.left.offset + 6 * j, 6)
    return [row[k] for k in range(6)]


def rates_along(on: Evaluator, edge: Acting, twist: list[Real], rate: Vector) -> None:
    """Write the rates along the degrees of freedom of an edge, of a twist of its second frame relative to its first."""

    def each_freedom(j: Integer) -> None:
        rate[j] = dot(left_row(edge, j), twist)

    on.loop(edge.dim, each_freedom)


def pull_links(on: Evaluator, tables: Tables, work: Work, edge: Acting, motion: Relative, pull: Vector) -> None:
    """Add a pull in an edge to the wrenches on its links."""
    wide = [on.variable(0.0) for _ in range(6)]

    def each_freedom(j: Integer) -> None:
        for total, x in zip(wide, left_row(edge, j), strict=True):
            total.value = total.value + x * pull[j]

    on.loop(edge.dim, each_freedom)
    whole = turned(motion.turn, [total.value for total in wide])

    def on_link(link: Integer, by: list[Real]) -> None:
        way = sub(motion.at, place_of(on, work.places(tables), link).at)
        push(work.pushed, link, shift_back(by, way))

    on.when(edge.second >= 0, lambda: on_link(edge.second, whole))
    on.when(edge.first >= 0, lambda: on_link(edge.first, scale(-1.0, whole)))


def push(pushed: Matrix, link: Integer, by: list[Real]) -> None:
    """Add to the wrench on a link."""
    for k, x in enumerate(by):
        pushed[link, k] = pushed[link, k] + x
