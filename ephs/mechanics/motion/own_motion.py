"""Velocities and wrenches of very large or small mechanisms, computed in the mechanism's own units."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from ephs.mechanics.scene.geometry import coupling_of
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.own_units import SI, OwnUnits, in_own_units, units_of_states
from ephs.mechanics.scene.rescaled import freedom_units
from ephs.semantics.bundles.bundle import Array
from ephs.solve.result.solution import Solution


@final
@dataclass(frozen=True, slots=True, eq=False)
class OwnMotion:
    """A motion in the mechanism's own units.

    Parameters
    ----------
    motion
        The same in these units.
    scene
        That was given.
    """

    motion: Any
    scene: Scene
    units: OwnUnits

    def velocities(self) -> tuple[dict[str, Array], dict[str, Array]]:
        """(n, 6) twists by body and (n, d) rates by joint, implicit free joints included."""
        length, time = self.units.length, self.units.time
        twist = np.array([1.0] * 3 + [length] * 3) / time
        joints = dict(self.scene.all_joints()) | dict(self.scene.implicit_joints())
        rates = {
            name: rate * freedom_units(coupling_of(joints[name]), joints[name].coordinate, length) / time
            for name, rate in self.motion.rates.items()
        }
        return {name: u * twist for name, u in self.motion.twists.items()}, rates

    def wrench(self, name: str) -> Array:
        """(n, 6) of a joint."""
        units = np.array([self.units.energy] * 3 + [self.units.energy / self.units.length] * 3)
        return self.motion.wrench(name) * units


def own_motion(solution: Solution, make: Callable[[Scene, Solution], Any]) -> OwnMotion | None:
    """The motion of a solution in its own units, as ``make`` reads scenes; None if those are close to SI."""
    problem = solution.problem
    if problem is None or problem.scene is None or (units := OwnUnits.of(problem.scene)) == SI:
        return None
    own = in_own_units(problem)
    own = replace(own, shown=None, motion=lambda seen: make(own.scene, seen))
    sizes = units_of_states(own.descriptor, units, read=True)
    states = {path: value / sizes[path] for path, value in solution.states.items()}
    there = Solution(
        solution.name, solution.t / units.time, states, lambda: solution.ledgers, solution.stats, own, solution.labels
    )
    return OwnMotion(make(own.scene, there), problem.scene, units)
