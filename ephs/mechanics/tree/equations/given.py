"""External inputs: forces on joints and wrenches on bodies, in the arrays that the sweeps read."""

from collections.abc import Callable, Mapping
from typing import final

import numpy as np

from ephs.mechanics.tree.equations.prescribed import Prescribed
from ephs.mechanics.tree.finding.frames import GROUND
from ephs.mechanics.tree.finding.mechanism import Reduced
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.solve.posing.problem import Problem


@final
class Given:
    """The inputs of one problem that are flows.

    Attributes
    ----------
    drive
        (joints' degrees of freedom,) forces on the rates of all joints.
    wrench
        (links, 6) in body frames.
    supply
        Efforts that are prescribed to what is attached, then flows by the efforts of its network.
    """

    def __init__(self, problem: Problem, reduced: Reduced, freedoms: int, prescribed: Prescribed) -> None:
        self._signals, self._reduced = problem.signals, reduced
        self.drive, self.wrench = np.zeros(freedoms), np.zeros((reduced.links, 6))
        self._contact: Callable[[float], Array] | None = None
        self._drives: list[tuple[Path, slice]] = []
        self._wrenches: list[tuple[Path, int, Array | None]] = []
        for port, frame in ((one.port, one.frame) for one in reduced.acting):
            if frame.link != GROUND:
                centre = np.array_equal(frame.offset, SE3.identity())
                seen = None if centre else SE3.adjoint(SE3.inverse(frame.offset)).T
                self._wrenches.append((port, frame.link, seen))
        net = reduced.attaching.network
        self.supply = np.zeros(len(net.inputs) + net.skew.shape[0])
        t = reduced.tables
        self._prescribed = prescribed
        for i, edge in enumerate(reduced.edges):
            if edge.port is not None and not self._signals[edge.port].effort:
                self._drives.append((edge.port, slice(int(t.r_at[i]), int(t.r_at[i] + t.dim[i]))))
        ports = [port for port, _ in self._drives] + [port for port, _, _ in self._wrenches]
        ports += [port for port, _ in net.inputs] + [one.port for one in net.injections]
        self._own = np.zeros(freedoms)
        for _, where in self._drives:
            self._own[where] = 1.0
        self._fixed = {port: self._signals[port].at(0.0, {}) for port in ports if self._signals[port].constant}
        self.place(0.0, None)

    @property
    def pushed(self) -> bool:
        """Whether there are forces on joints or wrenches on bodies."""
        return bool(self._drives or self._wrenches)

    def place(self, t: float, state: Mapping[Path, Array] | None) -> None:
        """Put the inputs at a time and state into the arrays; without a state those that are constant."""
        fixed, signals = self._fixed, self._signals
        self.put(lambda port: fixed[port] if port in fixed else 0.0 if state is None else signals[port].at(t, state))
        self._prescribed.place(t)
        if self._contact is not None:
            self.drive[:] = self._own * self.drive + self._contact(t)

    def push(self, contact: Callable[[float], Array] | None) -> None:
        """Let closed contacts act besides, by forces (joints' degrees of freedom,) on the rates that are functions of
        time.
        """
        self._contact = contact
        if contact is None:
            self.drive *= self._own

    def put(self, value: Callable[[Path], Array | float]) -> None:
        """Put the inputs into the arrays, each as ``value(port)``."""
        for port, where in self._drives:
            self.drive[where] = value(port)
        for _, link, _ in self._wrenches:
            self.wrench[link] = 0.0
        for port, link, seen in self._wrenches:
            given = value(port)
            self.wrench[link] += given if seen is None else seen @ np.broadcast_to(given, 6)
        net = self._reduced.attaching.network
        for i, (port, k) in enumerate(net.inputs):
            self.supply[i] = np.atleast_1d(value(port))[k]
        self.supply[len(net.inputs) :] = 0.0
        for one in net.injections:
            self.supply[len(net.inputs) :] += np.atleast_1d(value(one.port))[one.place] * one.row

    def acted(self, edges: set[int]) -> tuple[frozenset[int], frozenset[int]]:
        """Edges, beside those given, and links on which they act."""
        t = self._reduced.tables
        at = {int(t.r_at[i]): i for i in range(len(self._reduced.joints)) if t.dim[i]}
        links = {link for _, link, _ in self._wrenches}
        pushed = {at[where.start] for _, where in self._drives if where.start in at}
        pushed |= {i for first, i in at.items() if first in self._reduced.attaching.edges}
        return frozenset(edges | pushed), frozenset(links)
