"""The laws of one step of the natural discretisation: balances; discretising commutes with composing.

A step keeps them to what Newton's method left and to rounding, whatever its length; tolerances hold both.
"""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from ephs.operad import Path, Quantity
from ephs.operad.charges import ENTROPY
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.meaning.step import Solved, solved
from ephs.semantics.primitives.behaviour import NaturalBehaviour
from ephs.semantics.primitives.primitives import Irreversible, Storage
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.rank import TINY
from ephs.semantics.systems.probe import Probe, Verdict

UNSOLVED = 1e-6
"""A step whose residual stays above this has no solution near by; the laws of steps are vacuous there."""
ROUNDING = float(np.finfo(float).eps)
EVALUATION = 1e-12
"""Rounding relative to the sum of absolute terms: a step's relations are some hundred roundings deep."""
VACUOUS = Verdict(0.0, 0.0, "vacuous: no step was found, a constraint contradicts the state or h is too large")


@lru_cache(maxsize=1)  # all laws of a step at one probe; probes are distinguished by identity
def _solved(probe: Probe) -> Solved:
    return solved(probe.system, probe.state, NaturalBehaviour(probe.reference, probe.h), probe.inputs, probe.ports)


def _after(probe: Probe, solved: Solved) -> dict[Path, Array]:
    return {
        path: manifold(quantity.space).retract(probe.state[path], probe.h * solved.rates[path])
        for path, quantity in probe.system.states.items()
    }


def _energies(probe: Probe, solved: Solved, *, exergy: bool) -> Iterator[tuple[float, float]]:
    """(before, after) of each storage."""
    after = _after(probe, solved)
    for path, primitive in probe.system.leaves():
        if isinstance(primitive, Storage):
            of = primitive.exergy if exergy else primitive.total_energy
            here, there = (
                {port: values[path / port] for port in primitive.bundle.ports} for values in (probe.state, after)
            )
            yield of(here, probe.reference), of(there, probe.reference)


def energy_balance(probe: Probe) -> Verdict:
    """The energy of all storages changes by what outer ports supply, h Σ⟨eᴱ|f⟩."""
    solved = _solved(probe)
    if solved.residual > UNSOLVED:
        return VACUOUS
    terms = [there - here for here, there in _energies(probe, solved, exergy=False)]
    sizes = [abs(here) + abs(there) for here, there in _energies(probe, solved, exergy=False)]
    for port, (flow, effort) in solved.outer.items():
        intensive = probe.reference.intensive(probe.system.interface[port].quantity)
        terms.append(-probe.h * float((effort + intensive) @ flow))
    return _balance(probe, solved, terms, sizes, "energy", "J")


def exergy_balance(probe: Probe) -> Verdict:
    """The exergy of all storages changes by the supply h Σ⟨e|f⟩ less the destruction h θ₀ Σσ."""
    solved = _solved(probe)
    if solved.residual > UNSOLVED:
        return VACUOUS
    terms = [there - here for here, there in _energies(probe, solved, exergy=True)]
    sizes = [abs(here) + abs(there) for here, there in _energies(probe, solved, exergy=True)]
    # an exergy is a difference of two larger terms
    sizes += [abs(here) + abs(there) for here, there in _energies(probe, solved, exergy=False)]
    terms += [-probe.h * float(effort @ flow) for flow, effort in solved.outer.values()]
    theta = probe.reference.temperature
    for _, made, size in _productions(probe, solved):
        terms.append(probe.h * theta * made)
        sizes.append(probe.h * theta * size)
    return _balance(probe, solved, terms, sizes, "exergy", "J")


def entropy_balance(probe: Probe) -> Verdict:
    """The entropy of all storages changes by the supply of outer ports and what irreversible components make."""
    solved = _solved(probe)
    if solved.residual > UNSOLVED:
        return VACUOUS
    productions = list(_productions(probe, solved))
    terms = [*_amounts(probe, solved, ENTROPY), *(-probe.h * made for _, made, _ in productions)]
    return _balance(probe, solved, terms, [probe.h * size for *_, size in productions], "entropy", "J/K")


def conservation(probe: Probe) -> Verdict:
    """Volumes, atoms and all other charges change by what outer ports supply and by nothing else."""
    solved = _solved(probe)
    charges = {charge for q in probe.system.states.values() for charge, _ in q.charges if charge != ENTROPY}
    if not charges:
        return Verdict(0.0, 0.0, "no such state")
    found = [_balance(probe, solved, _amounts(probe, solved, name), [], name, "in all") for name in sorted(charges)]
    return max(found, key=lambda verdict: verdict.defect - verdict.tolerance)


def _amounts(probe: Probe, solved: Solved, charge: str) -> list[float]:
    """Changes of a charge where it is stored, less what outer ports supply."""
    terms: list[float] = []
    for path, quantity in probe.system.states.items():
        terms += [probe.h * amount for amount in _carried(quantity, charge, solved.rates[path])]
    for port, (flow, _) in solved.outer.items():
        quantity = probe.system.interface[port].quantity
        terms += [-probe.h * amount for amount in _carried(quantity, charge, flow)]
    return terms


def _carried(quantity: Quantity, charge: str, flow: Array) -> list[float]:
    row = dict(quantity.charges).get(charge, ())
    return [number * float(entry) for number, entry in zip(row, flow, strict=False)]


def entropy_production(probe: Probe) -> Verdict:
    """σ ≥ 0 at each irreversible component."""
    solved = _solved(probe)
    if solved.residual > UNSOLVED:
        return VACUOUS
    found = list(_productions(probe, solved))
    if not found:
        return Verdict(0.0, 0.0, "no irreversible component")
    path, made, size = max(found, key=lambda entry: -entry[1] / max(entry[2], TINY))
    defect = max(0.0, -made / max(size, TINY))
    return Verdict(defect, EVALUATION, f"{len(found)} irreversible components, {path} makes the least: {made:.1e} W/K")


def _productions(probe: Probe, solved: Solved) -> Iterator[tuple[Path, float, float]]:
    """Each irreversible component, the entropy it makes in W/K, and the sum of the absolute terms in that."""
    after = _after(probe, solved)
    for slot in probe.system.descriptor().components:
        primitive = slot.primitive
        if isinstance(primitive, Irreversible):
            middle = {
                port: manifold(s.quantity.space).midpoint(probe.state[s.path], after[s.path])
                for port, s in zip(primitive.reads, slot.reads, strict=True)
            }
            effort = solved.efforts[slot.path]
            hot = primitive.bundle.indicator(ENTROPY)
            made = -float(hot @ primitive.flow(middle, effort, probe.reference))
            terms = np.abs(primitive.matrix(middle, effort, probe.reference)) @ np.abs(effort)
            yield slot.path, made, float(hot @ terms) / probe.reference.temperature


def _balance(probe: Probe, solved: Solved, terms: list[float], sizes: list[float], what: str, unit: str) -> Verdict:
    """Terms of a balance, whose sum vanishes, with the magnitudes for its tolerance."""
    if solved.residual > UNSOLVED:
        return VACUOUS
    scale = sum(map(abs, terms)) + sum(sizes)
    # a residual of a balance of flows meets an effort, a residual of an effort meets a rate
    numbers = [*solved.rates.values(), *(e for _, e in solved.outer.values()), *solved.efforts.values()]
    largest = max((float(np.abs(n).max(initial=0.0)) for n in numbers), default=0.0)
    largest += probe.reference.temperature + probe.reference.pressure
    count = sum(n.size for n in numbers)
    left = probe.h * (solved.residual + ROUNDING + solved.rounding / largest) * count * largest
    defect = abs(sum(terms))
    detail = f"{what} is balanced to {defect:.1e} of {scale:.2e} {unit}"
    return Verdict(defect, EVALUATION * scale + left, detail)


def naturality(probe: Probe) -> Verdict:
    """Discretise, then compose = flatten, then discretise."""
    nested = _solved(probe)
    if nested.residual > UNSOLVED:
        return VACUOUS
    behaviour = NaturalBehaviour(probe.reference, probe.h)
    flat = solved(probe.system.flatten(), probe.state, behaviour, probe.inputs, probe.ports)
    if flat.residual > UNSOLVED:
        return VACUOUS
    scale = max([1.0, *(float(np.abs(w).max(initial=0.0)) for w in flat.rates.values())])
    worst = max(
        (float(np.abs(flat.rates[path] - nested.rates[path]).max(initial=0.0)) for path in flat.rates),
        default=0.0,
    )
    worst /= scale
    # two Newton iterations with other eliminations: condition 10⁴ times the rounding of an evaluation
    allowed = 1e4 * 8.0 * ROUNDING + (flat.rounding + nested.rounding) / scale
    return Verdict(worst, allowed, f"rates of {len(flat.rates)} states agree to {worst:.1e}")
