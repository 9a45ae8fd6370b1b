"""The second outward sweep: rates of joints and accelerations of links; and the three sweeps in a row."""

from collections.abc import Callable
from typing import TypeAlias

from ephs.mechanics.tree.sweeps.inward import inward, load_inward
from ephs.mechanics.tree.sweeps.joints import rate_outside
from ephs.mechanics.tree.sweeps.outward import outward
from ephs.mechanics.tree.sweeps.records import Joint, Link, Tree
from ephs.semantics.spaces.se3 import twist_inward
from ephs.semantics.spaces.vectors import add, combine, dot
from ephs.semantics.stage import Evaluator, Integer, Real, Vector

Force: TypeAlias = Callable[[Integer, Joint, Link], list[Real]]
"""The forces (d,) on the rates of a link's joint: called with the link's number, its joint and its constants."""


def no_force(i: Integer, joint: Joint, link: Link) -> list[Real]:
    """Nothing acts in the joints."""
    return [0.0] * joint.dim


def accelerate_outward(on: Evaluator, tree: Tree, q: Vector, rate: Vector, i: Integer) -> None:
    """ṙ of link i's joint and the link's acceleration beyond its bias, where the parent's is known."""

    def one(joint: Joint, link: Link) -> None:
        state = tree.states[i]
        change = twist_inward(state.rotation, state.place, tree.states[link.parent].change)
        rho: list[Real] = [0.0] * joint.dim
        if not joint.driven:
            gain, push = state.gain, state.push
            rho = [push[j] - dot(gain[j], change) for j in range(joint.dim)]
        state.change = add(change, combine(joint.basis, rho)) if joint.dim else change
        for j, value in enumerate(rate_outside(on, joint, link, q, rho)):
            rate[link.r_at + j] = value

    tree.visit(on, i, one)


def accelerations(on: Evaluator, tree: Tree, q: Vector, r: Vector, rate: Vector, force: Force = no_force) -> Integer:
    """ṙ at the elements q and rates r, into rate; 0, or 1 + a link whose joint moves no mass."""
    outward(on, tree, q, r)
    fault = on.counter(0)

    def gather(i: Integer) -> None:
        inward(on, tree, i, fault)
        load_inward(on, tree, q, force, i)

    tree.each(on, gather, down=True)
    tree.each(on, lambda i: accelerate_outward(on, tree, q, rate, i))
    return fault.value
