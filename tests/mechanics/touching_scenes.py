"""Scene files of bodies and sheets that touch, drawn at random: on the ground and on each other, free and in joints."""

from collections.abc import Callable, Mapping
from itertools import combinations, product
from random import Random
from typing import Any

import numpy as np

from ephs.mechanics.shapes.pairs import touches
from ephs.semantics.spaces import SE3
from tests.mechanics.drawn_scenes import FREEDOMS, load, vector, windings

Shape = Mapping[str, Any]
CORNERS = np.array([[-0.08, -0.06, -0.05], [0.09, -0.05, -0.05], [0.0, 0.1, -0.05], [0.0, 0.0, 0.11]])
ROUND = ("sphere", "capsule")
SHAPES = (*ROUND, "cylinder", "box", "points")
JOINTS = ("revolute", "prismatic", "planar", "spherical", "cylindrical", "screw")
UPRIGHT = ("prismatic", "cylindrical", "screw")
FAR, STEPS = 1.5, 60
"""Height in m above which nothing touches, and of how many the first one is sought at which something does."""


def drawn_touching(seed: int, *, hard: bool = False) -> dict[str, Any]:
    """Tables of up to three bodies, each half a millimetre in, or up to one above, what it touches first below."""
    r = Random(seed)
    u, likely = r.uniform, lambda part: r.random() < part
    out, heat = _world(r)
    exponent = {} if hard or likely(0.6) else {"exponent": 1.5}

    def surface(body: str, shape: Shape) -> dict[str, Any]:
        return {"body": body, "shape": shape, **_law(r, hard=hard), **exponent, **heat()}

    ground, tilt = r.choice([{"plane": {}}, {"box": [1.0, 1.0, 0.2]}]), [1.0, u(-0.1, 0.1), u(-0.1, 0.1), 0.0]
    place = np.array([*tilt / np.linalg.norm(tilt), 0.0, 0.0, 0.0 if "plane" in ground else -0.1])
    on_ground = {"rotation": place[:4].tolist(), "position": place[4:].tolist()}
    out["surfaces"] = {"floor": surface("ground", ground) | on_ground}
    there, kinds = [(ground, place)], SHAPES if likely(0.4) else ROUND
    for i in range(r.randint(1, 3)):
        kinds = (next(iter(there[-1][0])),) if i and likely(0.5) else kinds  # of one kind with the one before
        shape, mass, turn, (x, y, _) = _shape(r, kinds), u(0.5, 2.0), _turn(r), vector(r, 0.04)
        high = _touching_height(there, shape, lambda z, x=x, y=y, turn=turn: np.array([*turn, x, y, z]))
        at = [x, y, high + (u(1e-4, 1e-3) if hard else u(-5e-4, 1e-3))]
        there.append((shape, np.array([*turn, *at])))
        moments = [4e-3 * mass * u(1.0, 1.4) for _ in range(3)]
        out["bodies"][f"b{i}"] = {"mass": mass, "inertia": moments, "position": at, "rotation": turn}
        out["surfaces"][f"s{i}"] = surface(f"b{i}", shape)
        out["joints"][f"j{i}"] = _joint(r, f"b{i}", at, hard=hard) | (heat() if likely(0.5) else {})
    pairs = combinations(out["surfaces"], 2)
    out["contacts"] = {f"{one}_{other}": {"surfaces": r.sample([one, other], 2)} for one, other in pairs}
    _add_forces(r, out)
    return out


def drawn_hard(seed: int) -> dict[str, Any]:
    """The same with hard surfaces and stops, which are open at the start."""
    return drawn_touching(seed, hard=True)


def drawn_sheet(seed: int) -> dict[str, Any]:
    """Tables of a sheet of 2 × 2 to 4 × 2 elements that touches the ground, a body, or both."""
    r = Random(seed)
    u, (out, heat) = r.uniform, _world(r)
    (long, wide), radius, (m, n) = (u(0.15, 0.25), u(0.1, 0.15)), u(0.005, 0.02), r.choice([(2, 2), (3, 2), (4, 2)])
    high = radius + u(-5e-4, 1e-3)
    corners = [[0.0, 0.0, high], [long, 0.0, high], [long, wide, high], [0.0, wide, high]]
    material = {"thickness": u(0.01, 0.02), "E": u(5e4, 2e5), "nu": 0.3, "rho": u(500.0, 1000.0)}
    sheet = {"corners": corners, "elements": [m, n], **material, "damping": u(1e-3, 5e-3), "spread": True}
    held, covered = r.random() < 0.5, r.random() < 0.5
    if held:
        sheet["edges"] = [r.choice(["ground", "free"]), "free", "ground", "free"]
    out["shells"] = {"cloth": sheet}
    skin = _law(r, hard=False) | {"stiffness": u(1e3, 5e3)} | heat()
    out["surfaces"] = {"skin": {"body": "cloth", "shape": {"sphere": radius}, **skin}}
    if not (held and covered):
        out["surfaces"]["floor"] = {"body": "ground", "shape": {"plane": {}}, **_law(r, hard=False)}
    if covered:
        size, turn, mass = u(0.12, 0.16), _turn(r), u(0.2, 0.5)
        shape = r.choice([{"sphere": size}, {"box": [2.0 * size] * 3}, {"capsule": [size, 0.1]}])
        x, y = 0.5 * long + u(-0.02, 0.02), 0.5 * wide + u(-0.02, 0.02)
        nodes = product(np.linspace(0.0, long, m + 1), np.linspace(0.0, wide, n + 1))
        balls = [({"sphere": radius}, np.array([1.0, 0.0, 0.0, 0.0, *node, high])) for node in nodes]
        up = _touching_height(balls, shape, lambda z: np.array([*turn, x, y, z]))
        at = [x, y, up + u(-2e-4, 5e-4)]
        out["bodies"]["ball"] = {"mass": mass, "inertia": [5e-3 * mass] * 3, "position": at, "rotation": turn}
        out["surfaces"]["ball"] = {"body": "ball", "shape": shape, **_law(r, hard=False), **heat()}
        out["joints"]["ball"] = _free("ball", at, [*vector(r, 1.0), *vector(r, 0.2)[:2], -u(0.1, 0.3)])
    return out


def _world(r: Random) -> tuple[dict[str, Any], Callable[[], dict[str, str]]]:
    """Tables with gravity, and whether there is a thermal node; what draws where heat goes."""
    world = {"gravity": [*vector(r, 2.0)[:2], -r.uniform(5.0, 10.0)], "temperature": r.uniform(250.0, 350.0)}
    out: dict[str, Any] = {"world": world, "bodies": {}, "joints": {}}
    if r.random() < 0.5:
        out["thermal"] = {"hot": {"capacity": r.uniform(1.0, 5.0), "temperature": r.uniform(280.0, 320.0)}}
    return out, lambda: {"heat": "hot"} if "thermal" in out and r.random() < 0.5 else {}


def _turn(r: Random) -> list[float]:
    q = np.array([r.gauss(0.0, 1.0) for _ in range(4)])
    return (q / np.linalg.norm(q)).tolist()


def _shape(r: Random, kinds: tuple[str, ...]) -> Shape:
    u, kind = r.uniform, r.choice(kinds)
    sizes: Mapping[str, Callable[[], Any]] = {
        "sphere": lambda: u(0.05, 0.12),
        "capsule": lambda: [u(0.04, 0.07), u(0.1, 0.2)],
        "cylinder": lambda: [u(0.05, 0.08), u(0.12, 0.25)],
        "box": lambda: [u(0.1, 0.2) for _ in range(3)],
        "points": lambda: (CORNERS * [u(0.7, 1.4) for _ in range(3)]).tolist(),
    }
    return {kind: sizes[kind]()}


def _law(r: Random, *, hard: bool) -> dict[str, Any]:
    u = r.uniform
    friction = {"friction": r.choice([0.0, u(0.1, 0.3), u(0.5, 1.0)])}
    if hard:
        return friction | {"restitution": r.choice([0.0, u(0.2, 0.9)])}
    turning = {"rolling": u(1e-3, 1e-2), "spinning": u(1e-3, 1e-2)} if r.random() < 0.3 else {}
    return friction | turning | {"stiffness": u(2e3, 2e4), "loss": r.choice([0.0, u(0.1, 0.5)]), "slip": u(0.01, 0.05)}


def _touching_height(there: list[tuple[Shape, Any]], shape: Shape, pose: Callable[[float], Any]) -> float:
    """The greatest height in m at which a shape touches one of those that are there."""

    def nearest(z: float) -> float:
        return min(least_gap(*each, shape, pose(z)) for each in there)

    heights = np.linspace(FAR, 0.0, STEPS).tolist()
    k = next(k for k, z in enumerate(heights) if nearest(z) < 0.0)
    low, high = heights[k], heights[k - 1]
    for _ in range(30):  # to 1e-9 m
        middle = 0.5 * (low + high)
        low, high = (middle, high) if nearest(middle) < 0.0 else (low, middle)
    return high


def least_gap(shape1: Shape, pose1: Any, shape2: Shape, pose2: Any) -> float:
    """The least gap in m of two shapes at poses (7,)."""
    one, other = ({"mesh": shape["points"]} if "points" in shape else shape for shape in (shape1, shape2))
    points, _ = touches(one, pose1, other, pose2)  # bodies whose frames are that of the world
    return min(float(gap.distance(SE3.compose(SE3.inverse(a), b))) for a, b, gap in points)


def _free(body: str, at: list[float], rates: list[float]) -> dict[str, Any]:
    return {"type": "free", "bodies": ["ground", body], "at": at, "rate": rates}


def _joint(r: Random, body: str, at: list[float], *, hard: bool) -> dict[str, Any]:
    u = r.uniform
    if r.random() < 0.6:
        return _free(body, at, [*vector(r, 3.0), *vector(r, 0.5)[:2], -u(0.2, 0.6)])
    kind, (x, y) = r.choice(JOINTS), (u(-0.5, 0.5), u(-0.5, 0.5))
    place = [a + b for a, b in zip(at, [u(0.1, 0.3), u(-0.2, 0.2), u(-0.1, 0.1)], strict=True)]
    joint: dict[str, Any] = {"type": kind, "bodies": r.sample(["ground", body], 2), "at": place}
    rates = [u(-1.0, 1.0) for _ in range(FREEDOMS[kind])]
    joint |= {"axis": [x, y, 1.0] if kind in UPRIGHT else [x, 1.0, y], "friction": r.choice([0.0, u(0.02, 0.4)])}
    joint |= {"rate": rates[0] if len(rates) == 1 else rates} | ({"pitch": u(0.05, 0.2)} if kind == "screw" else {})
    if len(rates) == 1 and r.random() < 0.5:
        joint |= {"limit_restitution": u(0.0, 0.8)} if hard else {"limit_stiffness": u(1e3, 5e3), "limit_loss": 0.3}
        joint["limits"] = [-u(0.005, 0.02), u(0.005, 0.02)]
    return joint


def _add_forces(r: Random, out: dict[str, Any]) -> None:
    u, likely, bodies = r.uniform, lambda part: r.random() < part, list(out["bodies"])
    if likely(0.3):
        ends = {"bodies": ["ground", r.choice(bodies)], "at1": [u(-0.3, 0.3), 0.0, 0.8], "at2": vector(r, 0.05)}
        law = {"stiffness": u(10.0, 100.0), "length": u(0.1, 0.5), "damping": u(0.0, 1.0)}
        out["springs"] = {"spring": ends | law}
    if likely(0.3):
        out["loads"] = load(r, bodies, 5.0)
    single = [name for name, joint in out["joints"].items() if FREEDOMS[joint["type"]] == 1]
    if single and likely(0.4):
        out["motors"] = {"motor": {"joint": single[0], **windings(r), "inductance": u(0.05, 0.2)}}
