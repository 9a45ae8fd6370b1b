"""Fold transformers, and the junctions without storage behind them, into the adjacent components.

A component that determines the effort at one of its ports from those at another by constant numbers, and nothing else,
says only in which frame or on which lever arm its neighbours are seen: theirs becomes its port, through that map. So go
the offsets of joints, levers, rigid links, and the ground, whose effort is zero.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import final

import numpy as np

from ephs.mechanics.rewrite.rewrite import Rule, RuleSite, StateMap, Strength, SystemDraft
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Irreversible, Primitive, Reversible, Storage
from ephs.semantics.primitives.pullback import Map, pull_back
from ephs.semantics.spaces.decompositions import singular_values
from ephs.semantics.spaces.rank import IMPLICIT

NAME = "fold a transformer"


def _determining(primitive: Primitive) -> tuple[Array, Array] | None:
    """(L, C) of a component whose relation is constant and has constraints only."""
    if not isinstance(primitive, Reversible) or primitive.reads or primitive.discrete is not None:
        return None
    skew, constraint = primitive.structure({})
    return (skew, constraint) if primitive.multipliers and not np.any(skew) else None


def _columns(draft: SystemDraft, box: Path, primitive: Reversible, constraint: Array) -> dict[Path, Array]:
    """The constraint on the efforts at each junction: ports on one junction share theirs."""
    out: dict[Path, Array] = {}
    for port, where, _ in primitive.bundle.items():
        junction = draft.wires[box][port].junction
        out[junction] = out[junction] + constraint[:, where] if junction in out else constraint[:, where]
    return out


def _map(columns: Mapping[Path, Array], size: float, inner: Path) -> tuple[Array, Path | None] | None:
    """(matrix, outer junction) with e at the inner one = matrix · e at the outer one; None otherwise."""
    block = columns[inner]
    others = [j for j in columns if j != inner]
    if block.shape[0] != block.shape[1] or len(others) > 1:
        return None
    if not singular_values(block)[-1] > IMPLICIT * size:
        return None
    if not others:
        return np.zeros((block.shape[0], 0)), None
    return np.asarray(-np.linalg.solve(block, columns[others[0]]), dtype=float), others[0]


def _places(draft: SystemDraft) -> Iterator[tuple[Path, ...]]:
    for box, primitive in draft.fillings.items():
        if _determining(primitive) is not None:
            yield (box,)
            # inner junctions first, by their names: junctions behind a joint's offset belong to the joint
            for junction in sorted({j.junction for j in draft.wires[box].values()}, key=lambda j: (-len(j), j)):
                yield box, junction


def _folds(draft: SystemDraft, box: Path) -> Iterator["_Fold"]:
    """Junctions that a box may fold: those at which it determines the effort."""
    primitive = draft.fillings.get(box)
    found = None if primitive is None else _determining(primitive)
    if found is None or not isinstance(primitive, Reversible):
        return
    columns = _columns(draft, box, primitive, found[1])
    size = float(np.abs(found[1]).max(initial=0.0))
    for junction in columns:
        mapped = _map(columns, size, junction)
        if mapped is not None:
            yield _Fold(box, junction, *mapped)


def transformations(draft: SystemDraft, junction: Path) -> Iterator[tuple[Array, Path | None]]:
    """(matrix, other junction) of each component that determines the effort at a junction; None where it is zero."""
    for box, _ in draft.on(junction):
        for fold in _folds(draft, box):
            if fold.junction == junction:
                yield fold.matrix, fold.target


def _idle(draft: SystemDraft, box: Path) -> RuleSite | None:
    """A component without effect: a closed loop of levers."""
    primitive = draft.fillings.get(box)
    found = None if primitive is None else _determining(primitive)
    if found is None or not isinstance(primitive, Reversible):
        return None
    columns = _columns(draft, box, primitive, found[1])
    size = float(np.abs(found[1]).max(initial=0.0))
    if any(np.abs(block).max(initial=0.0) > IMPLICIT * size for block in columns.values()):
        return None
    if any(draft.junctions[j].exposed and {b for b, _ in draft.on(j)} == {box} for j in columns):
        return None  # an outer port needs a junction

    def make(draft: SystemDraft) -> StateMap:
        draft.remove([box])
        draft.remove([], _deserted(draft, columns))
        return StateMap()

    return RuleSite(NAME, box, Strength.RELATION, f"{box} repeats equations of others for the same efforts", "", make)


def _deserted(draft: SystemDraft, junctions: Iterable[Path]) -> list[Path]:
    """Junctions without ports."""
    return [j for j in junctions if not draft.on(j) and not draft.reading(j) and not draft.junctions[j].exposed]


def _fold_site(draft: SystemDraft, place: tuple[Path, ...]) -> RuleSite | None:
    if len(place) == 1:
        return _idle(draft, place[0])
    box, junction = place
    fold = next((fold for fold in _folds(draft, box) if fold.junction == junction), None)
    if fold is None:
        return None
    refusal = fold.refusal(draft) or fold.choice(draft)
    return RuleSite(NAME, box, Strength.RELATION, fold.reason(draft), refusal, fold.make)


@final
class _Fold:
    """One fold: the transformer at ``box`` with its inner junction."""

    def __init__(self, box: Path, junction: Path, matrix: Array, target: Path | None) -> None:
        self.box, self.junction, self.matrix, self.target = box, junction, matrix, target

    def neighbours(self, draft: SystemDraft) -> list[tuple[Path, Path]]:
        """The other power ports on the junction."""
        return [where for where in draft.on(self.junction) if where[0] != self.box]

    def reason(self, draft: SystemDraft) -> str:
        """Why, in words."""
        into = ", ".join(sorted({str(box) for box, _ in self.neighbours(draft)})) or "nothing"
        if self.target is None:
            return f"the effort at {self.junction} is always zero: {into} needs no port there"
        d = self.matrix.shape
        if d[0] == d[1] and np.array_equal(self.matrix, np.eye(d[0])):
            return f"the effort at {self.junction} is that at {self.target}, and nothing is stored there"
        return f"nothing is stored at {self.junction}: {into} can be connected to {self.target} by a constant matrix"

    def refusal(self, draft: SystemDraft) -> str:
        """Why not, in words."""
        if draft.junctions[self.junction].exposed:
            return f"{self.junction} is an outer port"
        if (storage := draft.stored(self.junction)) is not None:
            return f"{storage} stores a state at {self.junction}"
        if readers := draft.reading(self.junction):
            return f"{readers[0][0]} reads the state of {self.junction}"
        if any(self.junction in group for group in draft.links):
            return f"{self.junction} shares its state with other junctions"
        around = self.neighbours(draft)
        alone = self.target is not None and not around and len(draft.on(self.target)) == 1
        if self.target is not None and alone and draft.junctions[self.target].exposed:
            return f"nothing else is connected to the outer port {self.target}"
        for box, port in around:
            process = draft.fillings[box]
            if process.interface[port].quantity.environment:
                return f"{self.junction} carries heat for the environment"
            if process.kernel is not None and self.matrix.shape[1] > self.matrix.shape[0]:
                return f"the compiled relation of {box} would be lost"
        return ""

    def choice(self, draft: SystemDraft) -> str:
        """Reason for refusal: another component determines the effort too, and either choice would be arbitrary.

        It is not where all junctions that determine one another end in one, nor where two are in series.
        """
        others = self.neighbours(draft)
        if self.target is None:  # components behind a transformer first: it determines the frame's pose
            for box, _ in others:
                for fold in _folds(draft, box):
                    if fold.target is not None and fold.junction != self.junction and not fold.refusal(draft):
                        return f"{box} comes first"
        rivals = [box for box, _ in others if any(fold.junction == self.junction for fold in _folds(draft, box))]
        if len(others) < 2 or not rivals or _ends(draft, self.junction) < 2:
            return ""
        return f"{rivals[0]} determines the effort at {self.junction} as well"

    def make(self, draft: SystemDraft) -> StateMap:
        """Apply the fold."""
        neighbours: dict[Path, list[Path]] = {}
        for box, port in self.neighbours(draft):
            neighbours.setdefault(box, []).append(port)
        kind = None if self.target is None else draft.kind(self.target)
        for box, ports in neighbours.items():
            process = draft.fillings[box]
            if isinstance(process, Storage):
                raise TypeError(f"{box} is a storage")
            assert isinstance(process, (Reversible, Irreversible))
            given = pull_back(process, dict.fromkeys(ports, Map(self.matrix, kind)))
            draft.replace(box, given, dict.fromkeys(ports, self.target) if self.target is not None else {})
        draft.remove([self.box], [self.junction])
        # an outer junction with the transformer as its only component is now empty
        draft.remove([], _deserted(draft, [] if self.target is None else [self.target]))
        return StateMap()


def _ends(draft: SystemDraft, start: Path) -> int:
    """Number of junctions in a cycle of efforts that cannot be folded; that of no effort is one."""
    seen, queue, ends, still = {start}, [start], 0, False
    while queue:
        here = queue.pop()
        foldable = False
        for box, _ in draft.on(here):
            folds = list(_folds(draft, box))
            for fold in folds:
                still |= fold.target is None
                foldable |= fold.junction == here and not fold.refusal(draft)
            if folds:
                fresh = {where.junction for where in draft.wires[box].values()} - seen
                seen |= fresh
                queue += fresh
        ends += not foldable
    return ends + still


WHY = (
    "nothing is stored, read or exposed at its inner junction, so the parts there are connected to the outer one by a "
    "constant matrix; and junctions with zero effort, as at the ground, need no ports"
)
FOLD = Rule(NAME, Strength.RELATION, WHY, _places, _fold_site)
"""Fold components that determine one effort from another."""
