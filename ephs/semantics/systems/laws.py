"""Laws that composites inherit from their parts, as values, measured at a probe.

Each law is stated once, here. Tests, `System.check`, `ephs check` and `ephs.testing` run the same objects.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ephs.operad import ROOT, Path, Pattern
from ephs.semantics.meaning import Instant, Relation, relation_of_pattern
from ephs.semantics.meaning.components import at_instant
from ephs.semantics.meaning.fields import Rational
from ephs.semantics.meaning.functor import filled, is_dirac
from ephs.semantics.primitives.primitives import Reversible
from ephs.semantics.systems import balances
from ephs.semantics.systems.probe import Probe, SystemLaw, Verdict, random_probe
from ephs.semantics.systems.system import System

__all__ = ["SYSTEM_LAWS", "Probe", "SystemLaw", "Verdict", "random_probe", "system_law"]


def _instant_of(system: System, probe: Probe) -> Instant:
    return system.relation(probe.reference).at(probe.state, probe.ports, efforts=probe.efforts)


def _decided(holds: bool, detail: str) -> Verdict:
    """Of a law that holds or does not, whatever the size of numbers."""
    return Verdict(0.0 if holds else np.inf, 0.0, detail)


def _functoriality(probe: Probe) -> Verdict:
    one, other = (probe.system.relation(probe.reference, route=route) for route in ("flat", "nested"))
    if one.classes != other.classes:
        return _decided(False, f"the states of the base are {_base(one)} and {_base(other)}")
    flat, nested = (each.at(probe.state, probe.ports, efforts=probe.efforts) for each in (one, other))
    same = flat.same(nested)
    words = "agree" if same else "differ"
    return _decided(same, f"{len(one.classes)} states; relations of dimension {flat.dimension} {words}")


def _base(relation: Relation) -> str:
    """The classes of a relation's states, as text."""
    return " | ".join(" = ".join(map(str, (*each.ports, *each.stores, *each.readers))) for each in relation.classes)


def _patterns(system: System, path: Path = ROOT) -> Iterator[tuple[Path, Pattern]]:
    yield path, system.pattern
    for box, filling in system.fillings.items():
        if isinstance(filling, System):
            yield from _patterns(filling, path / box)


def _tellegen(probe: Probe) -> Verdict:
    """The relation of a pattern is its own orthogonal for the form with the outer part negated, decided in ℚ."""
    known: set[Pattern] = set()
    count = 0
    for path, pattern in _patterns(probe.system):
        count += 1
        if pattern not in known and not is_dirac(relation_of_pattern(Rational(), pattern)):
            return _decided(False, f"{path}: the relation of the pattern makes or loses power, or is not maximal")
        known.add(pattern)
    return _decided(True, f"{count} patterns conserve power, decided in rational numbers")


def _dirac(probe: Probe) -> Verdict:
    """The pattern with all reversible components: a Dirac structure on outer ports and those of the others."""
    flat = probe.system.flatten()
    found = _instant_of(flat, probe)
    if found.contradiction:
        return _decided(True, found.contradiction)
    point = found.point
    parts = {
        box: at_instant(primitive, box, point) for box, primitive in flat.leaves() if isinstance(primitive, Reversible)
    }
    whole = filled(relation_of_pattern(point.field, flat.pattern), parts)
    detail = f"dimension {whole.dimension} on {len(whole.variables)} flows and efforts"
    return _decided(is_dirac(whole), f"{detail}, its own orthogonal to the error bounds")


def _renaming(probe: Probe) -> Verdict:
    """Boxes renamed so that they sort in the opposite order."""
    system = probe.system
    boxes = sorted(system.fillings)
    if ROOT in boxes:
        return _decided(True, "an identity, whose box has no name")
    prefix = "box"
    while any(path[0].startswith(prefix) for path in system.pattern.junctions):
        prefix += "_"
    names = {box: Path((f"{prefix}{len(boxes) - i:06d}",)) for i, box in enumerate(boxes)}
    pattern = system.pattern.rename(boxes=names)
    renamed = System.of(pattern, {names[box]: filling for box, filling in system.fillings.items()})

    def new(path: Path) -> Path:
        return path.moved(names)

    one = _instant_of(system, probe)
    two = _instant_of(
        renamed,
        replace(
            probe,
            state={new(path): value for path, value in probe.state.items()},
            efforts={new(path): value for path, value in probe.efforts.items()},
        ),
    )
    if one.linear.empty and two.linear.empty:
        return _decided(True, "both relations are empty")
    moved = one.linear.renamed(lambda v: v._replace(port=two.point.names[new(v.port)]) if v.kind == "rate" else v)
    same = moved.same(two.linear)
    return _decided(same, f"{len(boxes)} boxes renamed, the relations {'agree' if same else 'differ'}")


SYSTEM_LAWS: tuple[SystemLaw, ...] = (
    SystemLaw("functoriality", "flatten, then fill = fill, then compose", _functoriality),
    SystemLaw("Tellegen", "a pattern's relation is Lagrangian: power in = power out", _tellegen),
    SystemLaw("Dirac", "a pattern filled with Dirac structures is a Dirac structure", _dirac),
    SystemLaw("renaming", "names of boxes mean nothing", _renaming),
    SystemLaw("power balance", "the energy changes by what outer ports supply", balances.energy_balance),
    SystemLaw("exergy balance", "the exergy changes by supply and destruction", balances.exergy_balance),
    SystemLaw("entropy balance", "the entropy changes by supply and production", balances.entropy_balance),
    SystemLaw("conservation", "volumes and amounts change by supply alone", balances.conservation),
    SystemLaw("entropy production", "no irreversible component destroys entropy", balances.entropy_production),
    SystemLaw("naturality", "discretise, then compose = flatten, then discretise", balances.naturality),
)


def system_law(name: str) -> SystemLaw:
    """The law of this name.

    Raises
    ------
    KeyError
        There is none.
    """
    return {law.name: law for law in SYSTEM_LAWS}[name]
