"""Edges between poses of which the first does not move: what relations of their logarithms share."""

from dataclasses import dataclass
from typing import final

from ephs.semantics.derive.charts import moved
from ephs.semantics.spaces import se3
from ephs.semantics.spaces.codes import SE3
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.memory import Vector
from ephs.semantics.stage.numbers import Integer


@final
@dataclass(frozen=True, slots=True)
class PoseEdges:
    """Edges (a, b) between poses q₀ = 1, q₁, …

    Parameters
    ----------
    ends
        Numbers of the poses that each edge goes from and to; 0 is the one that does not move.
    """

    ends: tuple[tuple[int, int], ...]

    @property
    def poses(self) -> int:
        """Number of poses that are states."""
        return max(map(max, self.ends))

    @property
    def width(self) -> int:
        """Numbers of all logarithms."""
        return 6 * len(self.ends)

    @property
    def numbers(self) -> int:
        """Number of parameters: the logarithms d⁰ at rest, then a matrix on all logarithms row by row."""
        return self.width + self.width**2

    def with_first(self, on: Evaluator, states: Vector) -> Vector:
        """Poses (7 + 7 poses,): 1, then those that are states."""
        found = on.scratch(7 + 7 * self.poses)
        found[0] = 1.0
        for i in range(7 * self.poses):
            found[7 + i] = states[i]
        return found

    def moved(self, on: Evaluator, poses: Vector, step: Vector) -> Vector:
        """Poses after increments (6 + 6 poses,)."""
        end = on.scratch(7 + 7 * self.poses)

        def move(k: Integer) -> None:
            point, by = ([x[size * k + i] for i in range(size)] for x, size in ((poses, 7), (step, 6)))
            for i, x in enumerate(moved(on, SE3, point, by)):
                end[7 * k + i] = x

        on.loop(1 + self.poses, move)
        return end

    def at_rest(self, on: Evaluator, logarithms: Vector) -> Vector:
        """Relative poses exp(d⁰) (7 edges,) of logarithms (6 edges,)."""
        rest = on.scratch(7 * len(self.ends))

        def pose_at_rest(e: Integer) -> None:
            for i, x in enumerate(se3.exp(on, [logarithms[6 * e + i] for i in range(6)])):
                rest[7 * e + i] = x

        on.loop(len(self.ends), pose_at_rest)
        return rest

    def end(self, on: Evaluator, edge: Integer, side: int) -> Integer:
        """Number of the pose at an end of an edge."""
        found: Integer = self.ends[-1][side]
        for number, ends in enumerate(self.ends[:-1]):
            found = on.select(on.same(edge, number), ends[side], found)
        return found
