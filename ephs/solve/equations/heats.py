"""Heat as energy: thermal storages advance by energy, and friction's heat is the energy lost by the motion.

**Energies.** A storage of heat is advanced by the energy that it takes up, E = c1 (exp(s/c2) − 1); its entropy
follows, with it the mean temperature θ̄ = ΔE/Δs of the step. With it components make flow · (1/θ̄ at the sink − 1/θ̄ at
the source), so entropies change by what all make, to rounding, and friction never makes less than nothing. Of this sum
each has the part that the temperatures at the method's stages say.

**Friction.** The heat H of a step is a quadrature of powers, which says nothing of a motion that decays in the step.
There D = E⁰ + W − E¹ of all that is not heat is right, where Radau IIA finds a hundredth of it at hλ = 2000 and the
trapezoidal rule thousands of times as much. Methods whose quadrature finds no more than is lost, those that are
algebraically stable, take what is lost beyond it, D − H > 0, for friction's heat, in proportion to what each made.
Others have heat go from H towards D, no further than the estimated error of its quadrature, which is its difference to
an embedded one, and not below zero. D − H is of the order of the method's error, so that the order stays. What remains
of it is an error of the motion.
"""

from collections.abc import Callable
from typing import final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.numbering import Index
from ephs.semantics.primitives.primitives import Primitive, Storage
from ephs.solve.posing.errors import Outcome, SolveError

EXPONENTIAL = 1e-12
"""Relative tolerance for recognising an exponential energy law: rounding of the functions."""
LINEAR = 1e-8
"""Change of a temperature, relative, below which a series is taken: its square is below rounding."""
PLAIN = -2
"""In place of a component: a state of an attachment, which is integrated directly and not as energy."""


def exponential_law(primitive: Primitive) -> tuple[float, float] | None:
    """c1 in J and c2 in J/K of E = c1 (exp(s/c2) − 1); None for other storages and the environment."""
    if not isinstance(primitive, Storage) or len(primitive.interface) != 1:
        return None
    match dict(primitive.parameters):
        case {"capacity": float(capacity), "temperature": float(temperature)}:
            c1, c2 = capacity * temperature, capacity
        case {"c1": float(c1), "c2": float(c2)}:
            pass
        case _:
            return None
    points = c2 * np.array([-0.7, 1.1])  # other storages may use these parameter names
    found = [float(primitive.energy({port: np.array([s])})) for port in primitive.bundle.ports for s in points]
    return (c1, c2) if np.allclose(found, c1 * np.expm1(points / c2), rtol=EXPONENTIAL, atol=0.0) else None


@final
class Heats:
    """Thermal storages of one system, and the heat that they receive from its components.

    Energies are in J and count from s = 0. Flows, in W or J, are what components pass: the heat of friction; of
    conduction what goes from one end to the other.

    Parameters
    ----------
    paths
        Of the states, entropies.
    components
        (entropies,) the storages of an exponential law, by their numbers; −1 of the environment, −2 of other states,
        which count as they are: as energies at 1 K.
    laws
        c1 in J and c2 in J/K of these storages, as they are at present.
    ends
        (flows, 2) the entropies where a flow comes from and where it goes, −1 where there is none.
    theta
        Temperature of the environment in K.
    """

    def __init__(
        self,
        paths: tuple[Path, ...],
        components: Index,
        laws: Callable[[], tuple[Array, Array]],
        ends: Index,
        theta: float,
    ) -> None:
        self._paths, self._components, self._present, self._theta = paths, components, laws, theta
        self._nodes, self.plain = components >= 0, components == PLAIN
        self._booked, self._units = bool(np.any(self._nodes)), np.where(self.plain, 1.0, theta)
        self._source, self._sink = ends.T
        self._loose = np.where(np.all(ends < 0, axis=1), 1.0, 0.0)

    @property
    def _laws(self) -> tuple[Array, Array]:
        """c1 in J and c2 in J/K of the nodes at present."""
        return self._present()

    def temperatures(self, heats: Array) -> Array:
        """(entropies,) in K."""
        out = np.where(self.plain, 1.0, np.full(heats.shape, self._theta))
        k, (c1, c2) = self._nodes, self._laws
        out[..., k] = (c1 + heats[..., k]) / c2
        return out

    def frozen(self, heats: Array) -> int | None:
        """Component of a storage whose temperature is not above zero; None: there is none."""
        cold = np.flatnonzero(~(self.temperatures(heats) > 0.0))
        return int(self._components[cold[0]]) if cold.size else None

    def coldest(self, heats: Array) -> Array:
        """(entropies,) energies at a hundredth of the present temperatures, without bound of the environment."""
        out = np.full(heats.shape, -np.inf)
        k, (c1, _) = self._nodes, self._laws
        out[k] = 0.01 * (c1 + heats[k]) - c1
        return out

    def entropies(self, heats: Array) -> Array:
        """(..., entropies) in J/K, of energies."""
        out = heats / self._units
        if self._booked:
            k, (c1, c2) = self._nodes, self._laws
            out[..., k] = c2 * np.log1p(heats[..., k] / c1)
        return out

    def energies(self, s: Array) -> Array:
        """(..., entropies) in J, of entropies."""
        out = s * self._units
        if self._booked:
            k, (c1, c2) = self._nodes, self._laws
            out[..., k] = c1 * np.expm1(s[..., k] / c2)
        return out

    def slopes(self) -> Array:
        """(entropies,) dθ/dE in K/J, zero of the environment."""
        out = np.zeros(self._nodes.size)
        out[self._nodes] = 1.0 / self._laws[1]
        return out

    def flows(self, heats: Array, entropies: Array) -> Array:
        """(makers,) flows by entropies a second: productions of components; of conduction the outflow of its source."""
        theta = self.temperatures(heats)
        return entropies * np.where(
            self._source >= 0, _end_values(theta, self._source), _end_values(theta, self._sink) + self._loose
        )

    def taken(self, heats: Array, flows: Array) -> tuple[Array, Array]:
        """Changes of energies in J by the flows of a step, those of other states not at all; and (flows,) the entropy
        that each makes in J/K.

        By mean temperatures of the step these sum up to the change of entropies, but each is of order two in the step.

        Raises
        ------
        SolveError
            More heat was carried away than there is.
        """
        change = np.zeros(heats.size + 1)
        np.add.at(change, self._sink, flows)
        np.subtract.at(change, self._source, flows)
        change = np.where(self.plain, 0.0, change[:-1])
        k, theta = self._nodes, self.temperatures(heats)
        share = np.zeros(heats.size)
        share[k] = change[k] / (self._laws[1] * theta[k])
        if not np.all(share > -1.0):
            raise SolveError(Outcome.TEMPERATURE, str(self._paths[int(np.argmin(share > -1.0))]), "")
        small = np.abs(share) < LINEAR  # θ̄/θ = x / log(1 + x)
        ratio = np.where(small, 1.0 + 0.5 * share, share / np.log1p(np.where(small, 1.0, share)))
        cold = 1.0 / (theta * ratio)
        return change, flows * (_end_values(cold, self._sink) - _end_values(cold, self._source) + self._loose)


def _end_values(values: Array, ends: Index) -> Array:
    """(..., ends) values of the entropies at ends of flows, zero where there is none."""
    return np.where(ends < 0, 0.0, values[..., ends]) if values.shape[-1] else np.zeros((*values.shape[:-1], ends.size))
