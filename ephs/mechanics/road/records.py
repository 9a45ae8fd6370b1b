"""Records of a tree of links for the sweeps: constants, intermediate results, kinds of joints."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar, final

from ephs.semantics.stage import Evaluator, Integer, Real, Record, integer, real, reals

Row = TypeVar("Row")


class LinkConstants(Record):
    """Constants of a link, in the frame at its tree joint; parents come first, the ground is the row after the last.

    Attributes
    ----------
    parent
        Row of the parent.
    kind
        Number of the joint in `Tree.joints`.
    q_at, r_at
        Where the joint's element and rates start.
    sense
        1 where the joint is walked from its first to its second body, else −1; elements of abelian pairs take it.
    rotation, place
        The joint's first frame in the parent's frame.
    shift
        Angle in rad of a revolute joint's first frame about z, beyond `rotation`.
    mass, moment, inertia
        In kg, kg m, and kg m² about the frame's origin (upper triangle).
    armature
        Inertia of the joint's rate itself, as of a rotor that it turns.
    """

    parent = integer()
    kind = integer()
    q_at = integer()
    r_at = integer()
    sense = real()
    shift = real()
    rotation = reals(3, 3)
    place = reals(3)
    mass = real()
    moment = reals(3)
    inertia = reals(6)
    armature = real()


class LinkPlace(Record):
    """Motion of a link, in world axes about the origin of its frame: what stands first in its `LinkState`.

    Attributes
    ----------
    turn, at
        The link's frame in the world.
    twist, bias
        Twist (ω, υ), and the acceleration at ṙ = 0, in which gravity and prescribed accelerations are.
    change
        Acceleration beyond the bias.
    """

    turn = reals(3, 3)
    at = reals(3)
    twist = reals(6)
    bias = reals(6)
    change = reals(6)


class LinkState(Record):
    """Quantities of a link that the sweeps keep, in world axes about the origin of its frame.

    Attributes
    ----------
    turn, at, twist, bias, change
        See `LinkPlace`.
    down
        The frame's origin from that of the link's parent.
    axes
        Twists S of a joint's rates in its first ``dim`` rows, of joints that are walked backward.
    load
        Wrench that the link and what it carries need beyond inertia · change.
    angular, mixed, linear
        Articulated inertia [[A, C], [Cᵀ, M]]: upper triangles of A and M, rows of C.
    gain, inverse, push
        D⁻¹Uᵀ, D⁻¹ (upper triangle) and D⁻¹(τ − SᵀP) of the joint.
    reach
        Length of the way from the ground's origin, along the joints, in m.
    """

    turn = reals(3, 3)
    at = reals(3)
    twist = reals(6)
    bias = reals(6)
    change = reals(6)
    down = reals(3)
    axes = reals(6, 6)
    load = reals(6)
    angular = reals(6)
    mixed = reals(3, 3)
    linear = reals(6)
    gain = reals(6, 6)
    inverse = reals(21)
    push = reals(6)
    reach = real()


@final
@dataclass(frozen=True, slots=True)
class JointKind:
    """A kind of joints: a subgroup of SE(3), known while a program is staged.

    Attributes
    ----------
    code, size
        The group, and how many numbers an element has.
    basis
        Columns (d, 6) of B, orthogonal.
    backward
        Walked from its second to its first body, in a group that is not abelian: its element is inverted.
    driven
        Its motion is prescribed.
    armature
        Its rate has inertia of its own.
    """

    code: int
    size: int
    basis: tuple[tuple[float, ...], ...]
    backward: bool = False
    driven: bool = False
    armature: bool = False

    @property
    def dim(self) -> int:
        """Number of its freedoms."""
        return len(self.basis)

    @property
    def round(self) -> bool:
        """It turns about its frame's origin and may move along, so that its freedoms are those of any other axes."""
        units = tuple(tuple(float(i == j) for j in range(6)) for i in range(6))
        return self.basis == units[:3] or (self.basis == units and not self.backward)

    @property
    def revolute(self) -> bool:
        """It turns about z, and that is all."""
        return self.basis == ((0.0, 0.0, 1.0, 0.0, 0.0, 0.0),)


class Links(Protocol):
    """Constants of links, by row."""

    def of(self, i: Integer, kind: int | None) -> LinkConstants:
        """Row i, which is known to have the kind of joint with this number."""
        ...


class LinkStates(Protocol):
    """Memory of links and the ground, by row."""

    def __getitem__(self, i: Integer, /) -> LinkState: ...


@final
@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """A mechanism without loops.

    Attributes
    ----------
    joints
        The kinds of joints in it.
    size
        How many links; row `size` of the states is the ground's.
    gravity
        (3,) in the ground's frame.
    planar
        All moves parallel to the plane of x and y, and all joints turn about z or slide.
    """

    joints: tuple[JointKind, ...]
    size: Integer
    links: Links
    states: LinkStates
    gravity: list[Real]
    planar: bool

    def units(self, joint: JointKind) -> dict[int, int]:
        """Entries of a twist that are degrees of freedom -> number of the degree of freedom, where that is known while
        staging: a joint that turns about the plane's normal, or about or along all axes. None where rates have inertia.
        """
        if joint.armature:
            return {}
        return {k: k for k in range(joint.dim)} if joint.round else {2: 0} if self.planar and joint.revolute else {}

    def each(self, on: Evaluator, body: Callable[[Integer], None], *, down: bool = False) -> None:
        """Call body(i) for all links, parents first, or last; written out where their number is known."""
        if isinstance(self.size, int):
            for i in range(self.size - 1, -1, -1) if down else range(self.size):
                body(i)
        else:
            on.loop(self.size, body, down=down)

    def visit(self, on: Evaluator, i: Integer, body: Callable[[JointKind, LinkConstants], None]) -> None:
        """Call body(joint, link) of link i with the kind of its joint, which is then known."""
        kind = self.links.of(i, None).kind

        def among(first: int) -> None:
            if first == len(self.joints) - 1:
                body(self.joints[first], self.links.of(i, first))
            else:
                on.when(
                    on.same(kind, first),
                    lambda: body(self.joints[first], self.links.of(i, first)),
                    lambda: among(first + 1),
                )

        if self.joints:
            among(0)
