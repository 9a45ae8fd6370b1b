"""The search for a state and effort at which a structure fails, and the way from there to the simplest one.

It needs no library: primitives are made inside of property tests, too, where no other may run. `ephs.testing` drives
the same trials by Hypothesis.
"""

import random
from collections.abc import Sequence
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from ephs.semantics.bundles.bundle import Reference
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.verdicts.checks import NEARER, check_at
from ephs.semantics.verdicts.constant import require_by_units
from ephs.semantics.verdicts.recorded import beyond_rounding
from ephs.semantics.verdicts.trials import (
    REFERENCES,
    Trial,
    affordable,
    beside,
    chosen,
    coordinates,
    simpler,
    smallest,
    special_numbers,
    trial_of,
)

if TYPE_CHECKING:
    from ephs.semantics.primitives.primitives import Primitive

COUNT = 400
"""Numerical trials of a structure without a proof."""
DEFINED = 40
"""Trials in which a structure has to have a finite value once."""
SHRINKS = 2000
"""Trials on the way to the simplest counterexample, at most."""
ROUNDED = ("isotropy", "symmetry", "energy", "conservation", "definite")
"""Exceptions that may be rounding."""
UNDEFINED = ("finite", "undefined", "no-value")
"""Exceptions that mean that the structure is undefined at a state."""


def failure(primitive: "Primitive", where: Trial) -> StructureError | None:
    """Failure at that point, or None."""
    try:
        with np.errstate(all="ignore"):  # NaN and infinities are detected in the value
            check_at(primitive, where)
            if primitive.kind == "reversible":
                require_by_units(primitive, where)
    except StructureError as error:
        return beyond_rounding(primitive, where, error) if error.kind in ROUNDED else error
    except (ArithmeticError, ValueError) as error:
        return StructureError(
            "finite", primitive.name, what="the structure", found=f"{type(error).__name__}: {error}",
            witness=where.witness(primitive),
        )  # fmt: skip
    return None


def simplest(primitive: "Primitive") -> None:
    """Check the simplest trial, which reveals wrong shapes; others if its values are not finite.

    Raises
    ------
    StructureError
        It fails, or there are finite values nowhere.
    """
    found = failure(primitive, trial_of(primitive, *chosen(primitive, _first)))
    if found is not None and found.kind not in UNDEFINED:
        raise found
    if found is not None:
        search(primitive, DEFINED)


def _first(_: int) -> int:
    return 0


def search(primitive: "Primitive", count: int) -> int:
    """Try so many states and efforts, the simplest first; how many had finite values.

    Raises
    ------
    StructureError
        With the simplest counterexample found as its witness.
    """
    source, special = random.Random(20), special_numbers(primitive)
    count = affordable(primitive, count)
    undefined: StructureError | None = None
    defined = 0
    for numbers in islice(beside(primitive, special), count):
        found = failure(primitive, trial_of(primitive, numbers, REFERENCES[0]))
        if found is not None and found.kind not in UNDEFINED:
            raise shrunk(primitive, numbers, REFERENCES[0], found)
    for share in NEARER:
        for number in range(count):
            numbers, reference = chosen(primitive, source.randrange, special) if number else chosen(primitive, _first)
            found = failure(primitive, trial_of(primitive, numbers, reference).nearer(primitive, share))
            if found is None:
                defined += 1
            elif found.kind in UNDEFINED:
                undefined = undefined or found
            else:
                raise shrunk(primitive, numbers, reference, found)
        if 8 * defined >= count:
            return defined
    if undefined is not None and not defined:
        raise undefined
    return defined


def shrunk(
    primitive: "Primitive", numbers: Sequence[float], reference: Reference, found: StructureError
) -> StructureError:
    """The same failure at the simplest numbers: each made simpler, as far as the structure still fails."""
    where = coordinates(primitive)
    numbers, left, changed = list(numbers), affordable(primitive, SHRINKS), True
    for start in (REFERENCES[0], reference):
        now = failure(primitive, trial_of(primitive, numbers, start))
        if now is not None and now.kind == found.kind:
            reference, found = start, now
            break
    for tried in smallest(where):
        now = failure(primitive, trial_of(primitive, tried, reference))
        if now is not None and now.kind == found.kind:
            numbers, found = list(tried), now
            break
    while changed:
        changed = False
        for i, coordinate in enumerate(where):
            for value in simpler(numbers[i], coordinate):
                left -= 1
                if left < 0:
                    return found
                tried = [*numbers[:i], value, *numbers[i + 1 :]]
                now = failure(primitive, trial_of(primitive, tried, reference))
                if now is not None and now.kind == found.kind:
                    numbers, found, changed = tried, now, True
                    break
    return found
