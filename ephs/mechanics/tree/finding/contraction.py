"""Contraction of the constant relations of a mechanism's attachments to a network."""

from collections.abc import Callable, Mapping, Sequence
from typing import final

import numpy as np

from ephs.mechanics.tree.finding.frames import Unplaced
from ephs.mechanics.tree.finding.network import Attached, Injection, JointInertia, Network, Tie
from ephs.mechanics.tree.finding.wiring import Incidence
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import StateSlot
from ephs.semantics.linear.sums import uncancelled
from ephs.semantics.primitives.primitives import Irreversible, Primitive, Reversible, Storage
from ephs.semantics.spaces.rank import TINY
from ephs.solve.equations.sparse import Index

NEGLIGIBLE = 1e-12
"""Entry of a contracted relation that counts as zero, relative to the largest of the relation that it came from."""


def network_of(
    wiring: Incidence,
    components: Sequence[int],
    rates: Mapping[int, int],
    nodes: Mapping[int, int],
    prescribed: Callable[[Path], bool],
    refuse: Callable[[int], str | None],
) -> Network:
    """The network of some components.

    Parameters
    ----------
    rates
        Junction of a joint's momentum -> the joint's freedoms.
    nodes
        Junction of a booked entropy -> its number.
    prescribed
        Whether an effort is prescribed at an outer port.
    refuse
        Why nothing can be attached to a junction; None where it can.

    Raises
    ------
    Unplaced
        A component meets what is no joint, or states and motions depend on each other through constant relations.
    """
    if not components:
        return Network()
    return _Contraction(wiring, components, rates, nodes, prescribed, refuse).network()


RATE, NODE, INPUT, STATE, FREE = range(5)


@final
class _Contraction:
    def __init__(
        self,
        wiring: Incidence,
        components: Sequence[int],
        rates: Mapping[int, int],
        nodes: Mapping[int, int],
        prescribed: Callable[[Path], bool],
        refuse: Callable[[int], str | None],
    ) -> None:
        self.wiring, self.components, self.rates, self.nodes = wiring, components, rates, nodes
        self._prescribed, self._refuse = prescribed, refuse
        self.column: dict[tuple[int, int], int] = {}
        self.sort: list[int] = []
        self.storage: dict[int, tuple[int, StateSlot]] = {}  # column -> storage there, its state
        self.stiff: list[JointInertia] = []
        self.tied: list[tuple[int, dict[int, float]]] = []  # component -> ratios of the rates that it ties
        for number in components:
            self._lay(number)

    def _primitive(self, number: int) -> Primitive:
        return self.wiring.components[number].primitive

    def _fault(self, number: int, reason: str) -> Unplaced:
        return Unplaced(self.wiring.components[number].path, reason)

    def _lay(self, number: int) -> None:
        """Give the junctions of a component their columns."""
        slot = self.wiring.components[number]
        for port, _, quantity in slot.primitive.bundle.items():
            junction = self.wiring.ports[number][str(port)]
            if reason := self._refuse(junction):
                raise self._fault(number, reason)
            for k in range(quantity.space.dim):
                if (junction, k) not in self.column:
                    self.column[junction, k] = len(self.sort)
                    self.sort.append(self._sort(junction))
            if not isinstance(slot.primitive, Storage):
                continue
            if quantity.space.dim != 1 or quantity.space.size != 1:
                raise self._fault(number, "stores what is no number, away from bodies and joints")
            at = self.column[junction, 0]
            state = next(s for p, s in zip(slot.primitive.reads, slot.reads, strict=True) if p == port)
            self.storage[at] = number, state
            if self.sort[at] == FREE:
                self.sort[at] = STATE
            elif self.sort[at] == INPUT:
                raise self._fault(number, "stores at a port whose effort is prescribed")

    def _sort(self, junction: int) -> int:
        if junction in self.rates:
            return RATE
        if junction in self.nodes:
            return NODE
        outer = self.wiring.outer.get(junction)
        return INPUT if outer is not None and self._prescribed(outer) else FREE

    def _places(self, number: int) -> list[int]:
        """Columns of a component's efforts."""
        ports = self.wiring.ports[number]
        return [
            self.column[ports[str(port)], k]
            for port, _, quantity in self._primitive(number).bundle.items()
            for k in range(quantity.space.dim)
        ]

    # ---- constant relations ------------------------------------------------------------------------------------

    def network(self) -> Network:
        count = len(self.sort)
        skew, rows, called = np.zeros((count, count)), list[Array](), list[int]()
        owners: list[int] = []
        for number in self.components:
            primitive = self._primitive(number)
            if isinstance(primitive, Storage):
                continue
            if isinstance(primitive, Irreversible) or primitive.reads:
                called.append(number)
                continue
            places = self._places(number)
            left, constraint = primitive.structure({})
            np.add.at(skew, (np.array(places)[:, None], np.array(places)[None, :]), left)
            for one in uncancelled(constraint, places):
                row = np.zeros(count)
                np.add.at(row, places, one)
                rows.append(row)
                owners.append(number)
        dependent = self._eliminated(np.array(rows).reshape(len(rows), count), owners)
        for at in [at for at, (number, state) in self.storage.items() if self.sort[at] == RATE]:
            self._inertia(at, {at: 1.0})
        kinds = [[at for at in range(count) if self.sort[at] == sort and at not in dependent] for sort in range(4)]
        kinds[STATE] = self._ordered(kinds[STATE], dependent)
        free = [at for at in range(count) if self.sort[at] == FREE and at not in dependent]
        order = [*kinds[RATE], *kinds[NODE], *kinds[INPUT], *kinds[STATE], *free]
        place = {at: z for z, at in enumerate(order)}
        multipliers = [(number, k) for number in called for k in range(_multipliers(self._primitive(number)))]
        size = len(order) + len(multipliers)
        basis = np.zeros((count, size))
        for at, z in place.items():
            basis[at, z] = 1.0
        for at, others in dependent.items():
            for other, by in others.items():
                basis[at, place[other]] = by
        back = {at: key for key, at in self.column.items()}
        multiplier = {key: len(order) + i for i, key in enumerate(multipliers)}
        states = tuple(self.storage[at][1] for at in kinds[STATE])
        first: dict[int, int] = {}
        for i, at in enumerate(kinds[STATE]):
            first.setdefault(self.storage[at][0], i)
        rate = {key: i for i, key in enumerate(back[at] for at in kinds[RATE])}
        return Network(
            rates=tuple(back[at] for at in kinds[RATE]),
            nodes=tuple(self.nodes[back[at][0]] for at in kinds[NODE]),
            inputs=tuple((self.wiring.outer[back[at][0]], back[at][1]) for at in kinds[INPUT]),
            storages=tuple(first.items()),
            states=states,
            unknown=size - len(order) + len(free),
            skew=basis.T @ skew @ basis,
            attached=tuple(self._attached(number, basis, multiplier, states) for number in called),
            inertias=tuple(
                JointInertia(one.component, one.state, rate[back[one.rate]], one.ratio, one.inertia)
                for one in self.stiff
            ),
            injections=tuple(self._injections(basis)),
            ties=tuple(
                Tie(number, tuple((rate[back[at]], by) for at, by in terms.items())) for number, terms in self.tied
            ),
        )

    def _eliminated(self, rows: Array, owners: list[int]) -> dict[int, dict[int, float]]:
        """Columns that constant relations make depend on others, each with its row.

        Raises
        ------
        Unplaced
            Relations are left that tie states, or motions, to each other.
        """
        rows = rows / np.maximum(np.abs(rows).max(axis=1, initial=0.0), TINY)[:, None]
        pivots: dict[int, int] = {}
        _pivot(rows, [at for at, sort in enumerate(self.sort) if sort == FREE], pivots)
        inertial = [
            at
            for at, (number, _) in self.storage.items()
            if self.sort[at] == STATE and _inertia(self._primitive(number)) is not None
        ]
        _pivot(rows, inertial, pivots, left=[i for i in range(len(rows)) if i not in pivots])
        rows[np.abs(rows) <= NEGLIGIBLE] = 0.0
        self._tie(rows, owners, [i for i, row in enumerate(rows) if i not in pivots and row.any()])
        found: dict[int, dict[int, float]] = {}
        for i, at in pivots.items():
            found[at] = {int(other): -float(rows[i, other]) for other in np.flatnonzero(rows[i]) if other != at}
            if self.sort[at] == STATE:
                self._inertia(at, found[at])
        return found

    def _tie(self, rows: Array, owners: list[int], left: list[int]) -> None:
        """Take rows on rates of joints as ties, those that others imply left out.

        Raises
        ------
        Unplaced
            A row has more than rates, or the rows hold a joint still.
        """
        for i in left:
            if any(self.sort[at] != RATE for at in np.flatnonzero(rows[i])):
                raise self._overdetermined(rows[i], owners[i])
        found: dict[int, int] = {}
        apart = rows.copy()
        _pivot(apart, [at for at, sort in enumerate(self.sort) if sort == RATE], found, left)
        for i in sorted(found):
            if np.count_nonzero(np.abs(apart[i]) > NEGLIGIBLE) == 1:
                raise self._held(rows[i], owners[i])
            self.tied.append((owners[i], {int(at): float(rows[i, at]) for at in np.flatnonzero(rows[i])}))

    def _held(self, row: Array, owner: int) -> Unplaced:
        if np.count_nonzero(row) == 1:
            return self._fault(owner, "prescribes the motion of a joint")
        return self._fault(owner, "contradicts the other gears of a loop: together they hold their joints still")

    def _overdetermined(self, row: Array, owner: int) -> Unplaced:
        sorts = {self.sort[at] for at in np.flatnonzero(row)}
        stored = [self.storage[at][0] for at in np.flatnonzero(row).tolist() if at in self.storage]
        if RATE in sorts and sorts <= {RATE, INPUT}:
            return self._fault(owner, "prescribes the motion of a joint")
        if stored:
            return self._fault(stored[0], "stores what other states determine")
        return self._fault(owner, "prescribes an effort that is given already")

    def _inertia(self, at: int, others: Mapping[int, float]) -> None:
        """A storage whose effort others determine becomes inertia of a joint."""
        number, state = self.storage[at]
        inertia, on = _inertia(self._primitive(number)), [other for other in others if self.sort[other] == RATE]
        if inertia is None or len(others) != 1 or len(on) != 1 or self.rates[self._back(on[0])] != 1:
            raise self._fault(number, "stores what other states, or the rates of several degrees of freedom, determine")
        self.stiff.append(JointInertia(number, state, on[0], others[on[0]], inertia))

    def _back(self, at: int) -> int:
        """The junction of a column."""
        return next(junction for (junction, _), column in self.column.items() if column == at)

    def _ordered(self, columns: list[int], dependent: Mapping[int, object]) -> list[int]:
        """Columns of states, those of one storage side by side in its order."""
        wanted, out = set(columns), list[int]()
        for number in self.components:
            if isinstance(self._primitive(number), Storage):
                places = self._places(number)
                mine = [at for at in places if at in wanted]
                if mine and len(mine) != len(places):
                    raise self._fault(number, "stores in one of its states what others determine")
                out += mine
        return out

    # ---- what is called ----------------------------------------------------------------------------------------

    def _attached(
        self, number: int, basis: Array, multiplier: Mapping[tuple[int, int], int], states: Sequence[StateSlot]
    ) -> Attached:
        slot, places = self.wiring.components[number], self._places(number)
        more = np.zeros((_multipliers(slot.primitive), basis.shape[1]))
        for k, row in enumerate(more):
            row[multiplier[number, k]] = 1.0
        taking = {state.path: len(self.nodes) + i for i, state in enumerate(states)}
        heated: list[tuple[int, int]] = []
        for port, where, quantity in slot.primitive.bundle.items():
            if quantity.kind != "entropy" or not isinstance(slot.primitive, Irreversible):
                continue
            junction = self.wiring.ports[number][str(port)]
            stored = self.storage.get(self.column[junction, 0])
            taken = self.nodes[junction] if junction in self.nodes else taking[stored[1].path] if stored else -1
            heated.append((where.start, taken))
        return Attached(
            number, np.vstack([basis[places], more]), tuple(state.path for state in slot.reads), tuple(heated)
        )

    def _injections(self, basis: Array) -> list[Injection]:
        return [
            Injection(self.wiring.outer[junction], k, basis[at])
            for (junction, k), at in self.column.items()
            if self.sort[at] in (STATE, FREE) and junction in self.wiring.outer
        ]


def _multipliers(primitive: Primitive) -> int:
    return primitive.multipliers if isinstance(primitive, Reversible) else 0


def _inertia(primitive: Primitive) -> float | None:
    """J of a storage of one number with E = x²/(2 J); None of others."""
    kernel = primitive.kernel
    if kernel is None or kernel.name != "quadratic" or len(kernel.parameters) != 1:
        return None
    return 1.0 / float(kernel.parameters[0]) if kernel.parameters[0] > 0.0 else None


def _pivot(rows: Array, columns: Sequence[int], pivots: dict[int, int], left: Sequence[int] | None = None) -> None:
    """Solve rows for columns, by Gauss and Jordan with the largest pivots; ``pivots``: row -> its column."""
    open_rows, open_columns = list(range(len(rows)) if left is None else left), list(columns)
    while open_rows and open_columns:
        sizes: Array = np.abs(rows[np.ix_(open_rows, open_columns)])
        i, j = np.unravel_index(int(sizes.argmax()), sizes.shape)
        if sizes[i, j] <= NEGLIGIBLE:
            return
        row, column = open_rows.pop(int(i)), open_columns.pop(int(j))
        rows[row] /= rows[row, column]
        others: Index = np.flatnonzero(np.arange(len(rows)) != row)
        rows[others] -= np.outer(rows[others, column], rows[row])
        pivots[row] = column
