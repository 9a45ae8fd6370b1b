"""The kinds of primitive system: storage, environment, reversible, irreversible.

A primitive *is* its structure as data (an energy, a Dirac structure, an Onsager structure). Flows, efforts,
checks, the discrete relation and the compiled kernel all derive from that one object.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, final

import numpy as np

from ephs.operad import Algebra, Directory, Interface, Path, PortType, Quantity
from ephs.semantics.bundles.bundle import Array, Bundle, Reference
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.bundles.support import Support
from ephs.semantics.spaces import manifold
from ephs.semantics.verdicts.verdict import Condition, StructureVerdict, examine

if TYPE_CHECKING:
    from ephs.semantics.derive.linear import Linear
    from ephs.semantics.derive.relations import Relation
    from ephs.semantics.systems.system import Filling

Point = Mapping[Path, Array]
"""States of the ports that a primitive reads: port -> (size,)."""
Domain = tuple[tuple[Path, float, float], ...]
"""Ports with the least and the largest number that their states may have."""
Initial = tuple[tuple[Path, tuple[float, ...]], ...]
"""Ports with the numbers of their initial states."""
Proof = Callable[[], tuple[Condition, ...]]


@final
@dataclass(frozen=True, slots=True)
class Kernel:
    """The compiled counterpart of a primitive's discrete relation, and its numbers.

    Parameters
    ----------
    name
        What kind of relation it is.
    relation
        What is compiled.
    potentials
        Places among the parameters that hold reference potentials, each with what it is the potential of: amounts by
        charge. They are zero until a reference environment is known.
    """

    name: str
    relation: "Relation | Linear"
    parameters: tuple[float, ...] = ()
    potentials: tuple[tuple[int, tuple[tuple[str, float], ...]], ...] = ()

    def numbers(self, reference: Reference) -> tuple[float, ...]:
        """The parameters in a reference environment."""
        if not self.potentials:
            return self.parameters
        out = list(self.parameters)
        for place, carried in self.potentials:
            out[place] = sum(amount * reference.potential(charge) for charge, amount in carried)
        return tuple(out)


@final
@dataclass(frozen=True, slots=True)
class Formula:
    """The function that defines a primitive, for numbers and symbols alike.

    Parameters
    ----------
    function
        Called by name with the states of read ports, of a process with their energy efforts, and with the parameters.
        A storage's gives E, a reversible component's (L, C), either of which may be None, an irreversible one's M.
    parameters
        Names among the primitive's own parameters that the function takes.
    gradient
        Of a storage whose gradient is written by hand: dE, left-trivialised, called like the function.
    """

    function: Callable[..., Any]
    parameters: tuple[str, ...] = ()
    gradient: Callable[..., Any] | None = None


class _Structure(ABC):
    """Common part of all primitives: an interface, and a verdict on the structure, given once."""

    __slots__ = ()
    interface: Interface
    _verdict: StructureVerdict | None
    _bundle: Bundle | None

    @property
    @abstractmethod
    def kind(self) -> str:
        """Kind of primitive."""

    @property
    def verdict(self) -> StructureVerdict:
        """Verdict on its structure: ``"proved"`` or ``"searched"``, with the conditions and their proofs.

        Raises
        ------
        StructureError
            The structure is refuted, which a trusted one only says here.
        """
        if self._verdict is None:
            object.__setattr__(self, "_verdict", examine(self))  # pyright: ignore[reportArgumentType] - all are primitives
        assert self._verdict is not None
        return self._verdict

    @property
    def bundle(self) -> Bundle:
        """The layout of the fibre."""
        if self._bundle is None:
            object.__setattr__(self, "_bundle", Bundle.of(self.interface))
        assert self._bundle is not None
        return self._bundle

    @property
    def algebra(self) -> "Algebra[Filling]":
        """Primitives fill boxes as systems do."""
        from ephs.semantics.algebra import systems

        return systems


@final
@dataclass(frozen=True, slots=True)
class Storage(_Structure):
    """Storage of energy: x = ξ, f = ξ̇, e = dH(ξ) with the exergy H = E − θ₀ Σs + π₀ Σv − Σ μ₀ n.

    Parameters
    ----------
    name
        The type's name, e.g. ``"spring"``.
    interface
        Power ports only; the states live at them.
    energy
        E(x) in J, from the ports' states, up to a constant.
    gradient
        dE(x), left-trivialised, (n,) in the ports' order; by differences of the energy where None.
    discrete_gradient
        ∇̄E(x⁰, v) with ⟨∇̄E|v⟩ = E(x⁰·exp v) − E(x⁰) exactly, symmetric in the two states, (n,). Where None:
        port by port the gradient at the midpoint, corrected along the increment (Gonzalez).
    parameters
        Names and numbers, for printing and comparison.
    environment
        True for the reference environment: H ≡ 0 and e = 0; the state still integrates the flow.
    kernel, formula
        The compiled counterpart, and the defining function for printed equations.
    notation
        How equations between vectors are written: a function of a `symbols.voices.Voice` that gives efforts by port,
        or (flows by port, conditions).
    domain
        (port, least, largest) of states that are kept between bounds: what is proved and searched is there.
    proof
        Shows the conditions, where that is not read off the formula; asked once, for the verdict.
    trusted
        Give a verdict when it is asked for, and not when made: what makes it accepts only parameters for which the
        conditions hold. Tests ask for the verdicts.
    support
        Where energy and effort are not 0. Of an irreversible process in the states that it reads; its flow is 0 as well
        where the energy of a storage beside it is, which has the same support.
    initial
        (port, numbers) of states in which a run starts, where these are not the identity of their space.
    gap
        Of surfaces whose relative pose it stores: steps must not pass where it is negative. None of others.
    """

    name: str
    interface: Interface
    energy: Callable[[Point], float] = field(compare=False)
    gradient: Callable[[Point], Array] | None = field(default=None, compare=False)
    discrete_gradient: Callable[[Point, Array], Array] | None = field(default=None, compare=False)
    parameters: tuple[tuple[str, object], ...] = ()
    environment: bool = False
    kernel: Kernel | None = field(default=None, compare=False, repr=False)
    formula: Formula | None = field(default=None, compare=False, repr=False)
    notation: Callable[[Any], Any] | None = field(default=None, compare=False, repr=False)
    domain: Domain = ()
    proof: Proof | None = field(default=None, compare=False, repr=False)
    trusted: bool = field(default=False, compare=False, repr=False)
    support: Support | None = field(default=None, compare=False, repr=False)
    initial: Initial = ()
    gap: object = field(default=None, compare=False, repr=False)
    _verdict: StructureVerdict | None = field(default=None, init=False, compare=False, repr=False)
    _bundle: Bundle | None = field(default=None, init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        if self.trusted:
            return
        for port in state_ports(self.interface):
            raise StructureError("storage-ports", self.name, found=str(port))
        _ = self.verdict

    @property
    def kind(self) -> Literal["storage", "environment"]:
        """Kind of primitive."""
        return "environment" if self.environment else "storage"

    @property
    def reads(self) -> tuple[Path, ...]:
        """The ports whose states enter: a storage's own."""
        return self.bundle.ports

    def with_initial(self, values: Mapping[str, object]) -> "Storage":
        """The storage in another start: initial values by port.

        Raises
        ------
        AssemblyError
            An unknown port, a wrong shape, or a number that is not finite.
        """
        from ephs.semantics.systems.initial import started

        return started(self, {Path.of(port): value for port, value in values.items()}, Path())

    def retract(self, x: Point, v: Array) -> dict[Path, Array]:
        """The state x·exp(v), port by port; v (n,) in the fibre's layout."""
        return {p: manifold(q.space).retract(x[p], v[where]) for p, where, q in self.bundle.items()}

    def energy_gradient(self, x: Point) -> Array:
        """dE(x), left-trivialised, (n,)."""
        if self.gradient is not None:
            return np.asarray(self.gradient(x), dtype=float)
        from ephs.semantics.primitives.differences import differences

        return differences(self, x)

    def effort(self, x: Point, reference: Reference) -> Array:
        """e = dH(x), (n,); zero for the environment."""
        if self.environment:
            return np.zeros(self.bundle.size)
        return self.energy_gradient(x) - self.bundle.intensive(reference)

    def discrete_effort(self, x0: Point, v: Array, reference: Reference) -> Array:
        """∇̄H(x⁰, v), (n,): the effort of the natural discretisation over the increment v."""
        if self.environment:
            return np.zeros(self.bundle.size)
        if self.discrete_gradient is not None:
            gradient = np.asarray(self.discrete_gradient(x0, v), dtype=float)
        else:
            from ephs.semantics.primitives.differences import increments

            gradient = increments(self, x0, v)
        return gradient - self.bundle.intensive(reference)

    def exergy(self, x: Point, reference: Reference) -> float:
        """H(x) in J, up to the constant of the energy."""
        if self.environment:
            return 0.0
        return float(self.energy(x)) - self._exchanged(x, reference)

    def total_energy(self, x: Point, reference: Reference) -> float:
        """E(x) in J; of the environment θ₀ s − π₀ v + Σ μ₀ n."""
        return self._exchanged(x, reference) if self.environment else float(self.energy(x))

    def _exchanged(self, x: Point, reference: Reference) -> float:
        """Energy of the same states at the environment's intensities, θ₀ s − π₀ v + Σ μ₀ n, in J."""
        return sum(float(reference.intensive(q) @ x[p]) for p, _, q in self.bundle.items() if q.environment)


@final
@dataclass(frozen=True, slots=True)
class Reversible(_Structure):
    """Reversible exchange of energy: the Dirac structure f = L(x) e + C(x)ᵀ λ, 0 = C(x) e.

    A gyrator has no C, a constraint no L, a transformer is the constraint C = [−g(x), 1] (its λ is f₂).

    Parameters
    ----------
    structure
        (L (n, n), C (k, n)) from the states of the ports in ``reads``.
    discrete
        (C_h (k, n), F (k,)) from (h, x⁰, increments of the read states, e): the discrete constraint, with
        C_h e = F, used in place of C at the midpoint.
    working
        Whether its discrete relation does work, C_h e ≠ F: over a step it is no Dirac structure. The work is booked as
        supplied, and component by component.
    external_field
        Whether an external field turns around with time, as a magnet's or the rotation of a frame: then the structure
        need not be invariant under time reversal of its quantities alone.
    domain, proof, trusted, support
        As of a `Storage`; of an irreversible process a domain may bound energy efforts, too.
    """

    name: str
    interface: Interface
    structure: Callable[[Point], tuple[Array, Array]] = field(compare=False)
    reads: tuple[Path, ...] = ()
    discrete: Callable[[float, Point, Point, Array], tuple[Array, Array]] | None = field(default=None, compare=False)
    parameters: tuple[tuple[str, object], ...] = ()
    multipliers: int = 0
    kernel: Kernel | None = field(default=None, compare=False, repr=False)
    formula: Formula | None = field(default=None, compare=False, repr=False)
    notation: Callable[[Any], Any] | None = field(default=None, compare=False, repr=False)
    domain: Domain = ()
    proof: Proof | None = field(default=None, compare=False, repr=False)
    trusted: bool = field(default=False, compare=False, repr=False)
    working: bool = False
    external_field: bool = field(default=False, compare=False, repr=False)
    _verdict: StructureVerdict | None = field(default=None, init=False, compare=False, repr=False)
    _bundle: Bundle | None = field(default=None, init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        if not self.trusted:
            _ = self.verdict

    @property
    def kind(self) -> Literal["reversible"]:
        """Kind of primitive."""
        return "reversible"


@final
@dataclass(frozen=True, slots=True)
class Irreversible(_Structure):
    """Irreversible process: f = M(x, e) e / θ₀ with M symmetric, non-negative and M eᴱ = 0.

    Parameters
    ----------
    matrix
        M (n, n) in the units of θ₀·f/e, from (states of ``reads``, e (n,), reference).
    domain, proof, trusted
        As of a `Storage`; of an irreversible process a domain may bound energy efforts, too.
    one_sided
        Whether M depends on the direction of the flow, as of valves, diodes and contacts, which push only: then its
        parity under time reversal is not asked for.
    impulse
        Law of its impulses, of a process that acts at instants, as a hard contact or a hard stop; None of others.
    """

    name: str
    interface: Interface
    matrix: Callable[[Point, Array, Reference], Array] = field(compare=False)
    reads: tuple[Path, ...] = ()
    parameters: tuple[tuple[str, object], ...] = ()
    kernel: Kernel | None = field(default=None, compare=False, repr=False)
    formula: Formula | None = field(default=None, compare=False, repr=False)
    notation: Callable[[Any], Any] | None = field(default=None, compare=False, repr=False)
    domain: Domain = ()
    proof: Proof | None = field(default=None, compare=False, repr=False)
    trusted: bool = field(default=False, compare=False, repr=False)
    one_sided: bool = field(default=False, compare=False, repr=False)
    support: Support | None = field(default=None, compare=False, repr=False)
    impulse: object = field(default=None, compare=False, repr=False)
    _verdict: StructureVerdict | None = field(default=None, init=False, compare=False, repr=False)
    _bundle: Bundle | None = field(default=None, init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        if not self.trusted:
            _ = self.verdict

    @property
    def kind(self) -> Literal["irreversible"]:
        """Kind of primitive."""
        return "irreversible"

    def flow(self, x: Point, e: Array, reference: Reference) -> Array:
        """f = M(x, e) e / θ₀, (n,)."""
        self.require_temperature(e, reference)
        return self.matrix(x, e, reference) @ e / reference.temperature

    def require_temperature(self, e: Array, reference: Reference) -> None:
        """Refuse an absolute temperature θ₀ + e_s that is not positive."""
        for _, where, quantity in self.bundle.items():
            if quantity.kind == "entropy" and not reference.temperature + e[where][0] > 0.0:
                raise StructureError("temperature", self.name, found=float(reference.temperature + e[where][0]))


Primitive = Storage | Reversible | Irreversible


@cache
def power_ports(**ports: Quantity) -> Interface:
    """An interface of power ports only."""
    return Directory({name: PortType(quantity, True) for name, quantity in ports.items()})


def state_ports(interface: Interface) -> tuple[Path, ...]:
    """The ports without power, whose states are read."""
    return tuple(port for port, port_type in interface.items() if not port_type.power)


def midpoint(primitive: Primitive, x0: Point, v: Point) -> dict[Path, Array]:
    """The states x⁰·exp(v/2) of the ports that a primitive reads."""
    return {
        port: manifold(primitive.interface[port].quantity.space).retract(x0[port], 0.5 * v[port])
        for port in primitive.reads
    }
