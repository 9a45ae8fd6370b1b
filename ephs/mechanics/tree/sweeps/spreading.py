"""Twists that rates of the joints make, and the power of joints whose motion is prescribed."""

from ephs.mechanics.tree.sweeps.closing import MULTIPLIER, Rows
from ephs.mechanics.tree.sweeps.joints import rate_inside
from ephs.mechanics.tree.sweeps.records import Joint, Link, State, Tree
from ephs.semantics.spaces.se3 import twist_inward, twist_outward
from ephs.semantics.spaces.vectors import add, apply, apply_transposed, combine, dot, symmetric
from ephs.semantics.stage import Evaluator, Integer, Matrix, Real, Vector


def spread(on: Evaluator, tree: Tree, q: Vector, x: Vector) -> None:
    """The twists that rates x of the joints make, to where links keep their accelerations."""

    def one(i: Integer) -> None:
        def through(joint: Joint, link: Link) -> None:
            state = tree.states[i]
            change = twist_inward(state.rotation, state.place, tree.states[link.parent].change)
            rate = rate_inside(on, joint, link, q, [x[link.r_at + j] for j in range(joint.dim)])
            state.change = add(change, combine(joint.basis, rate)) if joint.dim else change

        tree.visit(on, i, through)

    tree.each(on, one)


def axes(on: Evaluator, tree: Tree, q: Vector, columns: Matrix) -> None:
    """The twists (n, 6) about the ground's origin and along its axes that units of the joints' rates make."""

    def one(i: Integer) -> None:
        def through(joint: Joint, link: Link) -> None:
            state = tree.states[i]
            for j in range(joint.dim):
                rate = rate_inside(on, joint, link, q, [float(j == k) for k in range(joint.dim)])
                twist = twist_outward(state.turn, state.at, combine(joint.basis, rate))
                for k, x in enumerate(twist):
                    columns[link.r_at + j, k] = x

        tree.visit(on, i, through)

    tree.each(on, one)


def _needed(state: State) -> list[Real]:
    """The wrench I δa + P on a link and what it carries."""
    turning, moving, mixed = state.change[:3], state.change[3:], state.mixed
    torque = add(apply(symmetric(state.angular), turning), apply(mixed, moving))
    force = add(apply_transposed(mixed, turning), apply(symmetric(state.linear), moving))
    return add(state.load, [*torque, *force])


def driven_power(on: Evaluator, tree: Tree, rows: Rows, q: Vector, r: Vector, force: Vector) -> Real:
    """The power of the joints whose motion is prescribed, beside that of the forces in them."""
    total = on.variable(0.0)

    def one(i: Integer) -> None:
        def through(joint: Joint, link: Link) -> None:
            if not joint.driven:
                return
            rate = [r[link.r_at + j] for j in range(joint.dim)]
            along = combine(joint.basis, rate_inside(on, joint, link, q, rate))
            own = dot([force[link.r_at + j] for j in range(joint.dim)], rate)
            total.value = total.value + (dot(along, _needed(tree.states[i])) - own)

            def pulled(s: Integer) -> None:
                multiplier = rows.value[rows.slot[2 * s], MULTIPLIER]
                total.value = total.value - multiplier * dot(along, rows.at_slot(s))

            on.loop(rows.last(i), pulled, start=rows.ended(i))

        tree.visit(on, i, through)

    tree.each(on, one)
    return total.value
