"""Units of an exchange in parallel."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.solve.exchange.errors import ExchangeError
from ephs.solve.exchange.running import Running
from ephs.solve.exchange.wires import WireEnd
from ephs.solve.running.snapshot import Snapshot

if TYPE_CHECKING:
    from ephs.solve.exchange.exchange import Exchange


@final
class Together:
    """The units of an exchange in one run.

    Attributes
    ----------
    t
        In s, where they stand.
    places
        All outputs.
    """

    def __init__(self, exchange: "Exchange") -> None:
        self._of, self.t = exchange, 0.0
        self._units = {name: Running(name, unit) for name, unit in exchange.units.items()}
        self.places = [WireEnd(name, output) for name, unit in exchange.units.items() for output in unit.outputs]

    def begin(self, t: float, state: Any, held: Mapping[WireEnd, float]) -> None:
        """Initialise them at a time, in the order of their outputs' dependencies."""
        self.t, of = t, self._of
        for unit in self._units.values():
            unit.begin(t)
        self._set({**self._functions(state), **held})
        for target in of.order:
            source = of.sources[target]
            assert isinstance(source, WireEnd)
            value = of.starts[source] if source in of.starts else self.value(source)
            self._set({target: value})
        for unit in self._units.values():
            unit.ready()

    def step(self, t: float, held: Mapping[WireEnd, float]) -> None:
        """Go on to a time."""
        self._set(held)
        for unit in self._units.values():
            unit.step(t)
        self.t = t

    def transfer(self, state: Any) -> None:
        """Set the wired inputs of the next period."""
        wired = {target: self.value(source) for target, source in self._wired()}
        self._set({**self._functions(state), **wired})

    def _wired(self) -> list[tuple[WireEnd, WireEnd]]:
        return [(target, source) for target, source in self._of.sources.items() if isinstance(source, WireEnd)]

    def _functions(self, state: Any) -> dict[WireEnd, float]:
        out: dict[WireEnd, float] = {}
        for target, source in self._of.sources.items():
            if not isinstance(source, WireEnd):
                out[target] = number(source(self.t, state), f"wire to {target}") if callable(source) else source
        return out

    def _set(self, values: Mapping[WireEnd, float]) -> None:
        for name, unit in self._units.items():
            unit.set({place.name: value for place, value in values.items() if place.unit == name})

    def value(self, place: WireEnd) -> float:
        """An output now."""
        return self._units[place.unit].get([place.name])[0]

    def outputs(self) -> list[float]:
        """All outputs now, as in ``places``."""
        return [value for name, unit in self._units.items() for value in unit.get(self._of.units[name].outputs)]

    def snapshot(self) -> Snapshot | None:
        """Snapshot for `restore`; None where a unit cannot keep its state."""
        if not all(unit.unit.keeps_state for unit in self._units.values()):
            return None
        return {name: unit.snapshot() for name, unit in self._units.items()}

    def restore(self, t: float, snapshot: Snapshot | None) -> None:
        """Initialize at a time in s, and go on from a snapshot.

        Raises
        ------
        ExchangeError
            A unit cannot keep its state.
        """
        for name, unit in self._units.items():
            if snapshot is None:
                raise ExchangeError("state", where=name)
            unit.begin(t)
            unit.ready()
            unit.restore(t, snapshot[name])
        self.t = t


def number(value: Any, where: str) -> float:
    """One finite number.

    Raises
    ------
    ExchangeError
        It is none.
    """
    try:
        found = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ExchangeError("value", where=where, found=value) from None
    if found.size != 1 or not np.isfinite(found).all():
        raise ExchangeError("value", where=where, found=value)
    return float(found.reshape(()))
