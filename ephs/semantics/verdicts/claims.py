"""What is claimed of a primitive: its formulas as terms, and of which ports they are."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast, final

import numpy as np

from ephs.semantics.derive.recording import Untraceable, record
from ephs.semantics.spaces import codes, manifold
from ephs.semantics.symbols.bounds import Interval
from ephs.semantics.symbols.terms import Term, recorded
from ephs.semantics.verdicts.trials import extent

if TYPE_CHECKING:
    from ephs.semantics.primitives.primitives import Primitive


@final
@dataclass(frozen=True, slots=True)
class Seen:
    """A port that a formula reads.

    Parameters
    ----------
    symbols
        Terms of its numbers.
    bounds
        Least and largest value of each number.
    code
        Of the space.
    """

    symbols: tuple[Term, ...]
    bounds: Interval
    code: int
    parity: int


@final
@dataclass(frozen=True, slots=True)
class Claim:
    """What is claimed of a primitive.

    Parameters
    ----------
    kind
        Of primitive; says which conditions.
    outputs
        The energy; or L (n, n) above C (k, n), row by row; or M (n, n).
    seen
        Ports in the order of their numbers; the first n numbers of an irreversible process are its energy efforts.
    parity
        (n,) of the fibre.
    conserved
        (n,) amounts of each charge that must be conserved.
    hot
        (n,) whether an effort is a temperature.
    gradient
        As it is given, of a storage.
    signs
        Sign of each parameter that stands for all numbers of it.
    """

    kind: str
    outputs: tuple[Term, ...]
    seen: tuple[Seen, ...]
    parity: tuple[int, ...]
    conserved: tuple[tuple[float, ...], ...]
    hot: tuple[bool, ...]
    gradient: tuple[Term, ...] | None
    signs: Mapping[str, int]

    @property
    def bounds(self) -> dict[Term, Interval]:
        """Bounds of each symbol."""
        of = {1: (0.0, math.inf), 0: (0.0, 0.0), -1: (-math.inf, 0.0)}
        known: dict[Term, Interval] = {name: of[sign] for name, sign in self.signs.items()}
        return known | {symbol: port.bounds for port in self.seen for symbol in port.symbols}


def claim_of(primitive: "Primitive", signs: Mapping[str, int]) -> Claim:
    """What is claimed of a primitive with a formula; of all that differ in parameters of the same signs only.

    Raises
    ------
    Untraceable
        The formula needs numbers.
    """
    from ephs.semantics.primitives.forms import stacked

    formula, bundle = primitive.formula, primitive.bundle
    assert formula is not None
    efforts = bundle.ports if primitive.kind == "irreversible" else ()
    seen: list[Seen] = []
    sizes: dict[str, int | None] = {}
    for port in (*efforts, *(port for port in primitive.reads if port not in efforts)):
        quantity = primitive.interface[port].quantity
        space = manifold(quantity.space)
        size = space.size if port in primitive.reads else quantity.space.dim
        symbols: tuple[Term, ...] = (str(port),) if size == 1 else tuple(("entry", str(port), i) for i in range(size))
        code = space.code if port in primitive.reads else codes.VECTOR
        seen.append(Seen(symbols, extent(primitive, port, quantity), code, quantity.parity))
        sizes[str(port)] = None if size == 1 else size
    inputs = [*(symbol for port in seen for symbol in port.symbols), *signs]
    k = primitive.multipliers if primitive.kind == "reversible" else 0
    called = stacked(formula, bundle.size, k) if primitive.kind == "reversible" else formula.function

    def terms(function: Callable[..., Any]) -> tuple[Term, ...]:
        return recorded(record(function, {**sizes, **dict.fromkeys(signs)}), inputs)

    outputs = terms(called)
    expected = 1 if primitive.kind == "storage" else bundle.size * (bundle.size + k)
    if len(outputs) != expected:
        raise Untraceable(f"{len(outputs)} numbers where {expected} are wanted")
    gradient = None if formula.gradient is None else terms(flat_gradient(formula.gradient))
    return of_formulas(primitive, outputs, tuple(seen), gradient, signs)


def of_formulas(
    primitive: "Primitive",
    outputs: tuple[Term, ...],
    seen: tuple[Seen, ...] = (),
    gradient: tuple[Term, ...] | None = None,
    signs: Mapping[str, int] | None = None,
) -> Claim:
    """The claim that formulas are those of a primitive."""
    bundle = primitive.bundle
    kept = [kind for kind in bundle.charges if (primitive.kind, kind) != ("irreversible", "entropy")]
    return Claim(
        primitive.kind,
        outputs,
        seen,
        tuple(map(int, bundle.parity())),
        tuple(tuple(map(float, bundle.indicator(kind))) for kind in kept),
        tuple(bool(amount) for amount in bundle.indicator("entropy")),
        gradient,
        signs or {},
    )


def flat_gradient(function: Callable[..., Any]) -> Callable[..., Any]:
    """A gradient that is given port by port as one vector."""

    def flat(**x: Any) -> Any:
        found = function(**x)
        parts = cast("Sequence[Any]", found) if isinstance(found, list | tuple) else (found,)
        return np.concatenate([np.atleast_1d(np.asarray(part, dtype=object)) for part in parts])

    return flat


def frame_of(port: Seen) -> list[list[Term]]:
    """(numbers, dimension) of a point: the derivatives of x·exp(v) by v at v = 0."""
    x = port.symbols
    if port.code == codes.VECTOR:
        return [[float(i == j) for j in range(len(x))] for i in range(len(x))]
    if port.code == codes.SE2:
        c, s = ("cos", x[0]), ("sin", x[0])
        return [[1.0, 0.0, 0.0], [0.0, c, ("-", s)], [0.0, s, c]]
    w, v = x[0], x[1:4]
    cross = _cross(v)
    half: list[list[Term]] = [[("*", -0.5, entry) for entry in v]]
    rows: list[list[Term]] = [
        [("*", 0.5, ("+", w if i == j else 0.0, cross[i][j])) for j in range(3)] for i in range(3)
    ]
    half += rows
    if port.code == codes.SO3:
        return half
    place: list[list[Term]] = [[float(i == j) for j in range(3)] for i in range(3)]
    if port.code == codes.SE3:  # 1 − 2 |v|² + 2 (v vᵀ + w [v]×)
        square: Term = ("-", 0.5, ("+", *(("*", entry, entry) for entry in v)))
        more = [[("+", ("*", v[i], v[j]), ("*", w, cross[i][j])) for j in range(3)] for i in range(3)]
        place = [[("*", 2.0, ("+", more[i][j], square if i == j else 0.0)) for j in range(3)] for i in range(3)]
    zero: list[Term] = [0.0, 0.0, 0.0]
    return [*([*row, *zero] for row in half), *([*zero, *row] for row in place)]


def _cross(v: Sequence[Term]) -> list[list[Term]]:
    a, b, c = v
    return [[0.0, ("-", c), b], [c, 0.0, ("-", a)], [("-", b), a, 0.0]]
