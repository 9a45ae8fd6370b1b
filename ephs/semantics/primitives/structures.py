"""Structures of primitives: quadratic and exponential energies, constant Dirac structures, dissipation."""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

from ephs.operad import Interface, Path, quantity
from ephs.semantics.bundles.bundle import Array, Bundle
from ephs.semantics.derive.linear import Linear
from ephs.semantics.primitives.forms import dissipated, stored
from ephs.semantics.primitives.primitives import (
    Formula,
    Irreversible,
    Kernel,
    Point,
    Proof,
    Reversible,
    Storage,
    power_ports,
)
from ephs.semantics.spaces import codes, manifold
from ephs.semantics.verdicts.checks import STATEMENTS
from ephs.semantics.verdicts.verdict import Condition, stated


def quadratic(
    name: str,
    interface: Interface,
    matrix: Array,
    parameters: tuple[tuple[str, object], ...],
    formula: Formula | None = None,
    *,
    trusted: bool = False,
) -> Storage:
    """E = ½ xᵀ Q x on vector spaces; Q (n, n) symmetric. Its discrete gradient Q (x⁰ + v/2) is exact."""

    def vector(x: Point) -> Array:
        return np.concatenate([x[p] for p in ports])

    ports = tuple(interface)
    q = np.array(matrix, dtype=float)
    return Storage(
        name,
        interface,
        energy=lambda x: 0.5 * float(vector(x) @ q @ vector(x)),
        gradient=lambda x: q @ vector(x),
        discrete_gradient=lambda x0, v: q @ (vector(x0) + 0.5 * v),
        parameters=parameters,
        # the kernel knows no reference environment
        kernel=None if Bundle.of(interface).charges else Kernel("quadratic", Linear("quadratic"), tuple(q.ravel())),
        formula=formula,
        proof=None if formula is not None else lambda: _quadratic_proof(interface, q),
        trusted=trusted,
    )


def _quadratic_proof(interface: Interface, q: Array) -> tuple[Condition, ...]:
    """Conditions on E = ½ xᵀ Q x, from the entries of Q, as far as these decide them."""
    bundle = Bundle.of(interface)
    parity = bundle.parity()
    even, turned, slope, hot = STATEMENTS["storage"]
    plain = all(manifold(quantity.space).code == codes.VECTOR for _, _, quantity in bundle.items())
    return (
        stated(even, not np.any(q[np.multiply.outer(parity, parity) < 0.0]), "Q joins states of one parity only"),
        stated(turned, plain, "none is read"),
        stated(slope, plain and np.array_equal(q, q.T) and bool(np.all(np.isfinite(q))), "Q is symmetric"),
        stated(hot, "entropy" not in bundle.charges, "no entropy is stored"),
    )


def exponential(
    name: str, c1: float, c2: float, parameters: tuple[tuple[str, object], ...], formula: Formula | None = None
) -> Storage:
    """E = c1·(exp(s/c2) − 1): energies count from s = 0, so that small heats are not lost beside a large E."""
    sound = c1 > 0.0 and 0.0 < c2 < math.inf and 0.0 < c1 / c2 < math.inf

    return stored(
        name,
        power_ports(s=quantity.entropy),
        exponential_energy,
        {"c1": c1, "c2": c2},
        parameters,
        formula=formula,
        # a random state of a small capacity is too cold or too hot for differences
        trusted=sound,
    )


def exponential_energy(s: Any, c1: float, c2: float) -> Any:
    """E = c1·(exp(s/c2) − 1)."""
    return c1 * np.expm1(s / c2)


def constant_structure(
    name: str,
    interface: Interface,
    skew: Array,
    constraint: Array,
    parameters: tuple[tuple[str, object], ...] = (),
    formula: Formula | None = None,
    *,
    trusted: bool = False,
    external_field: bool = False,
) -> Reversible:
    """A Dirac structure that does not depend on states: L (n, n), C (k, n); `external_field` as of a `Reversible`."""
    n, k = skew.shape[0], constraint.shape[0]
    entries = [*skew.ravel().tolist(), *constraint.reshape(k, n).ravel().tolist()]
    return Reversible(
        name,
        interface,
        structure=lambda _x: (skew, constraint),
        parameters=parameters,
        multipliers=k,
        kernel=Kernel("constant_structure", Linear("constant_structure"), tuple(entry or 0.0 for entry in entries)),
        formula=formula or Formula(lambda: (skew, constraint)),
        trusted=trusted,
        external_field=external_field,
    )


def coupling(name: str, interface: Interface, *, trusted: bool = False) -> Reversible:
    """q.f = −p.e, p.f = q.e, on ports q and p of equal dimension: L = [[0, −1], [1, 0]]."""
    n = next(iter(interface.values())).quantity.space.dim
    eye, zero = np.eye(n), np.zeros((n, n))
    skew = np.block([[zero, -eye], [eye, zero]])
    return constant_structure(name, interface, skew, np.zeros((0, 2 * n)), trusted=trusted)


def dissipation(
    name: str,
    interface: Interface,
    resistance: Array | Callable[[Point, Array, float], Array],
    *,
    parameters: tuple[tuple[str, object], ...] = (),
    formula: Formula | None = None,
    shown: Proof | None = None,
    trusted: bool = False,
    one_sided: bool = False,
) -> Irreversible:
    """Dissipation of a port's power into heat: p.f = μ u, s.f = −⟨u|μ u⟩/θ, with u = p.e and θ = θ₀ + s.e.

    M = [[θ μ, −μ u], [−(μ u)ᵀ, ⟨u|μ u⟩/θ]].

    Parameters
    ----------
    interface
        The dissipating power port, then the entropy port, then state ports that are read.
    resistance
        μ (d, d), symmetric and non-negative; or a function of (states read, u, θ).
    shown
        Proves the conditions where μ is a function.
    one_sided
        As of an `Irreversible`.
    """
    power, heat, *_ = (str(port) for port in interface)
    states = [str(port) for port in interface if not interface[port].power]

    def matrix(**given: Any) -> Any:
        u, theta = np.atleast_1d(given[power]), given[heat]
        x = {Path.of(port): np.atleast_1d(given[port]) for port in states}
        return onsager(resistance(x, u, theta) if callable(resistance) else resistance, u, theta)

    proof: Proof | None = shown
    if formula is None and not callable(resistance):
        mu = np.asarray(resistance, dtype=float)
        proof = lambda: dissipation_proof(interface, mu)  # noqa: E731 - beside the one that is given
    said: dict[str, Any] = {"formula": formula, "proof": proof, "trusted": trusted, "one_sided": one_sided}
    return dissipated(name, interface, matrix, {}, parameters, "dissipation", **said)


def onsager(mu: Any, u: Any, theta: Any) -> Any:
    """M = [[θ μ, −μ u], [−(μ u)ᵀ, ⟨u|μ u⟩/θ]] (d + 1, d + 1), of numbers or what is recorded."""
    mu = np.asarray(mu)
    drag = [_product(row, u) for row in mu]
    rows = [[theta * entry for entry in row] + [-pull] for row, pull in zip(mu, drag, strict=True)]
    return [*rows, [*(-pull for pull in drag), _product(drag, u) / theta]]


def _product(row: Any, u: Any) -> Any:
    """Σ rowᵢ uᵢ without the entries that are known to vanish."""
    return sum((a * b for a, b in zip(row, u, strict=True) if not (isinstance(a, float) and a == 0.0)), 0.0)


def _semidefinite(matrix: Array) -> bool:
    """Whether a symmetric matrix (n, n) is ⪰ 0, by elimination over ℚ of its numbers as given."""
    rows = [[Fraction(entry) for entry in row] for row in matrix.tolist()]
    while rows:
        (d, *pivot), *rest = rows
        if d < 0 or (d == 0 and any(pivot)):
            return False
        rows = [[a - row[0] * b / (d or 1) for a, b in zip(row[1:], pivot, strict=True)] for row in rest]
    return True


def dissipation_proof(interface: Interface, mu: Array | None) -> tuple[Condition, ...]:
    """The conditions on M = Bᵀ (μ/θ) B with B = [θ, −u], which has B eᴱ = θ u − u θ = 0: conditions on μ remain.

    Parameters
    ----------
    mu
        (d, d) constant; None where it is a function of the states that is known to be non-negative and even.
    """
    sound = mu is None or (np.array_equal(mu, mu.T) and bool(np.all(np.isfinite(mu))))
    square = sound and (mu is None or _semidefinite(mu))
    power, *_ = interface.values()
    symmetric, definite, energy, conserving, mirrored, turned = STATEMENTS["irreversible"]
    form = "M = Bᵀ (μ/θ) B with B = [θ, −u]"
    return (
        stated(symmetric, sound, f"{form}, μ is symmetric"),
        stated(definite, square, f"{form}, μ ⪰ 0 and θ > 0"),
        stated(energy, sound, f"{form}, B eᴱ = 0"),
        stated(conserving, not power.quantity.environment, "there are none"),
        stated(mirrored, sound, "μ is even"),
        stated(turned, sound, "μ reads none" if mu is not None else "μ is even in quaternions"),
    )
