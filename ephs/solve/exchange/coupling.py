"""`Coupling`: units as the environment of a system, exchanged once a period, with the energy of the exchange.

A sample comes after the system went through a period. The units then go through it too, power ports with the means that
the system had, and what they return is held over the next one.
"""

from collections.abc import Callable, ItemsView, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.exchange.balance import PortBalance
from ephs.solve.exchange.errors import ExchangeError
from ephs.solve.exchange.together import Together, number
from ephs.solve.exchange.unit import PowerPort
from ephs.solve.exchange.wires import WireEnd, place_of
from ephs.solve.posing.errors import nearest_of
from ephs.solve.posing.sampled import Sampled
from ephs.solve.running.snapshot import Snapshot

if TYPE_CHECKING:
    from ephs.solve.exchange.exchange import Exchange

Reading = Callable[[float, Any], Any]
"""f(t, state) -> number."""


@final
@dataclass(frozen=True, slots=True)
class Bond:
    """A power port of a unit at an outer port of a system: efforts are equal, flows add up to zero.

    Parameters
    ----------
    port
        ``unit.port``.
    measured
        f(t, state) -> number: the flow into the system where the unit gives the effort, its effort where the unit
        gives the flow.
    integral
        f(t, state) -> number whose difference over a period is the integral of ``measured``; None: by the trapezoid of
        samples.
    """

    port: str
    measured: Reading
    integral: Reading | None = None


@final
@dataclass(frozen=True, slots=True, eq=False)
class Traffic:
    """Energy produced by the power ports of a coupling.

    Parameters
    ----------
    t
        (n,) ends of periods in s.
    made
        Input -> (n,) in J in the period that ends there.
    """

    t: Array
    made: Mapping[str, Array]

    @property
    def debt(self) -> Mapping[str, Array]:
        """Input -> (n,) in J, energy produced so far less the returned part."""
        return {name: np.cumsum(values) for name, values in self.made.items()}


@final
@dataclass(frozen=True, slots=True)
class _Joined:
    """A power port at a coupling: both signs, and the readings of the system."""

    place: WireEnd
    port: PowerPort
    taken: float
    given: float
    measured: Reading
    integral: Reading | None


@final
class _CouplingMemory(Mapping[str, Any]):
    """Memory of a coupling after a sample; written down only where a journal asks, which is before the next."""

    __slots__ = ("_count", "_of")

    def __init__(self, of: "Coupling", count: int) -> None:
        self._of, self._count = of, count

    def __getitem__(self, name: str) -> Any:
        return self._count if name == "count" else self._of.snapshot()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._of.snapshot())

    def __len__(self) -> int:
        return len(self._of.snapshot())

    def items(self) -> ItemsView[str, Any]:
        """All of it."""
        return self._of.snapshot().items()


@final
class Coupling:
    """An exchange with the system inputs that it provides; result of `Exchange.couple`.

    Attributes
    ----------
    inputs
        For `ephs.simulate`.
    """

    def __init__(self, exchange: "Exchange", joined: Mapping[str, _Joined], signals: Mapping[str, WireEnd], kept: bool):
        self._of, self._joined, self._signals = exchange, joined, signals
        self._balances = {name: PortBalance(one.taken, one.given, kept) for name, one in joined.items()}
        self._together: Together | None = None
        self._count, self._values, self._integrals = 0, dict[str, float](), dict[str, float]()
        self._times: list[float] = []
        self._made: dict[str, list[float]] = {name: [] for name in joined}
        self.inputs: dict[str, Any] = {}
        for name in (*joined, *signals):
            sampled = Sampled(exchange.period, self._sampling(name), memory={"count": 0})
            one = joined.get(name)
            outer = one is not None and not name.startswith("joints.")
            effort = one is not None and one.port.output == one.port.effort
            self.inputs[name] = {"effort" if effort else "flow": sampled} if outer else sampled

    @property
    def traffic(self) -> Traffic:
        """Record of the last run."""
        return Traffic(np.array(self._times), {name: np.array(made) for name, made in self._made.items()})

    def _sampling(self, name: str) -> Callable[[float, Any, Snapshot], tuple[float, Snapshot]]:
        leads = name == next(iter((*self._joined, *self._signals)))

        def sample(t: float, state: Any, memory: Snapshot) -> tuple[float, Snapshot]:
            if not leads:
                return self._values[name], memory
            if memory["count"] == 0:
                self._begin(t, state)
            else:
                if memory["count"] != self._count or self._together is None:
                    self._restore(memory)
                self._go_on(t, state)
            return self._values[name], _CouplingMemory(self, self._count)

        return sample

    def _begin(self, t: float, state: Any) -> None:
        self._together = together = Together(self._of)
        self._count, self._times = 1, []
        self._made = {name: [] for name in self._joined}
        measured = {name: number(one.measured(t, state), name) for name, one in self._joined.items()}
        held = {
            WireEnd(one.place.unit, one.port.input): one.taken * measured[name] for name, one in self._joined.items()
        }
        together.begin(t, state, held)
        for name, one in self._joined.items():
            self._balances[name].begin(measured[name], together.value(WireEnd(one.place.unit, one.port.output)))
        self._read(t, state)

    def _go_on(self, t: float, state: Any) -> None:
        together = self._together
        assert together is not None
        h = t - together.t
        held: dict[WireEnd, float] = {}
        displacements: dict[str, float] = {}
        before = {name: self._integral_of_unit(one) for name, one in self._joined.items()}
        for name, one in self._joined.items():
            whole = None
            if one.integral is not None:
                whole = number(one.integral(t, state), name) - self._integrals[name]
            taken, displacements[name] = self._balances[name].moved(h, number(one.measured(t, state), name), whole)
            held[WireEnd(one.place.unit, one.port.input)] = taken
        together.step(t, held)
        for name, one in self._joined.items():
            y = together.value(WireEnd(one.place.unit, one.port.output))
            start, end = before[name], self._integral_of_unit(one)
            whole = None if start is None or end is None else end - start
            self._made[name].append(self._balances[name].returned(h, y, whole, displacements[name]))
        together.transfer(state)
        self._times.append(t)
        self._count += 1
        self._read(t, state)

    def _integral_of_unit(self, one: _Joined) -> float | None:
        assert self._together is not None
        return None if one.port.integral is None else self._together.value(WireEnd(one.place.unit, one.port.integral))

    def _read(self, t: float, state: Any) -> None:
        assert self._together is not None
        self._values = {name: balance.g for name, balance in self._balances.items()}
        self._values |= {name: self._together.value(place) for name, place in self._signals.items()}
        for name, one in self._joined.items():
            if one.integral is not None:
                self._integrals[name] = number(one.integral(t, state), name)

    def snapshot(self) -> Snapshot:
        """Snapshot for a journal."""
        assert self._together is not None
        return {
            "count": self._count,
            "t": self._together.t,
            "units": self._together.snapshot(),
            "balances": {name: balance.snapshot() for name, balance in self._balances.items()},
            "integrals": dict(self._integrals),
            "times": np.array(self._times),
            "made": {name: np.array(made) for name, made in self._made.items()},
        }

    def _restore(self, memory: Snapshot) -> None:
        self._together = together = Together(self._of)
        together.restore(memory["t"], memory["units"])
        self._count, self._times = memory["count"], memory["times"].tolist()
        self._integrals = dict(memory["integrals"])
        self._made = {name: values.tolist() for name, values in memory["made"].items()}
        for name, balance in self._balances.items():
            balance.restore(memory["balances"][name])


def coupling_of(exchange: "Exchange", targets: "Mapping[str, str | Bond]", balanced: bool) -> Coupling:
    """Couple an exchange to a system; see `Exchange.couple`."""
    joined: dict[str, _Joined] = {}
    signals: dict[str, WireEnd] = {}
    for name, given in targets.items():
        text = given.port if isinstance(given, Bond) else given
        place = place_of(text, exchange.units)
        unit = exchange.units[place.unit]
        port = unit.ports.get(place.name)
        if port is None:
            known = [*unit.ports, *(() if isinstance(given, Bond) else unit.outputs)]
            if isinstance(given, Bond) or place.name not in unit.outputs:
                near, expected = nearest_of(place.name, known), ", ".join(known) or "none"
                raise ExchangeError("target", where=name, found=text, expected=expected, near=near)
            signals[name] = place
            continue
        if any(one.place == place for one in joined.values()):
            raise ExchangeError("twice", found=text)
        if isinstance(given, Bond):
            taken = -1.0 if port.output == port.effort else 1.0
            joined[name] = _Joined(place, port, taken, -taken, given.measured, given.integral)
        elif name.startswith("joints."):
            measured, integral = (_of_joint(name, what) for what in ("rate", "coordinate"))
            joined[name] = _Joined(place, port, 1.0, -1.0, measured, integral)
        else:
            raise ExchangeError("outer", where=name)
    return Coupling(exchange, joined, signals, balanced)


def _of_joint(name: str, what: str) -> Reading:
    joint = name.removeprefix("joints.")

    def read(_t: float, state: Any) -> float:
        found = getattr(state.joints[joint], what)
        if np.size(found) != 1:
            raise ExchangeError("joint", where=name, found=np.size(found))
        return float(found[0])

    return read
