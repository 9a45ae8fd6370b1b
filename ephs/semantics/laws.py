"""The laws of systems, as values: what composites inherit from their parts, measured at a probe.

Each law is stated once, here. Tests, `System.check`, `ephs check` and `ephs.testing` run the same objects.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import final

import numpy as np

from ephs.operad import ROOT, Path, Pattern
from ephs.semantics.behaviour import Natural
from ephs.semantics.bundle import Array, Bundle, Reference
from ephs.semantics.checks import random_point
from ephs.semantics.descriptor import Input
from ephs.semantics.natural import Solved, solve_flat, solve_nested
from ephs.semantics.primitives import Irreversible, Storage
from ephs.semantics.pattern_relation import pattern_relation
from ephs.semantics.spaces import manifold
from ephs.semantics.subspace import Subspace
from ephs.semantics.system import System

__all__ = ["SYSTEM_LAWS", "Probe", "SystemLaw", "Verdict", "random_probe", "system_law"]


UNSOLVED = 1e-6
"""A step whose residual stays above this has no solution near by; the laws of steps are vacuous there."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Probe:
    """Where laws are measured: a system at a state, over a step of h seconds.

    Parameters
    ----------
    inputs
        What is prescribed at the outer power ports.
    efforts
        Arguments of the Onsager matrices by component, where a relation is taken at an instant.
    """

    system: System
    state: Mapping[Path, Array]
    inputs: Mapping[Path, Input] = field(default_factory=dict[Path, Input])
    efforts: Mapping[Path, Array] = field(default_factory=dict[Path, Array])
    reference: Reference = field(default_factory=Reference)
    h: float = 1e-2


@final
@dataclass(frozen=True, slots=True)
class Verdict:
    """How far a law is from holding, and how far rounding may put it."""

    defect: float
    tolerance: float
    detail: str

    @property
    def holds(self) -> bool:
        """Whether the defect is explained by rounding."""
        return self.defect <= self.tolerance


@final
@dataclass(frozen=True, slots=True)
class SystemLaw:
    """A law of systems: its name, what it says, and how to measure its defect."""

    name: str
    statement: str
    measure: Callable[[Probe], Verdict]

    def __call__(self, probe: Probe) -> Verdict:
        """Measure the law at a probe."""
        return self.measure(probe)


def random_probe(
    system: System, seed: int = 0, *, reference: Reference | None = None, h: float = 1e-2
) -> Probe:
    """A probe at random states with random flows at the outer ports."""
    rng = np.random.default_rng(seed)
    state: dict[Path, Array] = {}
    efforts: dict[Path, Array] = {}
    for path, primitive in system.leaves():
        if isinstance(primitive, Storage):
            point = random_point(primitive.bundle, primitive.bundle.ports, rng)
            state |= {path / port: value for port, value in point.items()}
        elif isinstance(primitive, Irreversible):
            size = primitive.bundle.size
            hot = primitive.bundle.indicator("entropy") == 1.0
            efforts[path] = np.where(hot, rng.uniform(-30.0, 30.0, size), rng.standard_normal(size))
    inputs = {
        port: Input(0.1 * rng.standard_normal(quantity.space.dim), False)
        for port, _, quantity in Bundle.of(system.interface).items()
    }
    return Probe(system, state, inputs, efforts, reference or Reference(), h)


# ---- relations -------------------------------------------------------------------------------------------------


def _functoriality(probe: Probe) -> Verdict:
    flat, nested = (
        probe.system.relation(probe.reference, route=route).at(
            {str(p): v for p, v in probe.state.items()}, probe.efforts
        )
        for route in ("flat", "nested")
    )
    distance = flat.distance(nested)
    return Verdict(distance, 1e-12, f"projectors of dimension {flat.dimension} differ by {distance:.1e}")


def _patterns(system: System, path: Path = ROOT) -> Iterator[tuple[Path, Pattern]]:
    yield path, system.pattern
    for box, filling in system.fillings.items():
        if isinstance(filling, System):
            yield from _patterns(filling, path / box)


def _tellegen(probe: Probe) -> Verdict:
    """The relation of a pattern is Lagrangian for the form with the outer part negated."""
    worst, count = 0.0, 0
    for path, pattern in _patterns(probe.system):
        count += 1
        subspace, form = pattern_relation(pattern), power_form(pattern)
        if 2 * subspace.dimension != subspace.ambient:
            expected = subspace.ambient // 2
            return Verdict(np.inf, 0.0, f"{path}: dimension {subspace.dimension}, expected {expected}")
        worst = max(worst, isotropy(subspace, form))
    return Verdict(worst, 1e-13, f"{count} patterns; power is conserved to {worst:.1e}")


def power_form(pattern: Pattern) -> Array:
    """The symmetric form ⟨e|f⟩ summed over inner ports less outer ports, on the coordinates of `pattern_relation`."""
    blocks = [(Bundle.of(box.interface).size, 1.0) for box in pattern.boxes.values()]
    blocks.append((Bundle.of(pattern.interface).size, -1.0))
    size = 2 * sum(n for n, _ in blocks)
    out, at = np.zeros((size, size)), 0
    for n, sign in blocks:
        flows, efforts = np.arange(at, at + n), np.arange(at + n, at + 2 * n)
        out[flows, efforts] = out[efforts, flows] = sign
        at += 2 * n
    return out


def isotropy(subspace: Subspace, form: Array) -> float:
    """Largest value of the form on an orthonormal basis: 0 for an isotropic subspace."""
    return float(np.abs(subspace.basis.T @ form @ subspace.basis).max(initial=0.0))


# ---- balances over a step --------------------------------------------------------------------------------------


def _solved(probe: Probe) -> Solved:
    return solve_flat(probe.system, probe.state, Natural(probe.reference, probe.h), probe.inputs)


def _vacuous() -> Verdict:
    return Verdict(
        0.0, 0.0, "vacuous: no step was found, a constraint contradicts the state or h is too large"
    )


def _after(probe: Probe, solved: Solved) -> dict[Path, Array]:
    return {
        path: manifold(quantity.space).retract(probe.state[path], probe.h * solved.rates[path])
        for path, quantity in probe.system.states.items()
    }


def _power_balance(probe: Probe) -> Verdict:
    """Energy of all storages changes by what outer ports supply, Σ⟨e^E|f⟩ h."""
    solved = _solved(probe)
    if solved.residual > UNSOLVED:
        return _vacuous()
    after, terms = _after(probe, solved), [0.0]
    for path, primitive in probe.system.leaves():
        if isinstance(primitive, Storage):
            here, there = (
                {port: values[path / port] for port in primitive.bundle.ports}
                for values in (probe.state, after)
            )
            gain = primitive.total_energy(there, probe.reference) - primitive.total_energy(
                here, probe.reference
            )
            terms.append(gain)
            # the change is a difference of energies: their rounding enters
            terms += [s * 1e-3 * primitive.total_energy(here, probe.reference) for s in (1.0, -1.0)]
    for port, (flow, effort) in solved.outer.items():
        intensive = probe.reference.intensive(probe.system.interface[port].quantity)
        terms.append(-probe.h * float((effort + intensive) @ flow))
    return _balance(terms, "energy", "J")


def _entropy_balance(probe: Probe) -> Verdict:
    """The entropy of all storages changes by what outer ports supply and what irreversible components make."""
    solved = _solved(probe)
    if solved.residual > UNSOLVED:
        return _vacuous()
    terms = [0.0]
    for path, quantity in probe.system.states.items():
        if quantity.kind == "entropy":
            terms.append(probe.h * float(solved.rates[path][0]))
    for port, (flow, _) in solved.outer.items():
        if probe.system.interface[port].quantity.kind == "entropy":
            terms.append(-probe.h * float(flow[0]))
    productions = _productions(probe, solved)
    terms += [-probe.h * made for made, _ in productions]
    terms += [s * probe.h * scale for _, scale in productions for s in (1.0, -1.0)]
    return _balance(terms, "entropy", "J/K")


def _entropy_production(probe: Probe) -> Verdict:
    """σ ≥ 0 at each irreversible component."""
    solved = _solved(probe)
    if solved.residual > UNSOLVED:
        return _vacuous()
    made = _productions(probe, solved)
    if not made:
        return Verdict(0.0, 0.0, "no irreversible component")
    worst = max(-value / max(scale, 1e-8) for value, scale in made)
    least = min(value for value, _ in made)
    return Verdict(
        max(0.0, worst), 1e-12, f"{len(made)} irreversible components, the least makes {least:.1e} W/K"
    )


def _productions(probe: Probe, solved: Solved) -> list[tuple[float, float]]:
    """Entropy made by each irreversible component and the sum of its absolute terms."""
    after = _after(probe, solved)
    flat = probe.system.descriptor()
    out: list[tuple[float, float]] = []
    for slot in flat.components:
        primitive = slot.primitive
        if isinstance(primitive, Irreversible):
            middle = {
                port: manifold(s.quantity.space).midpoint(probe.state[s.path], after[s.path])
                for port, s in zip(primitive.reads, slot.reads, strict=True)
            }
            flows = primitive.flow(middle, solved.efforts[slot.path], probe.reference)
            entropy = flows[primitive.bundle.indicator("entropy") == 1.0]
            out.append((-float(entropy.sum()), float(np.abs(entropy).sum())))
    return out


def _balance(terms: list[float], what: str, unit: str) -> Verdict:
    scale = sum(map(abs, terms))
    defect = abs(sum(terms)) / max(scale, 1e-8)  # below that, all terms are what Newton's method left
    # a step solved by Newton's method with a differenced Jacobian leaves residuals of a few roundings times condition
    return Verdict(defect, 1e-9, f"{what} is balanced to {defect:.1e} of {scale:.2e} {unit}")


def _naturality(probe: Probe) -> Verdict:
    """Discretise, then compose = flatten, then discretise."""
    behaviour = Natural(probe.reference, probe.h)
    flat = solve_flat(probe.system, probe.state, behaviour, probe.inputs)
    nested = solve_nested(probe.system, probe.state, behaviour, probe.inputs)
    if min(flat.residual, nested.residual) > UNSOLVED:
        return _vacuous()
    scale = max([1.0, *(float(np.abs(w).max(initial=0.0)) for w in flat.rates.values())])
    worst = max(
        (float(np.abs(flat.rates[path] - nested.rates[path]).max(initial=0.0)) for path in flat.rates),
        default=0.0,
    )
    return Verdict(worst / scale, 1e-9, f"rates of {len(flat.rates)} states agree to {worst / scale:.1e}")


SYSTEM_LAWS: tuple[SystemLaw, ...] = (
    SystemLaw("functoriality", "flatten, then fill = fill, then compose", _functoriality),
    SystemLaw("Tellegen", "a pattern's relation is Lagrangian: power in = power out", _tellegen),
    SystemLaw("power balance", "the energy changes by what outer ports supply", _power_balance),
    SystemLaw("entropy balance", "the entropy changes by supply and production", _entropy_balance),
    SystemLaw("entropy production", "no irreversible component destroys entropy", _entropy_production),
    SystemLaw("naturality", "discretise, then compose = flatten, then discretise", _naturality),
)


def system_law(name: str) -> SystemLaw:
    """The law of this name.

    Raises
    ------
    KeyError
        There is none.
    """
    return {law.name: law for law in SYSTEM_LAWS}[name]
