"""Quantities: what is exchanged at a port, as values; and the kinds of ports."""

from dataclasses import dataclass, replace
from math import isfinite
from types import MappingProxyType
from typing import TypeAlias, final

from ephs.operad.directory import Directory
from ephs.operad.errors import PatternError

__all__ = [
    "Interface",
    "PortType",
    "Quantities",
    "Quantity",
    "Space",
    "interface_text",
    "known_quantity",
    "name_pair",
    "quantity",
    "quantity_word",
]

# Kind of pair: dimension of its subgroup of SE(3), numbers stored for an element, names of its parameters.
_PAIRS: dict[str, tuple[int, int, tuple[str, ...]]] = {
    "revolute": (1, 1, ()),
    "prismatic": (1, 1, ()),
    "screw": (1, 1, ("pitch",)),
    "cylindrical": (2, 2, ()),
    "planar": (3, 3, ()),
    "spherical": (3, 4, ()),
    "fixed": (0, 0, ()),
    "free": (6, 7, ()),
}
_ENVIRONMENT = frozenset({"entropy", "volume", "amount"})


@final
@dataclass(frozen=True, slots=True)
class Space:
    """A manifold with a trivialised tangent bundle, by name.

    Parameters
    ----------
    name
        The key under which the semantics finds its operations; a trailing ``*`` marks a dual space.
    dim
        Dimension of the tangent fibre, so of flows and efforts.
    size
        How many numbers are stored for a point.
    parameters
        Names and values, such as the pitch of a screw in metres per radian.
    """

    name: str
    dim: int
    size: int
    parameters: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        if self.dim < 0 or self.size < self.dim:
            raise PatternError("space", found=f"{self.dim} and size {self.size}", what=self.name)
        for name, value in self.parameters:
            if not isfinite(value):
                raise PatternError("parameter", found=f"{name}={value}", what=self.name)

    def __str__(self) -> str:
        values = ", ".join(f"{name}={value:g}" for name, value in self.parameters)
        return f"{self.name}({values})" if values else self.name


@final
@dataclass(frozen=True, slots=True, repr=False)
class Quantity:
    """A physical quantity, compared by value.

    Parameters
    ----------
    kind
        Its name: ``"displacement"``, ``"momentum"``, ``"entropy"``, ``"pose"``, …
    space
        Where its values, flows and efforts live.
    parity
        +1 if it is even under time reversal, -1 if it is odd, as momenta and flux linkages are.
    frame
        Name of the frame in which it is given, to find ports connected across frames. It has no bearing on
        the semantics and is compared only where both sides carry one.

    Raises
    ------
    PatternError
        If the parity is neither +1 nor -1.
    """

    kind: str
    space: Space
    parity: int
    frame: str | None = None

    def __post_init__(self) -> None:
        if self.parity not in (1, -1):
            raise PatternError("parity", found=self.parity, what=self.kind)

    def matches(self, other: "Quantity") -> bool:
        """Whether ports of the two quantities may be connected.

        The frames decide only where both quantities carry one, so matching is transitive among quantities
        which all carry a frame and among those without, not across.
        """
        tagged = self.frame is not None and other.frame is not None
        alike = (self.kind, self.space, self.parity) == (other.kind, other.space, other.parity)
        return alike and (not tagged or self.frame == other.frame)

    def in_frame(self, frame: str | None) -> "Quantity":
        """The same quantity, given in the named frame."""
        return replace(self, frame=frame)

    @property
    def environment(self) -> bool:
        """Whether the reference environment has an intensive variable for it, as temperature for entropy."""
        return self.kind in _ENVIRONMENT

    def __str__(self) -> str:
        return f"{self.kind} on {self.space}" + (f" in frame {self.frame}" if self.frame is not None else "")

    def __repr__(self) -> str:
        word = _WORDS.get(self)
        if word is not None:
            return f"quantity.{word}"
        frame = "" if self.frame is None else f", frame={self.frame!r}"
        return f"Quantity({self.kind!r}, {self.space!r}, {self.parity!r}{frame})"


@final
@dataclass(frozen=True, slots=True)
class PortType:
    """What a port is: its quantity, and whether it bears power or only shares its state."""

    quantity: Quantity
    power: bool = True

    def __str__(self) -> str:
        return ("" if self.power else "~") + str(self.quantity)


Interface: TypeAlias = Directory[PortType]
"""Port names to port types; it may be empty."""


def interface_text(interface: Interface) -> str:
    """An interface on one line, sorted, for messages."""
    return "{" + ", ".join(f"{port}: {interface[port]}" for port in sorted(interface)) + "}"


_REAL = Space("real", 1, 1)


@final
@dataclass(frozen=True, slots=True, repr=False)
class Quantities:
    """The quantities of this package by name; other ones are made with `Quantity`.

    Scalars are real numbers. ``pose`` is a 7-vector [w, x, y, z, rx, ry, rz], ``body_momentum`` a 6-vector
    (angular, linear) in the body frame; ``direct_pose`` and ``direct_momentum`` have the same numbers, but
    the direct product SO(3) x R3 as their group.
    """

    displacement: Quantity = Quantity("displacement", _REAL, 1)
    momentum: Quantity = Quantity("momentum", _REAL, -1)
    angle: Quantity = Quantity("angle", _REAL, 1)
    angular_momentum: Quantity = Quantity("angular_momentum", _REAL, -1)
    charge: Quantity = Quantity("charge", _REAL, 1)
    flux_linkage: Quantity = Quantity("flux_linkage", _REAL, -1)
    entropy: Quantity = Quantity("entropy", _REAL, 1)
    volume: Quantity = Quantity("volume", _REAL, 1)
    pose: Quantity = Quantity("pose", Space("SE(3)", 6, 7), 1)
    body_momentum: Quantity = Quantity("momentum", Space("se(3)*", 6, 6), -1)
    direct_pose: Quantity = Quantity("pose", Space("SO(3)xR3", 6, 7), 1)
    direct_momentum: Quantity = Quantity("momentum", Space("so(3)xR3*", 6, 6), -1)

    def relative_pose(self, kind: str, **parameters: float) -> Quantity:
        """The pose of the second joint frame in the first, an element of the pair's subgroup of SE(3).

        Parameters
        ----------
        kind
            ``"revolute"``, ``"prismatic"``, ``"screw"``, ``"cylindrical"``, ``"planar"``, ``"spherical"``,
            ``"fixed"`` or ``"free"``.
        **parameters
            ``pitch`` of a screw, in metres per radian.

        Raises
        ------
        PatternError
            For an unknown kind, or parameters that the kind does not have.
        """
        dim, size, values = _pair(kind, parameters)
        return Quantity("relative_pose", Space(kind, dim, size, values), 1)

    def joint_momentum(self, kind: str, **parameters: float) -> Quantity:
        """The momentum conjugate to a relative pose; parameters and errors as there."""
        dim, _, values = _pair(kind, parameters)
        return Quantity("momentum", Space(kind + "*", dim, dim, values), -1)


def name_pair(kind: str, dim: int, size: int, parameters: tuple[str, ...] = ()) -> None:
    """Let `quantity` name the relative poses and joint momenta of a further kind of pair.

    `ephs.semantics.spaces.register_pair` calls it; what is known already may be said again.

    Parameters
    ----------
    dim, size
        Of the subgroup of SE(3), and of the numbers stored for an element.
    parameters
        Names of its parameters.

    Raises
    ------
    PatternError
        The kind is known with other numbers.
    """
    known = _PAIRS.setdefault(kind, (dim, size, parameters))
    if known != (dim, size, parameters):
        raise PatternError("pair-known", found=(dim, size, parameters), expected=known, what=kind)


def _pair(kind: str, parameters: dict[str, float]) -> tuple[int, int, tuple[tuple[str, float], ...]]:
    if kind not in _PAIRS:
        raise PatternError("pair", found=kind, expected=", ".join(sorted(_PAIRS)))
    dim, size, names = _PAIRS[kind]
    if set(parameters) != set(names):
        found, expected = ", ".join(sorted(parameters)) or "none", ", ".join(names) or "none"
        raise PatternError("pair-parameters", found=found, expected=expected, what=kind)
    return dim, size, tuple((name, float(parameters[name])) for name in names)


def quantity_word(value: Quantity) -> tuple[str, tuple[str, ...], dict[str, float]] | None:
    """The name by which the package knows the quantity, frame aside, with arguments; None for a user's own."""
    plain = value.in_frame(None)
    if plain in _WORDS:
        return _WORDS[plain], (), {}
    space, pair = plain.space, plain.space.name.rstrip("*")
    values = dict(space.parameters)
    if pair not in _PAIRS or set(values) != set(_PAIRS[pair][2]):
        return None
    for word, make in (("relative_pose", quantity.relative_pose), ("joint_momentum", quantity.joint_momentum)):
        if make(pair, **values) == plain:
            return word, (pair,), values
    return None


def known_quantity(word: str, arguments: tuple[str, ...] = (), **parameters: float) -> Quantity | None:
    """The package's quantity of this name, or None; the inverse of `quantity_word`.

    Raises
    ------
    PatternError
        For an unknown kind of pair, or parameters that it does not have.
    """
    if word in ("relative_pose", "joint_momentum") and len(arguments) == 1 and "kind" not in parameters:
        return getattr(quantity, word)(arguments[0], **parameters)
    if arguments or parameters:
        return None
    return next((value for value, known in _WORDS.items() if known == word), None)


quantity = Quantities()
_WORDS: MappingProxyType[Quantity, str] = MappingProxyType(
    {value: word for word in Quantities.__dataclass_fields__ if isinstance(value := getattr(quantity, word), Quantity)}
)
