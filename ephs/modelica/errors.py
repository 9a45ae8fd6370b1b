"""Exception of the Modelica import, and its messages."""

from typing import Final, final

from ephs.operad.messages import TextError

TEXTS: Final = {
    "package": "Modelica is read by Pymoca, which is not installed: pip install ephs[modelica]",
    "file": "{where}: no file or folder of Modelica",
    "text": "{where}: {found}",
    "flat": "{where}: cannot be flattened: {found}",
    "parameter": "{where}: no parameter {found!r}, expected one of {expected}{near}",
    "value": "{where}: parameter {found} has no value: give one, {found}=…",
    "connector": "{where}: connector {port} of {found}, expected one of {expected}",
    "ports": "{where}: no connectors, so that there is nothing to compose",
    "signal": "{where}: reads the signal {found}, and signals carry no power",
    "array": "{where}: {found} is an array, expected single numbers",
    "algorithm": "{where}: an algorithm, expected equations",
    "branch": "{where}: switches on {found}",
    "discrete": "{where}: {found!r} is of type {kind}, expected a real number",
    "initial": "{where}: an initial equation, expected the value of one state: {equation}",
    "time": "{where}: a function of time drives it",
    "expression": "{where}: {found}, expected arithmetic",
    "nonlinear": "{where}: not linear in its currents, forces and rates: {equation}",
    "state": "{where}: state {found} in {unit}, expected one of {expected}",
    "constraint": "{where}: a constraint of positions that is not linear: {equation}",
    "count": "{where}: {found} equations for its ports and states, expected {expected}; fewer where a signal drives it",
    "source": "{where}: a source, the environment of a system: {equation}",
    "contradiction": "{where}: its equations contradict each other",
    "stored": "{where}: no energy ½ xᵀHx of its states {states} balances the power of {equation}",
    "undetermined": "{where}: the power at its ports does not tell the energy of its states {states}: read its parts",
    "unstable": "{where}: the energy of its states {states} is not positive: H = {found}",
    "power": "{where}: makes energy, {found:.6g} W at {witness}: {equation}",
    "heat": "{where}: its heat ports do not give off what its other ports lose: {equation}",
    "thermal": "{where}: expected a heat capacity, or heat conducted between two ports: {equation}",
    "first": "{where}: takes {found} W of heat, and stores none: {equation}",
    "second": "{where}: heat flows from cold to hot: {equation}",
    "structure": "{where}: {found}",
}


@final
class ModelicaError(TextError, ValueError):
    """A component of Modelica that cannot be imported."""

    _texts = TEXTS
