"""Heat from irreversible components to stores of heat of a system, booked as energy; see `Heats`."""

from typing import final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.numbering import Index, spans
from ephs.semantics.primitives.primitives import Storage
from ephs.semantics.spaces.rank import TINY
from ephs.solve.equations.heats import Heats
from ephs.solve.equations.model import Model
from ephs.solve.methods.conduction import ConductionMatrix
from ephs.solve.methods.continuous import AccumulatorRates
from ephs.solve.methods.records import IRREVERSIBLE, STORING
from ephs.solve.methods.stores import HeatStores


@final
class Passages:
    """Thermal ports of irreversible components at stores of heat.

    Attributes
    ----------
    called
        Whether there are some besides those of conduction.
    """

    def __init__(self, model: Model, stores: HeatStores, conduction: ConductionMatrix | None) -> None:
        t, d = model.tables, model.descriptor
        self._stores, self._conduction = stores, conduction
        makers = np.flatnonzero(t.kind == IRREVERSIBLE)
        owners, flows = np.repeat(makers, t.dims[makers, 0]), spans(t.e_at[makers], t.dims[makers, 0])
        efforts = t.e_index[flows]
        thermal = t.entropy[efforts] == 1.0
        count = np.bincount(owners[thermal], minlength=t.kind.size)
        chosen = np.flatnonzero(thermal & (stores.at[efforts] >= 0))
        self._makers, self._flows, effort = owners[chosen], flows[chosen], efforts[chosen]
        self._frictions = np.flatnonzero((count[self._makers] == 1) & (t.dims[self._makers, 0] > 1))
        self._effort, self._intensive = int(t.counts[0]) + effort, t.intensive[effort]
        self._conducting = np.searchsorted(self._flows, conduction.ports) if conduction is not None else None
        self.called = chosen.size > (0 if conduction is None else conduction.ports.size)
        self._at = at = stores.at[effort]
        self._heats = Heats(
            tuple(d.components[number].path for number in stores.components.tolist()),
            np.where(stores.hot, stores.components, -1), lambda: (stores.c1, stores.c2),
            np.stack([np.full(at.size, -1), at], axis=1), model.reference.temperature,
        )  # fmt: skip
        self._rest = (t.kind == STORING).astype(float)
        self._rest[stores.components] = 0.0
        # energies do not count what the environment takes otherwise
        surroundings = [
            number for number in np.flatnonzero(self._rest).tolist()
            if isinstance(primitive := d.components[number].primitive, Storage) and primitive.environment
        ]  # fmt: skip
        self._whole = not surroundings

    @property
    def frictions(self) -> bool:
        """Whether some heat is that of friction, which follows what other states lose."""
        return bool(self._frictions.size)

    def powers(self, found: AccumulatorRates) -> Array:
        """(2, passages) power in W and entropy in W/K that go to the stores at an instant, conduction aside."""
        entropies = -found.flows[self._flows]
        return np.array([entropies * (found.unknowns[self._effort] + self._intensive), entropies])

    def booked(
        self, y: Array, passed: Array | None, stages: tuple[Array, Array], missed: Array | None,
        energies: Array | None, work: float,
    ) -> tuple[Array, Array, float, float]:  # fmt: skip
        """The heat of a step from the numbers y.

        Parameters
        ----------
        passed, missed
            (2, passages) heat in J and entropy in J/K by a quadrature, conduction aside, (passages,) differences of
            heat to an embedded one; None: nothing, and where there is no friction.
        stages
            (stages,) weights in s, and (stages, states) numbers there.
        energies
            (2, components) stored before and after, in J, where there is friction.
        work
            What was supplied, in J.

        Returns
        -------
        tuple
            (stores,) numbers of the stores at the end; (components,) by how much more entropy each component made than
            its quadrature says, in J/K; by how much more heat of friction there is than its quadrature says, and heat
            that went to the stores, in J.

        Raises
        ------
        SolveError
            More heat was carried away than there is.
        """
        heat, entropy = np.zeros((2, self._makers.size)) if passed is None else passed
        stores, frictions, lost, counted = self._stores, self._frictions, None, entropy.copy()
        if self._conduction is not None:
            conduction, (weights, ys) = self._conduction, stages
            powers = (conduction.powers @ ys.T).T + conduction.rest
            theta = self._heats.temperatures(ys[:, stores.states] * stores.units)[:, self._at[self._conducting]]
            heat[self._conducting], entropy[self._conducting] = weights @ powers, weights @ (powers / theta)
        if self._whole and energies is not None:
            others = float(heat.sum()) - float(heat[frictions].sum())
            lost = work - float((energies[1] - energies[0]) @ self._rest) - others
        flows = heat_of_friction(heat, frictions, missed, lost)
        before = y[stores.states] * stores.units
        change, made = self._heats.taken(before, flows)
        made = self._shared(made, entropy * np.divide(flows, heat, out=np.ones(heat.size), where=heat != 0.0))
        out = np.bincount(self._makers, made - counted, self._rest.size).astype(float)
        more = float((flows - heat)[frictions].sum())
        return (before + change) / stores.units, out, more, float(flows.sum())

    def _shared(self, whole: Array, parts: Array) -> Array:
        """(passages,) entropies in J/K by a quadrature, so moved that each store has the sum of the whole ones.

        A heat over its store's mean temperature has the wrong sign where the heat turns around within the step.
        """
        sizes, at = np.abs(parts), self._at
        total, rest = np.bincount(at, sizes), np.bincount(at, whole - parts)
        return np.where(total[at] > 0.0, parts + rest[at] * sizes / np.maximum(total[at], TINY), whole)


def heat_of_friction(flows: Array, frictions: Index, missed: Array | None, lost: float | None) -> Array:
    """Flows of a step with friction's heat moved towards the energy that the motion lost.

    Parameters
    ----------
    flows, missed
        (passages,) in J by a quadrature, and its differences to an embedded one; None where there is no friction.
    frictions
        Those that are heat of friction.
    lost
        E⁰ + W − E¹ in J; None where the work is what the energies say.
    """
    if lost is None or missed is None:
        return flows
    out, k = flows.copy(), frictions
    short = lost - float(flows[k].sum())
    made = np.maximum(0.0, flows[k])  # a component that destroys entropy is not concealed
    room = np.abs(missed[k]) if short > 0.0 else np.minimum(np.abs(missed[k]), made)
    whole = float(room.sum())
    if whole > 0.0:
        out[k] = np.maximum(flows[k] - made, flows[k] + room * (np.sign(short) * min(1.0, abs(short) / whole)))
    return out
