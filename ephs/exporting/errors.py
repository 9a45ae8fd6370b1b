"""Exception of exports, and its messages."""

from typing import Final, final

from ephs.operad.messages import TextError

TEXTS: Final = {
    "method": "method {found!r} cannot be exported, expected {expected}",
    "input": "input {found!r}: expected a joint with a free coordinate or an actuator, one of {expected}",
    "input parameter": "parameter {found!r} belongs to the input {where!r}, expected a number of another element",
    "output": "output {found!r}: expected one of {expected}, or the beginning of such a name",
    "function": "the input at {where} is a Python function, expected a constant: name it as an input of the export",
    "python": "{where}: a component is evaluated by Python, expected staged functions",
    "impacts": "{where}: a hard contact or stop, expected elastic ones",
    "suffix": "output file {found!r}: expected a name that ends in {expected}",
    "target": "target {found!r}: expected one of {expected}",
    "tool": "{what} needs {tool}, which is not installed: pip install {package}",
    "refused": "{tool} refuses the program: {found}",
    "structure": "parameters {found}: they change the structure of the mechanism, expected numbers only",
    "start": "parameters {found}: other values of them give {why}; expected numbers that the joints leave free",
    "polynomial": "parameter {found}: the program's tables are not polynomials of degree 2 in it, expected one such as "
    "a mass, a stiffness, a friction or a force",
    "values": "numbers of shape {found}: expected {expected}, one for each parameter",
    "double": "{where}: numbers of {found}; expected float64",
    "name": "name {found!r}: expected a C identifier of letters, digits and _",
}


@final
class ExportError(TextError, ValueError):
    """A model that cannot be exported with these options."""

    _texts = TEXTS
