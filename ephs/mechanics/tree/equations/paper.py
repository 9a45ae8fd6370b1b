"""Between the reduced form and the paper's states: every state of the system from joints' elements, and back."""

from collections.abc import Callable, Iterator
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.tree.engine.states import ELEMENT, ENTROPY, MOMENTUM, POSE, RELATIVE, STATES, Ends, Source, Walked
from ephs.mechanics.tree.engine.tables import table_of
from ephs.mechanics.tree.finding.mechanism import Reduced
from ephs.mechanics.tree.finding.tables import SPRING
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3, manifold
from ephs.semantics.spaces.decompositions import least_squares, symmetric_eigen
from ephs.semantics.stage import Table
from ephs.semantics.stage.calling import Bound
from ephs.semantics.systems.kept import once
from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.posing.problem import Problem

NEAR, OFF = 1e-6, 1e-3
"""Initial positions and momenta may differ by this from what the joints make of them: positions relative to their size
where that is above 1; momenta, by the roots of their energies, relative to all of them, or to what the mechanism gains
along its length at its accelerations: nodal momenta of some methods do differ, to their order."""
CHARTED = 0.1
"""Part of an allowed increment within which numbers of a state imply it: an increment is at most four times as large as
the largest difference of the numbers."""


@final
class PaperStates:
    """The map of states for one problem."""

    def __init__(self, reduced: Reduced, problem: Problem) -> None:
        self.reduced, self.problem = reduced, problem
        network = reduced.attaching.network
        self._inertias = network.inertias
        self._turning = reduced.attaching.ports[[one.rate for one in network.inertias]]
        self._momentum = np.array([one.inertia * one.ratio for one in network.inertias])
        self._paths, plan, self._tables = once(reduced, "states", self._found)
        self._plan = plan.copy()
        self._memory = np.zeros((reduced.links + 1, 7)), np.zeros((reduced.links + 1, 6))
        self._known = False
        self.rest = problem.point

    def _found(self) -> tuple[list[Path], NDArray[np.int64], tuple[Table[Walked], Table[Ends]]]:
        """Paths and sources of the states, and the tables that these are made from."""
        slots = {slot.path: slot for slot in self.problem.descriptor.states}
        paths: list[Path] = []
        reduced, t, plan = self.reduced, self.reduced.tables, []
        for path, source, number in self._sources():
            if path in slots:
                paths.append(path)
                start = int(t.q_at[number]) if source == ELEMENT else number
                plan.append([source, start, slots[path].at, slots[path].quantity.space.size, 0])
        walked, springs = slice(0, reduced.links), np.flatnonzero(t.kind == SPRING)
        joints = np.stack(
            [t.parent, *(column[walked] for column in (t.forward, t.code, t.dim, t.q_at, t.r_at))], axis=1
        )
        frames = [t.offset1, t.offset2, t.basis.reshape(-1, 36)]
        bodies = np.hstack([*(column[walked] for column in frames), t.inertia.reshape(-1, 36)])
        ends = np.stack([t.first[springs], t.second[springs]], axis=1)
        offsets = np.hstack([t.offset1[springs], t.offset2[springs]])
        sources = np.array(plan, dtype=np.int64).reshape(-1, Source.integer_width)
        return paths, sources, (table_of(Walked, joints, bodies), table_of(Ends, ends, offsets))

    def _sources(self) -> Iterator[tuple[Path, int, int]]:
        """(path, where it comes from, number of the link, edge or entropy) of the states."""
        inertial = (one.state.path for one in self._inertias)
        for number, path in enumerate([*self.reduced.entropies, *inertial]):
            yield path, ENTROPY, number
        for number, link in enumerate(self.reduced.places):
            if link.pose is not None:
                yield link.pose.path, POSE, number
            if link.momentum is not None:
                yield link.momentum.path, MOMENTUM, number
        springs = self.reduced.tables.kind == SPRING
        before = np.cumsum(springs) - springs  # how many springs stand before each edge
        for number, (edge, spring, first) in enumerate(zip(self.reduced.edges, springs, before.tolist(), strict=True)):
            if edge.path is not None and edge.state is not None:
                yield edge.state, RELATIVE if spring else ELEMENT, first if spring else number

    def arrays(self) -> list[Any]:
        """All arrays of the tables, of whole and of real numbers."""
        return [array for table in self._tables for array in table.arrays]

    def parts(self) -> dict[str, Any]:
        """Tables and memory of the program of states, by the names of its arguments; after `rows` has run once."""
        bodies, springs = self._tables
        poses, twists = self._memory
        return {
            "bodies": bodies, "springs": springs, "plan": table_of(Source, self._plan), "poses": poses,
            "twists": twists,
        }  # fmt: skip

    def inertias(self) -> tuple[NDArray[np.int64], Array]:
        """Places in r of the rates that storages follow as inertia of joints, and momentum by rate, (k,) each."""
        return np.array(self._turning, dtype=np.int64), self._momentum

    def rows(self, q: Array, r: Array, s: Array) -> Array:
        """(rows, point_size) all states, of rows of joints' elements, rates and entropies."""
        out = np.tile(self.rest, (q.shape[0], 1))
        self.walked(q, r, self.stored(r, s), out)()
        if not self._known and q.shape[0]:
            self._known = True
            # a pose has two quaternions: that one which is continuous with the initial one
            posed = np.isin(self._plan[:, 0], (POSE, RELATIVE))
            at = self._plan[posed, 2, None] + np.arange(4)
            self._plan[posed, -1] = (out[0, at] * self.rest[at]).sum(axis=1) < 0.0
            if self._plan[posed, -1].any():
                return self.rows(q, r, s)
        return out

    def walked(self, q: Array, r: Array, stored: Array, x: Array) -> Bound:
        """A call that writes all states of rows of elements, rates and `stored` to x, whose rows are `rest` before."""
        plan = table_of(Source, self._plan)
        return STATES.compiled()["rows"].bind(*self._tables, plan, q, r, stored, *self._memory, x)

    def stored(self, r: Array, s: Array) -> Array:
        """(rows, …): s, then the states of storages that are inertia of joints."""
        return np.hstack([s, r[:, self._turning] * self._momentum]) if self._inertias else s

    def at(self, q: Array, r: Array, s: Array) -> dict[Path, Array]:
        """All states of the system."""
        x = self.rows(q[None], r[None], s[None])[0]
        return {
            path: x[at : at + size] for path, (_, _, at, size, _) in zip(self._paths, self._plan.tolist(), strict=True)
        }

    def initial(self) -> tuple[Array, Array, Array]:
        """(q, r, s) of the problem's initial states."""
        tables, reduced, initial = self.reduced.tables, self.reduced, self.problem.initial
        q = np.zeros(reduced.coordinates)
        for i, edge in enumerate(reduced.joints):
            given = edge.pair.manifold.identity() if edge.state is None else initial[edge.state]
            q[int(tables.q_at[i]) : int(tables.q_at[i] + tables.q_size[i])] = given
        s = np.array([float(initial[path][0]) for path in reduced.entropies])
        return q, self._rates_of(q), s

    def check(self, q: Array, r: Array, s: Array, accelerations: Callable[[], Array]) -> None:
        """Compare the closed initial state with the given one.

        ``accelerations`` (n,) of the tree's freedoms are asked for where momenta seem off the joints.

        Raises
        ------
        SolveError
            They differ: the initial states contradict the joints.
        """
        made, given = self.rows(q[None], r[None], s[None])[0], self.rest
        self._check_momenta(made, lambda: self.rows(q[None], accelerations()[None], s[None])[0])
        far, states = np.flatnonzero(np.abs(made - given) > CHARTED * NEAR), self.problem.descriptor.states
        for number in np.unique(np.searchsorted([slot.at for slot in states], far, side="right") - 1):
            slot = states[number]
            near = (OFF if slot.quantity.parity < 0 else NEAR) * max(1.0, float(np.abs(given[slot.point]).max()))
            found = float(np.abs(manifold(slot.quantity.space).increment(made[slot.point], given[slot.point])).max())
            if found > near:
                raise SolveError(Outcome.INCONSISTENT, str(slot.path), f"it is off by {found:.1e}")

    def _check_momenta(self, made: Array, pushed: Callable[[], Array]) -> None:
        """Compare momenta of bodies, all states (size,) as the joints make them of rates and of accelerations."""
        bodies = [(i, link.momentum) for i, link in enumerate(self.reduced.places) if link.momentum is not None]
        if not bodies:
            return
        at = np.array([np.arange(slot.point.start, slot.point.stop) for _, slot in bodies])
        inertia = self.reduced.tables.inertia[[i for i, _ in bodies]]

        def roots(momenta: Array) -> Array:
            return np.sqrt(np.einsum("ij,ij->i", momenta, np.linalg.solve(inertia, momenta[..., None])[..., 0]))

        off = roots(made[at] - self.rest[at])
        worst = int(np.argmax(off))
        size = float(np.linalg.norm(roots(self.rest[at])))
        if off[worst] > OFF * size:
            heavy = float(np.sqrt(inertia[:, 5, 5].sum()))
            size = max(size, float(np.sqrt(np.linalg.norm(roots(pushed()[at])) * heavy * self.problem.length)))
        if off[worst] > OFF * size:
            found = f"it is off by {off[worst] / size:.1e} of what moves" if size else "nothing moves"
            raise SolveError(Outcome.INCONSISTENT, str(bodies[worst][1].path), found)

    def _rates_of(self, q: Array) -> Array:
        """The tree's rates from the bodies' momenta: from each body to the nearest one with inertia before it."""
        tables, reduced, initial = self.reduced.tables, self.reduced, self.problem.initial
        rates = np.zeros(reduced.freedoms)
        momenta = {i: initial[link.momentum.path] for i, link in enumerate(reduced.places) if link.momentum is not None}
        if not any(map(np.any, momenta.values())):
            return rates
        given, twists = list(momenta), {-1: np.zeros(6)}
        moving = np.linalg.solve(tables.inertia[given], np.array(list(momenta.values()))[..., None])[..., 0]
        roots = _roots(tables.inertia)  # what hardly has inertia knows little of its twist
        for i, twist in zip(given, moving, strict=True):
            twists[i] = twist
            columns: list[Array] = []
            freedoms: list[int] = []
            carried, here = np.eye(6), i
            while here == i or here not in twists:
                d, at = int(tables.dim[here]), int(tables.r_at[here])
                inner, motion = self._joint(q, here)
                columns.append(carried @ motion)
                freedoms += range(at, at + d)
                carried = carried @ SE3.adjoint(SE3.inverse(inner))
                here = int(tables.parent[here])
            own = twists[i] - carried @ twists[here]
            root = roots[i]
            rates[freedoms] = least_squares(root @ np.column_stack(columns), root @ own)
        return rates

    def _joint(self, q: Array, i: int) -> tuple[Array, Array]:
        """Pose of a body in the one before it, and (6, d) the twists that its joint's rates make."""
        t, pair = self.reduced.tables, self.reduced.edges[i].pair
        near, far = t.offset1[i], t.offset2[i]
        there = SE3.compose(near, pair.include(q[int(t.q_at[i]) : int(t.q_at[i] + t.q_size[i])]))
        ahead = SE3.compose(there, SE3.inverse(far))
        if t.forward[i]:
            return ahead, SE3.adjoint(far) @ pair.basis
        return SE3.inverse(ahead), -SE3.adjoint(there) @ pair.basis


def _roots(inertias: Array) -> Array:
    """Symmetric roots (links, 6, 6) of inertias, their sizes taken where they are negative."""
    moments, axes = symmetric_eigen(inertias)
    return (axes * np.sqrt(np.abs(moments))[:, None]) @ axes.mT
