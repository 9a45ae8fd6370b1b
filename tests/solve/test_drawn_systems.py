"""Runs of drawn systems, by every method: what changes is the integral of the rates that the stack of equations has."""

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from numpy.polynomial import Chebyshev

import ephs
from ephs.mechanics.methods.registry import METHODS
from ephs.semantics import Irreversible, Reference, Storage
from ephs.testing import systems
from tests.numerics import largest
from tests.semantics.stacked import RANK, components_of, equations_of, path_of, states_of

TIGHT = {name: 10.0 ** (-1.5 * method.order) for name, method in METHODS.items() if method.systems}
"""Relative tolerance of a step by method."""
STEPS = 100.0
"""Whose errors add up in a run."""
UNTIL, DEGREE, REFERENCE = 0.1, 16, Reference()
NODES = 0.5 * UNTIL * (1.0 - np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE))
"""Of a polynomial of that degree; every other one of half of it."""


def moving(system, x, given):
    """Rates by state, entropy made by component, and power at outer ports; None where the stack leaves them open.

    Parameters
    ----------
    x
        Values by the ports of storages: (boxes, port).
    given
        Outer unknowns that have a value.
    """
    parts = dict(components_of(system))
    value = {node: x[min(group & x.keys())] for group in states_of(system) for node in group}
    lossy = {boxes: part.bundle for boxes, part in parts.items() if isinstance(part, Irreversible)}
    efforts = {boxes: np.zeros(bundle.size) for boxes, bundle in lossy.items()}
    for _ in range(200):
        rows = [*equations_of(system, lambda *node: value[node], efforts, REFERENCE, 1.0)]
        rows += [{unknown: 1.0, ("one",): -number} for unknown, number in given.items()]
        place = {name: k for k, name in enumerate(dict.fromkeys(name for row in rows for name in row))}
        matrix = np.zeros((len(rows), len(place)))
        for i, row in enumerate(rows):
            matrix[i, [place[name] for name in row]] = list(row.values())
        right = -matrix[:, (one := place.pop(("one",)))]
        matrix[:, one] = 0.0
        u, sizes, v = np.linalg.svd(matrix)
        rank = int(np.sum(sizes > RANK * sizes[0]))
        found = v[:rank].T @ (u[:, :rank].T @ right / sizes[:rank])
        free = np.linalg.norm(v[rank:], axis=0) > RANK

        def read(kind, boxes, port, q, found=found, place=place):
            return [found[place[kind, (boxes, port), i]] for i in range(q.space.dim)]

        at = {boxes: {kind: np.concatenate([read(kind, boxes, port, q) for port, _, q in bundle.items()])
                      for kind in ("effort", "flow")} for boxes, bundle in lossy.items()}  # fmt: skip
        settled = all(largest(at[b]["effort"] - e) <= 1e-13 * (1.0 + largest(e)) for b, e in efforts.items())
        efforts = {boxes: each["effort"] for boxes, each in at.items()}
        if settled:
            break
    wanted = [k for name, k in place.items() if name[0] == "rate" or name[1][0] in lossy or name[1][0] == ()]
    if not settled or free[wanted].any() or largest(matrix @ found - right) > 1e-9 * (1.0 + largest(found)):
        return None
    rates = [found[place["rate", node, i]] for node in x for i in range(x[node].size)]
    made = [each["effort"] @ each["flow"] / REFERENCE.temperature for each in at.values()]
    powers = [found[place["effort", *name[1:]]] * found[place["flow", *name[1:]]] for name in given]
    return np.array([*rates, *made, sum(powers)])


def changed(sol, system, x):
    """The same of a run: how far it has come by the last instant."""
    makers = [sol.ledgers.makers[path_of(b)] for b, part in components_of(system) if isinstance(part, Irreversible)]
    ends = np.concatenate([np.atleast_1d(sol[str(path_of(*node))][-1]) for node in x])
    starts = np.concatenate([*x.values(), np.zeros(0)])
    exergetic = sum(np.zeros(1), start=sol.ledgers.supplied[-1])
    return np.array([*(ends - starts), *(made[-1] for made in makers), exergetic])


@pytest.mark.long
@settings(suppress_health_check=list(HealthCheck), max_examples=10, deadline=None)
@given(st.data(), st.integers(0, 2**16))
def test_states_and_ledgers_change_by_the_integrals_of_their_rates(data, seed):
    system, rng = data.draw(systems(groups=False, max_depth=2, max_junctions=2)), np.random.default_rng(seed)
    assume(all(of.power for of in system.interface.values()))
    parts = dict(components_of(system))
    stored = [next(node for node in group if isinstance(parts.get(node[0]), Storage)) for group in states_of(system)]
    x = {(b, p): rng.uniform(0.2, 1.0, parts[b].interface[p].quantity.space.dim) for b, p in sorted(stored)}
    kinds = {port: data.draw(st.sampled_from(("effort", "flow"))) for port in system.interface}

    def drive(t):
        return 0.3 + np.sin(2.0 * t)

    def rates(t, at):
        dims = {port: of.quantity.space.dim for port, of in system.interface.items()}
        return moving(system, at, {(kinds[p], ((), p), i): drive(t) for p in kinds for i in range(dims[p])})

    assume(0 < sum(value.size for value in x.values()) <= 4 and rates(0.0, x) is not None)
    inputs = {str(p): {kind: lambda t, n=system.interface[p].quantity.space.dim: np.full(n, drive(t))}
              for p, kind in kinds.items()}  # fmt: skip
    start = {str(path_of(*node)): value for node, value in x.items()}
    for method, rtol in TIGHT.items():
        sol = ephs.simulate(
            system, UNTIL, initial=start, inputs=inputs, save_at=NODES, method=method, rtol=rtol, atol=rtol
        )
        seen = np.array([
            rates(t, {node: np.atleast_1d(sol[str(path_of(*node))][i]) for node in x}) for i, t in enumerate(sol.t)
        ])  # fmt: skip
        whole, half = (
            np.array([Chebyshev.fit(NODES[::k], row[::k], DEGREE // k).integ()(UNTIL)
                      - Chebyshev.fit(NODES[::k], row[::k], DEGREE // k).integ()(0.0) for row in seen.T])
            for k in (1, 2)
        )  # fmt: skip
        allowed = STEPS * rtol * (1.0 + np.abs(whole)) + np.abs(whole - half)
        found = changed(sol, system, x)
        assert np.all(np.abs(found - whole) <= allowed), (method, system)
        if STEPS * rtol < 1e-4 < 1e-2 < largest(whole):  # the control
            assert np.any(np.abs(found - 1.1 * whole) > allowed)
