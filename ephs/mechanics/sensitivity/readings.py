"""What of a solution is read, by name: for derivatives and for recorded motions."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ephs.mechanics.scene.errors import did_you_mean, listing
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.solve.errors import OptionError
from ephs.mechanics.solve.solution import Solution
from ephs.semantics.bundle import Array

__all__ = ["reading"]

LEDGERS = ("energy", "exergy", "entropy", "heat", "work", "kinetic", "potential")
PARTS = {
    "joints": ("coordinate", "rate"),
    "bodies": ("position", "velocity", "quaternion", "angular_velocity"),
    "markers": ("position", "velocity"),
    "thermal": ("temperature",),
}


def reading(solution: Solution, name: str) -> Array:
    """(n,) or (n, d) of a name: a state's path; ``joints.pin.coordinate`` or ``.rate``; ``bodies.rod.position``,
    ``.velocity``, ``.quaternion``, ``.angular_velocity``; ``markers.tip.position``, ``.velocity``;
    ``thermal.housing.temperature``; ``energy``, ``exergy``, ``entropy``, ``heat``, ``work``, ``kinetic``,
    ``potential``. Brackets choose an entry: ``joints.pin.coordinate[0]``.

    Raises
    ------
    OptionError
        There is nothing of that name.
    """
    stem, bracket, entry = name.partition("[")
    values = _whole(solution, stem, name)
    if not bracket:
        return values
    number = int(entry[:-1]) if entry[:-1].isdigit() and entry.endswith("]") else -1
    if not (values.ndim == 2 and 0 <= number < values.shape[1]):
        raise OptionError("reading", name, f"an entry of {values.shape[1] if values.ndim == 2 else 'one number'}")
    return values[:, number]


def _whole(solution: Solution, name: str, asked: str) -> Array:
    if name in LEDGERS:
        return np.asarray(getattr(solution, name), dtype=float)
    states = {str(path): path for path in solution}
    if name in states:
        return solution[states[name]]
    kind, _, rest = name.partition(".")
    own, _, key = rest.rpartition(".")
    known = _things(solution.scene)
    if own in known.get(kind, ()) and key in PARTS[kind]:
        readers: dict[str, Callable[[str], Any]] = {
            "joints": solution.joint, "bodies": solution.body, "markers": solution.marker, "thermal": solution.thermal
        }  # fmt: skip
        return np.asarray(getattr(readers[kind](own), key), dtype=float)
    every = [*states, *LEDGERS]
    every += [f"{kind}.{own}.{key}" for kind, names in known.items() for own in names for key in PARTS[kind]]
    raise OptionError("reading", asked, did_you_mean(asked, every, f"one of {listing(every)}"))


def _things(scene: Scene | None) -> dict[str, list[str]]:
    if scene is None:
        return {}
    return {
        "joints": [name for name, _ in [*scene.all_joints(), *scene.implicit_joints()]],
        "bodies": [name for name, _ in scene.all_bodies()],
        "markers": [name for name, _ in scene.all_markers()],
        "thermal": [name for name, _ in scene.all_thermal()],
    }
