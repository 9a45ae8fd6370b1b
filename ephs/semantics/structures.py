"""Structures of primitives: quadratic and exponential energies, constant Dirac structures, dissipation."""

import math
from collections.abc import Callable

import numpy as np

from ephs.operad import Interface, Path, quantity
from ephs.semantics.bundle import Array, Bundle, Reference
from ephs.semantics.checks import STATEMENTS
from ephs.semantics.primitives import Formula, Irreversible, Kernel, Point, Proof, Reversible, Storage, power_ports
from ephs.semantics.spaces import codes, manifold
from ephs.semantics.verdict import Condition, proved

__all__ = ["KERNELS", "constant_structure", "coupling", "dissipation", "dissipation_proof", "exponential", "quadratic"]

KERNELS = "ephs.semantics.kernels"
"""The module of the compiled counterparts."""


def exp(x: float) -> float:
    """The exponential, infinite where it overflows: iterates of a solver may go there."""
    return math.exp(x) if x < 709.0 else math.inf


def expm1(x: float) -> float:
    """exp(x) − 1, infinite where it overflows."""
    return math.expm1(x) if x < 709.0 else math.inf


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
        kernel=None if Bundle.of(interface).charges else Kernel(KERNELS, "quadratic", tuple(q.ravel())),
        formula=formula,
        proof=lambda: _quadratic_proof(interface, q),
        trusted=trusted,
    )


def _quadratic_proof(interface: Interface, q: Array) -> tuple[Condition, ...]:
    """The conditions on E = ½ xᵀ Q x, from the entries of Q; of what they do not show, none."""
    bundle = Bundle.of(interface)
    parity = bundle.parity()
    even, turned, slope, hot = STATEMENTS["storage"]
    plain = all(manifold(quantity.space).code == codes.VECTOR for _, _, quantity in bundle.items())
    return (
        Condition(even, not np.any(q[np.multiply.outer(parity, parity) < 0.0]), "Q joins states of one parity only"),
        Condition(turned, plain, "none is read"),
        Condition(slope, plain and np.array_equal(q, q.T) and bool(np.all(np.isfinite(q))), "Q is symmetric"),
        Condition(hot, "entropy" not in bundle.charges, "no entropy is stored"),
    )


def exponential(
    name: str, c1: float, c2: float, parameters: tuple[tuple[str, object], ...], formula: Formula | None = None
) -> Storage:
    """E = c1·(exp(s/c2) − 1): energies count from s = 0, so that small heats are not lost beside a large E."""
    port = Path.of("s")
    sound = c1 > 0.0 and 0.0 < c2 < math.inf and 0.0 < c1 / c2 < math.inf

    def proof() -> tuple[Condition, ...]:
        return proved("an entropy is even, dE = θ = c1/c2 exp(s/c2), c1 > 0 and c2 > 0", *STATEMENTS["storage"])

    def gradient(x: Point) -> Array:
        return np.array([c1 / c2 * exp(float(x[port][0]) / c2)])

    def discrete_gradient(x0: Point, v: Array) -> Array:
        rise = float(v[0]) / c2
        mean = expm1(rise) / rise if rise != 0.0 else 1.0
        return gradient(x0) * mean

    return Storage(
        name,
        power_ports(s=quantity.entropy),
        energy=lambda x: c1 * expm1(float(x[port][0]) / c2),
        gradient=gradient,
        discrete_gradient=discrete_gradient,
        parameters=parameters,
        kernel=Kernel(KERNELS, "exponential", (c1, c2)),
        formula=formula,
        proof=proof if sound else None,
        # a random state of a small capacity is so cold or so hot that differences tell nothing
        trusted=sound,
    )


def constant_structure(
    name: str,
    interface: Interface,
    skew: Array,
    constraint: Array,
    parameters: tuple[tuple[str, object], ...] = (),
    formula: Formula | None = None,
    *,
    trusted: bool = False,
) -> Reversible:
    """A Dirac structure that does not depend on states: L (n, n), C (k, n)."""
    n, k = skew.shape[0], constraint.shape[0]
    entries = [*skew.ravel().tolist(), *constraint.reshape(k, n).ravel().tolist()]
    return Reversible(
        name,
        interface,
        structure=lambda _x: (skew, constraint),
        parameters=parameters,
        multipliers=k,
        kernel=Kernel(KERNELS, "constant_structure", tuple(entry or 0.0 for entry in entries)),  # most share one zero
        formula=formula or Formula(lambda: (skew, constraint)),
        trusted=trusted,
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
    reads: tuple[Path, ...] = (),
    kernel: Kernel | None = None,
    parameters: tuple[tuple[str, object], ...] = (),
    formula: Formula | None = None,
    shown: Proof | None = None,
    trusted: bool = False,
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
    """
    d = next(iter(interface.values())).quantity.space.dim

    def matrix(x: Point, e: Array, reference: Reference) -> Array:
        u, theta = e[:d], reference.temperature + float(e[d])
        mu = resistance(x, u, theta) if callable(resistance) else resistance
        drag = mu @ u
        out = np.empty((d + 1, d + 1))
        out[:d, :d] = theta * mu
        out[:d, d] = out[d, :d] = -drag
        out[d, d] = float(u @ drag) / theta
        return out

    proof: Proof | None = shown
    if not callable(resistance):
        mu = np.asarray(resistance, dtype=float)
        kernel, proof = Kernel(KERNELS, "dissipation", tuple(mu.ravel())), lambda: dissipation_proof(interface, mu)
    return Irreversible(name, interface, matrix, reads, parameters, kernel, formula, proof=proof, trusted=trusted)


def dissipation_proof(interface: Interface, mu: Array | None) -> tuple[Condition, ...]:
    """The conditions on M = Bᵀ (μ/θ) B with B = [θ, −u], which has B eᴱ = θ u − u θ = 0: what is left concerns μ.

    Parameters
    ----------
    mu
        (d, d) constant; None where it is a function of the states that is known to be non-negative and even.
    """
    sound = mu is None or (np.array_equal(mu, mu.T) and bool(np.all(np.isfinite(mu))))
    square = sound and (mu is None or not mu.any() or float(np.linalg.eigvalsh(mu)[0]) >= 0.0)
    power, *_ = interface.values()
    symmetric, definite, energy, conserving, mirrored, turned = STATEMENTS["irreversible"]
    form = "M = Bᵀ (μ/θ) B with B = [θ, −u]"
    return (
        Condition(symmetric, sound, f"{form}, μ is symmetric"),
        Condition(definite, square, f"{form}, μ ⪰ 0 and θ > 0"),
        Condition(energy, sound, f"{form}, B eᴱ = 0"),
        Condition(conserving, not power.quantity.environment, "there are none"),
        Condition(mirrored, sound, "μ is even"),
        Condition(turned, sound, "μ reads none" if mu is not None else "μ is even in quaternions"),
    )
