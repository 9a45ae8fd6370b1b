"""Efforts of a network that only balances determine, flows, and their derivatives: the program of all networks."""

from collections.abc import Callable
from functools import cache
from typing import Any, Final

from ephs.mechanics.tree.sweeps.network import Net, Stores, write_entry
from ephs.semantics.linear.dense import copy, lu, lu_solve
from ephs.semantics.spaces.rank import TINY
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Matrix,
    Program,
    Truth,
    Vector,
    indices,
    signature_of,
    vector,
)

UNSOLVED: Final = 9
"""Status where efforts do not follow from the balances of flows."""
ROUNDING: Final = 2e-15
"""Sum of flows that counts as zero, relative to what is added."""
ENOUGH: Final = 1e-9
"""The same where Newton's method gets no further."""
ROUNDS: Final = 30
_PLACE: Final[dict[str, Any]] = {
    "net": indices(), "reals": vector(), "parameters": vector(), "scal": vector(3), "given": vector(),
}  # fmt: skip
_ABOUT: Final[dict[str, Any]] = {"q": vector(), "s": vector(), "warmth": vector(), "made": vector()}
ATTACH: Final = signature_of(**_PLACE, **_ABOUT)
"""Signature of the network of a mechanism, which is called by its address."""


def solve_network(on: Evaluator, net: Net, q: Vector, s: Vector, warmth: Vector, made: Vector) -> Integer:
    """Write efforts and flows where rates are given in z; ``warmth``: temperatures; return a status."""
    known, head = net.known, net.head

    def warm(k: Integer) -> None:
        net.effort[head[0] + k] = warmth[net.temperature[k]]

    def give(k: Integer) -> None:
        net.effort[head[0] + (head[1] + k)] = net.given[k]

    on.loop(head[1], warm)
    on.loop(head[2], give)
    status = on.counter(0)
    status.value = net.store_efforts(on, s)

    def evaluate() -> None:
        status.value = net.flows(on, q, s, made)

    def newton() -> None:
        on.loop(head[4], lambda k: write_entry(net.effort, known + k, 0.0))
        _newton(on, net, evaluate, status)

    on.when(on.same(status.value, 0), lambda: on.when(head[4] > 0, newton, evaluate))
    _give(on, net)
    return status.value


def _give(on: Evaluator, net: Net) -> None:
    """Power of inputs at outer ports."""
    net.power[0] = 0.0
    first = net.head[0] + net.head[1]

    def effort(k: Integer) -> None:
        net.power[0] = net.power[0] + net.flow[first + k] * net.effort[first + k]

    def flow(k: Integer) -> None:
        net.power[0] = net.power[0] + net.given[net.head[2] + k] * net.effort[k]

    on.loop(net.head[2], effort)
    on.loop(net.effort.size, flow)


def _newton(on: Evaluator, net: Net, evaluate: Callable[[], None], status: Any) -> None:
    known, unknown = net.known, net.head[4]
    before, rounds = on.variable(1e300), on.counter(0)

    def step() -> None:
        _factorise(on, net, status)

        def less(k: Integer) -> None:
            net.step[k] = -net.flow[known + k]

        on.loop(unknown, less)
        lu_solve(on, net.matrix, net.pivot, net.step)

        def move(k: Integer) -> None:
            net.effort[known + k] = net.effort[known + k] + net.step[k]

        on.loop(unknown, move)

    def once() -> Truth:
        evaluate()
        worst = on.variable(0.0)

        def each_entry(k: Integer) -> None:
            at = known + k
            off = on.absolute(net.flow[at]) / on.maximum(net.gross[at], TINY)
            worst.value = on.maximum(worst.value, off)

        on.loop(unknown, each_entry)
        rounds.value = rounds.value + 1
        stuck = on.negate(worst.value < 0.5 * before.value)
        done = on.either(worst.value <= ROUNDING, on.both(stuck, worst.value <= ENOUGH))
        refused = on.negate(on.same(status.value, 0))
        left = on.either(refused, done)
        astray = on.both(on.negate(left), rounds.value >= ROUNDS)
        net.failed(on, status, on.select(astray, UNSOLVED, 0), net.head[6])
        before.value = worst.value
        on.when(on.negate(on.either(left, astray)), step)
        return on.either(left, on.negate(on.same(status.value, 0)))

    def again() -> None:
        step()
        evaluate()

    on.repeat(once)
    # Slopes of components have no derivatives of their own: those of efforts are right one step after the efforts.
    on.when(on.same(status.value, 0), again)


def _factorise(on: Evaluator, net: Net, status: Any) -> None:
    """Factorise the slopes of the balances by what they determine."""
    known, unknown = net.known, net.head[4]
    _still(on, net)

    def column(k: Integer) -> None:
        net.turned[known + k] = 1.0
        net.tangent(on)
        net.turned[known + k] = 0.0

        def each_entry(j: Integer) -> None:
            net.matrix[j, k] = net.changed[known + j]

        on.loop(unknown, each_entry)

    on.loop(unknown, column)
    sound = lu(on, net.matrix, net.pivot)
    net.failed(on, status, on.select(sound, 0, UNSOLVED), net.head[6])


def _still(on: Evaluator, net: Net) -> None:
    on.loop(net.turned.size, lambda k: write_entry(net.turned, k, 0.0))
    on.loop(net.moved.size, lambda k: write_entry(net.moved, k, 0.0))


def slopes_of(on: Evaluator, net: Net, out: Matrix) -> Integer:
    """Write the derivatives (known, known + bent) of flows, where `solve` has been; return a status.

    By rates, temperatures, prescribed efforts and states, then by degrees of freedom of joints that are read.
    """
    known, unknown, status = net.known, net.head[4], on.counter(0)
    on.when(unknown > 0, lambda: _factorise(on, net, status))

    def column(k: Integer) -> None:
        _still(on, net)
        at = k - net.first_state
        on.when(at < 0, lambda: write_entry(net.turned, k, 1.0))
        on.when(on.both(at >= 0, k < known), lambda: _by_state(on, net, at))
        on.when(k >= known, lambda: _by_read(on, net, -1 - net.bent[on.select(k < known, 0, k - known)]))
        net.tangent(on)

        def follow() -> None:
            def less(j: Integer) -> None:
                net.step[j] = -net.changed[known + j]

            on.loop(unknown, less)
            lu_solve(on, net.matrix, net.pivot, net.step)
            copy(on, net.step.part(0, unknown), net.turned.part(known, unknown))
            net.tangent(on)

        on.when(unknown > 0, follow)

        def each_entry(j: Integer) -> None:
            out[j, k] = net.changed[j]

        on.loop(known, each_entry)

    on.loop(out.columns, column)
    return status.value


def _by_read(on: Evaluator, net: Net, place: Integer) -> None:
    def each_entry(j: Integer) -> None:
        on.when(on.same(net.vary[j], place), lambda: write_entry(net.moved, j, 1.0))

    on.loop(net.vary.size, each_entry)


def _by_state(on: Evaluator, net: Net, at: Integer) -> None:
    """Changes of efforts and of what is read with a state."""

    def each_store(it: Stores) -> None:
        n, mine = it.dims[0], at - it.state

        def each_entry(j: Integer) -> None:
            net.turned[it.effort + j] = net.kept[it.kept + (j * n + mine)]

        on.when(on.both(mine >= 0, mine < n), lambda: on.loop(n, each_entry))

    net.stores(on, each_store)
    _by_read(on, net, at + net.head[5])


@cache
def network_program() -> Program:
    """Return the program of all networks."""

    kinds = {**_PLACE, **_ABOUT}
    return Program("network", solve=Entry.bundled(solve_network, kinds, (_PLACE, Net.of)))
