"""The relation of a loss by the rates of logarithms of relative poses: μ = Bᵀ R B with ḋ = B u along all edges.

Flows are p.f = μ u, s.f = −⟨u|μ u⟩/θ at the middle of the step. Their derivatives are those over dual numbers, one
direction at a time. R and the logarithms d⁰ at rest are parameters.
"""

from dataclasses import dataclass
from typing import final

from ephs.semantics.derive.arguments import Arguments
from ephs.semantics.derive.pose_edges import PoseEdges
from ephs.semantics.derive.relating import DOMAIN, OK, TEMPERATURE, finite
from ephs.semantics.spaces import se3
from ephs.semantics.spaces.vectors import apply, apply_transposed, scale, sub
from ephs.semantics.stage.duals import Duals
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.memory import Vector
from ephs.semantics.stage.numbers import Integer, Real


@final
@dataclass(frozen=True, slots=True)
class LogarithmLoss:
    """Ports of the rates of all poses but the first, then of entropy; reads the poses.

    Parameters
    ----------
    edges
        As of a `LogarithmStep`.
    """

    edges: PoseEdges

    @property
    def dimensions(self) -> tuple[int, int, int, int]:
        """Numbers of efforts, conditions, increments and state coordinates."""
        poses = self.edges.poses
        return 6 * poses + 1, 0, 6 * poses, 7 * poses

    @property
    def numbers(self) -> int:
        """Number of parameters: d⁰ of all edges, then R row by row."""
        return self.edges.numbers

    def stage(self, on: Evaluator, a: Arguments, *, bare: bool) -> Integer:
        """Write flows and, unless bare, their derivatives by efforts and increments."""
        n, _, m, _ = self.dimensions
        state, given, rest = self.edges.with_first(on, a.x0), on.scratch(n + m), self.edges.at_rest(on, a.p)
        for i in range(n):
            given[i] = a.e[i]
        for i in range(m):
            given[n + i] = 0.5 * a.v[i]
        theta = a.e[n - 1] + a.scal[1]
        flows = self._flows(on, a.p, rest, state, given, a.scal[1])
        for i, flow in enumerate(flows):
            a.f[i] = flow
        status = on.select(theta > 0.0, on.select(finite(on, flows), OK, DOMAIN), TEMPERATURE)
        if bare:
            return status
        duals = Duals(on)

        def along(way: Integer) -> None:
            moving = duals.scratch(n + m)
            for i in range(n + m):
                slope = 1.0 if i < n else 0.5
                moving[i] = duals.dual(given[i], (on.select(on.same(way, i), slope, 0.0),))
            p, between, still = (Vector(duals.cells(x.cells), x.start, x.size) for x in (a.p, rest, state))
            turned = self._flows(duals, p, between, still, moving, duals.dual(a.scal[1]))
            for i, flow in enumerate(turned):
                a.jac[i * (n + m) + way] = duals.dual(flow).slopes[0]

        on.loop(n + m, along)
        return status

    def _flows(
        self, on: Evaluator, p: Vector, rest: Vector, state: Vector, given: Vector, reference: Real
    ) -> list[Real]:
        """Flows at efforts and half increments that are given one after the other."""
        n, _, m, _ = self.dimensions
        edges, width, count = self.edges, self.edges.width, len(self.edges.ends)
        rates, half = on.scratch(6 + m), on.scratch(6 + m)
        for i in range(m):
            rates[6 + i], half[6 + i] = given[i], given[n + i]
        middle = edges.moved(on, state, half)
        before, after, change = on.scratch(36 * count), on.scratch(36 * count), on.scratch(width)

        def measure(e: Integer) -> None:
            ends = edges.end(on, e, 0), edges.end(on, e, 1)
            a, b = ([middle[7 * k + i] for i in range(7)] for k in ends)
            d = se3.increment(on, a, se3.compose(on, [rest[7 * e + i] for i in range(7)], b))
            rows = se3.dexp_inv(on, d), se3.dexp_inv(on, scale(-1.0, d))
            seen = [apply(one, [rates[6 * k + i] for i in range(6)]) for one, k in zip(rows, ends, strict=True)]
            for i, x in enumerate(sub(seen[1], seen[0])):
                change[6 * e + i] = x
            for one, kept in zip(rows, (before, after), strict=True):
                for i, row in enumerate(one):
                    for j, x in enumerate(row):
                        kept[36 * e + 6 * i + j] = x

        on.loop(count, measure)
        stress, power = on.scratch(width), on.variable(0.0)

        def pull(i: Integer) -> None:
            total = on.variable(0.0)

            def add(j: Integer) -> None:
                total.value = total.value + p[width + width * i + j] * change[j]

            on.loop(width, add)
            stress[i] = total.value
            power.value = power.value + total.value * change[i]

        on.loop(width, pull)
        force = on.scratch(6 + m)

        def push(e: Integer) -> None:
            own = [stress[6 * e + i] for i in range(6)]
            for side, kept, sign in ((0, before, -1.0), (1, after, 1.0)):
                rows = [[kept[36 * e + 6 * i + j] for j in range(6)] for i in range(6)]
                k = edges.end(on, e, side)
                for i, x in enumerate(apply_transposed(rows, own)):
                    force[6 * k + i] = force[6 * k + i] + sign * x

        on.loop(count, push)
        return [*(force[6 + i] for i in range(m)), -1.0 * power.value / (given[n - 1] + reference)]
