"""Which components of Modelica's standard library keep both laws, by package: what is taken, and why the rest is not.

It is not shipped: ``python -m benchmarks.modelica FOLDER`` reads the folder that holds ``Modelica/package.mo``.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import ephs

__all__ = ["Found", "main", "survey", "tables"]

PACKAGES = (
    "Electrical.Analog.Basic",
    "Electrical.Analog.Ideal",
    "Electrical.Analog.Sensors",
    "Electrical.Analog.Sources",
    "Mechanics.Rotational.Components",
    "Mechanics.Rotational.Sensors",
    "Mechanics.Rotational.Sources",
    "Mechanics.Translational.Components",
    "Mechanics.Translational.Sensors",
    "Mechanics.Translational.Sources",
    "Thermal.HeatTransfer.Components",
    "Thermal.HeatTransfer.Sensors",
    "Thermal.HeatTransfer.Sources",
)
LETTERS = {"d": 1.0, "M": 0.5}
"""Parameters whose start value makes a part vanish: a damper without damping, coils that are one."""
REASONS = {
    "flat": "not flattened",
    "connector": "other connectors",
    "array": "arrays",
    "signal": "signals",
    "count": "signals",
    "branch": "switches",
    "discrete": "switches",
    "expression": "functions",
    "algorithm": "functions",
    "nonlinear": "nonlinear",
    "constraint": "nonlinear",
    "state": "nonlinear",
    "source": "sources",
    "time": "sources",
    "power": "make energy",
    "heat": "make energy",
    "thermal": "other heat",
    "first": "make energy",
}
"""Headings of the table by faults of `ModelicaError`."""


@dataclass(frozen=True, slots=True)
class Found:
    """One component: what it is made of, or the fault for which it is refused and its text."""

    package: str
    name: str
    kinds: tuple[str, ...]
    fault: str = ""
    text: str = ""


def survey(library: ephs.ModelicaLibrary, packages: Sequence[str]) -> list[Found]:
    """Every model of the packages; what has no value gets one."""
    return [_read(library, package, name) for package in packages for name in library.models(package)]


def _read(library: ephs.ModelicaLibrary, package: str, name: str) -> Found:
    given: dict[str, float] = {}
    short = name.rsplit(".", 1)[1]
    for letter, value in LETTERS.items():
        try:
            kinds = library.read(name, **{letter: value}).kinds
        except ephs.ModelicaError:
            continue
        return Found(package, short, kinds)
    while True:
        try:
            return Found(package, short, library.read(name, **given).kinds)
        except ephs.ModelicaError as error:
            if error.fault != "value":
                return Found(package, short, (), error.fault, str(error).removeprefix(f"{name}: "))
            given[str(error).split("parameter ")[1].split(" ")[0]] = 1.0


def tables(found: Sequence[Found]) -> str:
    """Counts by package and reason, and the names of what is taken, in Markdown."""
    heads = list(dict.fromkeys(REASONS.values()))
    lines = [f"| package | models | taken | {' | '.join(heads)} |", "|" + " --- |" * (3 + len(heads))]
    packages = list(dict.fromkeys(each.package for each in found))
    for package in (*packages, ""):
        inside = [each for each in found if package in ("", each.package)]
        counts = Counter(REASONS.get(each.fault, "other heat") for each in inside if each.fault)
        cells = [package.removeprefix("Modelica.") or "all", len(inside), sum(not each.fault for each in inside)]
        lines.append("| " + " | ".join(map(str, [*cells, *(counts[head] or "" for head in heads)])) + " |")
    lines += ["", "| package | storage | reversible | irreversible |", "| --- | --- | --- | --- |"]
    for package in packages:
        inside = [each for each in found if each.package == package and not each.fault]
        if not inside:
            continue
        names = [
            ", ".join(sorted(each.name for each in inside if kind in each.kinds))
            for kind in ("storage", "reversible", "irreversible")
        ]
        lines.append("| " + " | ".join([package.removeprefix("Modelica."), *names]) + " |")
    return "\n".join(lines)


def main(words: Sequence[str]) -> None:
    """Print the tables; with ``--reasons`` each component that is refused."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.modelica", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--reasons", action="store_true")
    given = parser.parse_args(words)
    found = survey(ephs.ModelicaLibrary(given.folder), [f"Modelica.{package}" for package in PACKAGES])
    print(tables(found))
    if given.reasons:
        print("\n".join(f"- {each.package}.{each.name}: {each.text}" for each in found if each.fault))


if __name__ == "__main__":
    main(sys.argv[1:])
