"""The relation of a storage of relative poses whose energy is quadratic in logarithms: E = ½ Δᵀ K Δ.

Of poses q₁ = 1, q₂, … the edges (a, b) have d = log(q_a⁻¹ exp(d⁰) q_b); Δ are the changes d − d⁰ of all edges. Over a
step ΔE = mᵀ(d¹ − d⁰) with the stress m of the mean Δ, and d¹ − d⁰ = D̄ v by the rules of `slopes`, so the efforts are
D̄ᵀm: accumulated from the end, one edge at a time. Their derivatives are those over dual numbers, one increment at a
time. All elements share the machine code; K and d⁰ are parameters.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, final

from ephs.semantics.derive.arguments import Arguments
from ephs.semantics.derive.charts import over
from ephs.semantics.derive.pose_edges import PoseEdges
from ephs.semantics.derive.recording import record
from ephs.semantics.derive.relating import DOMAIN, OK, finite
from ephs.semantics.derive.slopes import Slopes, lifted
from ephs.semantics.derive.tape import Tape, over_step
from ephs.semantics.spaces import se3, so3
from ephs.semantics.spaces.codes import SE3
from ephs.semantics.spaces.vectors import cross, dot
from ephs.semantics.stage.duals import Duals
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.memory import Vector
from ephs.semantics.stage.numbers import Integer, Real


@final
@dataclass(frozen=True, slots=True)
class LogarithmStep:
    """The efforts of such a storage over a step.

    Parameters
    ----------
    edges
        Those along which it has logarithms.
    """

    edges: PoseEdges

    @property
    def dimensions(self) -> tuple[int, int, int, int]:
        """Numbers of efforts, conditions, increments and state coordinates."""
        poses = self.edges.poses
        return 6 * poses, 0, 6 * poses, 7 * poses

    @property
    def numbers(self) -> int:
        """Number of parameters: d⁰ of all edges, then K row by row."""
        return self.edges.numbers

    def stage(self, on: Evaluator, a: Arguments, *, bare: bool) -> Integer:
        """Write efforts, their derivatives by the step, and the energy; no derivatives where it is bare."""
        n, edges = self.dimensions[0], self.edges
        state, step, rest = edges.with_first(on, a.x0), on.scratch(6 + n), edges.at_rest(on, a.p)
        for i in range(n):
            step[6 + i] = a.v[i]
        efforts, energy = self._evaluated(on, a.p, rest, state, step)
        for i in range(n):
            a.e[i] = efforts[6 + i]
        a.c[0] = energy
        good = finite(on, [energy, *(a.e[i] for i in range(n))])
        if bare:
            return on.select(good, OK, DOMAIN)
        duals = Duals(on)

        def along(way: Integer) -> None:
            moving = duals.scratch(6 + n)
            for i in range(n):
                moving[6 + i] = duals.dual(step[6 + i], (on.select(on.same(way, i), 1.0, 0.0),))
            p, between, still = (Vector(duals.cells(x.cells), x.start, x.size) for x in (a.p, rest, state))
            turned, _ = self._evaluated(duals, p, between, still, moving)
            for i in range(n):
                a.f[i * n + way] = duals.dual(turned[6 + i]).slopes[0]

        on.loop(n, along)
        return on.select(good, OK, DOMAIN)

    def _evaluated(self, on: Evaluator, p: Vector, rest: Vector, state: Vector, step: Vector) -> tuple[Vector, Real]:
        """Efforts of all poses, and the energy at the end."""
        edges, width, count = self.edges, self.edges.width, len(self.edges.ends)
        end, first, last = edges.moved(on, state, step), on.scratch(width), on.scratch(width)

        def measure(e: Integer) -> None:
            between = [rest[7 * e + i] for i in range(7)]
            for at, out in ((state, first), (end, last)):
                a, b = ([at[7 * edges.end(on, e, side) + i] for i in range(7)] for side in (0, 1))
                for i, x in enumerate(se3.increment(on, a, se3.compose(on, between, b))):
                    out[6 * e + i] = x - p[6 * e + i]

        on.loop(count, measure)
        stress, energy = on.scratch(width), on.variable(0.0)

        def pull(i: Integer) -> None:
            mean, at_end = on.variable(0.0), on.variable(0.0)

            def add(j: Integer) -> None:
                k = p[width + width * i + j]
                mean.value = mean.value + k * (0.5 * (first[j] + last[j]))
                at_end.value = at_end.value + k * last[j]

            on.loop(width, add)
            stress[i] = mean.value
            energy.value = energy.value + 0.5 * last[i] * at_end.value

        on.loop(width, pull)
        efforts, slopes = on.scratch(6 + 6 * edges.poses), Slopes(on)

        def push(e: Integer) -> None:
            ends = edges.end(on, e, 0), edges.end(on, e, 1)
            given = [[x[size * k + i] for i in range(size)] for k in ends for x, size in ((state, 7), (step, 6))]
            between = [*over(on, SE3, given[0], given[1], 0), *over(on, SE3, given[2], given[3], 6)]
            constant = [*(rest[7 * e + i] for i in range(7)), *(stress[6 * e + i] for i in range(6))]
            tape, numbers = _work()
            found = over_step(slopes, tape, [*between, *map(lifted, constant)], [lifted(x) for x in numbers])
            for side, k in enumerate(ends):
                for i in range(6):
                    efforts[6 * k + i] = efforts[6 * k + i] + found.slopes[6 * side + i]

        on.loop(count, push)
        return efforts, energy.value


@cache
def _work() -> tuple[Tape, tuple[float, ...]]:
    """The tape of mᵀ log(a⁻¹ r b) of poses a, b, r and a stress m, and its numbers."""
    found = record(_along_stress, {"a": 7, "b": 7, "rest": 7, "stress": 6})
    return found.tape, found.parameters


def _along_stress(a: Any, b: Any, rest: Any, stress: Any) -> Any:
    """mᵀ log(a⁻¹ r b), with log d = (ω, x − ½ ω × x + c ω × (ω × x))."""
    back = [a[0], -a[1], -a[2], -a[3]]
    turned = _multiplied(back, _multiplied(rest[:4], b[:4]))
    there = so3.rotate(rest[:4], b[4:])
    place = so3.rotate(back, [rest[4 + i] + there[i] - a[4 + i] for i in range(3)])
    square = turned[0].squared_turn(*turned[1:])
    ratio = 2.0 * (turned[0] / abs(turned[0])) * square.turn_ratio()
    turn = [ratio * x for x in turned[1:]]
    side = cross(turn, place)
    far, curve = cross(turn, side), square.turn_curve()
    whole = [*turn, *(place[i] - 0.5 * side[i] + curve * far[i] for i in range(3))]
    return dot(stress, whole)


def _multiplied(a: Any, b: Any) -> Any:
    """Product of quaternions."""
    side = cross(a[1:], b[1:])
    return [a[0] * b[0] - dot(a[1:], b[1:]), *(a[0] * b[1 + i] + b[0] * a[1 + i] + side[i] for i in range(3))]
