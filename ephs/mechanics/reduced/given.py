"""External inputs: forces on joints and wrenches on bodies, in the arrays that the sweeps read."""

from collections.abc import Mapping
from typing import Any, final

import numpy as np

from ephs.mechanics.build import drive_ports, wrench_port
from ephs.mechanics.reduced.mechanism import Reduced
from ephs.mechanics.reduced.tables import SPRING
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.solve.problem import Problem
from ephs.operad import Path
from ephs.semantics.bundle import Array

__all__ = ["Given"]


@final
class Given:
    """The inputs of one problem that are flows.

    Attributes
    ----------
    drive
        (joints' freedoms,) forces on the rates of all joints.
    wrench
        (links, 6) in body frames.
    """

    def __init__(self, scene: Scene, problem: Problem, reduced: Reduced, freedoms: int) -> None:
        self._signals, self._reduced = problem.signals, reduced
        self.drive, self.wrench = np.zeros(freedoms), np.zeros((reduced.links, 6))
        self._ports: list[tuple[Path, Any, Any]] = []
        links = {name: i for i, name in enumerate(reduced.bodies) if name is not None}
        for name, _ in scene.all_bodies():
            if wrench_port(name) in self._signals:
                self._ports.append((wrench_port(name), self.wrench, links[name]))
        of_joint: dict[str, list[int]] = {}
        for i, edge in enumerate(reduced.edges):
            if reduced.tables.kind[i] != SPRING:
                of_joint.setdefault(edge.name, []).append(i)
        r_at, dim = reduced.tables.r_at, reduced.tables.dim
        for name, j in scene.all_joints():
            edges = sorted(of_joint[name], key=lambda i: reduced.edges[i].freedoms.start)
            for (port, _), i in zip(drive_ports(j), edges, strict=True):
                if port in self._signals and not self._signals[port].effort:
                    self._ports.append((port, self.drive, slice(int(r_at[i]), int(r_at[i] + dim[i]))))
        self.place(0.0, None)

    def place(self, t: float, state: Mapping[Path, Array] | None) -> None:
        """Put the inputs at a time and state into the arrays; without a state those that are constant."""
        for port, array, where in self._ports:
            signal = self._signals[port]
            array[where] = signal.at(t, state or {}) if state is not None or signal.constant else 0.0

    def acted(self, edges: set[int]) -> tuple[frozenset[int], frozenset[int]]:
        """Edges, beside those given, and links on which they act."""
        t = self._reduced.tables
        at = {int(t.r_at[i]): i for i in range(len(self._reduced.edges)) if t.kind[i] != SPRING and t.dim[i]}
        links = {int(where) for _, array, where in self._ports if array is self.wrench}
        pushed = {at[where.start] for _, array, where in self._ports if array is not self.wrench and where.start in at}
        return frozenset(edges | pushed), frozenset(links)
