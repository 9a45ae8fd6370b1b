"""`Unit`: a co-simulation unit of FMI 2.0 or 3.0 as a box with signal ports and power ports, read from its file."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any, final

from ephs.solve.exchange.errors import ExchangeError
from ephs.solve.posing.errors import nearest_of

BASES = ("kg", "m", "s", "A", "K", "mol", "cd")
"""Base units by their names in model descriptions; radians count as numbers."""
LISTED = 12
"""Names that a message lists at most."""


@final
@dataclass(frozen=True, slots=True)
class Measure:
    """A unit of measure: its name and, where the file defines it, exponents of `BASES`, factor and offset."""

    name: str
    exponents: tuple[int, ...] | None = None
    factor: float = 1.0
    offset: float = 0.0

    def times(self, other: "Measure") -> "Measure | None":
        """The product, where both are defined."""
        if self.exponents is None or other.exponents is None:
            return None
        exponents = tuple(a + b for a, b in zip(self.exponents, other.exponents, strict=True))
        return Measure(f"{self.name}.{other.name}", exponents, self.factor * other.factor, self.offset + other.offset)

    def agrees(self, other: "Measure") -> bool:
        """Whether both are the same unit, by definition or else by name."""
        if self.exponents is None or other.exponents is None:
            return self.name == other.name
        return (self.exponents, self.factor, self.offset) == (other.exponents, other.factor, other.offset)


WATT = Measure("W", (1, 2, -3, 0, 0, 0, 0))
SECOND = Measure("s", (0, 0, 1, 0, 0, 0, 0))


@final
@dataclass(frozen=True, slots=True)
class UnitVariable:
    """A variable of a unit: ``kind`` is its type in FMI, ``measure`` None where the file gives no unit."""

    name: str
    reference: int
    causality: str
    kind: str
    measure: Measure | None

    @property
    def real(self) -> bool:
        """Whether its value is a real scalar."""
        return self.kind in ("Real", "Float64")


@final
@dataclass(frozen=True, slots=True)
class PowerPort:
    """A power port of a unit: names of variables whose product is the power into the unit.

    Parameters
    ----------
    input, output
        Effort and flow, whichever way round.
    effort
        Which of the two is the effort.
    integral
        An output: the integral of ``output`` over time; None where the unit has none.
    """

    input: str
    output: str
    effort: str
    integral: str | None


@final
@dataclass(frozen=True, slots=True, eq=False)
class Unit:
    """A unit of FMI for co-simulation.

    Parameters
    ----------
    file
        Where it lies.
    description
        FMPy's model description.
    variables
        By name.
    feeds
        Output -> the inputs that it depends on at the same instant.
    ports
        Power ports by name.
    start
        Values of parameters and inputs at the start, by name.
    step
        Fixed internal step in s; None: any communication step.
    """

    file: Path
    description: Any
    variables: Mapping[str, UnitVariable]
    feeds: Mapping[str, tuple[str, ...]]
    ports: Mapping[str, PowerPort]
    start: Mapping[str, float]
    step: float | None

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the input signals."""
        return self._signals("input")

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the output signals."""
        return self._signals("output")

    def _signals(self, causality: str) -> tuple[str, ...]:
        return tuple(name for name, each in self.variables.items() if each.causality == causality and each.real)

    @property
    def keeps_state(self) -> bool:
        """Whether its state can be saved and restored."""
        return bool(self.description.coSimulation.canSerializeFMUstate)

    def variable(self, name: str, where: str, *causalities: str) -> UnitVariable:
        """One real variable of one of some causalities.

        Raises
        ------
        ExchangeError
            There is none.
        """
        found = self.variables.get(name)
        if found is None:
            known = [each.name for each in self.variables.values() if each.causality in causalities]
            raise ExchangeError(
                "variable", where=where, found=name, expected=_listed(known), near=nearest_of(name, known)
            )
        if not found.real:
            raise ExchangeError("type", where=where, found=name, kind=found.kind)
        if found.causality not in causalities:
            expected = " or ".join(causalities)
            raise ExchangeError("causality", where=where, found=name, kind=found.causality, expected=expected)
        return found


def unit_of(
    path: str | PathLike[str],
    ports: Mapping[str, Mapping[str, str]] | None = None,
    start: Mapping[str, float] | None = None,
) -> Unit:
    """Read a unit; see `ephs.library.fmu`.

    Raises
    ------
    ExchangeError
        There is no such unit, variable or power.
    """
    try:
        from fmpy import platform_tuple, read_model_description
    except ImportError:
        raise ExchangeError("package") from None
    file = Path(path)
    try:
        description: Any = read_model_description(BytesIO(file.read_bytes()), validate=True)
    except Exception as error:
        first = (str(error).splitlines() or [type(error).__name__])[0]
        raise ExchangeError("file", file=file, found=first) from error
    if not description.fmiVersion.startswith(("2.", "3.")):
        raise ExchangeError("version", file=file, found=description.fmiVersion)
    if description.coSimulation is None:
        raise ExchangeError("kind", file=file, found="model exchange or scheduled execution")
    _for_this_machine(file, description, platform_tuple)
    measures = {each.name: _measure(each) for each in description.unitDefinitions}
    variables = {each.name: _variable(each, measures) for each in description.modelVariables}
    inputs = tuple(each.name for each in variables.values() if each.causality == "input")
    feeds = {
        each.variable.name: inputs
        if each.dependencies is None
        else tuple(other.name for other in each.dependencies if other.name in inputs)
        for each in description.outputs
    }
    given = {name: float(value) for name, value in (start or {}).items()}
    fixed = description.coSimulation.fixedInternalStepSize
    step = float(fixed) if fixed is not None and float(fixed) > 0.0 else None
    unit = Unit(file, description, variables, feeds, {}, given, step)
    for name in given:
        unit.variable(name, f"{file.name}, start", "parameter", "input")
    found = {name: _port(unit, f"{file.name}, port {name}", words) for name, words in (ports or {}).items()}
    return replace(unit, ports=found)


def _for_this_machine(file: Path, description: Any, platform: str) -> None:
    from zipfile import ZipFile

    folder = platform if description.fmiVersion.startswith("3.") else _old_name(platform)
    with ZipFile(file) as content:
        there = {name.split("/")[1] for name in content.namelist() if name.startswith("binaries/") and name[9:]}
    if folder not in there:
        raise ExchangeError("machine", file=file, found=folder, expected=_listed(sorted(there)))


def _old_name(platform: str) -> str:
    machine, _, system = platform.partition("-")
    bits = "64" if machine in ("x86_64", "aarch64") else "32"
    return {"windows": "win"}.get(system, system) + bits


def _measure(of: Any) -> Measure:
    base = of.baseUnit
    if base is None:
        return Measure(of.name)
    return Measure(of.name, tuple(int(getattr(base, name)) for name in BASES), float(base.factor), float(base.offset))


def _variable(of: Any, measures: Mapping[str, Measure]) -> UnitVariable:
    name = of.unit or (of.declaredType.unit if of.declaredType is not None else None)
    measure = None if name is None else measures.get(name, Measure(name))
    kind = "an array" if of.dimensions else of.type
    return UnitVariable(of.name, of.valueReference, of.causality or "local", kind, measure)


def _port(unit: Unit, where: str, words: Mapping[str, str]) -> PowerPort:
    known = ("effort", "flow", "integral")
    for word in words:
        if word not in known:
            near = nearest_of(word, known)
            raise ExchangeError("variable", where=where, found=word, expected=_listed(known), near=near)
    for word in known[:2]:
        if word not in words:
            raise ExchangeError(
                "variable", where=where, found=None, expected=f"a variable named as its {word}", near=""
            )
    effort, flow = (unit.variable(words[word], where, "input", "output") for word in known[:2])
    if effort.causality == flow.causality:
        raise ExchangeError("causal", where=where, first=effort.name, second=flow.name, kind=effort.causality)
    if effort.measure is not None and flow.measure is not None:
        power = effort.measure.times(flow.measure)
        if power is not None and not power.agrees(WATT):
            raise ExchangeError("power", where=where, first=_told(effort), second=_told(flow))
    input, output = (effort, flow) if effort.causality == "input" else (flow, effort)
    integral = unit.variable(words["integral"], where, "output") if "integral" in words else None
    if integral is not None and integral.measure is not None and output.measure is not None:
        expected = output.measure.times(SECOND)
        if expected is not None and not expected.agrees(integral.measure):
            raise ExchangeError("integral", where=where, first=_told(integral), second=_told(output))
    return PowerPort(input.name, output.name, effort.name, None if integral is None else integral.name)


def _told(variable: UnitVariable) -> str:
    return f"{variable.name} in {variable.measure.name if variable.measure else 'no unit'}"


def _listed(names: Iterable[str]) -> str:
    names = list(names)
    return ", ".join(names[:LISTED]) + (f" … ({len(names)} in all)" if len(names) > LISTED else "") or "none"
