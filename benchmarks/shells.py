"""Shells against published values: displacements, large displacements, snaps, frequencies; time beside size; motion.

Of damped sheets: processor time for each element of set-up, of their rates, and of a step by radau; ratios are to the
smallest one.

Linear: Scordelis and Lo's roof, MacNeal and Harder (1985) with Simo's 0.0930 of the hemisphere, Cook. Large: Sze, Liu
and Lo (2004). Frequencies: NAFEMS FV12 and FV16, Rayleigh's ring. Values are ratios to the published ones.

A sheet that falls from level, clamped at a side: error over processor time, here, and by Exudyn where it is installed.
The error is the largest distance of the free corner from a refined run at 21 instants, over the length.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

import ephs
from benchmarks.peers.exudyn_plates import falling
from benchmarks.report import Report, table_of
from ephs.mechanics.elements.shell import spectra, statics
from ephs.mechanics.elements.shell.mesh import grid
from ephs.mechanics.elements.shell.section import ShellSection
from ephs.mechanics.elements.shell.shell import Shell
from ephs.mechanics.elements.shell.system import shell_system
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.tree.equations.equations import ReducedEquations

WX, WY, WZ, X, Y, Z = range(6)
ALL = tuple(range(6))
COLUMNS = {
    "problem": ("problem", 1.0), "elements": ("elements", 1.0), "published": ("published", 1.0),
    "found": ("found", 1.0), "ratio": ("ratio", 1.0), "time [s]": ("seconds", 1.0),
}  # fmt: skip
MOTION = {
    "by": ("by", 1.0), "elements": ("elements", 1.0), "steps": ("steps", 1.0), "time [s]": ("seconds", 1.0),
    "error": ("error", 1.0),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Falling:
    """A sheet that falls from level, clamped at a short side; SI units."""

    length: float = 1.0
    width: float = 0.25
    thickness: float = 0.02
    E: float = 1e7
    nu: float = 0.3
    rho: float = 1000.0
    gravity: float = 9.81
    until: float = 1.0

    def own(self, elements: tuple[int, int], method: str, **how: float) -> tuple[Any, dict[str, Any]]:
        """Places (21, 3) of the free corner, with steps and seconds of processor time, without compilation."""
        points, at, cells = grid(lambda u, v: (self.length * u, self.width * v, 0.0), elements)
        shell = Shell.of(points, cells, ShellSection.isotropic(self.thickness, self.E, self.nu, self.rho))
        held = np.flatnonzero(at[:, 0] == 0.0).tolist()
        system = shell_system(shell, gravity=(0.0, 0.0, -self.gravity), held=held)
        options: dict[str, Any] = {"method": method, "audit": "off", **how}
        ephs.simulate(system, 1e-3 * self.until, **options)  # compiles
        start = time.process_time()
        sol = ephs.simulate(system, self.until, save_at=np.linspace(0.0, self.until, 21), **options)
        seconds = time.process_time() - start
        return sol[f"node{len(points) - 1}.pe.q"][:, 4:], {"steps": int(sol.stats["steps"]), "seconds": seconds}


REFINED: tuple[tuple[int, int], str, dict[str, float]] = ((16, 4), "rk87", {"rtol": 1e-5, "atol": 1e-7})
OWN: tuple[tuple[tuple[int, int], str, dict[str, float]], ...] = (
    *(((n, max(1, n // 4)), "rk87", {"rtol": 1e-4, "atol": 1e-5}) for n in (2, 4, 8)),
    *(((n, max(1, n // 4)), "radau", {"rtol": 1e-3, "atol": 1e-4}) for n in (2, 4, 8)),
)
PEER: tuple[tuple[tuple[int, int], int], ...] = (((4, 1), 100), ((4, 1), 200), ((8, 2), 200), ((8, 2), 400))


@dataclass(frozen=True, slots=True)
class Held:
    """A shell with its loads and holds, and the parameters (m, 2) of its points."""

    shell: Shell
    at: Any
    free: Any
    load: Any

    def hold(self, which: Any, *axes: int) -> None:
        """Hold coordinates of some nodes."""
        for axis in axes:
            self.free[which, axis] = False

    def node(self, u: float, v: float) -> int:
        """The node nearest to parameters."""
        return int(np.argmin(np.linalg.norm(self.at - [u, v], axis=1)))

    def side(self, axis: int, value: float) -> Any:
        """The nodes where a parameter has a value."""
        return self.at[:, axis] == value

    def edge(self, which: Any, axis: int, whole: float) -> None:
        """A uniform load along an edge."""
        share = np.ones(which.sum())
        share[[0, -1]] = 0.5
        self.load[which, axis] = whole * share / share.sum()

    def small(self) -> Any:
        """Small displacements (m, 6)."""
        return statics.displacements(self.shell, self.load, self.free)


def made(
    surface: Any, elements: Any, section: ShellSection, normals: Any = None, distort: float = 0.0, seed: int = 0,
    along: Any = None,
) -> Held:  # fmt: skip
    """A shell on a surface; inner nodes are displaced by parts of an element."""

    def drawn(u: Any, v: Any) -> Any:
        rng = np.random.default_rng(seed)
        inside = (u > 0.0) & (u < 1.0) & (v > 0.0) & (v < 1.0)
        moves = distort * inside * rng.uniform(-1.0, 1.0, (2, len(u)))
        return surface(u + moves[0] / elements[0], v + moves[1] / elements[1])

    points, at, cells = grid(drawn, elements)
    up = None if normals is None else normals(points, at)
    shell = Shell.of(points, cells, section, up, along=along)
    return Held(shell, at, np.ones((len(points), 6), dtype=bool), np.zeros((len(points), 6)))


def about_y(points: Any, _at: Any) -> Any:
    """Normals of a cylinder about y."""
    return points * [1.0, 0.0, 1.0]


def outward(points: Any, _at: Any) -> Any:
    """Normals of a sphere."""
    return points


# ---- small displacements ---------------------------------------------------------------------------------------------


def roof(n: int, distort: float = 0.0) -> float:
    """Scordelis and Lo."""
    angle = np.radians(40.0)
    held = made(
        lambda u, v: (25 * np.sin(angle * u), 25 * v, 25 * np.cos(angle * u)), (n, n),
        ShellSection.isotropic(0.25, 4.32e8), about_y, distort,
    )  # fmt: skip
    held.hold(held.side(1, 0), X, Z)
    held.hold(held.side(1, 1), Y, WX, WZ)
    held.hold(held.side(0, 0), X, WY, WZ)
    held.load[:, Z] = held.shell.shares(-90.0 * held.shell.areas)
    return -held.small()[held.node(1, 1), Z]


def cylinder(n: int, distort: float = 0.0) -> float:
    """Pinched cylinder with end diaphragms."""
    held = made(
        lambda u, v: (300 * np.sin(u * np.pi / 2), 300 * v, 300 * np.cos(u * np.pi / 2)), (n, n),
        ShellSection.isotropic(3.0, 3e6, 0.3), about_y, distort,
    )  # fmt: skip
    held.hold(held.side(1, 0), X, Z)
    held.hold(held.side(1, 1), Y, WX, WZ)
    held.hold(held.side(0, 0), X, WY, WZ)
    held.hold(held.side(0, 1), Z, WX, WY)
    top = held.node(0, 1)
    held.load[top, Z] = -0.25
    return -held.small()[top, Z]


def ball(n: int, h: float = 0.04, distort: float = 0.0) -> Held:
    """A quarter of a hemisphere with a hole of 18°, unit forces."""

    def surface(u: Any, v: Any) -> Any:
        a, b = u * np.pi / 2, np.radians(72.0) * v
        return 10 * np.cos(a) * np.cos(b), 10 * np.sin(a) * np.cos(b), 10 * np.sin(b)

    held = made(surface, (n, n), ShellSection.isotropic(h, 6.825e7, 0.3), outward, distort)
    held.hold(held.side(0, 0), Y, WX, WZ)
    held.hold(held.side(0, 1), X, WY, WZ)
    held.hold(held.node(0, 0), Z)
    held.load[held.node(0, 0), X], held.load[held.node(1, 0), Y] = 1.0, -1.0
    return held


def hemisphere(n: int, h: float = 0.04, distort: float = 0.0) -> float:
    """Displacement under the force, in the thickness 0.04's size."""
    held = ball(n, h, distort)
    return held.small()[held.node(0, 0), X] * (h / 0.04) ** 3


def cook(n: int) -> float:
    """Cook's membrane."""
    held = made(lambda u, v: (48 * u, 44 * u + v * (44 - 28 * u), 0.0), (n, n), ShellSection.isotropic(1.0, 1.0, 1 / 3))
    held.hold(held.side(0, 0), *ALL)
    held.hold(slice(None), Z, WX, WY)
    held.edge(held.side(0, 1), Y, 1.0)
    return held.small()[held.node(1, 0.5), Y]


def twisted(n: int, h: float = 0.32) -> float:
    """Twisted beam, 6n × n elements, a unit force in its plane at the tip."""

    def surface(u: Any, v: Any) -> Any:
        turn, y = u * np.pi / 2, 1.1 * (v - 0.5)
        return 12 * u, y * np.cos(turn), y * np.sin(turn)

    def normals(_points: Any, at: Any) -> Any:
        turn, y = at[:, 0] * np.pi / 2, 1.1 * (at[:, 1] - 0.5)
        return np.stack([y * np.pi / 24, -np.sin(turn), np.cos(turn)], axis=1)

    held = made(surface, (6 * n, n), ShellSection.isotropic(h, 29e6, 0.22), normals)
    held.hold(held.side(0, 0), *ALL)
    held.edge(held.side(0, 1), Z, 1.0 if h == 0.32 else 1e-6)
    load = held.load[:, Z]
    return load @ held.small()[:, Z] / load.sum()


def plate(n: int, ratio: float = 0.01, distort: float = 0.0) -> float:
    """Centre of a clamped unit square under pressure, in p/D."""
    held = made(lambda u, v: (u, v, 0.0), (n, n), ShellSection.isotropic(ratio, 1.0, 0.3), None, distort, 3)
    held.hold(((held.at == 0) | (held.at == 1)).any(axis=1), *ALL)
    held.load[:, Z] = held.shell.shares(held.shell.areas)
    return held.small()[held.node(0.5, 0.5), Z] * ratio**3 / 12.0 / 0.91


# ---- large displacements ---------------------------------------------------------------------------------------------


def cantilever(n: int = 16) -> tuple[float, float]:
    """Deflection and shortening of a strip under an end shear of 4."""
    held = made(lambda u, v: (10 * u, v, 0.0), (n, 1), ShellSection.isotropic(0.1, 1.2e6))
    held.hold(held.side(0, 0), *ALL)
    held.edge(held.side(0, 1), Z, 4.0)
    end = statics.follow(held.shell, held.load, held.free, step=0.02).poses[-1, held.node(1, 0)]
    return end[6], 10.0 - end[4]


def rolled(n: int = 4) -> tuple[Held, Any]:
    """A strip of length 12 that an end moment rolls to a full circle; its poses."""
    held = made(lambda u, v: (12 * u, v, 0.0), (n, 1), ShellSection.isotropic(0.1, 1.2e6))
    held.hold(held.side(0, 0), *ALL)
    held.edge(held.side(0, 1), WY, -50.0 * np.pi / 3.0)
    poses = held.shell.poses
    for share in np.arange(1, 9) / 8.0:
        poses, _ = statics.equilibrium(held.shell, share * held.load, held.free, poses)
    return held, poses


def annulus(across: int = 10, along: int = 80) -> tuple[float, float]:
    """Lift of the inner and the outer corner of a slit annulus under a line force of 0.8."""

    def surface(u: Any, v: Any) -> Any:
        r, a = 6 + 4 * u, 2 * np.pi * v
        return r * np.cos(a), r * np.sin(a), 0.0

    held = made(surface, (across, along), ShellSection.isotropic(0.03, 21e6))
    held.hold(held.side(1, 0), *ALL)
    held.edge(held.side(1, 1), Z, 3.2)
    path = statics.follow(held.shell, held.load, held.free, step=0.002)
    return tuple(path.poses[-1, held.node(u, 1), 6] for u in (0, 1))  # pyright: ignore[reportReturnType]


def ball_large(n: int = 16) -> tuple[float, float]:
    """Outward and inward displacements of the hemisphere under forces of 400 (200 on a quarter)."""
    held = ball(n)
    end = statics.follow(held.shell, 200.0 * held.load, held.free, step=0.02).poses[-1]
    return end[held.node(0, 0), 4] - 10.0, 10.0 - end[held.node(1, 0), 5]


def pulled(across: int = 16, along: int = 24) -> tuple[float, float, Any]:
    """Displacements of an open cylinder pulled by 40000, an eighth of it; the path."""

    def surface(u: Any, v: Any) -> Any:
        a = u * np.pi / 2
        return 4.953 * np.sin(a), 5.175 * v, 4.953 * np.cos(a)

    held = made(surface, (along, across), ShellSection.isotropic(0.094, 10.5e6, 0.3125), about_y)
    held.hold(held.side(0, 0), X, WY, WZ)
    held.hold(held.side(0, 1), Z, WX, WY)
    held.hold(held.side(1, 0), Y, WX, WZ)
    a, b = held.node(0, 0), held.node(1, 0)
    held.load[a, Z] = 10000.0
    path = statics.follow(held.shell, held.load, held.free, step=0.002)
    return path.poses[-1, a, 6] - 4.953, 4.953 - path.poses[-1, b, 4], path


def snapped(n: int = 8, h: float = 12.7) -> statics.ShellPath:
    """Path of a hinged roof under a force in its middle, a quarter of it; loads in parts of 1 kN in all."""

    def surface(u: Any, v: Any) -> Any:
        return 2540.0 * np.sin(0.1 * u), 254.0 * v, 2540.0 * np.cos(0.1 * u)

    held = made(surface, (n, n), ShellSection.isotropic(h, 3102.75, 0.3), about_y)
    held.hold(held.side(0, 0), X, WY, WZ)
    held.hold(held.side(0, 1), X, Y, Z, WX, WZ)
    held.hold(held.side(1, 0), Y, WX, WZ)
    top = held.node(0, 0)
    held.load[top, Z] = -250.0
    low = held.shell.points[top, 2] - 30.0
    return statics.follow(
        held.shell, held.load, held.free, 1e3, step=0.3, stop=lambda _, poses: bool(poses[top, 6] < low)
    )


# ---- frequencies and critical loads ----------------------------------------------------------------------------------


def plate_modes(n: int, kind: str = "FV12", count: int = 6) -> Any:
    """Frequencies in Hz of NAFEMS's plates FV12 (free) and FV16 (one side clamped)."""
    h = 0.05
    held = made(lambda u, v: (10 * u, 10 * v, 0.0), (n, n), ShellSection.isotropic(h, 200e9, 0.3, 8000.0))
    held.hold(slice(None), X, Y, WZ)
    if kind == "FV16":
        held.hold(held.side(0, 0), *ALL)
    rigid = 3 if kind == "FV12" else 0
    found = spectra.modes(held.shell, held.free, count + rigid).values
    return found[rigid:] / (2.0 * np.pi)


def compressed(n: int = 8, h: float = 0.01) -> float:
    """Critical thrust of a hinged square plate of side 1, over π²D, which is 4."""
    held = made(lambda u, v: (u, v, 0.0), (n, n), ShellSection.isotropic(h, 1.0, 0.3))
    rim = ((held.at == 0) | (held.at == 1)).any(axis=1)
    held.hold(rim, Z)
    held.hold(held.side(0, 0), X)
    held.hold(held.node(0, 0), Y)
    held.hold(held.side(0, 0) | held.side(0, 1), WX)
    held.hold(held.side(1, 0) | held.side(1, 1), WY)
    held.edge(held.side(0, 1), X, -(np.pi**2) * h**3 / 12.0 / 0.91)
    return float(spectra.buckling(held.shell, held.load, held.free).values[0])


def ring(around: int) -> Any:
    """Two lowest frequencies of a free short cylinder over Rayleigh's for n = 2, 3 waves."""
    angle, height = 2 * np.pi * np.arange(around) / around, np.linspace(0.0, 0.2, 3)
    a, z = (x.ravel() for x in np.meshgrid(angle, height, indexing="ij"))
    points = np.stack([np.cos(a), np.sin(a), z], axis=1)
    number = np.arange(len(points)).reshape(around, 3)
    after = np.roll(number, -1, axis=0)
    corners = (number[:, :-1], after[:, :-1], after[:, 1:], number[:, 1:])
    cells = np.stack([corner.ravel() for corner in corners], axis=1)
    shell = Shell.of(points, cells, ShellSection.isotropic(0.01, 1.0, 0.0, 1.0), points * [1.0, 1.0, 0.0])
    found = spectra.modes(shell, np.ones((len(points), 6), dtype=bool), 12).values[6:] / (0.01 / np.sqrt(12.0))
    return [found[np.argmin(np.abs(found - e))] / e for n in (2, 3) if (e := n * (n * n - 1) / np.sqrt(n * n + 1))]


PUBLISHED: dict[str, tuple[Callable[[int], float], tuple[int, ...], float]] = {
    "roof": (roof, (4, 8, 16), 0.3024),
    "pinched cylinder": (cylinder, (4, 8, 16), 1.8248e-5),
    "hemisphere": (hemisphere, (4, 8, 16), 0.0930),
    "Cook's membrane": (cook, (2, 4, 8), 23.96),
    "twisted beam": (twisted, (1, 2, 4), 5.424e-3),
    "twisted beam, thin": (lambda n: twisted(n, 0.0032), (1, 2, 4), 5.256e-3),
    "clamped plate, h/L = 1e-4": (lambda n: plate(n, 1e-4), (8, 16), 0.00126532),
}
LARGE: dict[str, tuple[Callable[[], tuple[float, ...]], tuple[float, ...]]] = {
    "cantilever 16 × 1": (cantilever, (6.698, 3.286)),
    "slit annulus 10 × 80": (annulus, (13.891, 17.528)),
    "hemisphere, forces 400, 16 × 16": (ball_large, (4.067, 8.178)),
    "pull-out 16 × 24": (lambda: pulled()[:2], (2.768, 4.551)),
    "hinged roof, limit in kN, 8 × 8": (lambda: (limit(snapped()),), (2.2,)),
    "FV12 in Hz, 16 × 16": (lambda: tuple(plate_modes(16)), (1.622, 2.360, 2.922, 4.233, 4.233, 7.416)),
    "FV16 in Hz, 16 × 16": (lambda: tuple(plate_modes(16, "FV16")), (0.421, 1.029, 2.582, 3.306, 3.753, 6.555)),
    "ring over Rayleigh, 32 around": (lambda: tuple(ring(32)), (1.0, 1.0)),
    "thrust of a hinged plate over π²D, 16 × 16": (lambda: (compressed(16),), (4.0,)),
}


def sheet(n: int) -> ephs.System:
    """A sheet of n × n damped elements that is clamped on one side."""
    points, at, cells = grid(lambda u, v: (0.4 * u, 0.2 * v, 0.0), (n, n))
    shell = Shell.of(points, cells, ShellSection.isotropic(0.002, 1e7, 0.3, 1000.0))
    held = np.flatnonzero(at[:, 0] == 0.0)
    return shell_system(shell, gravity=(0.0, 0.0, -9.81), damping=1e-3, held=held.tolist())


def ready(n: int) -> tuple[float, float]:
    """Processor time in s for each of n × n elements: from the mesh to the first rates; and of rates then."""
    start = time.process_time()
    equations = ReducedEquations(problem_of_system(sheet(n)), 0.0)
    state = equations.start(0.0)
    y = equations.vector(state)
    equations.rates(0.0, state.q, y)
    made, times = time.process_time() - start, list[float]()
    for _ in range(5):
        start = time.process_time()
        for _ in range(1 + 1000 // n**2):
            equations.rates(0.0, state.q, y)
        times.append((time.process_time() - start) / (1 + 1000 // n**2))
    return made / n**2, min(times) / n**2


def swung(n: int) -> tuple[float, float]:
    """Processor time in s for each of n × n elements: of all before steps; and of a step."""

    def run(span: float) -> tuple[float, int]:
        start = time.process_time()
        solution = ephs.simulate(sheet(n), span, method="radau", audit="off")
        return time.process_time() - start, int(solution.stats["steps"])

    run(1e-7)  # compile
    few, many = run(1e-7), run(1e-3)
    return few[0] / n**2, (many[0] - few[0]) / (many[1] - few[1]) / n**2


def limit(path: statics.ShellPath) -> float:
    """The first largest share of a path."""
    falls = np.flatnonzero(np.diff(path.shares) < 0.0)
    return float(path.shares[falls[0] if falls.size else -1])


def report() -> Report:
    """All of them."""
    rows: list[dict[str, Any]] = []
    for name, (problem, sizes, known) in PUBLISHED.items():
        for n in sizes:
            start = time.perf_counter()
            found = problem(n)
            seconds = time.perf_counter() - start
            row = {"problem": name, "elements": n, "published": known, "found": float(found), "seconds": seconds}
            rows.append(row | {"ratio": float(found) / known})
    for name, (run, known) in LARGE.items():
        start = time.perf_counter()
        found = run()
        seconds = time.perf_counter() - start
        for have, want in zip(found, known, strict=False):  # of equal frequencies all are found
            row = {"problem": name, "published": want, "found": float(have), "ratio": float(have) / want}
            rows.append(row | {"seconds": seconds})
    ready(2)  # compile
    for run, sizes, names in (
        (ready, (10, 32, 100), ("sheet, set-up of an element in s", "rates of an element in s")),
        (
            swung,
            (8, 16, 32),
            ("sheet, set-up and first steps of radau, of an element in s", "a step of an element in s"),
        ),
    ):
        times = {n: run(n) for n in sizes}
        for k, name in enumerate(names):
            rows += [
                {"problem": name, "elements": n, "found": found[k], "ratio": found[k] / times[sizes[0]][k]}
                for n, found in times.items()
            ]
    motions = list(fallen())
    return Report(table_of(rows, COLUMNS) + "\n\n" + table_of(motions, MOTION), [*rows, *motions])


def fallen() -> Iterator[dict[str, Any]]:
    """Runs of a falling sheet, and their errors."""
    sheet = Falling()
    exact, _ = sheet.own(REFINED[0], REFINED[1], **REFINED[2])
    runs = [(method, n, sheet.own(n, method, **how)) for n, method, how in OWN]
    if find_spec("exudyn"):
        runs += [("Exudyn, thin plates", n, falling(sheet, n, steps)) for n, steps in PEER]
    for by, (n, m), (corner, facts) in runs:
        error = float(np.linalg.norm(corner - exact, axis=1).max()) / sheet.length
        yield {"by": by, "elements": f"{n} × {m}", "error": error, **facts}
