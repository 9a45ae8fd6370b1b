"""Relative poses as components meet them: the one of a spring, or all of an energy of several."""

from ephs.mechanics.road.cuts import frame_on, place_of, pose_of
from ephs.mechanics.tree.sweeps.acting import Acting, CompiledComponent, Tables, Work
from ephs.mechanics.tree.sweeps.expanding import About
from ephs.semantics.spaces import se3
from ephs.semantics.stage import Evaluator, Integer, Integers, Real


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
