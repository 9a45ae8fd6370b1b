"""Strategies for primitives of a given interface: random structures that satisfy all conditions on them."""

from typing import Any

import numpy as np
from hypothesis import strategies as st

from ephs.mechanics.elements import components
from ephs.operad import Interface, Path
from ephs.operad import quantity as quantities
from ephs.operad.charges import ENTROPY
from ephs.semantics import Irreversible, Reference, Reversible, Storage, library
from ephs.semantics.bundles.bundle import Array, Bundle
from ephs.semantics.primitives import forms, structures
from ephs.semantics.primitives.primitives import Formula, Point
from ephs.semantics.spaces import Pair
from ephs.semantics.spaces.decompositions import pseudoinverse

CLEARED = 1e-12
"""Rounding error of entries of order one."""


READING = st.sampled_from((False, True, True, True))
"""Whether a component reads the states that it can."""


def generators() -> st.SearchStrategy[np.random.Generator]:
    """Sources of the random numbers in matrices: numbers do not shrink to anything simpler than others."""
    return st.integers(0, 2**20).map(np.random.default_rng)


@st.composite
def storages(draw: st.DrawFn, interface: Interface) -> Storage:
    """Storages at power ports: quadratic, thermal, gravity for a pose, a spring for a relative pose.

    The interface has one port, or vector spaces without environment quantities only.
    """
    rng = draw(generators())
    bundle = Bundle.of(interface)
    kinds = [quantity for _, _, quantity in bundle.items()]
    if len(kinds) == 1:
        (_port,), quantity = bundle.ports, kinds[0]
        if quantity.kind == "entropy":
            if draw(st.booleans()):
                return _renamed(library.environment(), interface)
            return _renamed(components.thermal_node(rng.uniform(5.0, 50.0), rng.uniform(250.0, 350.0)), interface)
        if quantity.kind == "pose":
            group = "SE3" if quantity.space.name == "SE(3)" else "SO3xR3"
            return _renamed(components.gravity(rng.standard_normal(3), group), interface)
        if quantity.in_frame(None) == quantities.relative_pose("spherical"):
            return _turning(interface, rng.uniform(0.5, 3.0))
        if quantity.kind == "relative_pose":
            pair = Pair.from_space(quantity.space)
            return _renamed(components.pair_spring(pair, np.full(pair.dim, 1.5), np.zeros(pair.dim)), interface)
        if quantity.space.size == 1 and not quantity.environment and draw(st.booleans()):
            return _quartic(interface, rng.uniform(0.5, 3.0), rng.uniform(0.1, 0.5))
    parity = bundle.parity()
    factor = rng.standard_normal((bundle.size, bundle.size))
    matrix = factor @ factor.T + np.eye(bundle.size)
    return structures.quadratic("random storage", interface, _even(matrix, parity), ())


@st.composite
def reversibles(
    draw: st.DrawFn,
    interface: Interface,
    *,
    reads: tuple[Path, ...] = (),
    constrained: tuple[int, ...] = (-1, 1),
) -> Reversible:
    """Random Dirac structures f = L(x) e + C(x)* λ, 0 = C(x) e over the power ports of an interface.

    Parameters
    ----------
    reads
        State ports that may modulate L and C.
    constrained
        Parities of the efforts that constraints may hold.
    """
    rng = draw(generators())
    bundle = Bundle.of(interface)
    n, parity = bundle.size, bundle.parity()
    keep = _kept(bundle)
    skew = rng.standard_normal((n, n))
    skew = _cleared(keep @ _odd(skew - skew.T, parity) @ keep)
    rows = draw(st.integers(0, 1 if n > 1 and draw(st.booleans()) else 0))
    side = float(draw(st.sampled_from(constrained)))
    constraint, turned = (_cleared(rng.standard_normal((rows, n)) * (parity == side) @ keep) for _ in range(2))
    kept = np.linalg.norm(constraint, axis=1) > 0.1
    constraint, turned = constraint[kept], turned[kept]
    used = reads if reads and draw(READING) else ()
    if not used:
        return structures.constant_structure("random Dirac structure", interface, skew, constraint, trusted=True)

    def structure(x: Point) -> tuple[Array, Array]:
        scale = _scale(x)
        return scale * skew, constraint + (scale - 1.0) * turned

    rows = constraint.shape[0]
    return Reversible("random Dirac structure", interface, structure, used, multipliers=rows, trusted=True)


@st.composite
def irreversibles(draw: st.DrawFn, interface: Interface, *, reads: tuple[Path, ...] = ()) -> Irreversible:
    """Random Onsager structures: M = Σ s n nᵀ over pairs of coordinates, n = eⱼ uᵢ − eᵢ uⱼ with energy efforts e."""
    rng = draw(generators())
    bundle = Bundle.of(interface)
    strength = np.triu(np.abs(rng.standard_normal((bundle.size, bundle.size))), 1)
    fixed = sum((np.abs(bundle.indicator(name)) for name in bundle.charges if name != ENTROPY), np.zeros(bundle.size))
    strength[fixed != 0.0] = strength[:, fixed != 0.0] = 0.0
    strength += strength.T
    used = reads if reads and draw(READING) else ()

    def matrix(x: Point, e: Array, reference: Reference) -> Array:
        energy = e + bundle.intensive(reference)
        weight = _scale(x) * strength / (1.0 + np.abs(energy)[:, None] + np.abs(energy))
        return np.diag(weight @ energy**2) - weight * np.outer(energy, energy)

    return Irreversible("random Onsager structure", interface, matrix, used, trusted=True)


def _scale(x: Point) -> float:
    """A positive number that depends on each entry of the states, but not on signs: even, and of rotations."""
    return 1.0 + 0.5 * float(np.cos(sum(float(np.arange(1.0, v.size + 1.0) @ v**2) for v in x.values())))


def _quartic(interface: Interface, stiffness: float, hardening: float) -> Storage:
    """A storage of one's own, from a function."""

    def energy(**states: Any) -> Any:
        return sum(0.5 * stiffness * x**2 + 0.25 * hardening * x**4 for x in states.values())

    form = forms.storage_form(interface, energy, ())
    return Storage(
        "quartic", interface, form.energy, form.gradient, form.discrete_gradient, kernel=form.kernel,
        parameters=(("stiffness", stiffness), ("hardening", hardening)), formula=Formula(energy), trusted=True,
    )  # fmt: skip


def _turning(interface: Interface, stiffness: float) -> Storage:
    """E = 2 k |sin(φ/2)|², smooth on all rotations; its discrete gradient is the one of storages that have none."""
    (port,) = interface

    def energy(x: Point) -> float:
        return 2.0 * stiffness * float(x[port][1:] @ x[port][1:])

    def gradient(x: Point) -> Array:
        return 2.0 * stiffness * x[port][0] * x[port][1:]

    return Storage("turning spring", interface, energy, gradient, parameters=(("k", stiffness),), trusted=True)


def _kept(bundle: Bundle) -> Array:
    """The projector off the charges, which reversible structures conserve."""
    rows = np.array([bundle.indicator(name) for name in bundle.charges]).reshape(len(bundle.charges), bundle.size)
    return np.eye(bundle.size) - pseudoinverse(rows) @ rows


def _cleared(matrix: Array) -> Array:
    """A projected matrix of entries of order one without what rounding left where it should be zero."""
    return np.where(np.abs(matrix) > CLEARED, matrix, 0.0)


def _even(matrix: Array, parity: Array) -> Array:
    return np.where(np.outer(parity, parity) > 0.0, matrix, 0.0)


def _odd(matrix: Array, parity: Array) -> Array:
    return np.where(np.outer(parity, parity) < 0.0, matrix, 0.0)


def _renamed(storage: Storage, interface: Interface) -> Storage:
    """The storage with its one port named as in the interface."""
    (old,), (new,) = storage.bundle.ports, tuple(interface)
    if old == new:
        return storage

    def back(x: Point) -> dict[Path, Array]:
        return {old: x[new]}

    discrete: Any = storage.discrete_gradient
    gradient: Any = storage.gradient
    return Storage(
        storage.name,
        interface,
        energy=lambda x: storage.energy(back(x)),
        gradient=None if gradient is None else lambda x: gradient(back(x)),
        discrete_gradient=None if discrete is None else lambda x, v: discrete(back(x), v),
        parameters=storage.parameters,
        environment=storage.environment,
        kernel=storage.kernel,
        trusted=True,
    )
