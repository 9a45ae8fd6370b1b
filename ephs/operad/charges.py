"""Domains and conserved charges of quantities, and those of known kinds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from types import MappingProxyType
from typing import TypeAlias, cast, final

from ephs.operad.errors import PatternError

Domain: TypeAlias = tuple[float, float]
"""An open interval, in which each number of a state lies."""
Charges: TypeAlias = tuple[tuple[str, tuple[float, ...]], ...]
"""Name of a conserved charge -> how much of it a unit of each number of the state carries; sorted by name."""
WHOLE: Domain = (-inf, inf)
POSITIVE: Domain = (0.0, inf)
ENTROPY, VOLUME = "entropy", "volume"
"""The charges whose reference values are the temperature and the pressure of the environment."""


@final
@dataclass(frozen=True, slots=True)
class ChargeKind:
    """Defaults of scalars of a kind."""

    unit: str = ""
    domain: Domain = WHOLE
    charges: Charges = ()


PLAIN = ChargeKind()
KINDS: Mapping[str, ChargeKind] = MappingProxyType(
    {
        "displacement": ChargeKind("m"),
        "momentum": ChargeKind("kg m/s"),
        "angle": ChargeKind("rad"),
        "angular_momentum": ChargeKind("kg m²/s"),
        "charge": ChargeKind("C"),
        "flux_linkage": ChargeKind("Wb"),
        "magnetic_flux": ChargeKind("Wb"),
        "entropy": ChargeKind("J/K", charges=((ENTROPY, (1.0,)),)),
        "volume": ChargeKind("m³", POSITIVE, ((VOLUME, (1.0,)),)),
        "liquid": ChargeKind("m³", POSITIVE, (("liquid", (1.0,)),)),
        "pressure_impulse": ChargeKind("Pa s"),
        "amount": ChargeKind("mol", POSITIVE),
    }
)
"""Predefined kinds of scalars."""


def charges_of(kind: str, dim: int, given: object) -> Charges:
    """Normalised charges from pairs or a mapping; a scalar's may be a bare number.

    Raises
    ------
    PatternError
        A charge is not ``dim`` finite numbers, or entropy is carried by what is not of that kind.
    """
    expected = f"a name and {dim} finite number{'s' * (dim != 1)} each"
    try:
        pairs = dict(cast("Mapping[str, object]", given))
    except (TypeError, ValueError):
        raise PatternError("charges", what=kind, found=given, expected=expected) from None
    out: list[tuple[str, tuple[float, ...]]] = []
    for name, value in pairs.items():
        numbers = cast("Sequence[float]", value if isinstance(value, Sequence) else (value,))
        try:
            row = tuple(float(number) for number in numbers)
        except (TypeError, ValueError):
            row = ()
        if len(row) != dim or not all(map(isfinite, row)):
            raise PatternError("charges", what=kind, found=f"{name}: {value!r}", expected=expected)
        if any(row):
            out.append((name, row))
    found = tuple(sorted(out))
    if found and (kind == ENTROPY or ENTROPY in dict(found)) and (kind, found) != (ENTROPY, KINDS[ENTROPY].charges):
        expected = "entropy, once, and nothing else of the kind 'entropy'; and no entropy of other kinds"
        raise PatternError("charges", what=kind, found=dict(found), expected=expected)
    return found


def require_domain(kind: str, domain: object) -> None:
    """Raise an error unless the value is an open interval."""
    match domain:
        case (float() | int() as low, float() | int() as high) if low < high:
            return
        case _:
            raise PatternError("domain", what=kind, found=domain, expected="two numbers, the first less than the other")
