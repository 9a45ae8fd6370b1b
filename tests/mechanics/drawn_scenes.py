"""Scene files drawn at random: trees of joints of all kinds, and what can be put between and on them."""

import json
from collections.abc import Mapping
from random import Random
from typing import Any

FREEDOMS = {
    "revolute": 1, "prismatic": 1, "screw": 1, "cylindrical": 2, "planar": 3, "spherical": 3, "universal": 2, "free": 6,
}  # fmt: skip
SECTIONS = (
    "springs", "gears", "motors", "gas_springs", "cylinders", "tendons", "loads", "beams", "thermal", "conduction",
)  # fmt: skip


def toml(tables: Mapping[str, Any]) -> str:
    """A scene file of tables by section and name."""
    lines = ["format = 1"]
    for section, entries in tables.items():
        whole = {section: entries} if section in ("world", "assembly") else entries
        for name, entry in whole.items():
            lines.append(f"[{section}]" if name == section else f"[{section}.{name}]")
            lines += [f"{key} = {_shown(value)}" for key, value in entry.items()]
    return "\n".join(lines) + "\n"


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_shown(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_shown, value)) + "]"
    return json.dumps(value)


def drawn(seed: int) -> dict[str, Any]:
    """Tables of a scene; in SI units all sizes are about 1, and masses in reach of 1 s.

    One in two has heat between nodes, and so on: see `SECTIONS`.
    """
    r = Random(seed)
    u, likely = r.uniform, lambda part: r.random() < part
    gravity = vector(r, 9.81)
    out: dict[str, Any] = {"world": {"gravity": gravity, "temperature": u(250.0, 350.0)}, "bodies": {}, "joints": {}}
    if likely(0.5):
        out["thermal"] = {name: {"capacity": u(1.0, 5.0), "temperature": u(280.0, 320.0)} for name in ("hot", "cold")}
        ends = {"inside": ["hot", "cold"], "outside": ["cold", "environment"]}
        out["conduction"] = {name: {"between": pair, "conductance": u(0.01, 0.5)} for name, pair in ends.items()}

    def heat() -> dict[str, str]:
        return {"heat": r.choice(["hot", "cold"])} if "thermal" in out and likely(0.7) else {}

    for i in range(r.randint(1, 3)):
        _add_body(r, out, i, heat)
    bodies, single = list(out["bodies"]), [n for n, j in out["joints"].items() if FREEDOMS[j["type"]] == 1]
    r.shuffle(single)

    def point(body: str) -> list[float]:
        return vector(r, 1.0 if body == "ground" else 0.3)

    if likely(0.5):
        ends = r.sample(["ground", *bodies], 2)
        places = {"at1": point(ends[0]), "at2": point(ends[1])}
        law = {"stiffness": u(1.0, 30.0), "length": u(0.1, 1.0), "damping": u(0.0, 1.0)}
        out["springs"] = {"spring": {"bodies": ends, **places, **law, **heat()}}
    if len(single) > 1 and likely(0.6):
        belt = {"stiffness": u(5.0, 50.0), "damping": u(0.0, 1.0), "ratio": u(-2.0, 2.0), "friction": u(0.0, 0.2)}
        out["gears"] = {"belt": {"joints": single[:2], **belt, **heat()}}
    if single:
        _add_machines(r, out, single, heat)
    if likely(0.35) and len(bodies) > 1:
        on = r.sample(["ground", *bodies], r.randint(2, 3))
        law = {"stiffness": u(1.0, 20.0), "damping": u(0.0, 1.0)}
        out["tendons"] = {"tendon": {"bodies": on, "points": [point(body) for body in on], **law, **heat()}}
    if likely(0.4):
        out["loads"] = load(r, bodies, 2.0)
    if likely(0.25):
        body, start = r.choice(bodies), vector(r, 0.5)
        ends = {"from": start, "to": [x + y for x, y in zip(start, vector(r, 0.5), strict=True)], "ends": [body]}
        section = {"circle": 0.02, "E": u(3e4, 3e5), "nu": 0.3, "rho": 1000.0}
        out["beams"] = {"rod": {**ends, "elements": 2, "section": section, "damping": u(0.0, 0.02), **heat()}}
        out["assembly"] = {"adjust": True}
    return out


def vector(r: Random, size: float) -> list[float]:
    return [r.uniform(-size, size) for _ in range(3)]


def load(r: Random, bodies: list[str], size: float) -> dict[str, Any]:
    """A load of forces up to a size on one of the bodies."""
    wrench = {"force": vector(r, size), "moment": vector(r, 0.3), "follower": r.random() < 0.5}
    return {"load": {"body": r.choice(bodies), **wrench}}


def windings(r: Random) -> dict[str, float]:
    """Numbers that every motor has."""
    u = r.uniform
    return {"constant": u(0.1, 1.0), "resistance": u(0.5, 2.0), "voltage": u(-3.0, 3.0), "gear": u(0.5, 2.0)}


def _add_body(r: Random, out: dict[str, Any], i: int, heat: Any) -> None:
    u, kind, mass = r.uniform, r.choice(list(FREEDOMS)), r.uniform(0.3, 2.0)
    at, wide = vector(r, 0.6), [r.uniform(0.3, 1.0) ** 2 for _ in range(3)]
    moments = [0.05 * mass * (sum(wide) - each) for each in wide]
    out["bodies"][f"b{i}"] = {"mass": mass, "inertia": moments, "position": at, "rotation": {"rpy": vector(r, 2.0)}}
    on = "ground" if kind == "free" or not i else r.choice(["ground", *(f"b{j}" for j in range(i))])
    ends = [on, f"b{i}"][:: r.choice([1, -1])]
    place = [x + y for x, y in zip(at, vector(r, 0.3), strict=True)]
    rates = [u(-1.0, 1.0) for _ in range(FREEDOMS[kind])]
    joint = {"type": kind, "bodies": ends, "at": place, "axis": vector(r, 1.0)}
    joint["rate"] = rates[0] if len(rates) == 1 else rates
    if kind == "universal":
        x, y, z = joint["axis"]
        joint["axis2"] = [y, -x, 0.0] if abs(z) < 2.0 * abs(x) + 2.0 * abs(y) else [z, 0.0, -x]
    if kind == "screw":
        joint["pitch"] = u(-0.2, 0.2)
    if r.random() < 0.6:
        joint |= {"friction": u(0.02, 0.4), **heat()}
    if kind != "free" and r.random() < 0.5:
        joint["stiffness"] = u(1.0, 20.0)
    if len(rates) == 1 and r.random() < 0.2:
        joint["drive"] = u(-2.0, 2.0)
    out["joints"][f"j{i}"] = joint


def _add_machines(r: Random, out: dict[str, Any], single: list[str], heat: Any) -> None:
    u, likely = r.uniform, lambda part: r.random() < part
    if likely(0.4):
        circuit = windings(r)
        stores = {"inductance": r.choice([0.0, u(0.05, 0.2)]), "inertia": r.choice([0.0, u(0.01, 0.1)])}
        out["motors"] = {"motor": {"joint": single[0], **circuit, **stores, **heat()}}
    if likely(0.3):
        gas = {"volume": u(1e-3, 3e-3), "pressure": u(1e5, 2e5), "conductance": u(0.0, 1.0)}
        out["gas_springs"] = {"gas": {"joint": single[-1], "area": u(1e-4, 1e-3) * r.choice([-1, 1]), **gas, **heat()}}
    if likely(0.3):
        oil = {"volume": [u(1e-3, 3e-3)] * 2, "conductance": u(1e-8, 1e-7), "bulk": u(1e6, 5e6), "leak": u(0.0, 1e-8)}
        sides = {"area": [u(1e-4, 1e-3), -u(1e-4, 1e-3)], "pressure": [u(0.0, 1e4), u(0.0, 1e4)]}
        out["cylinders"] = {"cylinder": {"joint": single[-1], **sides, **oil, **heat()}}
