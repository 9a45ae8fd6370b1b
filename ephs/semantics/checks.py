"""The conditions under which a primitive is thermodynamically consistent, checked when it is made.

Base points are drawn with a fixed seed, so that a wrong primitive is refused every time with the same witness.
Conditions: Lohmayer, Capobianco, Leyendecker, section 2, with time-reversal parity as a further one.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundle import POSITIVE, Array, Bundle, Reference
from ephs.semantics.errors import StructureError
from ephs.semantics.spaces import codes, manifold
from ephs.semantics.subspace import Subspace

if TYPE_CHECKING:
    from ephs.semantics.primitives import Irreversible, Point, Reversible, Storage

__all__ = [
    "check_irreversible",
    "check_reversible",
    "check_storage",
    "dirac",
    "random_efforts",
    "random_point",
]

SAMPLES = 3
# of the largest entry; evaluations of structure are a few hundred roundings deep at the most
TOLERANCE = 1e-12
EVENNESS = 1e-9  # of the energy, in which large terms may cancel


def random_point(
    bundle: Bundle, ports: tuple[Path, ...], rng: np.random.Generator, size: float = 1.0
) -> dict[Path, Array]:
    """Random states for the named ports, of a size around the identity; volumes and amounts positive."""
    out: dict[Path, Array] = {}
    for port in ports:
        quantity = bundle.interface[port].quantity
        space = manifold(quantity.space)
        x = space.random(rng)
        if size != 1.0:
            x = space.retract(space.identity(), size * rng.standard_normal(space.dim))
        out[port] = np.exp(0.3 * x) if quantity.kind in POSITIVE else x
    return out


def random_efforts(bundle: Bundle, rng: np.random.Generator) -> Array:
    """Random efforts; on entropy ports within 50 K of the reference temperature."""
    e = rng.standard_normal(bundle.size)
    return np.where(bundle.indicator("entropy") == 1.0, np.clip(20.0 * e, -50.0, 50.0), e)


def _reversed(primitive_bundle: Bundle, x: "Point") -> dict[Path, Array]:
    """Time reversal of a state: quantities of odd parity change their sign."""
    return {
        p: primitive_bundle.interface[p].quantity.parity * v if _odd(primitive_bundle, p) else v for p, v in x.items()
    }


def _opposite(bundle: Bundle, x: "Point") -> Iterator[tuple[Path, Array]]:
    """The states with a rotation, by the other one of its two quaternions."""
    for port in x:
        if manifold(bundle.interface[port].quantity.space).code in (codes.SO3, codes.SE3, codes.SO3xR3):
            yield port, np.concatenate([-x[port][:4], x[port][4:]])


def _odd(bundle: Bundle, port: Path) -> bool:
    return bundle.interface[port].quantity.parity < 0


def _show(x: "Point") -> str:
    return ", ".join(f"{p}={np.array2string(v, precision=3)}" for p, v in x.items()) or "none is read"


def _worst(defect: Array) -> tuple[int, ...]:
    return tuple(int(i) for i in np.unravel_index(int(np.argmax(np.abs(defect))), defect.shape))


def check_storage(storage: "Storage") -> None:
    """E finite and even under time reversal, its gradient the differential, θ = ∂E/∂s > 0."""
    if storage.environment:
        return
    rng = np.random.default_rng(20)
    bundle, name = storage.bundle, storage.name
    for _ in range(SAMPLES):
        x, energy, gradient = _inside(storage, rng)
        if gradient.shape != (bundle.size,):
            raise StructureError("gradient-shape", name, found=gradient.shape, expected=(bundle.size,))
        _require_finite(name, "the energy", np.array(energy), x)
        _require_finite(name, "the gradient", gradient, x)
        mirrored = float(storage.energy(_reversed(bundle, x)))
        if not abs(energy - mirrored) <= EVENNESS * (abs(energy) + abs(mirrored)):
            raise StructureError("even", name, found=mirrored, expected=energy, witness=_show(x))
        for port, opposite in _opposite(bundle, x):
            found = float(storage.energy({**x, port: opposite}))
            if not abs(energy - found) <= EVENNESS * (abs(energy) + abs(found)):
                raise StructureError("rotation-sign", name, what="the energy tells", port=port, witness=_show(x))
        _check_gradient(storage, x, gradient, energy)
        for port, where, quantity in bundle.items():
            if quantity.kind == "entropy" and not gradient[where][0] > 0.0:
                raise StructureError("cold", name, port=port, found=float(gradient[where][0]), witness=_show(x))


def _inside(storage: "Storage", rng: np.random.Generator) -> tuple[dict[Path, Array], float, Array]:
    """A state where the energy neither overflows nor underflows: random, if need be near the identity."""
    hot = storage.bundle.indicator("entropy") == 1.0
    found: tuple[dict[Path, Array], float, Array] | None = None
    x: dict[Path, Array] = {}
    for size in (1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-9, 0.0):
        x = random_point(storage.bundle, storage.bundle.ports, rng, size)
        try:
            energy, gradient = float(storage.energy(x)), storage.energy_gradient(x)
        except (OverflowError, ZeroDivisionError):
            continue
        found = found or (x, energy, gradient)
        if gradient.shape != hot.shape:
            return found
        if np.isfinite(energy) and np.all(np.isfinite(gradient)) and np.all(gradient[hot] != 0.0):
            return x, energy, gradient
    return found or (x, np.inf, np.zeros(hot.shape))


def _require_finite(name: str, what: str, matrix: Array, x: "Point") -> None:
    if not np.all(np.isfinite(matrix)):
        raise StructureError("finite", name, what=what, found=matrix.tolist(), witness=_show(x))


def _check_gradient(storage: "Storage", x: "Point", gradient: Array, energy: float) -> None:
    """One random direction tells a wrong gradient; a central difference certifies about 1e-7 and no more."""
    if storage.gradient is None:
        return
    rng = np.random.default_rng(21)
    direction = rng.standard_normal(storage.bundle.size)
    best = (np.inf, 0.0, 0.0)  # of several lengths of the step: the energy may vary slowly, or fast
    for length in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14):
        step = length * direction
        try:
            there, back = (float(storage.energy(storage.retract(x, k * step))) for k in (1.0, -1.0))
        except (OverflowError, ZeroDivisionError):
            continue
        expected, found = 0.5 * (there - back), float(gradient @ step)
        slope = 1e-4 * float(np.abs(gradient) @ np.abs(step))
        rounding = 1e-14 * (abs(there) + abs(back) + abs(energy))
        if length < 1e-8 and rounding > slope:  # so short a step tells no gradient from another
            break
        if np.isfinite(expected):
            best = min(best, (abs(expected - found) / max(slope + rounding, 1e-300), found, expected))
    if not best[0] <= 1.0:
        _, found, expected = best
        entry = "(along a random direction)"
        raise StructureError("gradient", storage.name, entry=entry, found=found, expected=expected, witness=_show(x))


def dirac(skew: Array, constraint: Array) -> Subspace:
    """The subspace {(f, e): f = L e + Cᵀ λ, 0 = C e} of ℝ²ⁿ."""
    n, k = skew.shape[0], constraint.shape[0]
    kernel = np.block([[-np.eye(n), skew, constraint.T], [np.zeros((k, n)), constraint, np.zeros((k, k))]])
    return Subspace.from_kernel(kernel).project(range(2 * n))


def check_reversible(reversible: "Reversible") -> None:
    """Isotropic and of full dimension, conserving each environment quantity, invariant under time reversal."""
    rng = np.random.default_rng(22)
    bundle, name = reversible.bundle, reversible.name
    n, k, parity = bundle.size, reversible.multipliers, bundle.parity()
    for _ in range(SAMPLES):
        x = random_point(bundle, reversible.reads, rng)
        skew, constraint = reversible.structure(x)
        if skew.shape != (n, n):
            raise StructureError("gyrator-shape", name, found=skew.shape, expected=(n, n))
        if constraint.shape != (k, n):
            raise StructureError("constraint-shape", name, found=constraint.shape, expected=(k, n))
        _require_finite(name, "the matrix L", skew, x)
        _require_finite(name, "the matrix C", constraint, x)
        scale = float(np.abs(skew).max(initial=0.0))
        defect = skew + skew.T
        if not np.abs(defect).max(initial=0.0) <= TOLERANCE * scale:
            entry = _worst(defect)
            raise StructureError("isotropy", name, entry=entry, found=float(defect[entry]), witness=_show(x))
        for kind in bundle.environment_kinds():
            one = bundle.indicator(kind)
            defect = np.concatenate([skew @ one, constraint @ one])
            terms = np.concatenate([np.full(n, scale), np.abs(constraint).sum(axis=1)])
            if not np.all(np.abs(defect) <= TOLERANCE * terms):
                entry = _worst(defect / np.maximum(terms, 1e-300))
                found = float(defect[entry])
                raise StructureError("conservation", name, quantity=kind, entry=entry, found=found, witness=_show(x))
        # (f, e) ∈ D(x) ⇔ (−ϵf, ϵe) ∈ D(ϵx)
        here = dirac(skew, constraint)
        there = dirac(*reversible.structure(_reversed(bundle, x)))
        mirror = np.diag(np.concatenate([-parity, parity]))
        found = here.image(mirror).distance(there)
        if not found <= 1e-9:
            raise StructureError("parity", name, found=found, witness=_show(x))
        for port, opposite in _opposite(bundle, x):
            found = here.distance(dirac(*reversible.structure({**x, port: opposite})))
            if not found <= 1e-9:
                raise StructureError("rotation-sign", name, what="the structure tells", port=port, witness=_show(x))


def check_irreversible(irreversible: "Irreversible") -> None:
    """Onsager symmetric, non-negative, conserving energy and each environment quantity but entropy, of even parity."""
    rng = np.random.default_rng(23)
    bundle, name, reference = irreversible.bundle, irreversible.name, Reference()
    parity = bundle.parity()
    for _ in range(SAMPLES):
        x, e = random_point(bundle, irreversible.reads, rng), random_efforts(bundle, rng)
        matrix = irreversible.matrix(x, e, reference)
        if matrix.shape != (bundle.size, bundle.size):
            expected = (bundle.size, bundle.size)
            raise StructureError("onsager-shape", name, found=matrix.shape, expected=expected)
        _require_finite(name, "the matrix M", matrix, x)
        scale = float(np.abs(matrix).max(initial=0.0))
        defect = matrix - matrix.T
        if not np.abs(defect).max(initial=0.0) <= TOLERANCE * scale:
            entry = _worst(defect)
            raise StructureError("symmetry", name, entry=entry, found=float(defect[entry]), witness=_show(x))
        least = float(np.linalg.eigvalsh(matrix).min(initial=0.0))
        if not least >= -TOLERANCE * scale:
            raise StructureError("definite", name, found=least, witness=_show(x))
        energy_effort = e + bundle.intensive(reference)
        terms = np.abs(matrix) @ np.abs(energy_effort)
        defect = matrix @ energy_effort
        if not np.all(np.abs(defect) <= TOLERANCE * terms):
            entry = _worst(defect / np.maximum(terms, 1e-300))
            raise StructureError("energy", name, entry=entry, found=float(defect[entry]), witness=_show(x))
        for kind in bundle.environment_kinds():
            defect = matrix @ bundle.indicator(kind)
            if kind != "entropy" and not np.abs(defect).max(initial=0.0) <= TOLERANCE * scale:
                entry = _worst(defect)
                found = float(defect[entry])
                raise StructureError("conservation", name, quantity=kind, entry=entry, found=found, witness=_show(x))
        mirrored = irreversible.matrix(_reversed(bundle, x), parity * e, reference)
        found = float(np.abs(mirrored - parity[:, None] * matrix * parity[None, :]).max(initial=0.0))
        if not found <= TOLERANCE * scale:
            raise StructureError("parity", name, found=found, witness=_show(x))
        for port, opposite in _opposite(bundle, x):
            found = float(np.abs(irreversible.matrix({**x, port: opposite}, e, reference) - matrix).max(initial=0.0))
            if not found <= TOLERANCE * scale:
                raise StructureError("rotation-sign", name, what="the matrix M tells", port=port, witness=_show(x))
