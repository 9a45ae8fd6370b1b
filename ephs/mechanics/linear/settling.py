"""Systems at rest, by implicit Euler steps of growing length; mechanisms begin at the balance of their forces."""

from dataclasses import replace

import numpy as np

from ephs.mechanics.linear.balance import STALLED, balanced, restless
from ephs.mechanics.linear.freedoms import lengths_of
from ephs.mechanics.linear.pencil import Pencil, mechanism_of
from ephs.mechanics.linear.structure import largest_entry
from ephs.mechanics.runs.assembling import FlatJoints, assembled, flat_joints
from ephs.mechanics.tree.finding.frames import frames_of
from ephs.mechanics.tree.finding.tendons import tendon_lengths
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import AssemblyError
from ephs.semantics.descriptor.descriptor import Descriptor, StateSlot
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.codes import VECTOR
from ephs.solve.posing.errors import OptionError, SolveError
from ephs.solve.posing.problem import Problem

SHORTEST, LEAST, SETTLED, CLOSES = 1e-12, 1e-9, 1e-12, 1e-10
"""Artificial time: the shortest step, the least scale of states, the residual and the gaps of joints at the end."""
STEPS = 200

At = tuple[dict[Path, Array], float, int]
"""States, the largest rate, per second, relative to them, and the number of steps."""


def settled(problem: Problem) -> At:
    """The states of a system at rest near its initial ones.

    Raises
    ------
    SimulationError
        There are none; it names what still moves.
    """
    pencil, d = Pencil(problem), problem.descriptor
    start, steps = _balance(problem)
    if start is None:
        return _at_rest(problem, pencil, problem.point)
    x = d.pack(start)
    try:
        rates = pencil.unknowns(x)[: pencil.n_w]
    except SolveError as error:
        raise restless(error.path, error.equation or error.outcome.value) from error.cause
    for slot in _momenta(d):  # its forces are balanced, as a part of their sizes, which no state is
        rates[slot.rates] = 0.0
    left = largest_entry(rates[pencil.counted]) / max(largest_entry(x), LEAST)
    return (start, left, steps) if left <= STALLED else _at_rest(problem, pencil, x)


def _balance(problem: Problem) -> tuple[dict[Path, Array] | None, int]:
    """States of a mechanism at the balance of its forces, and the number of steps; None of other systems.

    Raises
    ------
    SimulationError
        There is none.
    """
    still = {slot.path: np.zeros(6) for slot in _momenta(problem.descriptor)}
    try:
        model = mechanism_of(replace(problem, initial={**problem.initial, **still}))
    except OptionError:  # what has no place in joint coordinates settles as other systems do
        return None, 0
    if model is None or len(model.layout.attached) > len(lengths_of(model)):
        return None, 0
    for name, parts in model.layout.edges.items():
        if any(edge.motion is not None and edge.motion.rate(0.0) for _, edge in parts):
            raise restless(f"joints.{name}", "its motion is prescribed")
    state, _, steps, _ = balanced(model)
    return model.states(state), steps


def _momenta(d: Descriptor) -> list[StateSlot]:
    """The momenta of bodies."""
    return [link.momentum for link in frames_of(d).links if link.momentum is not None]


def _at_rest(problem: Problem, pencil: Pencil, x: Array) -> At:
    """The states at the end of artificial time."""
    d, joints, h = problem.descriptor, flat_joints(problem.descriptor), 1e-3
    z, size, left, done = np.zeros(pencil.model.unknowns), 0.0, np.inf, 0
    try:
        for step in range(STEPS):
            done = step
            found = pencil.implicit_step(x, z, h)
            if found is None or _beyond_half_a_turn(d, h * found[: pencil.n_w]):
                h *= 0.25
                if h < SHORTEST:
                    break
                continue
            z, before = found, x
            x = d.advance(x, h * z[: pencil.n_w])
            size = max(largest_entry(x), LEAST)
            moved = largest_entry(x - before) / size
            left = largest_entry(z[: pencil.n_w][pencil.counted]) / size
            if not np.isfinite(left) or size > 1e12:
                break
            if h >= 1e6 and left <= SETTLED:
                closed = d.pack(_closed(joints, d.unpack(x)))
                if largest_entry(closed - x) <= CLOSES * size:
                    return d.unpack(closed), left, step
                x, z, h = closed, np.zeros_like(z), 1e-3
                continue
            h = min(h * (4.0 if moved < 0.5 else 1.5), 1e12)
    except SolveError as error:
        raise restless(error.path, error.equation or error.outcome.value) from error.cause
    fastest = max(d.states, key=lambda slot: largest_entry(z[slot.rates]))
    rate = largest_entry(z[fastest.rates])
    raise restless(str(fastest.path), f"after {done} steps it still changes by {rate:.3g} a second")


def _closed(joints: FlatJoints, states: dict[Path, Array]) -> dict[Path, Array]:
    """The states with bodies where the joints put them: steps follow the rates of the joints, which open them.

    Raises
    ------
    SimulationError
        A loop is open.
    """
    if not joints.links:
        return states
    try:
        states = assembled(joints, states, joints.relative)
    except AssemblyError as error:
        raise restless("", f"{error}: the way there is too far for its loops") from error
    return states | dict(tendon_lengths(joints.frames, states))


def _beyond_half_a_turn(d: Descriptor, change: Array) -> bool:
    """Whether a change of the states goes around: steps of whole turns solve the equations without coming to rest."""
    for slot in d.states:
        group, v = manifold(slot.quantity.space), change[slot.rates]
        if group.code != VECTOR and largest_entry(group.log(group.exp(v)) - v) > 1.0:
            return True
    return False
