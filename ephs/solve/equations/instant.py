"""The continuous equations at one instant: constraints differentiated once and solved with least-norm multipliers.

Dense and plain: an oracle for integrators, and what reports forces. Constraints have differentiation index 2, so that
their rate C ė + Ċ e = 0 determines multipliers and rates (Lohmayer, Capobianco, Leyendecker, section 5).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.operad import Path, Quantity
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.descriptor.curvature import curvature, flow_slopes, turned
from ephs.semantics.descriptor.descriptor import ComponentSlot, Descriptor, Input
from ephs.semantics.linear.sums import uncancelled
from ephs.semantics.primitives.primitives import Irreversible, Reversible
from ephs.semantics.spaces.decompositions import least_squares, svd
from ephs.semantics.spaces.rank import ELIMINATION, IMPLICIT, SPANNED, rank_of
from ephs.solve.equations.sparse import Index
from ephs.solve.posing.errors import Outcome, SolveError

ROUNDS, SETTLED = 50, 1e-12
"""Iterations for efforts that balances determine, and their relative change at which these end."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class InstantRates:
    """Rates, efforts and multipliers at an instant.

    Parameters
    ----------
    rates
        State path -> (dim,) left-trivialised rate.
    efforts
        (effort_size,).
    multipliers
        (multiplier_size,) of least norm.
    determined
        (multiplier_size,) whether each is the only one possible.
    flows
        Outer port -> (dim,) the flow into the system.
    """

    descriptor: Descriptor
    rates: Mapping[Path, Array]
    efforts: Array
    multipliers: Array
    determined: Array
    flows: Mapping[Path, Array]

    def multiplier(self, component: Path) -> Array:
        """The multipliers of a component, NaN where they are not determined."""
        slot = next(s for s in self.descriptor.components if s.path == component)
        where = slice(slot.multiplier, slot.multiplier + slot.multipliers)
        return np.where(self.determined[where], self.multipliers[where], np.nan)


def rates_read(slot: ComponentSlot) -> list[int]:
    """Places of the rates of the states that a component reads."""
    return [i for s in slot.reads for i in range(s.rates.start, s.rates.stop)]


def is_velocity(quantity: Quantity) -> bool:
    """Whether efforts of a quantity are velocities: it is odd under time reversal, and no flux linkage."""
    return quantity.parity < 0 and quantity.kind != "flux_linkage"


def rate_balances(d: Descriptor, x: Array) -> list[dict[int, float]]:
    """Flow balances of junctions that store nothing, as conditions on velocities: effort -> coefficient.

    Such a junction is that of a tendon's tension, where the rates of its segments and of its whole length add up to 0.
    Balances with other terms than velocities are left out.
    """
    velocities = {i for slot in d.junctions if is_velocity(slot.quantity) for i in range(d.effort_size)[slot.efforts]}
    inner = (slot for slot in d.junctions if not (slot.exposed or is_velocity(slot.quantity)))
    rows: dict[int, dict[int, float]] = {i: {} for slot in inner for i in range(d.effort_size)[slot.efforts]}
    for slot in d.components:
        if not isinstance(slot.primitive, Reversible):
            for effort in slot.efforts:
                rows.pop(effort, None)
    for slot in d.components:
        if not isinstance(slot.primitive, Reversible) or rows.keys().isdisjoint(slot.efforts):
            continue
        left, constraint = slot.primitive.structure(d.point(slot, x))
        for i, effort in enumerate(slot.efforts):
            if effort not in rows:
                continue
            if np.any(constraint[:, i]):
                del rows[effort]
                continue
            for other, by in zip(slot.efforts, left[i].tolist(), strict=True):
                rows[effort][other] = rows[effort].get(other, 0.0) + by
    found = ({other: by for other, by in row.items() if by} for row in rows.values())
    return [row for row in found if row and row.keys() <= velocities]


def instant(
    descriptor: Descriptor,
    reference: Reference,
    x: Array,
    inputs: Mapping[Path, Input] | None = None,
    rising: Mapping[Path, Array] | None = None,
) -> InstantRates:
    """Solve the equations at the states x.

    Parameters
    ----------
    rising
        Outer port -> derivative by time of the effort that is prescribed there; zero where not given.
    """
    d = descriptor
    given = d.complete_inputs(inputs)
    stored = stored_efforts(d, reference, x)
    constraint = constraints_of(d, x)
    efforts = _all_efforts(d, reference, x, constraint, stored, given)
    flows = _flows(d, reference, x, efforts)
    n_w, n_e, n_l = d.rate_size, d.effort_size, d.multiplier_size
    driven = [slot for slot in d.outer if given[slot.path].effort]
    n_o = sum(slot.quantity.space.dim for slot in driven)
    size = n_w + n_l + n_e + n_o  # unknowns: rates, multipliers, rates of efforts, outer flows
    _w, lam, rise = slice(0, n_w), slice(n_w, n_w + n_l), slice(n_w + n_l, n_w + n_l + n_e)
    balance, right = np.zeros((n_e, size)), -flows
    balance[:, lam] = constraint.T
    growth = np.zeros((n_w, size))
    for slot, storage in d.storages:
        rates = np.array(rates_read(slot), dtype=int)
        balance[list(slot.efforts), rates] += 1.0
        growth[np.ix_(rates, rates)] -= curvature(storage, d.point(slot, x), reference)
        growth[rates, [rise.start + i for i in slot.efforts]] += 1.0
    for slot in d.outer:
        if not given[slot.path].effort:
            right[slot.efforts] += given[slot.path].value
    held, lift, at = np.zeros((n_o, size)), np.zeros(n_o), n_w + n_l + n_e
    row = 0
    for slot in driven:
        dim = slot.quantity.space.dim
        balance[slot.efforts, at + row : at + row + dim] -= np.eye(dim)
        held[row : row + dim, rise][:, slot.efforts] = np.eye(dim)
        lift[row : row + dim] = (rising or {}).get(slot.path, 0.0)
        row += dim
    differentiated = np.zeros((n_l, size))
    differentiated[:, rise] = constraint
    turning = -_turned_constraints(d, reference, x, efforts, _known_rates(d, constraint, flows))
    matrix = np.vstack([balance, growth, differentiated, held])
    scale = np.abs(matrix).max(axis=1, initial=0.0)
    scale[scale == 0.0] = 1.0  # flows that are balanced by efforts alone
    everything = np.concatenate([right, np.zeros(n_w), turning, lift])
    solution, free = _least_norm(matrix / scale[:, None], everything / scale)
    outer = {slot.path: given[slot.path].value for slot in d.outer}
    row = at
    for slot in driven:
        outer[slot.path] = solution[row : row + slot.quantity.space.dim]
        row += slot.quantity.space.dim
    return InstantRates(
        d,
        {slot.path: solution[slot.rates] for slot in d.states},
        efforts,
        solution[lam],
        np.abs(free[lam]).max(axis=1, initial=0.0) < SPANNED,
        outer,
    )


def _least_norm(matrix: Array, right: Array) -> tuple[Array, Array]:
    """Solution of least norm, NaN where it depends on a NaN on the right, and a basis (n, k) of the null space."""
    u, sigma, vt = svd(matrix)
    rank, lost = rank_of(sigma, IMPLICIT), np.isnan(right)
    solution = vt[:rank].T @ ((u[:, :rank].T @ np.where(lost, 0.0, right)) / sigma[:rank])
    if lost.any():
        inverse = np.abs((vt[:rank].T / sigma[:rank]) @ u[:, :rank].T)
        solution[inverse[:, lost].max(axis=1) > SPANNED * inverse.max(axis=1)] = np.nan
    return solution, vt[rank:].T


def constraints_of(d: Descriptor, x: Array) -> Array:
    """All constraints as one matrix on the efforts, (multiplier_size, effort_size)."""
    out = np.zeros((d.multiplier_size, d.effort_size))
    for slot in d.components:
        if slot.multipliers and isinstance(slot.primitive, Reversible):
            _, constraint = slot.primitive.structure(d.point(slot, x))
            _place(out, slot, uncancelled(constraint, slot.efforts))
    return out


def _place(out: Array, slot: ComponentSlot, constraint: Array) -> None:
    rows = np.arange(slot.multiplier, slot.multiplier + slot.multipliers)
    np.add.at(out, (rows[:, None], np.array(slot.efforts, dtype=int)[None, :]), constraint)


def stored_efforts(d: Descriptor, reference: Reference, x: Array) -> dict[int, float]:
    """Efforts that storages give, by place."""
    out: dict[int, float] = {}
    for slot, storage in d.storages:
        out |= dict(zip(slot.efforts, storage.effort(d.point(slot, x), reference).tolist(), strict=True))
    return out


def _all_efforts(
    d: Descriptor,
    reference: Reference,
    x: Array,
    constraint: Array,
    stored: dict[int, float],
    given: Mapping[Path, Input],
) -> Array:
    """Efforts that storages give or inputs prescribe, and the others from the constraints and balances.

    Raises
    ------
    SolveError
        Newton's method does not find them.
    """
    known, supplied = dict(stored), np.zeros(d.effort_size)
    for slot in d.outer:
        if given[slot.path].effort:
            known |= dict(zip(range(slot.at, slot.at + slot.quantity.space.dim), given[slot.path].value, strict=True))
        else:
            supplied[slot.efforts] += given[slot.path].value
    out = np.zeros(d.effort_size)
    places = np.array(sorted(known), dtype=int)
    out[places] = [known[int(i)] for i in places]
    others = np.setdiff1d(np.arange(d.effort_size), places)
    if others.size:
        _balance(d, reference, x, constraint, out, others, supplied)
    return out


def _balance(
    d: Descriptor, reference: Reference, x: Array, constraint: Array, efforts: Array, others: Index, supplied: Array
) -> None:
    """Find the efforts that nothing stores: constraints hold, and flows into their junctions are balanced."""
    count, multipliers = others.size, np.zeros(len(constraint))
    matrix = np.zeros((count + len(constraint), count + len(constraint)))
    matrix[:count, count:], matrix[count:, :count] = constraint[:, others].T, constraint[:, others]
    for _ in range(ROUNDS):
        missed = _flows(d, reference, x, efforts) + constraint.T @ multipliers - supplied
        matrix[:count, :count] = _flow_slopes(d, reference, x, efforts)[np.ix_(others, others)]
        scale = np.abs(matrix).max(axis=1)
        scale[scale == 0.0] = 1.0
        right = np.concatenate([missed[others], constraint @ efforts]) / scale
        step = least_squares(matrix / scale[:, None], -right, part=ELIMINATION)
        efforts[others] += step[:count]
        multipliers += step[count:]
        if np.abs(step[:count]).max() <= SETTLED * np.abs(efforts).max():
            return
    junction = next(slot for slot in d.junctions if others[0] in range(slot.efforts.start, slot.efforts.stop))
    raise SolveError(Outcome.DIVERGED, str(junction.path), "efforts that nothing stores, by the balance of flows")


def _flows(d: Descriptor, reference: Reference, x: Array, efforts: Array) -> Array:
    """Sum at each junction of the flows that efforts alone determine, (effort_size,)."""
    out = np.zeros(d.effort_size)
    for slot in d.components:
        e = efforts[list(slot.efforts)]
        point = d.point(slot, x)
        if isinstance(slot.primitive, Irreversible):
            np.add.at(out, list(slot.efforts), slot.primitive.flow(point, e, reference))
        elif isinstance(slot.primitive, Reversible):
            np.add.at(out, list(slot.efforts), slot.primitive.structure(point)[0] @ e)
    return out


def _flow_slopes(d: Descriptor, reference: Reference, x: Array, efforts: Array) -> Array:
    """(effort_size, effort_size) derivatives of these sums by the efforts."""
    out = np.zeros((d.effort_size, d.effort_size))
    for slot in d.components:
        at, point = np.array(slot.efforts, dtype=int), d.point(slot, x)
        if isinstance(slot.primitive, Irreversible):
            np.add.at(out, np.ix_(at, at), flow_slopes(slot.primitive, point, efforts[at], reference))
        elif isinstance(slot.primitive, Reversible):
            np.add.at(out, np.ix_(at, at), slot.primitive.structure(point)[0])
    return out


def _known_rates(d: Descriptor, constraint: Array, flows: Array) -> Array:
    """Rates of the states at junctions without constraints: those are all that constraints may read."""
    touched = np.abs(constraint).max(axis=0, initial=0.0) > 0.0
    out = np.zeros(d.rate_size)
    for slot, _ in d.storages:
        for rate, effort in zip(rates_read(slot), slot.efforts, strict=True):
            out[rate] = 0.0 if touched[effort] else -flows[effort]
    return out


def _turned_constraints(d: Descriptor, reference: Reference, x: Array, efforts: Array, rates: Array) -> Array:
    """dC/dt e along known rates, (multiplier_size,)."""
    out = np.zeros(d.multiplier_size)
    for slot in d.components:
        known = rates[rates_read(slot)]
        if slot.multipliers and isinstance(slot.primitive, Reversible) and known.any():
            where = slice(slot.multiplier, slot.multiplier + slot.multipliers)
            out[where] = turned(slot.primitive, d.point(slot, x), efforts[list(slot.efforts)], known, reference)
    return out
