"""The dense equations of one mechanism: tables and memory of the staged program, and its functions on NumPy arrays."""

from dataclasses import replace
from typing import Any, Final, final

import numpy as np

from ephs.mechanics.tree.engine.build import whole_tables
from ephs.mechanics.tree.engine.links import links_of
from ephs.mechanics.tree.equations.attached import Attached
from ephs.mechanics.tree.equations.laws import Laws
from ephs.mechanics.tree.equations.slopes import Slopes
from ephs.mechanics.tree.finding.mechanism import Reduced
from ephs.mechanics.tree.finding.tables import CUT
from ephs.mechanics.tree.sweeps.charts import TIE
from ephs.mechanics.tree.sweeps.cuts import Cut, Relative
from ephs.mechanics.tree.sweeps.loops import kinds_of, loop_program
from ephs.mechanics.tree.sweeps.pack import STANDARD, packed
from ephs.mechanics.tree.sweeps.programs import PLACE
from ephs.mechanics.tree.sweeps.residuals import residuals
from ephs.semantics.bundle import Array
from ephs.semantics.spaces.rotations import matrix_to_quaternion, quaternion_to_matrix

__all__ = ["Residual"]

ALL: Final = kinds_of((joint.code, joint.size, joint.dim) for joint in STANDARD)
"""Kinds of groups that the program of all mechanisms has."""


@final
class Residual:
    """The functions of `ephs.mechanics.tree.sweeps.residuals` on the tables of one mechanism, and their memory.

    Vectors count n tree degrees of freedom, nv with those of cut joints, m rows of loops, and ``entropies``.

    Parameters
    ----------
    gravity
        (3,) in world axes.
    scal
        (h, θ₀, π₀), as the components' kernels take it.
    supply
        What is given to what is attached.

    Attributes
    ----------
    arrays
        Arguments of the program by name, but for numbers; those of the last evaluation are left in them.
    laws
        The components about the point of the last evaluation.
    counts
        Rows of each cut joint, then of each gear.
    """

    def __init__(self, reduced: Reduced, gravity: Array, scal: Array, supply: Array) -> None:
        t, found = reduced.tables, links_of(reduced)
        self._bodies, self._ground = found.bodies, quaternion_to_matrix(found.ground[:4])
        parts = [
            replace(part, joint=replace(part.joint, driven=False, armature=part.armature > 0.0)) for part in found.parts
        ]
        usual = {part.joint for part in parts} <= set(STANDARD)  # others have programs of their own class
        tree = packed(parts, self._ground @ gravity, planar=False, among=STANDARD if usual else ())
        chart, cut, numbers, forces = whole_tables(reduced, found.bodies, found.ground)
        tables, code = forces.tables(), t.code[np.flatnonzero(t.dim)].astype(np.int64)
        kinds = kinds_of([*np.column_stack([code, forces.edge[:, [5, 3]]]).tolist(), *cut[:, [2, 5, 3]].tolist()])
        self.program = residuals(tree.kind, tuple(sorted({*kinds, *(ALL if usual else ())})))
        self.laws = Laws(forces, len(reduced.made), scal)
        self.attached = Attached(reduced, scal, supply)
        self.counts: list[int] = [*cut[cut[:, 2] != TIE, 8].tolist(), *[1] * len(reduced.attaching.ties)]
        self.n, self.m, self.ns = reduced.freedoms, sum(self.counts), t.node.size
        c = int(t.dim[t.kind == CUT].sum())
        self.nv, driven = self.n + c, int(t.driven.sum())
        self.forces, self.rows = slice(0, self.n), slice(self.n, self.n + self.m)
        self.cut_rates = slice(self.rows.stop, self.rows.stop + c)
        self.cut_changes = slice(self.cut_rates.stop, self.cut_rates.stop + c)
        self.entropy_rates = slice(self.cut_changes.stop, self.cut_changes.stop + self.ns)
        n, m, ends = self.n, self.m, 2 * int(cut[:, 8].sum())
        self.arrays: dict[str, Any] = {
            "integers": tree.integers, "reals": tree.reals, "gravity": tree.gravity,
            "memory": np.zeros((tree.size + 1) * self.program.width), "cut": cut.ravel(),
            "cut_numbers": numbers.ravel(), "chart": chart.ravel(), "places": np.zeros((tree.size + 1, PLACE)),
            "motions": np.zeros((len(cut), Relative.real_width)), "end": np.arange(ends),
            "value": np.zeros((m, 4)), "covector": np.zeros((ends, 6)), "edge": tables["acting"],
            "code": code, "law": self.laws.law, "body": tables["body"], "warming": self.laws.warming,
            "passage": tables["conduction"],
            "flow": self.laws.flow, "tie": self.attached.tie, "tied": self.attached.tied,
            "beyond": np.zeros(len(self.attached.tied)), "pulls": np.zeros(self.nv),
            "base": np.zeros(reduced.coordinates), "v": np.zeros(self.nv),
            "q": np.zeros(reduced.coordinates), "r": np.zeros(n), "s": np.zeros(self.ns),
            "drive": np.zeros(self.nv), "wrench": np.zeros((reduced.links, 6)), "warmth": np.zeros(self.ns),
            "a": np.zeros(n), "multiplier": np.zeros(m), "unit": np.zeros(n), "mass": np.zeros((n, n)),
            "factor": np.zeros((n, n)), "row": np.zeros((m + driven, n)), "terms": np.zeros(m + driven),
            "rows": np.zeros((n, 6)),
        }  # fmt: skip
        self._numbers = {"size": tree.size, "driven": driven, "link": 0}
        self.outs = {
            "residual": np.zeros(self.entropy_rates.stop), "action": np.zeros(2 * n + 2 * c + self.ns),
            "rigid": np.zeros(n),
        }  # fmt: skip
        self.size, self._frames = tree.size, forces.body_frame
        self._calls: dict[str, Any] = {}
        loops, self._worst = loop_program(self.program.kinds).compiled(), np.zeros(1)
        joint = [self.arrays[name] for name in ("cut", "cut_numbers", "motions", "q")]
        self._fit = loops["fit"].bind(*joint)
        self._gaps = loops["gaps"].bind(*joint, self.arrays["value"], self._worst)
        self._driven = np.flatnonzero(t.driven)
        self._slopes: Slopes | None = None

    def bound(self, calls: Any, name: str, **others: Any) -> Any:
        """An entry function with these arrays for arguments, but for others."""
        given = {**self.arrays, **self._numbers, "out": self.outs.get(name), **others}
        return calls[name].bind(*(given[key] for key in self.program.program.entries[name].kinds))

    def _call(self, name: str) -> Any:
        """An entry function with these arrays, bound when it is first asked for."""
        if name not in self._calls:
            self._calls[name] = self.bound(self.program.program.compiled(), name)
        return self._calls[name]

    # ---- where the mechanism is --------------------------------------------------------------------------------

    def place(self, q: Array, r: Array) -> None:
        """Motions of links and cut joints, and the points of laws."""
        self.arrays["q"][:], self.arrays["r"][:] = q, r
        self._call("place")()

    def fitted(self, q: Array, r: Array) -> Array:
        """q with the cut joints' elements nearest to where their bodies put them."""
        self.place(q, r)
        if self.counts:
            self._fit()
        return self.arrays["q"].copy()

    def gaps(self) -> tuple[Array, float]:
        """Position residuals (m,) of loops where `fitted` has been, and the largest, in m and rad."""
        if not self.m:
            return np.zeros(0), 0.0
        self._gaps()
        return -self.arrays["value"][:, 0], float(self._worst[0])

    def assemble(self, q: Array, r: Array) -> int:
        """The mass matrix, its factor and the rows into ``arrays``; 0, or 1 + a degree of freedom that moves no
        mass.
        """
        a = self.arrays
        a["q"][:], a["r"][:] = q, r
        found = int(self._call("assemble")())
        for i, j in enumerate(self._driven):
            a["row"][i, j], a["terms"][i] = 1.0, 1.0 / a["factor"][j, j]
        return found

    def pose(self, body: int) -> Array:
        """(7,) of a body in the world, where `place` has been."""
        place, frame = self.arrays["places"][self._bodies.link[body]], self._frames[body]
        turn = self._ground.T @ place[:9].reshape(3, 3)
        at = self._ground.T @ place[9:12] + turn @ frame[9:]
        return np.concatenate([matrix_to_quaternion(turn @ frame[:9].reshape(3, 3)), at])

    def link(self, body: int) -> int:
        """Number of a body's link, −1 for the ground."""
        return self._bodies.link[body]

    def twist(self, body: int) -> Array:
        """(6,) of a body in its frame, where `place` has been."""
        return self.inside(body, self.arrays["places"][self._bodies.link[body], 12:18])

    def twists(self, body: int) -> Array:
        """(6, n) a body's twist by the tree's rates, where `place` has been."""
        link = self.link(body)
        if link < 0:
            return np.zeros((6, self.n))
        self._call("twists")(self.size, link)
        return self.inside(body, self.arrays["rows"]).T

    def inside(self, body: int, twist: Array) -> Array:
        """(…, 6) twists of a body in its frame, from those of its link."""
        frame = self._frames[body]
        turn, at = frame[:9].reshape(3, 3), frame[9:]
        turning, moving = twist[..., :3], twist[..., 3:]
        return np.concatenate([turning @ turn, (moving + np.cross(turning, at)) @ turn], axis=-1)

    def cut_twists(self) -> Array:
        """(nv − n,) rates of cut joints along their degrees of freedom, where the links' motion was computed last."""
        found, at = [np.zeros(0)], Cut.left.offset
        joints = self.arrays["cut"].reshape(-1, Cut.integer_width)
        numbers = self.arrays["cut_numbers"].reshape(-1, Cut.real_width)
        for joint, row, motion in zip(joints, numbers, self.arrays["motions"], strict=True):
            twist = motion[Relative.twist.offset : Relative.twist.offset + 6]
            found.append(row[at : at + 36].reshape(6, 6)[: joint[3]] @ twist)
        return np.concatenate(found)

    # ---- forces ------------------------------------------------------------------------------------------------

    def rigid(self, q: Array, r: Array, *, gravity: bool) -> Array:
        """(n,) the forces that inertia, and gravity, need at ṙ = 0."""
        a = self.arrays
        a["q"][:], a["r"][:] = q, r
        pull = a["gravity"].copy()
        a["gravity"][:] = pull if gravity else 0.0
        self._call("rigid")()
        a["gravity"][:] = pull
        return self.outs["rigid"].copy()

    def about(self, q: Array, r: Array, s: Array, drive: Array, wrench: Array) -> tuple[int, int]:
        """Take a point: laws about it, and what is given there; (status, component)."""
        a = self.arrays
        self.place(q, r)
        a["base"][:], a["s"][:], a["drive"][:], a["wrench"][:] = q, s, drive, wrench
        status, component = self.laws.about(s)
        if status or not self.attached.there:
            return status, component
        rates = np.concatenate([a["r"], self.cut_twists()])
        return self.attached.about(q, rates, s, a["warming"][:, 0].copy(), self.laws)

    def at(self, a: Array, multiplier: Array) -> Array:
        """The residual where `about` has been: forces, accelerations of rows, and so on; see the slices."""
        self.arrays["a"][:], self.arrays["multiplier"][:] = a, multiplier
        self._call("residual")()
        return self.outs["residual"]

    @property
    def out(self) -> Array:
        """Last result of `at`."""
        return self.outs["residual"]

    def slopes(self) -> Slopes:
        """Derivatives where these equations were evaluated last."""
        if self._slopes is None:
            self._slopes = Slopes(self)
        return self._slopes

    def power(self) -> float:
        """Power in W of what is given, forces on joints and wrenches on bodies, where `about` has been."""
        a = self.arrays
        work = float(a["drive"] @ np.concatenate([a["r"], self.cut_twists()])) + self.attached.power
        return work + sum(float(a["wrench"][b] @ self.twist(int(b))) for b in np.flatnonzero(a["wrench"].any(axis=1)))

    def follow(self, x0: Array, x: Array, h: float) -> Array:
        """States of what is attached in the middle of a step of h seconds from x0: a step of Newton's method from x,
        where `about` has been."""
        rates, slopes = self.attached.states()
        return x + np.linalg.solve(np.eye(x.size) - 0.5 * h * slopes, x0 + 0.5 * h * rates - x)

    def momenta(self) -> tuple[Array, Array]:
        """((n,), (n,)) ∂L/∂r, and ∂L/∂q with the forces that no potential has, where `about` has been."""
        self._call("action")()
        out = self.outs["action"]
        return out[: self.n].copy(), out[self.n : 2 * self.n].copy()
