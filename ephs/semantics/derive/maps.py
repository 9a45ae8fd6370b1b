"""Maps of efforts, port by port: e' = T e where a relation is seen through transformers, and its flows f = Tᵀ f'."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.spaces.vectors import Entries, Rows, combine, dot
from ephs.semantics.stage.numbers import Real

Array: TypeAlias = NDArray[np.float64]
Sort: TypeAlias = Literal["same", "frame", "any"]


@final
@dataclass(frozen=True, slots=True)
class Block:
    """The map of the efforts at one port.

    Parameters
    ----------
    inside, outside
        How many efforts the relation sees, and how many there are; none: those inside vanish.
    sort
        The identity, a change of frames [[R, 0], [S, R]], or any matrix.
    """

    inside: int
    outside: int
    sort: Sort

    @staticmethod
    def of_matrix(matrix: Array) -> "Block":
        """The block of a matrix (inside, outside)."""
        inside, outside = matrix.shape
        if inside == outside and np.array_equal(matrix, np.eye(inside)):
            return Block(inside, outside, "same")
        frame = matrix.shape == (6, 6) and not matrix[:3, 3:].any() and np.array_equal(matrix[:3, :3], matrix[3:, 3:])
        return Block(inside, outside, "frame" if frame else "any")

    @property
    def numbers(self) -> int:
        """Number of parameters of the map."""
        return {"same": 0, "frame": 18, "any": self.inside * self.outside}[self.sort]

    def rows(self, numbers: Sequence[Real]) -> Rows:
        """The matrix (inside, outside), by rows."""
        if self.sort == "same":
            return [[float(i == j) for j in range(self.outside)] for i in range(self.inside)]
        if self.sort == "any":
            return [list(numbers[i * self.outside : (i + 1) * self.outside]) for i in range(self.inside)]
        turning, below = ([list(numbers[k + 3 * i : k + 3 * i + 3]) for i in range(3)] for k in (0, 9))
        return [*[[*row, 0.0, 0.0, 0.0] for row in turning], *[[*b, *t] for b, t in zip(below, turning, strict=True)]]


@final
@dataclass(frozen=True, slots=True)
class Maps:
    """T, block by block: a block for each port of the relation that is seen."""

    blocks: tuple[Block, ...]

    @staticmethod
    def of_matrices(matrices: Sequence[Array]) -> "tuple[Maps, tuple[float, ...]]":
        """The maps with these matrices, and their numbers."""
        blocks = tuple(map(Block.of_matrix, matrices))
        numbers: list[float] = []
        for block, matrix in zip(blocks, matrices, strict=True):
            if block.sort == "frame":
                numbers += [*matrix[:3, :3].ravel().tolist(), *matrix[3:, :3].ravel().tolist()]
            elif block.sort == "any":
                numbers += matrix.ravel().tolist()
        return Maps(blocks), tuple(numbers)

    @property
    def inside(self) -> int:
        """Number of efforts that the relation sees."""
        return sum(block.inside for block in self.blocks)

    @property
    def outside(self) -> int:
        """Number of efforts."""
        return sum(block.outside for block in self.blocks)

    @property
    def numbers(self) -> int:
        """Number of parameters of the maps."""
        return sum(block.numbers for block in self.blocks)

    def rows(self, numbers: Sequence[Real]) -> list[Rows]:
        """The matrix of each block."""
        at, found = 0, list[Rows]()
        for block in self.blocks:
            found.append(block.rows(numbers[at : at + block.numbers]))
            at += block.numbers
        return found

    def inward(self, rows: Sequence[Rows], efforts: Entries) -> list[Real]:
        """T e of efforts (outside,), with the matrices of the blocks."""
        out: list[Real] = []
        for block, matrix, first in self._along(rows, outside=True):
            part = efforts[first : first + block.outside]
            out += part if block.sort == "same" else [dot(row, part) for row in matrix]
        return out

    def outward(self, rows: Sequence[Rows], flows: Entries) -> list[Real]:
        """Tᵀ f of flows (inside,)."""
        out: list[Real] = []
        for block, matrix, first in self._along(rows, outside=False):
            part = flows[first : first + block.inside]
            out += part if block.sort == "same" else combine(matrix, part) if block.outside else []
        return out

    def _along(self, rows: Sequence[Rows], *, outside: bool) -> Iterator[tuple[Block, Rows, int]]:
        first = 0
        for block, matrix in zip(self.blocks, rows, strict=True):
            yield block, matrix, first
            first += block.outside if outside else block.inside
