"""A user's function against its record: what is run, proved and printed is the record, so the two must agree.

They are compared at some dozens of states and efforts from 1e-6 to 1e6, and on both sides of every number that the
function is written with. No sampling sees a window that lies between these points and is bounded by numbers that the
function computes.
"""

import random
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.derive.recording import Recording, Untraceable, record
from ephs.semantics.primitives.forms import own_tape, run_tape, stacked
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.decompositions import symmetric_eigenvalues
from ephs.semantics.stage.elementary import WHOLE_TURNS
from ephs.semantics.verdicts.checks import unit_free
from ephs.semantics.verdicts.rounding import ROUNDED, Factor, exactly, rounding, steps_of
from ephs.semantics.verdicts.trials import (
    NEAR,
    REFERENCES,
    Trial,
    affordable,
    beside,
    chosen,
    coordinates,
    special_numbers,
    trial_of,
)
from ephs.semantics.verdicts.verdict import Condition

if TYPE_CHECKING:
    from ephs.semantics.primitives.primitives import Primitive

POINTS = 32
"""Points of all sizes at which a function and its record are compared."""
MOST = 4000
"""Points beside special numbers, at most."""
OWN = 8
"""Points at which a primitive's own numbers are compared with its formula's, and calls are repeated."""
DECADES = 6.0
"""Sizes of the numbers go from 1e-6 to 1e6."""
NEIGHBOURS = 4
"""Points beside one without a value at which one is looked for."""
DEFINED = "it has a value at every state"

Point = tuple[list[float], Reference]


def require_recorded(primitive: "Primitive") -> tuple[Condition, ...]:
    """Compare a primitive's function with its record.

    Returns
    -------
    tuple of Condition
        That it has a value everywhere, open, if there is a point without one next to points that have one.

    Raises
    ------
    StructureError
        They differ, or there is no value in a part of the domain.
    """
    function = _function(primitive)
    try:
        recording = record(function, _arguments(primitive))
    except Untraceable:
        return ()
    gap, offset, beside = "", None, 0.0
    for number, (numbers, reference) in enumerate(_points(primitive, recording)):
        trial = trial_of(primitive, numbers, reference)
        given = _given(primitive, trial)
        expected = _of_record(recording, given)
        if not np.all(np.isfinite(expected)):
            here = _gap(primitive, recording, numbers, reference)  # which refuses what is no single point
            gap = gap or here
        found = _called(function, given, np.float64 if number % 2 else float)
        if found is not None:
            _require_alike(primitive, recording, trial, found, expected)
        off = beyond_rounding(primitive, trial) if number < OWN else None
        if off is not None:
            raise off
        own = _own(primitive, trial) if number < OWN else None
        if own is not None and np.all(np.isfinite(own)):
            if offset is None:  # an energy is known up to a constant
                offset = own - expected if primitive.kind == "storage" else np.zeros(1)
                beside = ROUNDED * float(np.abs([own, expected]).max()) if primitive.kind == "storage" else 0.0
            _require_alike(primitive, recording, trial, own - offset, expected, beside)
    return (Condition(DEFINED, False, ("off", f"it has none at {gap}")),) if gap else ()


def require_steady(primitive: "Primitive") -> None:
    """Call or record a primitive's function twice.

    Raises
    ------
    StructureError
        It changes between two calls.
    """
    function, arguments = _function(primitive), _arguments(primitive)
    try:
        one, two = record(function, arguments), record(function, arguments)
    except Untraceable:
        _require_same_calls(primitive, function)
        return
    if one.tape != two.tape or not np.array_equal(one.parameters, two.parameters, equal_nan=True):
        trial = trial_of(primitive, *chosen(primitive, lambda _: 0))
        here, there = (_of_record(each, _given(primitive, trial)) for each in (one, two))
        i = int(np.argmax(here != there)) if here.shape == there.shape else 0
        raise _unlike("changing", primitive, trial, i, there[i], here[i])


def beyond_rounding(
    primitive: "Primitive", trial: Trial, otherwise: StructureError | None = None
) -> StructureError | None:
    """An identity or the sign of a matrix that is off by more than rounding of its record's operations.

    Parameters
    ----------
    otherwise
        The answer where there is no matrix, or no record of it; without it the sign is not looked at.
    """
    tape = None if primitive.kernel is None else own_tape(primitive.kernel)
    if tape is None or primitive.kernel is None or primitive.kind not in ("reversible", "irreversible"):
        return otherwise
    bundle, first, irreversible = primitive.bundle, len(primitive.kernel.potentials), primitive.kind == "irreversible"
    recording = Recording(tape, primitive.kernel.parameters[first : first + tape.parameters])
    numbers, outputs, n = _flat(_given(primitive, trial)), list(tape.outputs), bundle.size
    signed = irreversible and otherwise is not None  # the search finds the simplest state
    if otherwise is not None:
        own = _own(primitive, trial)
        try:  # a record says nothing of another matrix
            expected = steps_of(recording, numbers)[outputs]
            _require_alike(primitive, recording, trial, np.zeros(0) if own is None else own, expected)
        except StructureError:
            return otherwise
    kept = [kind for kind in bundle.charges if not irreversible or kind != "entropy"]
    vectors = [("conservation", kind, bundle.indicator(kind)) for kind in kept]
    vectors += [("energy", "", np.array(numbers[:n]))] * irreversible

    def defects(factor: Factor) -> Array:
        rows = steps_of(recording, numbers, factor)[outputs].reshape(-1, n)
        turned = rows[:n] - rows[:n].T if irreversible else rows[:n] + rows[:n].T
        sign = [_negative(rows)] if signed else []
        return np.concatenate([turned, *([rows @ vector] for *_, vector in vectors), sign], axis=None)

    with np.errstate(all="ignore"):
        found = defects(exactly)
        off = ~(np.abs(found) <= rounding(defects, found)) & np.isfinite(found)
    if not off.any():
        return None
    place = int(np.argmax(off))
    if signed and place == off.size - 1:
        least = float(symmetric_eigenvalues(steps_of(recording, numbers)[outputs].reshape(n, n)).min())
        return StructureError("definite", primitive.name, found=least, witness=trial.witness(primitive, (), least))
    kind, charge, entry = "symmetry" if irreversible else "isotropy", "", (place // n, place % n)
    if place >= n * n:
        number, row = divmod(place - n * n, len(outputs) // n)
        (kind, charge, _), entry = vectors[number], (row,)
    size = float(found[place])
    witness = trial.witness(primitive, entry, size)
    return StructureError(kind, primitive.name, found=size, entry=entry, witness=witness, quantity=charge)


def _negative(matrix: Array) -> float:
    """The least eigenvalue of M in units of its diagonal where it is negative, else 0; NaN where M has no value."""
    _, scaled, allowed = unit_free(matrix)
    least = float(symmetric_eigenvalues(scaled).min(initial=0.0)) if np.all(np.isfinite(scaled)) else np.nan
    return min(least + allowed, 0.0)


def _function(primitive: "Primitive") -> Callable[..., Any]:
    """What is recorded: the formula with its parameters, its matrices as one."""
    formula, given = primitive.formula, dict(primitive.parameters)
    assert formula is not None
    numbers = {name: given[name] for name in formula.parameters}

    def whole(**values: Any) -> Any:
        return function(**values, **numbers)

    function = formula.function
    if primitive.kind == "reversible":
        function = stacked(formula, primitive.bundle.size, primitive.multipliers)
    return whole if numbers else function


def _arguments(primitive: "Primitive") -> dict[str, int | None]:
    """Names of the arguments with how many numbers a vector has, None of a number: efforts, then states."""
    sizes: dict[str, int] = {}
    if primitive.kind == "irreversible":
        sizes = {str(port): where.stop - where.start for port, where, _ in primitive.bundle.items()}
    for port in primitive.reads:
        sizes.setdefault(str(port), manifold(primitive.interface[port].quantity.space).size)
    return {name: None if size == 1 else size for name, size in sizes.items()}


def _given(primitive: "Primitive", trial: Trial) -> dict[str, Array]:
    """The arguments at a trial, energy efforts first."""
    given: dict[str, Array] = {}
    if primitive.kind == "irreversible":
        bundle = primitive.bundle
        energy = trial.efforts + bundle.intensive(trial.reference)
        given = {str(port): effort for port, effort in bundle.split(energy).items()}
    for port in primitive.reads:
        given.setdefault(str(port), np.asarray(trial.states[port], dtype=float))
    return given


def _points(primitive: "Primitive", recording: Recording) -> Iterator[Point]:
    """Numbers of all sizes, the simplest first, then those that the function is written with."""
    source, where = random.Random(21), coordinates(primitive)
    simple, reference = chosen(primitive, lambda _: 0)
    yield simple, reference
    for i in range(len(where)):
        for value in (0.0, -simple[i]):
            if where[i].low < value < where[i].high:
                yield [*simple[:i], value, *simple[i + 1 :]], reference
    for number in range(POINTS):
        if number % 2:
            yield chosen(primitive, source.randrange)
            continue
        numbers: list[float] = []
        for coordinate in where:
            size = source.choice((1.0, -1.0)) * 10.0 ** source.uniform(-DECADES, DECADES)
            numbers.append(source.uniform(-3.0, 3.0) if coordinate.angle else coordinate.within(size))
        yield numbers, REFERENCES[number // 2 % len(REFERENCES)]
    near = beside(primitive, special_numbers(primitive, recording.parameters))
    for numbers in islice(near, affordable(primitive, MOST)):
        yield numbers, reference


def _of_record(recording: Recording, given: Mapping[str, Array]) -> Array:
    return run_tape(recording.tape, _flat(given), recording.parameters).ravel()


def _flat(given: Mapping[str, Array]) -> list[float]:
    return [float(entry) for values in given.values() for entry in values]


def _called(function: Callable[..., Any], given: Mapping[str, Array], kind: type) -> Array | None:
    """The function's numbers for numbers; None where it says that there are none."""
    try:
        with np.errstate(all="ignore"):
            found: Any = function(**{name: kind(x[0]) if x.size == 1 else x for name, x in given.items()})
            return np.asarray(np.asarray(found, dtype=object), dtype=float).ravel()
    except (ArithmeticError, TypeError, ValueError):  # no value, or none that is real
        return None


def _own(primitive: "Primitive", trial: Trial) -> Array | None:
    """What a primitive says itself, which may not be its formula; None where it says nothing."""
    try:
        with np.errstate(all="ignore"):
            if primitive.kind == "irreversible":
                return primitive.matrix(trial.states, trial.efforts, trial.reference).ravel()
            if primitive.kind == "reversible":
                return np.concatenate([part.ravel() for part in primitive.structure(trial.states)])
            return np.array([primitive.energy(trial.states)]) if primitive.kind == "storage" else None
    except (ArithmeticError, ValueError):
        return None


def _require_alike(
    primitive: "Primitive", recording: Recording, trial: Trial, found: Array, expected: Array, beside: float = 0.0
) -> None:
    """Refuse a number that is not the record's, by more than both may be rounded, and by more than ``beside``."""
    if found.shape != expected.shape:
        raise _unlike("unlike", primitive, trial, 0, found.shape, expected.shape)
    with np.errstate(all="ignore"):
        apart = np.abs(found - expected) > beside + ROUNDED * np.maximum(np.abs(found), np.abs(expected))
        apart |= np.isnan(found) != np.isnan(expected)
    if not apart.any():
        return
    numbers = _flat(_given(primitive, trial))
    outputs = list(recording.tape.outputs)
    allowed = rounding(lambda factor: steps_of(recording, numbers, factor)[outputs], expected)
    with np.errstate(all="ignore"):
        apart &= ~(np.abs(found - expected) <= beside + allowed)
    if apart.any() and not _overflows(recording, numbers):  # what overflows may do so elsewhere
        i = int(np.argmax(apart))
        raise _unlike("unlike", primitive, trial, i, found[i], expected[i])


def _overflows(recording: Recording, numbers: list[float]) -> bool:
    """Whether an operation's result is infinite, or an angle too large for a sine."""
    found = steps_of(recording, numbers)
    turned = [i for name, places, _ in recording.tape.operations if name in ("sin", "cos", "tan") for i in places]
    return bool(np.any(np.isinf(found)) or np.any(np.abs(found[turned]) > WHOLE_TURNS))


def _gap(primitive: "Primitive", recording: Recording, numbers: list[float], reference: Reference) -> str:
    """The point, if a function has a value near it; empty where its numbers are too large.

    Raises
    ------
    StructureError
        It has none around the point either.
    """
    trial = trial_of(primitive, numbers, reference)
    source = random.Random(24)
    for _ in range(NEIGHBOURS):
        shifts = [source.uniform(-NEAR, NEAR) for _ in numbers]
        moved = [x * (1.0 + shift) if x else shift for x, shift in zip(numbers, shifts, strict=True)]
        if np.all(np.isfinite(_of_record(recording, _given(primitive, trial_of(primitive, moved, reference))))):
            return str(trial.witness(primitive))
    if _overflows(recording, _flat(_given(primitive, trial))):
        return ""
    what = {"storage": "the energy", "reversible": "the structure"}.get(primitive.kind, "the matrix M")
    raise StructureError("no-value", primitive.name, what=what, witness=trial.witness(primitive))


def _require_same_calls(primitive: "Primitive", function: Callable[..., Any]) -> None:
    """Refuse a function that cannot be recorded and changes between two calls."""
    source = random.Random(23)
    trials = [trial_of(primitive, *chosen(primitive, source.randrange if n else lambda _: 0)) for n in range(OWN)]
    first = [_called(function, _given(primitive, trial), float) for trial in trials]
    for trial, one in zip(reversed(trials), reversed(first), strict=True):
        two = _called(function, _given(primitive, trial), float)
        if one is not None and two is not None and not np.array_equal(one, two, equal_nan=True):
            i = int(np.argmax(one != two)) if one.shape == two.shape else 0
            raise _unlike("changing", primitive, trial, i, two.ravel()[i], one.ravel()[i])


def _unlike(
    kind: str, primitive: "Primitive", trial: Trial, entry: int, found: object, expected: object
) -> StructureError:
    n = primitive.bundle.size
    place = () if primitive.kind == "storage" else (entry // n, entry % n)
    size = abs(found - expected) if isinstance(found, float) and isinstance(expected, float) else 0.0
    witness = trial.witness(primitive, place, float(size))
    return StructureError(kind, primitive.name, found=found, expected=expected, entry=place or 0, witness=witness)
