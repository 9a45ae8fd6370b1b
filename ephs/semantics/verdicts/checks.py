"""The conditions under which a primitive is thermodynamically consistent, at one state and effort.

`search` looks for a state and effort where one fails, `symbols.proofs` shows that there is none. Conditions: Lohmayer,
Capobianco, Leyendecker, section 2, with time-reversal parity as a further one.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array, Bundle
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.bundles.extents import into
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.decompositions import symmetric_eigenvalues
from ephs.semantics.spaces.rank import TINY
from ephs.semantics.verdicts.trials import ROTATING, Trial

if TYPE_CHECKING:
    from ephs.semantics.primitives.primitives import Irreversible, Point, Primitive, Reversible, Storage

SAME = 1e-9
"""Relative tolerance for equality of two structures, which are functions evaluated twice."""
TOLERANCE = 1e-12
"""Rounding relative to the largest entry; evaluations of structure are a few hundred roundings deep at the most."""
EVENNESS = 1e-9
"""Rounding relative to the energy, in which large terms may cancel."""
ROUNDING = 1e-11
"""Relative rounding error of a temperature computed by differences of the energy."""
NEARER = (1.0, 1e-2, 1e-4, 1e-6, 1e-9, 0.0)
"""Factors of a state whose temperature underflows: a state nearer to the identity tells its sign."""
STATEMENTS: dict[str, tuple[str, ...]] = {
    "storage": ("E(−ẋ) = E(ẋ)", "a rotation has one energy", "the gradient is dE", "∂E/∂s > 0"),
    "environment": ("H = 0 and e = 0",),
    "reversible": ("L + Lᵀ = 0", "environment quantities are conserved", "D(ϵx) = ϵD(x)", "a rotation has one D"),
    "irreversible": (
        "M − Mᵀ = 0", "M ⪰ 0", "M eᴱ = 0", "environment quantities but entropy are conserved", "M(ϵx, ϵe) = ϵ M ϵ",
        "a rotation has one M",
    ),
}  # fmt: skip
"""Conditions by the kind of primitive."""
MIRRORED = {"irreversible": STATEMENTS["irreversible"][4], "reversible": STATEMENTS["reversible"][2]}
"""Conditions that one-sided components and those in a reversed field need not satisfy."""
FLAGS = {
    "irreversible": "one_sided=True if it depends on the direction of the flow, as a valve does",
    "reversible": "external_field=True if an external field turns around with time, as a magnet's or a rotating frame",
}
"""What to declare where parity does not hold and need not."""


def random_point(bundle: Bundle, ports: tuple[Path, ...], rng: np.random.Generator) -> dict[Path, Array]:
    """Random states for the named ports; volumes and amounts positive."""
    out: dict[Path, Array] = {}
    for port in ports:
        quantity = bundle.interface[port].quantity
        space = manifold(quantity.space)
        out[port] = into(quantity, space.random(rng))
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
        if manifold(bundle.interface[port].quantity.space).code in ROTATING:
            yield port, np.concatenate([-x[port][:4], x[port][4:]])


def _odd(bundle: Bundle, port: Path) -> bool:
    return bundle.interface[port].quantity.parity < 0


def check_at(primitive: "Primitive", trial: Trial) -> None:
    """Check all conditions on a primitive at a state and effort.

    Raises
    ------
    StructureError
        With the trial as its witness. A structure without a finite value there fails as ``"finite"``.
    """
    if primitive.kind == "irreversible":
        _check_irreversible(primitive, trial)
    elif primitive.kind == "reversible":
        _check_reversible(primitive, trial)
    elif primitive.kind == "storage":
        _check_storage(primitive, trial)


def _fail(
    kind: str, primitive: "Primitive", trial: Trial, size: float, entry: tuple[int, ...] = (), **facts: object
) -> StructureError:
    witness = trial.witness(primitive, entry, size)
    return StructureError(kind, primitive.name, found=size, entry=entry, witness=witness, **facts)


def _require_finite(primitive: "Primitive", trial: Trial, what: str, matrix: Array) -> None:
    if not np.all(np.isfinite(matrix)):
        raise StructureError(
            "finite", primitive.name, what=what, found=matrix.tolist(), witness=trial.witness(primitive)
        )


def _worst(defect: Array) -> tuple[int, ...]:
    return tuple(int(i) for i in np.unravel_index(int(np.argmax(np.abs(defect))), defect.shape))


def _check_storage(storage: "Storage", trial: Trial) -> None:
    """E finite and even under time reversal, its gradient the differential, θ = ∂E/∂s > 0."""
    bundle, x = storage.bundle, trial.states
    energy, gradient = float(storage.energy(x)), storage.energy_gradient(x)
    if gradient.shape != (bundle.size,):
        raise StructureError("gradient-shape", storage.name, found=gradient.shape, expected=(bundle.size,))
    _require_finite(storage, trial, "the energy", np.array(energy))
    _require_finite(storage, trial, "the gradient", gradient)
    mirrored = float(storage.energy(_reversed(bundle, x)))
    if np.isfinite(mirrored) and not abs(energy - mirrored) <= EVENNESS * (abs(energy) + abs(mirrored)):
        raise _fail("even", storage, trial, mirrored, expected=energy)
    for port, opposite in _opposite(bundle, x):
        found = float(storage.energy({**x, port: opposite}))
        if not abs(energy - found) <= EVENNESS * (abs(energy) + abs(found)):
            raise _fail("rotation-sign", storage, trial, found, what="the energy tells", port=port)
    _check_gradient(storage, trial, gradient)
    for port, where, quantity in bundle.items():
        if quantity.kind == "entropy" and not gradient[where][0] > 0.0:
            found = _temperature(storage, trial, where)
            rounding = 0.0 if storage.gradient is not None else ROUNDING * abs(energy)
            if not found > 0.0 and (found == 0.0 or found < -rounding):
                raise _fail("cold", storage, trial, found, port=port)


def _temperature(storage: "Storage", trial: Trial, where: slice) -> float:
    """∂E/∂s; where it underflows, at a state nearer to the identity."""
    found = 0.0
    for share in NEARER:
        found = float(storage.energy_gradient(trial.nearer(storage, share).states)[where][0])
        if found != 0.0:
            break
    return found


def _check_gradient(storage: "Storage", trial: Trial, gradient: Array) -> None:
    """A gradient is the energy's slope; one that is derived by differences needs no check."""
    if storage.gradient is None:
        return
    from ephs.semantics.verdicts.gradients import gradient_defect

    defect = gradient_defect(storage, trial.states, gradient)
    if defect is not None:
        entry, found, expected = defect
        raise _fail("gradient", storage, trial, found, entry=(entry,), expected=expected)


def _apart(bundle: Bundle, one: tuple[Array, Array], two: tuple[Array, Array]) -> float:
    """Largest difference of the matrices of two structures (L, C), relative to these; 0 if they are one relation."""
    scales = [max(float(np.abs(a).max(initial=0.0)), TINY) for a in (one[0], one[1])]
    same = [float(np.abs(a - b).max(initial=0.0)) / s for a, b, s in zip(one, two, scales, strict=True)]
    same[1] = min(same[1], float(np.abs(one[1] + two[1]).max(initial=0.0)) / scales[1])
    if max(same) <= SAME or not one[1].size:
        return max(same)
    from ephs.semantics.meaning.components import constant_relation
    from ephs.semantics.meaning.fields import Rounded

    known = Rounded(SAME)
    relation, other = (constant_relation(known, bundle, *each) for each in (one, two))
    return 0.0 if relation.same(other) else max(same)


def _check_reversible(reversible: "Reversible", trial: Trial) -> None:
    """Isotropic and of full dimension, conserving each environment quantity, invariant under time reversal."""
    bundle, name, x = reversible.bundle, reversible.name, trial.states
    n, k, parity = bundle.size, reversible.multipliers, bundle.parity()
    skew, constraint = reversible.structure(x)
    if skew.shape != (n, n):
        raise StructureError("gyrator-shape", name, found=skew.shape, expected=(n, n))
    if constraint.shape != (k, n):
        raise StructureError("constraint-shape", name, found=constraint.shape, expected=(k, n))
    _require_finite(reversible, trial, "the matrix L", skew)
    _require_finite(reversible, trial, "the matrix C", constraint)
    scale = float(np.abs(skew).max(initial=0.0))
    defect = skew + skew.T
    if not np.abs(defect).max(initial=0.0) <= TOLERANCE * scale:
        entry = _worst(defect)
        raise _fail("isotropy", reversible, trial, float(defect[entry]), entry=entry)
    for kind in bundle.charges:
        one = bundle.indicator(kind)
        defect = np.concatenate([skew @ one, constraint @ one])
        scales = np.concatenate([np.full(n, scale), np.abs(constraint).max(axis=1, initial=0.0)])
        terms = scales * np.abs(one).sum()
        if not np.all(np.abs(defect) <= TOLERANCE * terms):
            entry = _worst(defect / np.maximum(terms, TINY))
            raise _fail("conservation", reversible, trial, float(defect[entry]), quantity=kind, entry=entry)
    # (f, e) ∈ D(x) ⇔ (−ϵf, ϵe) ∈ D(ϵx)
    there = reversible.structure(_reversed(bundle, x))
    found = _apart(bundle, (-parity[:, None] * skew * parity, constraint * parity), there) if _finite(*there) else 0.0
    if not reversible.external_field and not found <= SAME:
        raise _fail("parity", reversible, trial, found, flag=FLAGS["reversible"])
    for port, opposite in _opposite(bundle, x):
        found = _apart(bundle, (skew, constraint), reversible.structure({**x, port: opposite}))
        if not found <= SAME:
            raise _fail("rotation-sign", reversible, trial, found, what="the structure tells", port=port)


def _finite(*matrices: Array) -> bool:
    return all(bool(np.all(np.isfinite(matrix))) for matrix in matrices)


def unit_free(matrix: Array) -> tuple[Array, Array, float]:
    """M with rows and columns divided by the roots of its diagonal.

    Returns
    -------
    weight, scaled, allowed
        Factors (n,) of rows and columns, the scaled matrix (n, n), and the bound of the rounding of its entries.
    """
    size = np.sqrt(np.abs(np.diag(matrix)))
    size = np.where(size > 0.0, size, np.sqrt(np.abs(matrix).max(axis=1, initial=0.0)))
    weight = 1.0 / np.where(size > 0.0, size, 1.0)
    scaled = weight[:, None] * matrix * weight
    least = float((weight[:, None] * TINY * weight).max(initial=0.0))
    return weight, scaled, TOLERANCE * float(np.abs(scaled).max(initial=0.0)) + least


def _check_irreversible(irreversible: "Irreversible", trial: Trial) -> None:
    """Onsager symmetric, non-negative, conserving energy and each environment quantity but entropy, of even parity."""
    bundle, name, x, e, reference = irreversible.bundle, irreversible.name, trial.states, trial.efforts, trial.reference
    parity = bundle.parity()
    matrix = irreversible.matrix(x, e, reference)
    if matrix.shape != (bundle.size, bundle.size):
        raise StructureError("onsager-shape", name, found=matrix.shape, expected=(bundle.size, bundle.size))
    _require_finite(irreversible, trial, "the matrix M", matrix)
    weight, even, allowed = unit_free(matrix)
    defect = even - even.T
    if not np.abs(defect).max(initial=0.0) <= allowed:
        entry = _worst(defect)
        raise _fail("symmetry", irreversible, trial, float(matrix[entry] - matrix[entry[::-1]]), entry=entry)
    energy_effort = e + bundle.intensive(reference)
    least = float(symmetric_eigenvalues(even).min(initial=0.0))
    if not least >= -allowed:
        raise _fail("definite", irreversible, trial, float(symmetric_eigenvalues(matrix).min(initial=0.0)))
    terms = np.abs(matrix) @ np.abs(energy_effort)
    defect = matrix @ energy_effort
    if not np.all(np.abs(defect) <= np.maximum(TOLERANCE * terms, TINY)):
        entry = _worst(defect / np.maximum(terms, TINY))
        raise _fail("energy", irreversible, trial, float(defect[entry]), entry=entry)
    for kind in bundle.charges:
        one = bundle.indicator(kind)
        defect = matrix @ one
        terms = np.abs(matrix) @ np.abs(one)
        if kind != "entropy" and not np.all(np.abs(defect) <= np.maximum(TOLERANCE * terms, TINY)):
            entry = _worst(defect)
            raise _fail("conservation", irreversible, trial, float(defect[entry]), quantity=kind, entry=entry)
    mirrored = irreversible.matrix(_reversed(bundle, x), parity * e, reference)
    there = weight[:, None] * (parity[:, None] * mirrored * parity) * weight
    found = float(np.abs(there - even).max(initial=0.0)) if _finite(mirrored) else 0.0
    if not irreversible.one_sided and not found <= allowed:
        raise _fail("parity", irreversible, trial, found, flag=FLAGS["irreversible"])
    for port, opposite in _opposite(bundle, x):
        other = weight[:, None] * irreversible.matrix({**x, port: opposite}, e, reference) * weight
        found = float(np.abs(other - even).max(initial=0.0))
        if not found <= allowed:
            raise _fail("rotation-sign", irreversible, trial, found, what="the matrix M tells", port=port)
