"""`Exchange`: units that are wired to each other, and stepped together once a period."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.exchange.coupling import Bond, Coupling, coupling_of
from ephs.solve.exchange.errors import ExchangeError
from ephs.solve.exchange.together import Together
from ephs.solve.exchange.unit import Unit
from ephs.solve.exchange.wires import Source, WireEnd, place_of, sources_of, starting_order
from ephs.solve.posing.errors import number_of

SLIVER = 1e-9
"""Tolerance for times, as a fraction of a period."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Exchanged:
    """Outputs of units: ``t`` (n,) in s, ``values`` (n,) of each output by ``unit.output``."""

    t: Array
    values: Mapping[str, Array]

    def __getitem__(self, name: str) -> Array:
        return self.values[name]

    def __contains__(self, name: object) -> bool:
        return name in self.values


@final
@dataclass(frozen=True, slots=True, eq=False)
class Exchange:
    """Units that exchange signals once a period, with each other and with a system.

    Parameters
    ----------
    units
        By name, without dots.
    period
        In s; signals are constant in between.
    wires
        ``unit.input`` -> ``"unit.output"``, a number, or a function f(t, state) -> number; inputs that are not here
        keep their values of the start.
    initial
        Values of outputs at the start, by ``unit.output``, in place of the unit's own: they cut algebraic loops.

    Raises
    ------
    ExchangeError
        An end of a wire is not there, is in other units, or closes an algebraic loop; a unit does not have the period.
    """

    units: Mapping[str, Unit]
    period: float
    wires: Mapping[str, Any] = field(default_factory=dict[str, Any])
    initial: Mapping[str, float] = field(default_factory=dict[str, float])
    sources: Mapping[WireEnd, WireEnd | Source] = field(init=False, repr=False)
    order: tuple[WireEnd, ...] = field(init=False, repr=False)
    starts: Mapping[WireEnd, float] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        period = number_of("period", self.period)
        if not (np.isfinite(period) and period > 0.0):
            raise ExchangeError("period", found=self.period, expected="a number of seconds > 0")
        for name, unit in self.units.items():
            if not name or "." in name:
                raise ExchangeError("name", found=name)
            if unit.step is not None:
                ratio = period / unit.step
                if round(ratio) < 1 or abs(ratio - round(ratio)) > SLIVER * ratio:
                    expected = f"a multiple of the step of unit {name!r}, {unit.step!r} s"
                    raise ExchangeError("period", found=self.period, expected=expected)
        starts: dict[WireEnd, float] = {}
        for text, value in self.initial.items():
            place = place_of(text, self.units)
            self.units[place.unit].variable(place.name, "initial", "output")
            starts[place] = float(value)
        sources = sources_of(self.units, self.wires)
        for name, value in {
            "sources": sources,
            "order": starting_order(self.units, sources, starts),
            "starts": starts,
        }.items():
            object.__setattr__(self, name, value)

    def run(self, until: float, t0: float = 0.0) -> Exchanged:
        """Run the units by themselves; functions of wires are called with None for the state.

        Raises
        ------
        ExchangeError
            A unit fails, or the end is not on a period.
        """
        count = round((until - t0) / self.period)
        if count < 1 or abs(until - t0 - count * self.period) > SLIVER * abs(until - t0):
            raise ExchangeError("end", found=until, start=t0)
        together = Together(self)
        together.begin(t0, None, {})
        t = t0 + self.period * np.arange(count + 1, dtype=np.float64)
        rows = [together.outputs()]
        for k in range(1, count + 1):
            together.step(float(t[k]), {})
            together.transfer(None)
            rows.append(together.outputs())
        table = np.array(rows)
        names = [str(place) for place in together.places]
        return Exchanged(t, {name: table[:, i] for i, name in enumerate(names)})

    def couple(self, targets: "Mapping[str, str | Bond]", *, balanced: bool = True) -> Coupling:
        """Couple the units to a system: ``ephs.simulate(model, until, inputs=coupling.inputs)``.

        Parameters
        ----------
        targets
            Names of inputs of `ephs.simulate` -> what they are given: ``"unit.output"``, a signal;
            ``"unit.port"``, a power port, where the name is that of a joint with one coordinate; or a `Bond` at an
            outer port of a system.
        balanced
            Whether the energy that power ports make is given back; else what was sampled last is exchanged plainly.

        Raises
        ------
        ExchangeError
            There is no such output or port.
        """
        return coupling_of(self, targets, balanced)
