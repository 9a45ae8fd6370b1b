"""The dense equations of one mechanism: tables and memory of the staged program, and its functions on NumPy arrays."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, final

import numpy as np

from ephs.mechanics.road.charts import TIE
from ephs.mechanics.road.cuts import Cut, Relative
from ephs.mechanics.road.loops import kinds_of, loop_program
from ephs.mechanics.road.pack import STANDARD
from ephs.mechanics.road.records import LinkPlace
from ephs.mechanics.tree.engine.build import whole_of
from ephs.mechanics.tree.engine.residuals import ACTIVE, MOVING, point_program, residuals
from ephs.mechanics.tree.finding.mechanism import Reduced
from ephs.mechanics.tree.finding.tables import CUT
from ephs.mechanics.tree.sweeps.acting import TOTALS
from ephs.mechanics.tree.sweeps.expanding import memory_about
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import symmetric_eigen
from ephs.semantics.spaces.rank import REGULAR, TINY
from ephs.semantics.spaces.rotations import matrix_to_quaternion, quaternion_to_matrix
from ephs.solve.equations.sparse import Index

# Directional derivatives of a mechanism's dense equations, several at a time, by dual numbers.

DIRECTIONS: Final = 4
"""Directions of one call: vector units take four."""


@final
class EquationSlopes:
    """Derivatives where a mechanism's equations were evaluated last."""

    def __init__(self, residual: "Residual") -> None:
        self._residual = residual
        names = (*ACTIVE, "a")
        self._slopes = {name: np.zeros((*residual.arrays[name].shape, DIRECTIONS)) for name in names}
        self._calls: dict[str, Any] = {}
        self._outs: dict[str, Array] = {}

    def _call(self, name: str) -> Any:
        if name not in self._calls:
            found, out = self._residual, self._residual.outs[name]
            program = found.program.tangent(name, DIRECTIONS)
            pairs: dict[str, Any] = {key: (found.arrays[key], slopes) for key, slopes in self._slopes.items()}
            self._outs[name] = np.zeros((out.size, DIRECTIONS))
            self._calls[name] = found.bound(program.compiled(), name, **pairs, out=(out, self._outs[name]))
        return self._calls[name]

    def of(self, name: str, seeds: Mapping[str, Array], count: int, beside: str = "value") -> tuple[Array, Array]:
        """(size, count) derivatives of a function along the last axes of seeds, arguments by name, and those of an
        argument that the function writes, with ``count`` as its last axis.

        Parameters
        ----------
        name
            ``residual`` or ``action``.
        """
        call, written = self._call(name), self._slopes[beside]
        out = self._outs[name]
        found, other = np.empty((out.shape[0], count)), np.empty((*written.shape[:-1], count))
        for first in range(0, count, DIRECTIONS):
            here = min(DIRECTIONS, count - first)
            for key, seed in seeds.items():
                self._slopes[key][..., :here] = seed[..., first : first + here]
                self._slopes[key][..., here:] = 0.0
            call()
            found[:, first : first + here] = out[:, :here]
            other[..., first : first + here] = written[..., :here]
        for key in seeds:
            self._slopes[key][:] = 0.0
        return found, other

    def along(self, name: str, arguments: Sequence[str], wanted: Index | None = None) -> Array:
        """(size, k) derivatives by all entries of vectors, in their order, or by those that are wanted."""
        sizes = [self._slopes[key].shape[0] for key in arguments]
        units = np.eye(sum(sizes))
        units = units if wanted is None else units[:, wanted]
        parts = np.split(units, np.cumsum(sizes)[:-1])
        return self.of(name, dict(zip(arguments, parts, strict=True)), units.shape[1])[0]


ALL: Final = kinds_of((joint.code, joint.size, joint.dim) for joint in STANDARD)
"""Kinds of groups that the program of all mechanisms has."""


@final
class Residual:
    """The functions of `ephs.mechanics.tree.engine.residuals` on the tables of one mechanism, and their memory.

    Vectors count n tree degrees of freedom, nv with those of cut joints, m rows of loops, and ``entropies``.

    Parameters
    ----------
    scal
        (h, θ₀, π₀), as the components' kernels take it.
    supply
        What is given to what is attached.

    Attributes
    ----------
    arrays
        Arguments of the program by name, but for numbers; those of the last evaluation are left in them.
    made
        (makers,) entropy a second, in W/K, where `about` has been: that components make, of conductions what leaves
        their first store.
    counts
        Rows of each cut joint, then of each gear.
    stiffness
        (rows,) of prescribed joints, then of loops, in the metric that `assemble` made last: zeros, where M is regular.
    """

    def __init__(self, reduced: Reduced, scal: Array, supply: Array) -> None:
        t, whole = reduced.tables, whole_of(reduced)
        self._link, self._frames = whole.found.link, whole.body_frame
        self._ground = quaternion_to_matrix(whole.found.ground[:4])
        records, joints = whole.records, whole.tables["cut"].reshape(-1, Cut.integer_width)
        self.program = residuals(records.kind, tuple(sorted({*whole.kinds, *(ALL if whole.usual else ())})))
        self.counts: list[int] = [*joints[joints[:, 2] != TIE, 8].tolist(), *[1] * len(reduced.attaching.ties)]
        self.n, self.m, self.ns = reduced.freedoms, sum(self.counts), t.node.size
        c = int(t.dim[t.kind == CUT].sum())
        self.nv, driven = self.n + c, int(t.driven.sum())
        self.stiffness = np.zeros(self.m + driven)
        self.forces, self.rows = slice(0, self.n), slice(self.n, self.n + self.m)
        self.cut_rates = slice(self.rows.stop, self.rows.stop + c)
        self.cut_changes = slice(self.cut_rates.stop, self.cut_rates.stop + c)
        self.entropy_rates = slice(self.cut_changes.stop, self.cut_changes.stop + self.ns)
        n, m, q, net = self.n, self.m, np.zeros(reduced.coordinates), reduced.attaching.network
        self.made, self._totals = np.zeros(len(reduced.made)), np.zeros(TOTALS)
        self.arrays: dict[str, Any] = {
            **whole.tables, **{name: np.zeros(shape) for name, shape in whole.shapes.items()},
            "work": np.zeros((records.size + 1) * self.program.width), "fault": np.zeros(1, dtype=np.int64),
            "drive": np.zeros(self.nv), "wrench": np.zeros((reduced.links, 6)), "scal": scal, "supply": supply,
            "lead": np.zeros(n), **memory_about(t.evaluated, net.known, len(reduced.attaching.bent)),
            "increment": np.zeros(self.nv), "base": q, "q": q.copy(), "r": np.zeros(n),
            "a": np.zeros(n), "multiplier": np.zeros(m), "unit": np.zeros(n),
            "mass": np.zeros((n, n)), "factor": np.zeros((n, n)), "jacobian": np.zeros((m + driven, n)),
            "sizes": np.zeros((m + driven, n)), "terms": np.zeros(m + driven), "rows": np.zeros((n, 6)),
            "made": self.made, "totals": self._totals,
        }  # fmt: skip
        prescribed = np.arange(driven), np.flatnonzero(t.driven)
        self.arrays["jacobian"][prescribed] = self.arrays["sizes"][prescribed] = 1.0
        own: Any = whole.tables["own"][0]
        own.width = self.program.width
        self._numbers = {"driven": driven, "link": 0}
        self.outs = {
            "residual": np.zeros(self.entropy_rates.stop), "action": np.zeros(2 * n + 2 * c + self.ns),
            "rigid": np.zeros(n),
        }  # fmt: skip
        self._calls: dict[str, Any] = {}
        loops, self._worst = loop_program(self.program.kinds).compiled(), np.zeros(1)
        cuts = [self.arrays[name] for name in ("cut", "cut_numbers", "relative", "q")]
        self._fit = loops["fit"].bind(*cuts)
        self._gaps = loops["gaps"].bind(*cuts, self.arrays["value"], self._worst)
        program, call = point_program(), point_program().compiled()["about"]
        self._shared = call.first(*(self.arrays[name] for name in MOVING))
        others = list(program.entries["about"].kinds)[len(MOVING) :]
        self._point = call.bind(*(self.arrays[name] for name in others), first=self._shared)
        self._first = net.state_at
        self._slopes: EquationSlopes | None = None

    def bound(self, calls: Any, name: str, **others: Any) -> Any:
        """An entry function over dual numbers with these arrays for arguments, but for others."""
        given = {**self.arrays, **others}
        return calls[name].bind(*(given[key] for key in self.program.program.entries[name].kinds))

    def _call(self, name: str) -> Any:
        """An entry function with these arrays, bound when it is first asked for."""
        if name not in self._calls:
            given = {**self.arrays, **self._numbers, "out": self.outs.get(name)}
            others = list(self.program.program.entries[name].kinds)[len(MOVING) :]
            call = self.program.program.compiled()[name]
            self._calls[name] = call.bind(*(given[key] for key in others), first=self._shared)
        return self._calls[name]

    # ---- where the mechanism is --------------------------------------------------------------------------------

    def place(self, q: Array, r: Array) -> None:
        """Motions of links and cut joints."""
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
        """The mass matrix, the factor of a metric and the rows into ``arrays``; 0, or 1 + a degree of freedom that
        moves no mass and that no row determines.

        The metric is M, and where M is singular M + Jᵀ diag(``stiffness``) J: that of the least change of rates which
        the rows leave is the same.
        """
        a = self.arrays
        a["q"][:], a["r"][:] = q, r
        self.stiffness[:] = 0.0
        found = int(self._call("assemble")())
        if found and self.stiffness.size:
            found = self._stiffened()
        if not found:
            a["terms"][:] = a["sizes"] @ (1.0 / a["factor"].diagonal())
        return found

    def _stiffened(self) -> int:
        """Factor of the metric with stiffness on the rows, as large as the inertia that each meets; as `assemble`."""
        a = self.arrays
        mass, rows = a["mass"], a["jacobian"]
        own = mass.diagonal()
        met = np.where(own > 0.0, rows**2 / np.where(own > 0.0, own, 1.0), 0.0).sum(axis=1)
        usual = own.max() if own.max() > 0.0 else 1.0
        self.stiffness[:] = np.where(met > 0.0, 1.0 / np.where(met > 0.0, met, 1.0), usual)
        metric = mass + rows.T @ (self.stiffness[:, None] * rows)
        scale = 1.0 / np.sqrt(np.maximum(metric.diagonal(), TINY))
        sizes, ways = symmetric_eigen(metric * np.outer(scale, scale))
        if not sizes[0] > REGULAR * sizes.size:
            return 1 + int(np.argmax(np.abs(ways[:, 0])))
        a["factor"][:] = np.linalg.cholesky(metric)
        return 0

    @property
    def places(self) -> Array:
        """(links + 1, width) rows of links and the ground, which begin with `ephs.mechanics.road.records.LinkPlace`."""
        return self.arrays["work"].reshape(-1, self.program.width)

    def pose(self, body: int) -> Array:
        """(7,) of a body in the world, where `place` has been."""
        place, frame = self.places[self._link[body]], self._frames[body]
        turn = self._ground.T @ place[:9].reshape(3, 3)
        at = self._ground.T @ place[9:12] + turn @ frame[9:]
        return np.concatenate([matrix_to_quaternion(turn @ frame[:9].reshape(3, 3)), at])

    def link(self, body: int) -> int:
        """Number of a body's link, −1 for the ground."""
        return self._link[body]

    def twist(self, body: int) -> Array:
        """(6,) of a body in its frame, where `place` has been."""
        at = LinkPlace.twist.offset
        return self.inside(body, self._seen(body, self.places[self._link[body], at : at + 6]))

    def twists(self, body: int) -> Array:
        """(6, n) a body's twist by the tree's rates, where `place` has been."""
        link = self.link(body)
        if link < 0:
            return np.zeros((6, self.n))
        self._call("twists")(link)
        return self.inside(body, self._seen(body, self.arrays["rows"])).T

    def _seen(self, body: int, twist: Array) -> Array:
        """(…, 6) twists of a body's link in the link's axes, from those in world axes."""
        turn = self.places[self._link[body], :9].reshape(3, 3)
        return np.concatenate([twist[..., :3] @ turn, twist[..., 3:] @ turn], axis=-1)

    def inside(self, body: int, twist: Array) -> Array:
        """(…, 6) twists of a body in its frame, from those of its link in the link's."""
        frame = self._frames[body]
        turn, at = frame[:9].reshape(3, 3), frame[9:]
        turning, moving = twist[..., :3], twist[..., 3:]
        return np.concatenate([turning @ turn, (moving + np.cross(turning, at)) @ turn], axis=-1)

    def cut_twists(self) -> Array:
        """(nv − n,) rates of cut joints along their degrees of freedom, where the links' motion was computed last."""
        found, at = [np.zeros(0)], Cut.left.offset
        joints = self.arrays["cut"].reshape(-1, Cut.integer_width)
        numbers = self.arrays["cut_numbers"].reshape(-1, Cut.real_width)
        for joint, row, motion in zip(joints, numbers, self.arrays["relative"], strict=True):
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
        """Take a point: evaluate what acts there; (status, component)."""
        a = self.arrays
        self.place(q, r)
        a["base"][:], a["entropy"][:], a["drive"][:], a["wrench"][:] = q, s, drive, wrench
        return int(self._point()), int(a["fault"][0])

    def at(self, a: Array, multiplier: Array) -> Array:
        """The residual where `about` has been: forces, accelerations of rows, and so on; see the slices."""
        self.arrays["a"][:], self.arrays["multiplier"][:] = a, multiplier
        self._call("residual")()
        return self.outs["residual"]

    @property
    def out(self) -> Array:
        """Last result of `at`."""
        return self.outs["residual"]

    def slopes(self) -> EquationSlopes:
        """Derivatives where these equations were evaluated last."""
        if self._slopes is None:
            self._slopes = EquationSlopes(self)
        return self._slopes

    @property
    def powers(self) -> Array:
        """Rates in W of `TOTALS`, without the work of prescribed motions, where `about` has been."""
        return self._totals.copy()

    def follow(self, x0: Array, x: Array, h: float) -> Array:
        """States of what is attached in the middle of a step of h seconds from x0: a step of Newton's method from x,
        where `about` has been."""
        mine = slice(self._first, self.arrays["flow"].size)
        rates, slopes = -self.arrays["flow"][mine], -self.arrays["slope"][mine, mine]
        return x + np.linalg.solve(np.eye(x.size) - 0.5 * h * slopes, x0 + 0.5 * h * rates - x)

    def momenta(self) -> tuple[Array, Array]:
        """((n,), (n,)) ∂L/∂r, and ∂L/∂q with the forces that no potential has, where `about` has been."""
        self._call("action")()
        out = self.outs["action"]
        return out[: self.n].copy(), out[self.n : 2 * self.n].copy()
