"""Wires between units: sources of inputs, agreement of units of measure, and the order of initialisation."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.solve.exchange.errors import ExchangeError
from ephs.solve.exchange.unit import Unit
from ephs.solve.posing.errors import nearest_of

Source = float | Callable[[float, Any], Any]
"""A constant, or a function f(t, state)."""


@final
@dataclass(frozen=True, slots=True, order=True)
class WireEnd:
    """A variable, or a power port, of a unit of an exchange."""

    unit: str
    name: str

    def __str__(self) -> str:
        return f"{self.unit}.{self.name}"


def place_of(text: str, units: Mapping[str, Unit]) -> WireEnd:
    """Place of ``unit.name``; names within units may have dots.

    Raises
    ------
    ExchangeError
        There is no such unit.
    """
    unit, _, name = text.partition(".")
    if unit not in units:
        known = ", ".join(units)
        raise ExchangeError("unit", found=unit, expected=known, near=nearest_of(unit, units))
    return WireEnd(unit, name)


def sources_of(units: Mapping[str, Unit], wires: Mapping[str, Any]) -> dict[WireEnd, WireEnd | Source]:
    """Source of each wired input.

    Raises
    ------
    ExchangeError
        An end of a wire is not there, or they do not fit.
    """
    found: dict[WireEnd, WireEnd | Source] = {}
    for text, given in wires.items():
        target = place_of(text, units)
        variable = units[target.unit].variable(target.name, f"wire to {text}", "input")
        if target.name in {port.input for port in units[target.unit].ports.values()}:
            raise ExchangeError("taken", where=text)
        if isinstance(given, str):
            source = place_of(given, units)
            other = units[source.unit].variable(source.name, f"wire to {text}", "output")
            if (
                variable.measure is not None
                and other.measure is not None
                and not variable.measure.agrees(other.measure)
            ):
                raise ExchangeError(
                    "units", where=text, source=given, first=other.measure.name, second=variable.measure.name
                )
            found[target] = source
        elif callable(given):
            found[target] = given
        elif isinstance(given, int | float | np.number) and np.isfinite(given):
            found[target] = float(given)
        else:
            raise ExchangeError("source", where=text, found=given)
    return found


def starting_order(
    units: Mapping[str, Unit], sources: Mapping[WireEnd, WireEnd | Source], initial: Mapping[WireEnd, float]
) -> tuple[WireEnd, ...]:
    """Inputs that read outputs, each after those that its output depends on at the same instant.

    Raises
    ------
    ExchangeError
        A loop of them.
    """
    order: list[WireEnd] = []
    done: set[WireEnd] = set()

    def visit(target: WireEnd, above: tuple[WireEnd, ...]) -> None:
        source = sources.get(target)
        if target in done or not isinstance(source, WireEnd):
            return
        if target in above:
            around = (*above[above.index(target) :], target)
            raise ExchangeError("loop", found=" <- ".join(f"{each} <- {sources[each]}" for each in around[:-1]))
        if source not in initial:
            for name in units[source.unit].feeds.get(source.name, ()):
                visit(WireEnd(source.unit, name), (*above, target))
        done.add(target)
        order.append(target)

    for target in sources:
        visit(target, ())
    return tuple(order)
