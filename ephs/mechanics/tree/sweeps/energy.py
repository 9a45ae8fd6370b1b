"""Kinetic energy and potential of gravity, in one outward sweep that preserves the other sweeps' results."""

from ephs.mechanics.tree.sweeps.joints import force_outside, frame, rate_inside
from ephs.mechanics.tree.sweeps.outward import momentum
from ephs.mechanics.tree.sweeps.records import Joint, Link, Tree
from ephs.semantics.spaces.se3 import twist_inward
from ephs.semantics.spaces.vectors import Entries, add, apply_transposed, combine, dot, scale
from ephs.semantics.stage import Evaluator, Integer, Matrix, Real, Vector


def _length(on: Evaluator, x: Entries) -> Real:
    """The sum of the sizes of a vector's entries, which is no less than its length."""
    return on.absolute(x[0]) + on.absolute(x[1]) + on.absolute(x[2])


def energy(on: Evaluator, tree: Tree, q: Vector, r: Vector, momenta: Matrix, spin: Vector, out: Vector) -> None:
    """Write kinetic energy, potential energy and the sum of its terms' sizes in J to ``out``.

    Heights count from the origin of the ground's frame; what they are rounded by is a part of the lengths on the way
    from there, which the sizes count. Momenta I u (links, 6), in the links' frames, go to
    ``momenta``, those of rates that have inertia of their own to ``spin`` (degrees of freedom,). Of the memory, twists
    change, to those of r at q.
    """
    ground = tree.states[tree.size]
    ground.twist, ground.down, ground.level, ground.reach = [0.0] * 6, tree.gravity, 0.0, 0.0
    pull = _length(on, tree.gravity)
    out[0], out[1], out[2] = 0.0, 0.0, 0.0

    def one(i: Integer) -> None:
        def through(joint: Joint, link: Link) -> None:
            state, parent = tree.states[i], tree.states[link.parent]
            rotation, place = frame(on, joint, link, q)
            rate = rate_inside(on, joint, link, q, [r[link.r_at + k] for k in range(joint.dim)])
            along = combine(joint.basis, rate) if joint.dim else [0.0] * 6
            twist = add(twist_inward(rotation, place, parent.twist), along)
            down, level = parent.down, parent.level
            level = level + dot(down, place)
            down = apply_transposed(rotation, down)
            reach = parent.reach + _length(on, place)
            state.twist, state.down, state.level, state.reach = twist, down, level, reach
            carried = momentum(link, twist)
            for k, x in enumerate(carried):
                momenta[i, k] = x
            weight = link.mass * level + dot(down, link.moment)
            out[0] = out[0] + 0.5 * dot(twist, carried)
            if joint.armature:
                turning = scale(link.armature, rate)
                out[0] = out[0] + 0.5 * dot(turning, rate)
                for k, x in enumerate(force_outside(on, joint, link, q, turning)):
                    spin[link.r_at + k] = x
            out[1] = out[1] - weight
            out[2] = out[2] + pull * (link.mass * reach + _length(on, link.moment))

        tree.visit(on, i, through)

    tree.each(on, one)
