"""Exception of exchanges, and its messages."""

from typing import Final, final

from ephs.operad.messages import TextError

TEXTS: Final = {
    "package": "a unit is loaded by FMPy, which is not installed: pip install ephs[fmi]",
    "file": "{file}: not an FMI 2.0 or 3.0 unit: {found}",
    "version": "{file}: a unit of FMI {found}, expected 2.0 or 3.0",
    "kind": "{file}: a unit for {found}, expected one for co-simulation",
    "machine": "{file}: no library for {found}; it has {expected}",
    "variable": "{where}: no variable {found!r}, expected one of {expected}{near}",
    "type": "{where}: variable {found!r} is {kind}, expected one real number",
    "causality": "{where}: variable {found!r} is {kind}, expected {expected}",
    "causal": "{where}: both {first!r} and {second!r} are {kind}s of the unit, expected an input and an output",
    "power": "{where}: {first} times {second} is not a power: expected units whose product is the watt",
    "integral": "{where}: {first} is not an integral of {second} over time: expected a unit of {second} times second",
    "unit": "unit {found!r}: expected one of {expected}{near}",
    "port": "unit {where!r} has no power port {found!r}, expected one of {expected}{near}",
    "name": "unit name {found!r}: expected one without dots, since dots end the unit name in wires",
    "source": "wire to {where}: found {found!r}, expected 'unit.output', a number, or a function f(t, state)",
    "units": "wire to {where}, in {second}: {source} is in {first}",
    "taken": "{where}: an input of a power port, but a wire also sets it",
    "loop": "algebraic loop between units: {found}; give one of these outputs a value at the start: initial={{...}}",
    "period": "period {found!r}: expected {expected}",
    "end": "until {found!r}: expected whole periods after {start!r}",
    "target": "{where}: {found!r} is neither a power port nor an output of a unit; expected one of {expected}{near}",
    "twice": "power port {found!r} is coupled twice",
    "outer": "{where}: a power port at an outer port is coupled by a `Bond`, which names the measured variable",
    "joint": "{where}: found {found} coordinates, expected a joint with one",
    "value": "{where}: found {found!r}, expected one finite number",
    "call": "unit {where} at t = {time:.9g} s: {found}",
    "state": "unit {where}: its state cannot be saved, so the run cannot be resumed from a journal",
}


@final
class ExchangeError(TextError, ValueError):
    """An invalid unit, or an invalid exchange between units and a system."""

    _texts = TEXTS
