"""Data of a mechanism's equations of motion: tables of records, addresses of its sweeps, memory of one evaluation."""

from dataclasses import dataclass
from typing import Annotated, Any, final

from ephs.mechanics.road import loops, programs
from ephs.mechanics.road.charts import Chart
from ephs.mechanics.road.cuts import Relative
from ephs.mechanics.road.rigid import SUMS
from ephs.mechanics.tree.sweeps.balances import ATTACH
from ephs.mechanics.tree.sweeps.grouping import Group, Middle
from ephs.semantics.descriptor.kernel_table import SIGNATURE
from ephs.semantics.stage import (
    Integer,
    Integers,
    Matrix,
    Record,
    Table,
    Vector,
    function,
    integer,
    integers,
    real,
    reals,
    signature_of,
)

ABOVE, BEYOND, APART, ALONG = 1, 2, 3, 4
"""End of a spring's action: above a plane z = reach of its first frame, beyond a distance, apart boxes or segments."""
ON_TREE, ON_CUT, ON_BODIES = range(3)
"""Kinds of edges in which something acts: a joint of the tree, a cut one, a spring between bodies."""
TOTALS = 3
"""Sums over a run before the flows: heat that stores take up as energy, work, heat that components of a network pass to
other entropies, as those of gases; in J."""


def _sweep(name: str) -> Any:
    returns = name in ("accelerations", "fold", "dependent")
    return function(signature_of(returns=returns, **programs.ARGUMENTS[name]))


def _loop(name: str) -> Any:
    return function(signature_of(returns=False, **loops.ARGUMENTS[name]))


class Own(Record):
    """Data of one mechanism: the functions of its class, and flags of what there is to do.

    Attributes
    ----------
    links, width
        Number of links, and of the numbers of memory of each.
    forced, driven
        1 where more than gravity acts; where joints have prescribed motions.
    attached
        1 where there is a network, which `attach` evaluates.
    islands
        How many groups of links keep momenta in every step; 0 where that is not asked for.
    falls
        1 where `accelerations` is all there is to do; else it has no address, or else the other sweeps have none.
    """

    links = integer()
    width = integer()
    forced = integer()
    driven = integer()
    attached = integer()
    islands = integer()
    falls = integer()
    accelerations = _sweep("accelerations")
    move = _sweep("move")
    fold = _sweep("fold")
    unfold = _sweep("unfold")
    resolve = _sweep("resolve")
    spread = _sweep("spread")
    axes = _sweep("axes")
    power = _sweep("power")
    dependent = _sweep("dependent")
    energy = _sweep("energy")
    rigid = _sweep("rigid")
    rows = _loop("rows")
    poses = _loop("poses")
    fit = _loop("fit")
    gaps = _loop("gaps")
    relative_rates = _loop("relative_rates")
    across = _loop("across")
    advance = _loop("advance")
    displace = _loop("move")
    velocities = _loop("velocities")
    attach = function(ATTACH)


class CompiledComponent(Record):
    """A component: its relation in machine code, and what it is called with.

    Attributes
    ----------
    law
        The function.
    dims
        Numbers of efforts, multipliers, increments and states.
    at
        Where its parameters start.
    made
        Place of the entropy that it makes, −1: none.
    onsager
        Of friction, M/θ₀ in place of the relation, where steps ask for that.
    """

    law = function(SIGNATURE)
    dims = integers(4)
    at = integer()
    made = integer()
    onsager = function(SIGNATURE)


class Acting(Record):
    """An edge in which components or given forces act.

    Attributes
    ----------
    kind
        `ON_TREE`, `ON_CUT` or `ON_BODIES`.
    first, second
        Links of its bodies, −1 for the ground.
    dim, q_at, size, r_at
        Degrees of freedom; where its element and its degrees of freedom start.
    cut
        Number among the cut joints, −1: none.
    spring, friction
        Components of the potential and of friction, −1: none.
    heat
        The entropy that takes its heat.
    several, poses
        Component of a potential of several relative poses, −1: none, and their number: those of this edge and of the
        next ones, which have 0.
    resisted
        Number of relative poses whose rates friction resists, those of this edge and the next ones; 0: the joint's own.
    support, reach
        `ABOVE` or `BEYOND`: where the second frame's place in the first is higher or farther, nothing acts; else 0.
    halves, margin
        Of `APART`: nor where boxes of these half lengths about both frames are farther from each other; of `ALONG`:
        boxes that are segments of the z axes.
    parallel
        Square of the sine of the angle between the z axes of `ALONG` below which nothing acts, either.
    inner_turn, inner_at, outer_turn, outer_at
        Its first frame in the first link's, its second in the second's.
    left
        (BᵀB)⁻¹Bᵀ in its first ``dim`` rows.
    """

    kind = integer()
    support = integer()
    first = integer()
    second = integer()
    dim = integer()
    q_at = integer()
    size = integer()
    r_at = integer()
    cut = integer()
    spring = integer()
    friction = integer()
    heat = integer()
    several = integer()
    poses = integer()
    resisted = integer()
    inner_at = reals(3)
    outer_at = reals(3)
    reach = real()
    margin = real()
    inner_turn = reals(3, 3)
    outer_turn = reals(3, 3)
    halves = reals(6)
    parallel = real()
    left = reals(6, 6)


class PushedBody(Record):
    """A body on which a given wrench acts: its link, −1 where none does, and its frame in the link's."""

    link = integer()
    turn = reals(3, 3)
    at = reals(3)


class EntropyNode(Record):
    """A store of entropy: E = c1 (exp(s/c2) − 1), or the environment's θ₀ s where there is no component, −1.

    Or, −2, a state of what is attached, which is advanced as it is; ``free``: 1 where it is not of entropy, so that
    corrections may move it.
    """

    component = integer()
    free = integer()
    c1 = real()
    c2 = real()


class ConductingComponent(Record):
    """A component that conducts between two entropies."""

    component = integer()
    one = integer()
    two = integer()


class Sink(Record):
    """The entropy, or −1, that takes what a component makes at a place; ``owner``: its component's first place.

    ``rubs``: 1 where all that the component makes becomes energy of a store of heat.
    """

    maker = integer()
    entropy = integer()
    owner = integer()
    rubs = integer()


class AttachedRate(Record):
    """A rate at which something is attached: its place among all degrees of freedom, its edge, and which degree of
    freedom of it.
    """

    place = integer()
    edge = integer()
    freedom = integer()


@final
@dataclass(frozen=True, slots=True)
class Tables:
    """A mechanism. Links are groups of bodies, parents first, in frames at their tree joints.

    Attributes
    ----------
    own
        One row.
    integers, reals, gravity
        Of the sweeps, see `ephs.mechanics.road.records`; gravity (3,) in the ground's frame.
    chart, cut, cut_numbers
        Joints, and those at which loops are cut, see `ephs.mechanics.road.cuts`.
    at, slot, row, flat, end
        The elimination of loops, see `ephs.mechanics.road.elimination.ClosingProgram`.
    island, bases
        Group of each link that may move as a whole, and how: see `ephs.mechanics.road.rigid`.
    port, net, numbers
        What is attached, and where: see `ephs.mechanics.tree.sweeps.network.Net`.
    drive, wrench, scal, supply, lead
        Given forces on the degrees of freedom of all joints, given wrenches (bodies, 6) in body frames, (h, θ₀, π₀),
        what is given to what is attached, and the accelerations (degrees of freedom,) of joints with prescribed
        motions.
    """

    own: Table[Own]
    integers: Integers
    reals: Vector
    gravity: Annotated[Vector, 3]
    chart: Table[Chart]
    cut: Integers
    cut_numbers: Vector
    at: Integers
    slot: Integers
    row: Integers
    flat: Integers
    end: Integers
    acting: Table[Acting]
    group: Table[Group]
    middle: Table[Middle]
    body: Table[PushedBody]
    node: Table[EntropyNode]
    conduction: Table[ConductingComponent]
    sink: Table[Sink]
    component: Table[CompiledComponent]
    parameters: Vector
    island: Integers
    bases: Vector
    port: Table[AttachedRate]
    net: Integers
    numbers: Vector
    drive: Vector
    wrench: Annotated[Matrix, 6]
    scal: Annotated[Vector, 3]
    supply: Vector
    lead: Vector

    @property
    def links(self) -> Integer:
        """Number of links."""
        return self.own[0].links

    @property
    def charts(self) -> Integers:
        """The integers of all charts."""
        return Integers(self.chart.integers, 0, self.chart.size * Chart.integer_width)


@final
@dataclass(frozen=True, slots=True)
class Work:
    """Memory of one evaluation.

    Attributes
    ----------
    work
        The sweeps' own: rows of links, the ground's last, which begin with `ephs.mechanics.road.records.LinkPlace`.
    pushed, force, zero
        Wrenches (links, 6) on links, in world axes about their frames' origins; forces on the tree's rates; zeros.
    attached, pulled
        Forces on the degrees of freedom of all joints: of what is attached, and all but the constraints'.
    located
        (points, 6): points of groups, and directions there, in the world.
    relative
        (cut joints, width): see `ephs.mechanics.road.cuts.Relative`.
    value, entry, covector, along, largest
        Of the rows of loops, see `ephs.mechanics.road.rows.LoopRows`.
    temperature, entropy
        Efforts and entropies of the nodes.
    x, v, e, lam, f, c, jac, scratch
        Memory of components: v and lam stay zero.
    alter, moved
        Changes of the tree's rates, and of all joints' increments.
    momenta, spin
        Of links (links, 6), as wrenches on them; of rates that have inertia of their own.
    direction, descent
        Free part of the rates; accelerations at rest by weight and springs.
    kept, released, found, torque, sums
        Of islands: momenta that steps keep, zeros, what `ephs.mechanics.road.rigid` writes, and its memory.
    still, idle, spare
        Zeros for given forces on all joints; memory for (heats, totals, flows).
    answer, fault
        A number that a function writes; the component or degree of freedom that an evaluation failed at.
    """

    work: Vector
    pushed: Annotated[Matrix, 6]
    force: Vector
    zero: Vector
    attached: Vector
    pulled: Vector
    located: Annotated[Matrix, 6]
    relative: Annotated[Matrix, Relative.real_width]
    value: Annotated[Matrix, 4]
    entry: Vector
    covector: Annotated[Matrix, 6]
    along: Annotated[Matrix, 12]
    largest: Vector
    temperature: Vector
    entropy: Vector
    x: Vector
    v: Vector
    e: Vector
    lam: Vector
    f: Vector
    c: Vector
    jac: Vector
    scratch: Vector
    alter: Vector
    moved: Vector
    momenta: Annotated[Matrix, 6]
    spin: Vector
    direction: Vector
    descent: Vector
    kept: Vector
    released: Vector
    found: Vector
    torque: Vector
    sums: Annotated[Matrix, SUMS]
    still: Vector
    idle: Vector
    spare: Vector
    answer: Annotated[Vector, 1]
    fault: Annotated[Integers, 1]

    def places(self, tables: Tables) -> Matrix:
        """Rows of links and the ground, which begin with `ephs.mechanics.road.records.LinkPlace`."""
        own = tables.own[0]
        return Matrix(self.work.cells, self.work.start, own.links + 1, own.width)
