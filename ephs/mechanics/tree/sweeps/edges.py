"""Springs, friction and given forces on joints and between bodies, as laws about a point.

A component between two frames is evaluated by itself. What it gives there, its pull and how that changes with place,
rate and temperature, is its law; the mechanism's equations read the laws. About the point they are exact to first
order, which is all that the equations and their derivatives at that point need.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from ephs.mechanics.tree.sweeps.acting import ON_BODIES, ON_TREE, Acting
from ephs.mechanics.tree.sweeps.charts import Kind, visit_kind
from ephs.mechanics.tree.sweeps.cuts import between, place_of
from ephs.mechanics.tree.sweeps.records import Tree
from ephs.semantics.spaces import se3, so3
from ephs.semantics.spaces.staged_groups import STAGED
from ephs.semantics.spaces.vectors import (
    Rows,
    add,
    apply,
    apply_transposed,
    combine,
    dot,
    product,
    scale,
    sub,
    transposed,
)
from ephs.semantics.stage import (
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Real,
    Record,
    Table,
    Vector,
    real,
    reals,
)

__all__ = ["Edges", "Law"]


class Law(Record):
    """Forces in an edge about a point.

    Attributes
    ----------
    place, rate, warmth
        The point: element, rates along the degrees of freedom, temperature over the environment's.
    pull
        Force on the rates there, in N and N m.
    stiffness, damping, softness
        By how much it falls with place (left-trivialised), rate and temperature.
    made
        Entropy made a second, in W/K; ``made_by_place``, ``made_by_rate`` and ``made_by_warmth`` its derivatives.
    """

    place = reals(7)
    rate = reals(6)
    warmth = real()
    pull = reals(6)
    stiffness = reals(6, 6)
    damping = reals(6, 6)
    softness = reals(6)
    made = real()
    made_by_place = reals(6)
    made_by_rate = reals(6)
    made_by_warmth = real()


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """An edge's element (7,), its rates (6,), and R and p of its second frame in its first link."""

    element: Vector
    rate: Vector
    arm: Vector

    @property
    def frame(self) -> tuple[Rows, list[Real]]:
        return [[self.arm[3 * i + j] for j in range(3)] for i in range(3)], [self.arm[9 + k] for k in range(3)]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """All edges in which something may act, and their laws.

    Attributes
    ----------
    kinds
        The kinds of groups among them.
    codes
        The group of each.
    places
        (links + 1, 24): see `cuts.Place`.
    """

    kinds: tuple[Kind, ...]
    edges: Table[Acting]
    codes: Integers
    laws: Table[Law]
    places: Matrix

    def _visit(self, on: Evaluator, q: Vector, r: Vector, body: Callable[[Acting, Law, _Motion, Kind], None]) -> None:
        """Call body(edge, law, motion, kind) for all edges."""

        def one(i: Integer) -> None:
            edge, law = self.edges[i], self.laws[i]
            motion = _Motion(on.scratch(7), on.scratch(6), on.scratch(12))

            def on_tree() -> None:
                on.loop(edge.dim, lambda j: _put(motion.rate, j, r[edge.r_at + j]))

            def across() -> None:
                near, far = place_of(on, self.places, edge.first), place_of(on, self.places, edge.second)
                outer, place = edge.outer_turn, edge.outer_at
                turn, at = between(near, far, outer, place)
                twist = sub(se3.twist_inward(outer, place, far.twist), se3.twist_inward(turn, at, near.twist))
                _fill(motion.arm, [*turn[0], *turn[1], *turn[2], *at])
                _fill(motion.rate, apply(edge.left, twist))

            def apart() -> None:
                inner, (turn, at) = edge.inner_turn, motion.frame
                found = so3.quaternion(on, product(transposed(inner), turn))
                _fill(motion.element, [*found, *apply_transposed(inner, sub(at, edge.inner_at))])

            def stored() -> None:
                on.loop(edge.size, lambda k: _put(motion.element, k, q[edge.q_at + k]))

            on.when(on.same(edge.kind, ON_TREE), on_tree, across)
            on.when(on.same(edge.kind, ON_BODIES), apart, stored)
            visit_kind(on, self.kinds, self.codes[i], edge.dim, lambda kind: body(edge, law, motion, kind))

        on.loop(self.edges.size, one)

    def meet(self, on: Evaluator, q: Vector, r: Vector) -> None:
        """Put the point of each law where its edge is."""

        def of(edge: Acting, law: Law, motion: _Motion, kind: Kind) -> None:
            law.place = [motion.element[k] for k in range(7)]
            law.rate = [motion.rate[j] for j in range(6)]

        self._visit(on, q, r, of)

    def act(
        self,
        on: Evaluator,
        tree: Tree,
        q: Vector,
        r: Vector,
        warmth: Vector,
        drive: Vector,
        force: Vector,
        heat: Vector,
    ) -> None:
        """Take pulls and drives off the forces on the tree's rates and the links' loads; add entropies made to heat."""

        def one(edge: Acting, law: Law, motion: _Motion, kind: Kind) -> None:
            dim, size = kind.dim, kind.size
            moved = STAGED[kind.code].increment(on, law.place[:size], [motion.element[k] for k in range(size)])
            faster = [motion.rate[j] - known for j, known in enumerate(law.rate[:dim])]
            warmer, pull = on.variable(0.0), on.scratch(6)
            stiffness, damping, softness = law.stiffness, law.damping, law.softness

            def made() -> None:
                warmer.value = warmth[edge.heat] - law.warmth
                change = dot(law.made_by_place[:dim], moved) + dot(law.made_by_rate[:dim], faster)
                heat[edge.heat] = heat[edge.heat] + (law.made + (change + law.made_by_warmth * warmer.value))

            on.when(edge.friction >= 0, made)
            for j in range(dim):
                less = dot(stiffness[j][:dim], moved) + dot(damping[j][:dim], faster)
                pull[j] = law.pull[j] - (less + softness[j] * warmer.value)
            on.when(edge.kind < ON_BODIES, lambda: _driven(on, pull, drive.part(edge.r_at, dim)))

            def on_tree() -> None:
                for j in range(dim):
                    force[edge.r_at + j] = force[edge.r_at + j] - pull[j]

            def between() -> None:
                wrench = combine(edge.left[:dim], [pull[j] for j in range(dim)])
                turn, at = motion.frame
                _load(on, tree, edge.second, se3.wrench_outward(edge.outer_turn, edge.outer_at, scale(-1.0, wrench)))
                _load(on, tree, edge.first, se3.wrench_outward(turn, at, wrench))

            on.when(on.same(edge.kind, ON_TREE), on_tree, between)

        self._visit(on, q, r, one)


def _driven(on: Evaluator, pull: Vector, drive: Vector) -> None:
    on.loop(drive.size, lambda j: _put(pull, j, pull[j] + drive[j]))


def _load(on: Evaluator, tree: Tree, link: Integer, by: list[Real]) -> None:
    def put() -> None:
        state = tree.states[link]
        state.load = add(state.load, by)

    on.when(link >= 0, put)


def _put(vector: Vector, k: Integer, value: Real) -> None:
    vector[k] = value


def _fill(vector: Vector, values: list[Real]) -> None:
    for k, value in enumerate(values):
        vector[k] = value
