"""Readings of a solution by name: for derivatives and for recorded motions."""

from collections.abc import Callable

from ephs.mechanics.scene.model import Scene
from ephs.mechanics.sweep.outputs import outputs_of
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.systems.system import System
from ephs.solve.posing.errors import OptionError
from ephs.solve.result.solution import Solution

Reading = Callable[[Solution], Array]
"""(n,) or (n, d) of a solution with n instants."""


def reading_of(model: System | Scene, name: str) -> Reading:
    """Reader of a name from a solution of a model: the names are those of `ephs.sweep`'s outputs, a state's path,
    ``joints.pin.coordinate``, ``bodies.rod.position``, ``markers.tip.velocity``, ``thermal.housing.temperature``,
    ``heat``; brackets choose an entry: ``joints.pin.coordinate[0]``.

    Raises
    ------
    OptionError
        There is nothing of that name.
    """
    stem, bracket, entry = str(name).partition("[")
    whole = outputs_of(model, [stem])[0].read
    if not bracket:
        return whole
    number = int(entry[:-1]) if entry[:-1].isdigit() and entry.endswith("]") else -1

    def column(solution: Solution) -> Array:
        values = whole(solution)
        if not (values.ndim == 2 and 0 <= number < values.shape[1]):
            expected = f"an entry of {values.shape[1]} numbers" if values.ndim == 2 else "no brackets: it is one number"
            raise OptionError("reading", name, expected)
        return values[:, number]

    return column
