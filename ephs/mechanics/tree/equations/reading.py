"""States of the general form out of joint coordinates, made when they are read."""

from collections.abc import Iterator, Mapping
from typing import final

from ephs.mechanics.tree.equations.paper import PaperStates
from ephs.mechanics.tree.finding.layout import Layout
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array


@final
class JointStates(Mapping[Path, Array]):
    """All states of a scene's system by path, at elements q, the tree's rates r and entropies s."""

    def __init__(self, paper: PaperStates, layout: Layout, q: Array, r: Array, s: Array) -> None:
        self._paper, self._layout, self._at = paper, layout, (q.copy(), r.copy(), s)
        self._all: dict[Path, Array] | None = None

    def rate(self, joint: str) -> Array | None:
        """(d,) the rate of a joint of the tree; None of one that closes a loop."""
        where = self._layout.freedoms.get(joint)
        return None if where is None or where.max(initial=-1) >= self._layout.n else self._at[1][where]

    def __getitem__(self, path: Path) -> Array:
        where = self._layout.paths.get(path)
        return self._whole()[path] if where is None else self._at[0][where]

    def __iter__(self) -> Iterator[Path]:
        return iter(self._whole())

    def __len__(self) -> int:
        return len(self._whole())

    def _whole(self) -> dict[Path, Array]:
        if self._all is None:
            self._all = self._paper.at(*self._at)
        return self._all
