"""Forces on a mechanism besides inertia and gravity: springs, friction and its heat, conduction, given wrenches."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from ephs.mechanics.road.cuts import Relative, frame_on, motion_of, place_of, pose_of, twist_of
from ephs.mechanics.road.needs import NO_INTEGERS
from ephs.mechanics.road.tree import shift_back, turned
from ephs.mechanics.tree.engine.near import Near
from ephs.mechanics.tree.engine.several import (
    dims_of,
    gather,
    left_row,
    meet,
    pull_links,
    pull_several,
    push,
    rates_along,
    rates_of_several,
)
from ephs.mechanics.tree.sweeps.acting import (
    ON_BODIES,
    ON_TREE,
    Acting,
    ConductingComponent,
    Tables,
    Work,
)
from ephs.mechanics.tree.sweeps.expanding import About
from ephs.mechanics.tree.sweeps.network import Net
from ephs.semantics.linear.dense import clear, copy
from ephs.semantics.spaces.vectors import dot, sub
from ephs.semantics.stage import Evaluator, Integer, Real, Variable, Vector, staged

if TYPE_CHECKING:
    from ephs.mechanics.tree.engine.drags import Drags


@staged
def act(
    on: Evaluator, tables: Tables, work: Work, q: Vector, r: Vector, s_rate: Vector, made: Vector, totals: Vector,
    kept: About | None, read: About | None, drags: "Drags | None" = None,
) -> Integer:  # fmt: skip
    """Write forces on joints and wrenches on links, rates of entropies, entropies made and powers; return a status.

    Entropies are those in the memory; ``totals`` receives the rates of `TOTALS`.

    Parameters
    ----------
    kept
        Receives what was evaluated; None: it is not kept.
    read
        Is read instead: nothing is evaluated but what was, to first order.
    drags
        Receives resistances in place of friction, which then does not act.
    """
    acting = _ActingEvaluation(on, tables, work, q, r, s_rate, made, totals, on.counter(0), kept, read, drags)
    clear(on, totals)
    on.loop(tables.node.size, acting.warm)
    on.loop(tables.body.size, acting.push)
    on.when(tables.own[0].attached > 0, lambda: acting.unless_refused(acting.attach))

    Near.of(on, tables, work).each(lambda edge, i: acting.unless_refused(lambda: acting.edge(edge, i)))
    on.loop(tables.conduction.size, lambda i: acting.unless_refused(lambda: acting.conduct(tables.conduction[i])))
    return acting.status.value


@staged
def strain(on: Evaluator, tables: Tables, work: Work, q: Vector, out: Vector) -> Integer:
    """Add the energies of springs in J to out[1], and their sizes to out[2]; return a status.

    Places of links in the memory are those at q where springs act between bodies.
    """
    acting = _ActingEvaluation(on, tables, work, q, q, work.idle, work.idle, work.idle, on.counter(0), None, None)

    def each_edge(edge: Acting, number: Integer) -> None:
        on.when(edge.spring >= 0, lambda: acting.unless_refused(lambda: acting.store(edge, out)))
        on.when(edge.poses > 0, lambda: acting.unless_refused(lambda: acting.store_several(edge, number, out)))

    Near.of(on, tables, work).each(each_edge)
    return acting.status.value


@final
@dataclass(frozen=True, slots=True)
class _ActingEvaluation:
    """One evaluation of what acts."""

    on: Evaluator
    tables: Tables
    work: Work
    q: Vector
    r: Vector
    s_rate: Vector
    made: Vector
    totals: Vector
    status: Variable[Integer]
    kept: About | None
    read: About | None
    drags: "Drags | None" = None

    def unless_refused(self, following: Callable[[], None]) -> None:
        """Go on where no component has refused."""
        self.on.when(self.on.same(self.status.value, 0), following)

    def _evaluate(self, number: Integer, *, stored: bool = False, moving: Integer = 0, onsager: bool = False) -> None:
        """Call a component at the states in the memory, without increments: efforts go to e, flows to f.

        ``moving``: how many degrees of freedom the state of what is no storage may have; with ``onsager`` M/θ₀ goes to
        jac in place of flows.
        """
        on, tables, w, row = self.on, self.tables, self.work, self.tables.component[number]
        dims = dims_of(self.tables, number)
        if self.read is not None:
            if stored:
                self.read.store(on, number, dims, w)
            else:
                self.read.relate(on, number, dims, w, on.select(on.same(dims[2], moving), moving, 0))
            return
        parameters = tables.parameters.part(row.at, tables.parameters.size - row.at)
        found = on.reach(
            row.onsager if onsager else row.law, dims, tables.scal, parameters, w.x, w.v, w.e, w.lam, w.f, w.c, w.jac,
            w.scratch,
        )  # fmt: skip

        def refuse() -> None:
            self.status.value = found
            w.fault[0] = number

        on.when(on.negate(on.same(found, 0)), refuse)
        if self.kept is not None:
            self.kept.keep(on, number, dims, w, stored)

    def warm(self, k: Integer) -> None:
        """Write the effort of an entropy to the memory."""
        number, w = self.tables.node[k].component, self.work
        w.temperature[k] = 0.0
        self.s_rate[k] = 0.0

        def stored() -> None:
            if self.read is not None:
                self.read.local[0] = w.entropy[k] - self.read.expanded(number, dims_of(self.tables, number)).state[0]
            else:
                w.x[0] = w.entropy[k]
            self._evaluate(number, stored=True)
            w.temperature[k] = w.e[0]

        self.unless_refused(lambda: self.on.when(number >= 0, stored))

    def push(self, b: Integer) -> None:
        """Add a given wrench on a body to its link."""
        body, w = self.tables.body[b], self.work

        def given() -> None:
            place = place_of(self.on, w.places(self.tables), body.link)
            turn, at = frame_on(place, body.turn, body.at)
            here = shift_back(turned(turn, [self.tables.wrench[b, k] for k in range(6)]), sub(at, place.at))
            self.totals[1] = self.totals[1] + dot(here, place.twist)
            push(w.pushed, body.link, here)

        self.on.when(body.link >= 0, given)

    def attach(self) -> None:
        """Evaluate what is attached: forces on joints, rates of entropies and of its states."""
        t, w = self.tables, self.work
        net = Net.of(t.net, t.numbers, t.parameters, t.scal, t.supply)
        flow, on, rates = self._flows(net), self.on, net.head[0]

        def push(k: Integer) -> None:
            w.attached[t.port[k].place] = -flow[k]

        def heat(k: Integer) -> None:
            at = net.temperature[k]
            self.s_rate[at] = self.s_rate[at] - flow[rates + k]
            self.totals[0] = self.totals[0] - flow[rates + k] * (w.temperature[at] + t.scal[1])

        def fill(k: Integer) -> None:
            self.s_rate[net.head[5] + k] = -flow[net.first_state + k]

        on.loop(rates, push)
        on.loop(net.head[1], heat)
        on.loop(net.head[3], fill)
        self.totals[1], self.totals[2] = self.totals[1] + net.power[0], self.totals[2] + net.power[2]

    def _flows(self, net: Net) -> Vector:
        """Flows of what is attached."""
        on, t, w, kept = self.on, self.tables, self.work, self.kept
        if self.read is not None:
            return self.read.flows(on, net, self._rate, w)

        def meet(k: Integer) -> None:
            net.effort[k] = self._rate(k)

        on.loop(t.port.size, meet)
        self.status.value = on.reach(
            t.own[0].attach, t.net, t.numbers, t.parameters, t.scal, t.supply, self.q, w.entropy, w.temperature,
            self.made,
        )  # fmt: skip

        def keep() -> None:
            if kept is not None:
                self.status.value = kept.attach(on, net, self._rate, w)

        self.unless_refused(keep)
        w.fault[0] = on.select(on.same(self.status.value, 0), w.fault[0], net.fault[0])
        return net.flow

    def _rate(self, k: Integer) -> Real:
        """The rate of the degree of freedom at a port."""
        on, port, rate = self.on, self.tables.port[k], self.on.variable(0.0)
        edge = self.tables.acting[port.edge]

        def in_tree() -> None:
            rate.value = self.r[port.place]

        def aside() -> None:
            twist = motion_of(self.work.relative, edge.cut).twist
            rate.value = dot(left_row(edge, port.freedom), twist)

        on.when(on.same(edge.kind, ON_TREE), in_tree, aside)
        return rate.value

    def edge(self, edge: Acting, number: Integer) -> None:
        """Add the forces of an edge with this number to those on joints, or to the wrenches on links."""
        on = self.on
        still = on.either(edge.friction < 0, edge.resisted > 0)
        bare = on.both(on.same(edge.kind, ON_BODIES), on.both(edge.spring < 0, still))
        on.when(bare, lambda: None, lambda: self._edge(edge, number))
        on.when(edge.poses > 0, lambda: self.unless_refused(lambda: self._several(edge, number)))

    def _edge(self, edge: Acting, number: Integer) -> None:
        on, w = self.on, self.work
        rate, pull = on.scratch(6), on.scratch(6)
        motion = Relative(NO_INTEGERS, 0, on.scratch(Relative.real_width).cells, 0)
        tree, between_bodies = on.same(edge.kind, ON_TREE), on.same(edge.kind, ON_BODIES)

        def in_tree() -> None:
            copy(on, self.r.part(edge.r_at, edge.dim), rate.part(0, edge.dim))

        def aside() -> None:
            on.when(between_bodies, lambda: self._between(edge, motion), lambda: self._cut(edge, motion))
            rates_along(on, edge, motion.twist, rate)

        on.when(tree, in_tree, aside)
        on.when(between_bodies, lambda: None, lambda: self._drive(edge, rate, pull))
        pressed = on.counter(1)

        def spring() -> None:
            self._spring(edge, pull)
            pressed.value = on.select(on.both(edge.support > 0, w.c[0] <= 0.0), 0, 1)

        def friction() -> None:
            rubs = on.both(edge.friction >= 0, on.same(edge.resisted, 0))
            on.when(on.both(rubs, on.same(pressed.value, 1)), lambda: self._friction(edge, number, rate, pull))

        on.when(edge.spring >= 0, spring)
        self.unless_refused(friction)

        def in_joint() -> None:
            def each_freedom(j: Integer) -> None:
                w.force[edge.r_at + j] = w.force[edge.r_at + j] + pull[j]

            on.loop(edge.dim, each_freedom)

        def keep() -> None:
            copy(on, pull.part(0, edge.dim), w.pulled.part(edge.r_at, edge.dim))

        on.when(tree, in_joint, lambda: pull_links(on, self.tables, w, edge, motion, pull))
        on.when(between_bodies, lambda: None, keep)

    def _cut(self, edge: Acting, motion: Relative) -> None:
        found = motion_of(self.work.relative, edge.cut)
        motion.turn, motion.at, motion.twist = found.turn, found.at, found.twist

    def _between(self, edge: Acting, motion: Relative) -> None:
        """The motion of a spring's frames; its pose goes to the states of components."""
        on, places = self.on, self.work.places(self.tables)
        near, far = place_of(on, places, edge.first), place_of(on, places, edge.second)
        turn, at = frame_on(far, edge.outer_turn, edge.outer_at)
        motion.turn, motion.at, motion.twist = turn, at, twist_of(near, far, turn, at)
        pose = pose_of(on, frame_on(near, edge.inner_turn, edge.inner_at), (turn, at))
        component = on.select(edge.spring < 0, edge.friction, edge.spring)
        component = on.select(component < 0, edge.several, component)
        meet(on, self.tables, self.work, self.read, component, pose, 0)

    def _drive(self, edge: Acting, rate: Vector, pull: Vector) -> None:
        """Start from the given forces on a joint, whose element goes to the states of components."""
        if self.read is not None:
            copy(self.on, self.read.increment.part(edge.r_at, edge.dim), self.read.local.part(0, edge.dim))
        else:
            copy(self.on, self.q.part(edge.q_at, edge.size), self.work.x.part(0, edge.size))

        def each_freedom(j: Integer) -> None:
            given = self.tables.drive[edge.r_at + j]
            pull[j] = given + self.work.attached[edge.r_at + j]
            self.totals[1] = self.totals[1] + given * rate[j]

        self.on.loop(edge.dim, each_freedom)

    def store(self, edge: Acting, out: Vector) -> None:
        """Add the energy of a spring."""
        on, energy = self.on, self.work.c

        def aside() -> None:
            self._between(edge, Relative(NO_INTEGERS, 0, on.scratch(Relative.real_width).cells, 0))

        def in_joint() -> None:
            copy(on, self.q.part(edge.q_at, edge.size), self.work.x.part(0, edge.size))

        on.when(on.same(edge.kind, ON_BODIES), aside, in_joint)
        self._evaluate(edge.spring, stored=True)
        out[1], out[2] = out[1] + energy[0], out[2] + on.absolute(energy[0])

    def store_several(self, edge: Acting, number: Integer, out: Vector) -> None:
        """Add the energy of the relative poses of an edge and the next ones."""
        on, energy = self.on, self.work.c
        gather(on, self.tables, self.work, self.read, edge, number)
        self._evaluate(edge.several, stored=True)
        out[1], out[2] = out[1] + energy[0], out[2] + on.absolute(energy[0])

    def _several(self, edge: Acting, number: Integer) -> None:
        """Add the forces of a potential of the relative poses of an edge and the next ones, and of their friction."""
        on, w = self.on, self.work
        gather(on, self.tables, self.work, self.read, edge, number)
        self._evaluate(edge.several, stored=True)
        pull_several(on, self.tables, w, edge, number, w.e)
        on.when(edge.resisted > 0, lambda: self.unless_refused(lambda: self._resist_several(edge, number)))

    def _resist_several(self, edge: Acting, number: Integer) -> None:
        """Add the friction of relative poses that the memory of components has."""
        on, w, heat = self.on, self.work, edge.heat
        rates = 6 * edge.resisted

        def lose(j: Integer) -> None:
            self.totals[0] = self.totals[0] + w.f[j] * w.e[j]

        rates_of_several(on, self.tables, w, edge, number, w.e)
        w.e[rates] = w.temperature[heat]
        self._evaluate(edge.friction, moving=rates)
        on.loop(rates, lose)
        pull_several(on, self.tables, w, edge, number, w.f)
        self._heat_by(edge, w.f[rates])

    def _spring(self, edge: Acting, pull: Vector) -> None:
        self._evaluate(edge.spring, stored=True)

        def each_freedom(j: Integer) -> None:
            pull[j] = pull[j] - self.work.e[j]

        self.on.loop(edge.dim, each_freedom)

    def _friction(self, edge: Acting, number: Integer, rate: Vector, pull: Vector) -> None:
        w, d, heat = self.work, edge.dim, edge.heat
        copy(self.on, rate.part(0, d), w.e.part(0, d))
        w.e[d] = w.temperature[heat]
        self._evaluate(edge.friction, moving=d, onsager=self.drags is not None)
        if self.drags is not None:
            self.drags.note(self.on, self.tables, w, edge, number)
            return

        def each_freedom(j: Integer) -> None:
            pull[j] = pull[j] - w.f[j]
            self.totals[0] = self.totals[0] + w.f[j] * rate[j]

        self.on.loop(d, each_freedom)
        self._heat_by(edge, w.f[d])

    def _heat_by(self, edge: Acting, flow: Real) -> None:
        """Let the friction of an edge heat by a flow of its entropy."""
        self.s_rate[edge.heat] = self.s_rate[edge.heat] - flow
        self.made[self.tables.component[edge.friction].made] = -flow

    def conduct(self, row: ConductingComponent) -> None:
        """Add the conduction of a component to the rates of two entropies, and note what leaves the first."""
        w, rate = self.work, self.s_rate
        w.e[0], w.e[1] = w.temperature[row.one], w.temperature[row.two]
        self._evaluate(row.component)
        rate[row.one] = rate[row.one] - w.f[0]
        rate[row.two] = rate[row.two] - w.f[1]
        self.made[self.tables.component[row.component].made] = w.f[0]
