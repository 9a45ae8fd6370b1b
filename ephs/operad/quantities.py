"""Quantities exchanged at ports, and kinds of ports."""

from dataclasses import dataclass, replace
from math import isfinite
from types import MappingProxyType
from typing import Any, TypeAlias, final

from ephs.operad.charges import KINDS, PLAIN, POSITIVE, WHOLE, Charges, Domain, charges_of, require_domain
from ephs.operad.directory import Directory
from ephs.operad.errors import PatternError
from ephs.operad.messages import nearest_of
from ephs.operad.units import dimension

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


_REAL = Space("real", 1, 1)


@final
@dataclass(frozen=True, slots=True, repr=False)
class Quantity:
    """A physical quantity, compared by value.

    Parameters
    ----------
    kind
        Its name: ``"displacement"``, ``"momentum"``, ``"entropy"``, ``"pose"``, …
    space
        The space of its values, flows and efforts.
    parity
        +1 if it is even under time reversal, -1 if it is odd, as momenta and flux linkages are.
    frame
        Name of the frame in which it is given, to find ports connected across frames (`ephs.operad.frames`). It has
        no bearing on the semantics, and none on which interfaces match.
    domain
        Open interval of its numbers, such as (0, inf); for states on vector spaces only.
    charges
        Conserved contents: pairs, or a mapping, of a name and the amount per unit of each number.
        For a species the names are elements, so the charges of several quantities form an element matrix. The
        reference environment has an intensive value for each charge: the temperature for ``"entropy"``, the
        pressure for ``"volume"``, and potentials for all others.
    unit
        Such as ``"kg m²/s"``; empty if unknown.

    Scalars of the package's kinds have the domain, charges and unit of the kind by default.

    Raises
    ------
    PatternError
        The parity is neither +1 nor -1, the domain is empty, a charge is not a number for each direction, or entropy
        is carried by another kind than ``"entropy"``.
    """

    kind: str
    space: Space
    parity: int
    frame: str | None = None
    domain: Domain = WHOLE
    charges: Charges = ()
    unit: str = ""

    def __post_init__(self) -> None:
        if self.parity not in (1, -1):
            raise PatternError("parity", found=self.parity, what=self.kind)
        known = KINDS.get(self.kind, PLAIN) if self.space == _REAL else PLAIN
        given = charges_of(self.kind, self.space.dim, self.charges)
        object.__setattr__(self, "domain", known.domain if self.domain == WHOLE else self.domain)
        object.__setattr__(self, "charges", given or known.charges)
        object.__setattr__(self, "unit", self.unit or known.unit)
        dimension(self.unit)
        require_domain(self.kind, self.domain)
        if self.space.name != "real" and (self.domain != WHOLE or self.charges):
            expected = "neither a domain nor charges: they are of vector spaces, Space('real', n, n)"
            raise PatternError("domain", what=self.kind, found=f"those of {self.space}", expected=expected)

    def matches(self, other: "Quantity") -> bool:
        """Whether ports of the two quantities may be connected.

        An equivalence: frames do not count, and units are compared by what they are made of.
        """
        if self == other:
            return True
        same = replace(other, frame=self.frame, unit=self.unit) == self
        return same and dimension(self.unit) == dimension(other.unit)

    def in_frame(self, frame: str | None) -> "Quantity":
        """The same quantity, given in the named frame."""
        return self if frame == self.frame else replace(self, frame=frame)

    @property
    def environment(self) -> bool:
        """Whether it carries a charge: the reference environment has an intensive value for each."""
        return bool(self.charges)

    @property
    def positive(self) -> bool:
        """Whether its numbers are positive, all over its domain."""
        return self.domain[0] >= 0.0

    def __str__(self) -> str:
        plain = self.in_frame(None)
        own = "" if quantity_word(plain) is not None else "".join(_own(plain))
        return f"{self.kind} on {self.space}{own}" + (f" in frame {self.frame}" if self.frame is not None else "")

    def __repr__(self) -> str:
        word = _WORDS.get(self)
        if word is not None:
            return f"quantity.{word}"
        default = Quantity(self.kind, self.space, self.parity)
        given = [
            f", {name}={getattr(self, name)!r}".replace("inf", "float('inf')" if name == "domain" else "inf")
            for name in ("frame", "domain", "charges", "unit")
            if getattr(self, name) != getattr(default, name)
        ]
        return f"Quantity({self.kind!r}, {self.space!r}, {self.parity!r}{''.join(given)})"


def _own(of: Quantity) -> list[str]:
    """Difference of a user's quantity from others, in words."""
    low, high = of.domain
    carried = ", ".join(f"{name} {', '.join(f'{n:g}' for n in row)}" for name, row in of.charges)
    return [
        f" in {of.unit}" if of.unit else "",
        f" between {low:g} and {high:g}" if of.domain != WHOLE else "",
        f" with {carried}" if carried else "",
    ]


@final
@dataclass(frozen=True, slots=True)
class PortType:
    """Type of a port: its quantity, and whether it bears power or only shares its state."""

    quantity: Quantity
    power: bool = True

    def __str__(self) -> str:
        return ("" if self.power else "~") + str(self.quantity)


Interface: TypeAlias = Directory[PortType]
"""Port names to port types; it may be empty."""


def interface_text(interface: Interface) -> str:
    """An interface on one line, sorted, for messages."""
    return "{" + ", ".join(f"{port}: {interface[port]}" for port in sorted(interface)) + "}"


@final
@dataclass(frozen=True, slots=True, repr=False)
class Quantities:
    """The quantities of this package by name; other ones are made with `Quantity`.

    Scalars are real numbers; volumes and amounts are positive. An ``amount`` is of nothing in particular, ``species``
    are amounts of a substance. The volume of a ``liquid`` counts its pressure from the environment's. ``pose`` is a
    7-vector [w, x, y, z, rx, ry, rz], ``body_momentum`` a 6-vector (angular, linear) in the body frame;
    ``direct_pose`` and ``direct_momentum`` have the same numbers, but the direct product SO(3) x R3 as their group.
    """

    displacement: Quantity = Quantity("displacement", _REAL, 1)
    momentum: Quantity = Quantity("momentum", _REAL, -1)
    angle: Quantity = Quantity("angle", _REAL, 1)
    angular_momentum: Quantity = Quantity("angular_momentum", _REAL, -1)
    charge: Quantity = Quantity("charge", _REAL, 1)
    flux_linkage: Quantity = Quantity("flux_linkage", _REAL, -1)
    entropy: Quantity = Quantity("entropy", _REAL, 1)
    volume: Quantity = Quantity("volume", _REAL, 1)
    amount: Quantity = Quantity("amount", _REAL, 1)
    magnetic_flux: Quantity = Quantity("magnetic_flux", _REAL, -1)
    liquid: Quantity = Quantity("liquid", _REAL, 1)
    pressure_impulse: Quantity = Quantity("pressure_impulse", _REAL, -1)
    pose: Quantity = Quantity("pose", Space("SE(3)", 6, 7), 1)
    body_momentum: Quantity = Quantity("momentum", Space("se(3)*", 6, 6), -1)
    direct_pose: Quantity = Quantity("pose", Space("SO(3)xR3", 6, 7), 1)
    direct_momentum: Quantity = Quantity("momentum", Space("so(3)xR3*", 6, 6), -1)

    def __getattr__(self, name: str) -> Any:
        if name == Quantity.__name__:  # makes other ones; it is no quantity, and so no name among them
            return Quantity
        raise AttributeError(f"there is no quantity {name!r}{nearest_of(name, quantity_names())}")

    def species(self, name: str, /, **elements: float) -> Quantity:
        """The amount of a substance in mol, with its composition: atoms, or other units, of each element.

        Parameters
        ----------
        name
            Of the substance: isomers are species of their own.
        **elements
            Atoms by element; where there are none, the substance itself counts as one.

        Examples
        --------
        >>> quantity.species("H2O", H=2, O=1).charges
        (('H', (2.0,)), ('O', (1.0,)))

        Raises
        ------
        PatternError
            An element's number is not finite, or is zero.
        """
        made = elements or {name: 1.0}
        if zero := [element for element, number in made.items() if number == 0.0]:
            raise PatternError("charges", what=name, found=f"{zero[0]}: 0", expected="numbers other than zero")
        rows = tuple((element, (number,)) for element, number in made.items())
        return Quantity(f"amount of {name}", _REAL, 1, domain=POSITIVE, charges=rows, unit="mol")

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
    """Register in `quantity` the relative poses and joint momenta of a further kind of pair.

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
        raise PatternError("pair", found=kind, expected=", ".join(sorted(_PAIRS)) + nearest_of(kind, _PAIRS))
    dim, size, names = _PAIRS[kind]
    if set(parameters) != set(names):
        found, expected = ", ".join(sorted(parameters)) or "none", ", ".join(names) or "none"
        raise PatternError("pair-parameters", found=found, expected=expected, what=kind)
    return dim, size, tuple((name, float(parameters[name])) for name in names)


def quantity_word(value: Quantity) -> tuple[str, tuple[str, ...], dict[str, float]] | None:
    """The quantity's name in the package with arguments, without the frame; None for a user-defined quantity."""
    plain = value.in_frame(None)
    if plain in _WORDS:
        return _WORDS[plain], (), {}
    space, pair = plain.space, plain.space.name.rstrip("*")
    values = dict(space.parameters)
    if (name := plain.kind.removeprefix("amount of ")) != plain.kind:
        elements = {element: row[0] for element, row in plain.charges if len(row) == 1}
        return ("species", (name,), elements) if quantity.species(name, **elements) == plain else None
    if pair not in _PAIRS or set(values) != set(_PAIRS[pair][2]):
        return None
    for word, make in (("relative_pose", quantity.relative_pose), ("joint_momentum", quantity.joint_momentum)):
        if make(pair, **values) == plain:
            return word, (pair,), values
    return None


def quantity_names() -> list[str]:
    """Names of the quantities of this package, and of its functions that make some."""
    return [word for word in dir(type(quantity)) if not word.startswith("_")]


def known_quantity(word: str, arguments: tuple[str, ...] = (), **parameters: float) -> Quantity | None:
    """The package's quantity of this name, or None; the inverse of `quantity_word`.

    Raises
    ------
    PatternError
        For an unknown kind of pair, or parameters that it does not have.
    """
    if word in ("relative_pose", "joint_momentum") and len(arguments) == 1 and "kind" not in parameters:
        return getattr(quantity, word)(arguments[0], **parameters)
    if word == "species" and len(arguments) == 1:
        return quantity.species(arguments[0], **parameters)
    if arguments or parameters:
        return None
    return next((value for value, known in _WORDS.items() if known == word), None)


quantity = Quantities()
_WORDS: MappingProxyType[Quantity, str] = MappingProxyType(
    {value: word for word in Quantities.__dataclass_fields__ if isinstance(value := getattr(quantity, word), Quantity)}
)
