"""Chemistry: ideal mixtures of species, reactions by mass action.

A species is data: what it is made of, and its energy, entropy and heat capacity in a standard state. A mixture stores
energy with entropy, volume and the amount of each species; it is homogeneous of degree one: E = θ s − π v + Σ μ n
(Euler) and s dθ − v dπ + Σ n dμ = 0 (Gibbs and Duhem). A reaction is Onsager's: its rate is the affinity times a factor
that is not negative, a logarithmic mean; with the mixture's potentials this is the law of mass action to the letter.
Atoms are conserved, moles are not. Sources: S. R. de Groot, P. Mazur, *Non-equilibrium thermodynamics* (1962), ch. X;
A. Mielke, *A gradient structure for reaction-diffusion systems*, Nonlinearity 24 (2011), for the logarithmic mean.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, final

import numpy as np

from ephs.operad import Directory, Interface, PortType, Quantity, quantity
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.library.made import finite, positive
from ephs.semantics.primitives.forms import dissipated, stored
from ephs.semantics.primitives.primitives import Irreversible, Storage
from ephs.semantics.primitives.special import log_mean
from ephs.semantics.spaces.decompositions import least_squares

__all__ = [
    "GAS_CONSTANT",
    "Phase",
    "Species",
    "element_potentials",
    "equilibrium_constant",
    "ideal_mixture",
    "mixture_entropy",
    "reaction",
]

BALANCED = 1e-12
"""Part of a reaction's atoms that its stoichiometric numbers may lose: rounding of their sum."""
GAS_CONSTANT = 8.31446261815324
"""R in J/(mol K), exact since 2019."""
Phase = Literal["gas", "solution"]
"""An ideal gas, whose concentrations are n/v; or an ideal solution of constant volume, with mole fractions."""


@final
@dataclass(frozen=True, slots=True)
class Species:
    """A substance in its standard state.

    Parameters
    ----------
    name
        Its ports bear this name.
    elements
        Atoms, or other units that no reaction changes, by element; the species itself where there are none. A mapping
        will do.
    energy
        Molar internal energy in J/mol at the standard temperature.
    entropy
        Molar entropy in J/(mol K) at the standard temperature and pressure; of a solution's species, when pure.
    capacity
        Molar heat capacity at constant volume in J/(mol K).
    temperature, pressure
        Of the standard state, in K and Pa.
    """

    name: str
    elements: tuple[tuple[str, float], ...] = ()
    energy: float = 0.0
    entropy: float = 0.0
    capacity: float = 1.5 * GAS_CONSTANT
    temperature: float = 298.15
    pressure: float = 1e5

    def __post_init__(self) -> None:
        made = dict(self.elements) or {self.name: 1.0}
        object.__setattr__(self, "elements", tuple(sorted((key, float(value)) for key, value in made.items())))
        finite(self.name, energy=self.energy, entropy=self.entropy)
        positive(self.name, capacity=self.capacity, temperature=self.temperature, pressure=self.pressure)
        if self.name in ("s", "v"):
            expected = "another name: ports s and v are entropy and volume"
            raise StructureError("parameter", self.name, key="name", found=self.name, expected=expected)

    @property
    def quantity(self) -> Quantity:
        """The amount of it, in mol."""
        return quantity.species(self.name, **dict(self.elements))

    @property
    def concentration(self) -> float:
        """Of the standard state of a gas, in mol/m³."""
        return self.pressure / (GAS_CONSTANT * self.temperature)

    def potential(self, temperature: Any, phase: Phase = "gas") -> Any:
        """Chemical potential in J/mol at the standard concentration, or of the pure species of a solution."""
        t = temperature
        heat = self.energy + self.capacity * (t - self.temperature)
        work = GAS_CONSTANT * t if phase == "gas" else 0.0
        return heat + work - t * (self.entropy + self.capacity * np.log(t / self.temperature))


def ideal_mixture(*, species: Sequence[Species], phase: Phase = "gas") -> Storage:
    """Ideal mixture; ports s, v (of a gas) and the species' names: E = Σ n (u + c (θ − θ*)).

    The temperature is that at which s = Σ n (σ + c ln(θ/θ*) − R ln a), with activities a = n/(v c*) in a gas and mole
    fractions in a solution.

    Raises
    ------
    StructureError
        No species, or one twice.
    """
    given = _distinct("ideal_mixture", species)
    base = given[0].temperature  # energies are counted from there: differences of large ones would be rounding

    def energy(s: Any, v: Any = None, **n: Any) -> Any:
        total = sum(n.values())
        pure = held = ground = 0.0
        for one in given:
            amount = n[one.name]
            activity = amount / (v * one.concentration) if phase == "gas" else amount / total
            constant = one.entropy + one.capacity * math.log(base / one.temperature)
            pure = pure + amount * (constant - GAS_CONSTANT * np.log(activity))
            held = held + amount * one.capacity
            ground = ground + amount * (one.energy + one.capacity * (base - one.temperature))
        return ground + held * base * np.expm1((s - pure) / held)

    return stored("ideal_mixture", _ports(given, phase, power=True), energy, {}, (("species", given), ("phase", phase)))


def mixture_entropy(
    species: Sequence[Species],
    *,
    temperature: float,
    amounts: Mapping[str, float],
    volume: float | None = None,
    phase: Phase = "gas",
) -> float:
    """Entropy in J/K of an ideal mixture at a temperature, for initial values.

    Parameters
    ----------
    amounts
        In mol, by name.
    volume
        In m³, of a gas.
    """
    total, out = sum(amounts.values()), 0.0
    for one in species:
        n = amounts[one.name]
        if phase == "gas":
            positive("mixture_entropy", volume=math.nan if volume is None else volume)
        activity = n / total if volume is None or phase == "solution" else n / (volume * one.concentration)
        warm = one.capacity * math.log(temperature / one.temperature)
        out += n * (one.entropy + warm - GAS_CONSTANT * math.log(activity))
    return out


def reaction(
    equation: str, *, species: Sequence[Species], k: float, activation: float = 0.0, phase: Phase = "gas"
) -> Irreversible:
    """Reaction by mass action; ports s, the species of the equation, and state port v of a gas.

    The rate in mol/s is v (k Π cᵃ − k' Π cᵇ), with concentrations c = n/v in mol/m³ and the equation's numbers a, b;
    of a solution k Π xᵃ − k' Π xᵇ with mole fractions x. The backward constant k' follows from the species' data.
    M = L/(R θ²) n nᵀ with n = (θ ν, −⟨ν|μ⟩), L the logarithmic mean of forward and backward rate.

    Parameters
    ----------
    equation
        As ``"2 A = B"``, ``"H2 + I2 = 2 HI"``: whole or broken numbers, names of species.
    k
        Forward rate constant, in the units that make the rate mol/s.
    activation
        Energy Eₐ in J/mol of Arrhenius' law, k exp(−Eₐ/(R θ)).

    Raises
    ------
    StructureError
        An element is not conserved, or the equation cannot be read.
    """
    given = _distinct("reaction", species)
    positive("reaction", k=k)
    finite("reaction", activation=activation)
    before, after = _sides(equation, given)
    taking = tuple(one for one in given if one.name in before or one.name in after)
    nu = {one.name: after.get(one.name, 0.0) - before.get(one.name, 0.0) for one in taking}
    for element in sorted({element for one in taking for element, _ in one.elements}):
        atoms = [nu[one.name] * dict(one.elements).get(element, 0.0) for one in taking]
        if abs(sum(atoms)) > BALANCED * sum(map(abs, atoms)):
            raise StructureError("elements", "reaction", equation=equation, element=element, found=f"{sum(atoms):+g}")

    def matrix(s: Any, v: Any = 1.0, **mu: Any) -> Any:
        thermal = GAS_CONSTANT * s
        forward = math.log(k) + np.log(v) - activation / thermal
        for name, order in before.items():
            one = next(each for each in taking if each.name == name)
            unit = math.log(one.concentration) if phase == "gas" else 0.0
            forward = forward + order * (unit + (mu[name] - one.potential(s, phase)) / thermal)
        drive = sum(number * mu[name] for name, number in nu.items())
        factor = log_mean(forward, forward + drive / thermal) / (thermal * s)
        normal = [s * nu[one.name] for one in taking] + [-drive]
        return [[factor * a * b for b in normal] for a in normal]

    interface = _ports(taking, phase, power=False)
    parameters = {"equation": equation, "species": given, "k": k, "activation": activation, "phase": phase}
    return dissipated("reaction", interface, matrix, {}, tuple(parameters.items()))


def equilibrium_constant(
    equation: str, *, species: Sequence[Species], temperature: float, phase: Phase = "gas"
) -> float:
    """Π cᵇ / Π cᵃ at equilibrium, of concentrations in mol/m³; of a solution, of mole fractions."""
    before, after = _sides(equation, tuple(species))
    out = 0.0
    for one in species:
        number = after.get(one.name, 0.0) - before.get(one.name, 0.0)
        unit = math.log(one.concentration) if phase == "gas" else 0.0
        out += number * (unit - float(one.potential(temperature, phase)) / (GAS_CONSTANT * temperature))
    return math.exp(out)


def element_potentials(potentials: Mapping[Species, float]) -> dict[str, float]:
    """Potentials of the elements in J/mol from those of the species of which the environment consists.

    For `Reference(potentials=…)`: least squares where there are more species than elements.
    """
    elements = sorted({element for one in potentials for element, _ in one.elements})
    rows = np.array([[dict(one.elements).get(element, 0.0) for element in elements] for one in potentials])
    found = least_squares(rows, np.array(list(potentials.values())))
    return dict(zip(elements, map(float, found), strict=True))


def _distinct(name: str, species: Sequence[Species]) -> tuple[Species, ...]:
    names = [one.name for one in species]
    if not names or len(set(names)) < len(names):
        found = ", ".join(names) or "none"
        raise StructureError("parameter", name, key="species", found=found, expected="one species or more, each once")
    return tuple(species)


def _ports(species: Sequence[Species], phase: Phase, *, power: bool) -> Interface:
    """Of a mixture: s, v, species; of a reaction: species, s, and the volume that it reads."""
    amounts = {one.name: PortType(one.quantity) for one in species}
    volume = {"v": PortType(quantity.volume, power)} if phase == "gas" else {}
    entropy = {"s": PortType(quantity.entropy)}
    return Directory(entropy | volume | amounts if power else amounts | entropy | volume)


def _sides(equation: str, species: Sequence[Species]) -> tuple[dict[str, float], dict[str, float]]:
    """Numbers by name, left and right of the equation."""
    names = {one.name for one in species}
    sides = equation.split("=")
    found: list[dict[str, float]] = []
    for side in sides if len(sides) == 2 else []:
        numbers: dict[str, float] = {}
        for term in side.split(" + "):
            read = re.fullmatch(r"\s*(\d+(?:\.\d+)?)?\s*(\S+)\s*", term)
            if read is None or read[2] not in names or not float(read[1] or 1):
                break
            numbers[read[2]] = numbers.get(read[2], 0.0) + float(read[1] or 1)
        else:
            found.append(numbers)
    if len(found) != 2:
        expected = f"as '2 A = B', of the species {', '.join(sorted(names))}"
        raise StructureError("parameter", "reaction", key="equation", found=equation, expected=expected)
    return found[0], found[1]
