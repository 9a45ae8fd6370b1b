"""Laws that composites inherit from their parts, as values, measured at a probe.

Each law is stated once, here. Tests, `System.check`, `ephs check` and `ephs.testing` run the same objects.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from ephs.operad import ROOT, Path, Pattern
from ephs.semantics import balances
from ephs.semantics.bundle import Array, Bundle
from ephs.semantics.checks import dirac
from ephs.semantics.primitives import Reversible
from ephs.semantics.probe import Probe, SystemLaw, Verdict, random_probe
from ephs.semantics.relations import LinearRelation, Relation, pattern_relation
from ephs.semantics.relations.base import BasePoint, place
from ephs.semantics.relations.pattern import Block, junction_relations
from ephs.semantics.spaces.rank import APART, PROJECTOR
from ephs.semantics.subspace import Subspace
from ephs.semantics.system import System

__all__ = [
    "SYSTEM_LAWS",
    "Probe",
    "SystemLaw",
    "Verdict",
    "isotropy",
    "power_form",
    "random_probe",
    "system_law",
]


def _functoriality(probe: Probe) -> Verdict:
    one, other = (probe.system.relation(probe.reference, route=route) for route in ("flat", "nested"))
    if one.classes != other.classes:
        return Verdict(np.inf, 0.0, f"the states of the base are {_base(one)} and {_base(other)}")
    flat, nested = (relation.at(probe.state, probe.ports, efforts=probe.efforts) for relation in (one, other))
    distance = flat.distance(nested)
    detail = f"{len(one.classes)} states; projectors of dimension {flat.dimension} differ by {distance:.1e}"
    return Verdict(distance, _rounding(flat.subspace, nested.subspace), detail)


def _base(relation: Relation) -> str:
    """The classes of a relation's states, as text."""
    return " | ".join(" = ".join(map(str, (*each.ports, *each.stores, *each.readers))) for each in relation.classes)


def _rounding(*subspaces: Subspace) -> float:
    """Tolerance for projectors: 1e-13 times the condition of the eliminations; those of other relations differ by
    a tenth and more."""
    return min(APART, PROJECTOR * max(10.0, *(subspace.condition for subspace in subspaces)))


def _patterns(system: System, path: Path = ROOT) -> Iterator[tuple[Path, Pattern]]:
    yield path, system.pattern
    for box, filling in system.fillings.items():
        if isinstance(filling, System):
            yield from _patterns(filling, path / box)


def _tellegen(probe: Probe) -> Verdict:
    """The relation of a pattern is Lagrangian for the form with the outer part negated."""
    worst, count = 0.0, 0
    known: dict[Pattern, float] = {}
    for path, pattern in _patterns(probe.system):
        count += 1
        if pattern not in known:
            blocks = list(junction_relations(pattern))
            dimension, expected = sum(block.dimension for _, block in blocks), _pairing(pattern)[0].size // 2
            if dimension != expected:
                return Verdict(np.inf, 0.0, f"{path}: dimension {dimension}, expected {expected}")
            known[pattern] = _power(pattern, blocks)
        worst = max(worst, known[pattern])
    return Verdict(worst, PROJECTOR, f"{count} patterns; power is conserved to {worst:.1e}")


def _power(pattern: Pattern, blocks: Iterable[Block]) -> float:
    """Largest value of the power form on a direct sum of relations, block by block; equal ones once."""
    partner, sign = _pairing(pattern)
    known: dict[tuple[int, bytes, bytes], float] = {}
    for where, block in blocks:
        places = {place: i for i, place in enumerate(where)}
        local = np.array([places.get(int(place), -1) for place in partner[where]])
        if (local < 0).any():  # the form pairs blocks, too
            return np.inf
        key = id(block), local.tobytes(), sign[where].tobytes()
        if key not in known:
            form = np.zeros((local.size, local.size))
            form[range(local.size), local] = sign[where]
            known[key] = isotropy(block, form)
    return max(known.values(), default=0.0)


def _pairing(pattern: Pattern) -> tuple[NDArray[np.intp], Array]:
    """Of each coordinate of `pattern_relation`, the one that it is multiplied with in the power, and the sign."""
    blocks = [(Bundle.of(box.interface).size, 1.0) for box in pattern.boxes.values()]
    blocks.append((Bundle.of(pattern.interface).size, -1.0))
    partner, sign, at = [np.zeros(0, dtype=np.intp)], [np.zeros(0)], 0
    for n, one in blocks:
        flows = np.arange(at, at + n)
        partner += [flows + n, flows]
        sign.append(np.full(2 * n, one))
        at += 2 * n
    return np.concatenate(partner), np.concatenate(sign)


def power_form(pattern: Pattern) -> Array:
    """The form ⟨e|f⟩ summed over inner ports less outer ports, on the coordinates of `pattern_relation`."""
    partner, sign = _pairing(pattern)
    out = np.zeros((sign.size, sign.size))
    out[range(sign.size), partner] = sign
    return out


def isotropy(subspace: Subspace, form: Array) -> float:
    """Largest value of the form on an orthonormal basis: 0 for an isotropic subspace."""
    return float(np.abs(subspace.basis.T @ form @ subspace.basis).max(initial=0.0))


def _dirac(probe: Probe) -> Verdict:
    """The pattern with all reversible components: a Dirac structure on outer ports and those of the others."""
    flat = probe.system.flatten()
    states, contradiction = place(probe.system.relation(probe.reference).classes, probe.state, probe.ports)
    if contradiction:
        return Verdict(0.0, 0.0, contradiction)
    point = BasePoint(states)
    whole, form = pattern_relation(flat.pattern), power_form(flat.pattern)
    kept: list[int] = []
    rows: list[Array] = []
    at = 0
    for box, content in flat.pattern.boxes.items():
        layout, primitive = Bundle.of(content.interface), flat.fillings[box]
        n = layout.size
        if isinstance(primitive, Reversible):
            # the box may list its ports in another order than the primitive
            order = [
                at + i
                for port in primitive.bundle.ports
                for i in range(layout.slice(port).start, layout.slice(port).stop)
            ]
            annihilator = Subspace.from_kernel(dirac(*primitive.structure(point.read(box, primitive))).basis.T).basis.T
            conditions = np.zeros((n, whole.ambient))
            conditions[:, [*order, *(n + i for i in order)]] = annihilator
            rows.append(conditions)
        else:
            kept += range(at, at + 2 * n)
        at += 2 * n
    kept += range(at, whole.ambient)
    matrix = np.vstack([np.zeros((0, whole.ambient)), *rows])
    filled = whole.restrict(matrix)
    found = filled.project(kept)
    if 2 * found.dimension != len(kept):
        return Verdict(np.inf, 0.0, f"dimension {found.dimension}, expected {len(kept) // 2}")
    worst = isotropy(found, form[np.ix_(kept, kept)])
    detail = f"dimension {found.dimension} on {len(kept)} flows and efforts, isotropic to {worst:.1e}"
    return Verdict(worst, PROJECTOR * found.condition, detail)


def _renaming(probe: Probe) -> Verdict:
    """Boxes renamed so that they sort in the opposite order."""
    system = probe.system
    boxes = sorted(system.fillings)
    if ROOT in boxes:
        return Verdict(0.0, 0.0, "an identity, whose box has no name")
    prefix = "box"
    while any(path[0].startswith(prefix) for path in system.pattern.junctions):
        prefix += "_"
    names = {box: Path((f"{prefix}{len(boxes) - i:06d}",)) for i, box in enumerate(boxes)}
    pattern = system.pattern.rename(boxes=names)
    renamed = System.of(pattern, {names[box]: filling for box, filling in system.fillings.items()})

    def new(path: Path) -> Path:
        return next(names[box] / path.relative_to(box) for box in boxes if box.is_prefix_of(path))

    one = system.relation(probe.reference).at(probe.state, probe.ports, efforts=probe.efforts)
    two = renamed.relation(probe.reference).at(
        {new(p): v for p, v in probe.state.items()},
        probe.ports,
        efforts={new(p): e for p, e in probe.efforts.items()},
    )
    if one.empty and two.empty:
        return Verdict(0.0, 0.0, "both relations are empty")
    where = _places(two)
    order = [i for path, _ in one.rates for i in where[new(path)]]
    order += range(len(order), two.subspace.ambient)
    distance = float(np.abs(one.projector - two.projector[np.ix_(order, order)]).max(initial=0.0))
    detail = f"{len(boxes)} boxes renamed, projectors differ by {distance:.1e}"
    return Verdict(distance, _rounding(one.subspace, two.subspace), detail)


def _places(relation: LinearRelation) -> dict[Path, range]:
    """Slice of the rates."""
    out: dict[Path, range] = {}
    at = 0
    for path, dim in relation.rates:
        out[path] = range(at, at + dim)
        at += dim
    return out


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
