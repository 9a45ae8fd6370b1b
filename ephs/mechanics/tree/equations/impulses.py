"""The tree's rates that are nearest to momenta of the links, in the mass metric."""

from typing import TYPE_CHECKING, final

import numpy as np

from ephs.mechanics.road.records import LinkConstants, LinkPlace
from ephs.semantics.bundles.bundle import Array

if TYPE_CHECKING:
    from ephs.mechanics.tree.equations.equations import ReducedEquations

TWIST = slice(LinkPlace.twist.offset, LinkPlace.twist.offset + 6)
"""Position of the twist in a link's row of `places`."""


@final
class Impulses:
    """M⁻¹ Sᵀ p by the sweeps of an engine whose links are the bodies, loops left out; it keeps memory.

    Parameters
    ----------
    inertia
        (links, 6, 6) in the links' frames.
    """

    def __init__(self, equations: "ReducedEquations", inertia: Array) -> None:
        engine, links, n = equations.engine, equations.reduced.links, equations.n
        self._inertia = inertia
        memory = np.zeros(engine.work["work"].size)
        self._places = memory.reshape(links + 1, -1)[:, : LinkPlace.real_width]
        program, _ = engine.reached["move"]
        calls = program.compiled()
        reals = engine.tables["reals"].copy()
        reals.reshape(-1, LinkConstants.real_width)[:, LinkConstants.armature.offset] = (
            0.0  # momenta are those of bodies
        )
        tree = links, engine.tables["integers"], reals, memory, np.zeros(3)
        whole = np.zeros(0, dtype=np.int64)
        numbers = np.zeros((0, 4)), np.zeros(0), np.zeros((0, 6)), np.zeros((0, 12))
        rows = np.zeros(4 * (links + 1), dtype=np.int64), whole, whole, whole, *numbers
        self._q, self._r, self._rate = np.zeros(equations.reduced.coordinates), np.zeros(n), np.zeros(n)
        self._wrench = np.zeros((links, 6))
        self._move = calls["move"].bind(*tree, self._q, self._r, np.zeros(n))
        self._fold = calls["fold"].bind(*tree, *rows, np.zeros(n), self._wrench)
        self._unfold = calls["unfold"].bind(*tree, *rows, self._rate)

    def outward(self, q: Array, r: Array) -> Array:
        """(links, 30) frames in the world, twists, and accelerations at ṙ = 0, in world axes about the frames' origins,
        at elements q and rates r.
        """
        self._q[:], self._r[:] = q, r
        self._move()
        return self._places[:-1].copy()

    def twists(self, q: Array, r: Array) -> Array:
        """(links, 6) in the links' frames, at elements q and rates r."""
        places = self.outward(q, r)
        return _turned(places[:, :9].reshape(-1, 3, 3).mT, places[:, TWIST])

    def rates(self, q: Array, prescribed: Array, momenta: Array) -> Array | None:
        """(n,) of momenta (links, 6) in the links' frames, with the rates of driven joints as prescribed (n,); None
        where a joint moves no mass.
        """
        rest = momenta - np.einsum("lij,lj->li", self._inertia, self.twists(q, prescribed))
        self._wrench[:] = _turned(self._places[:-1, :9].reshape(-1, 3, 3), rest)
        self.outward(q, np.zeros_like(prescribed))
        if self._fold():
            return None
        self._unfold()
        return prescribed + self._rate


def _turned(turn: Array, pairs: Array) -> Array:
    """(links, 6) twists or wrenches in other axes, by matrices (links, 3, 3)."""
    return np.einsum("lij,lhj->lhi", turn, pairs.reshape(-1, 2, 3)).reshape(-1, 6)
