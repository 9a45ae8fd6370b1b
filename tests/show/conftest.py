"""Stand-ins with the shape of a solution: a swinging rod with friction, and a circuit of states only."""

import math
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np
import pytest

from ephs.operad import Path, Pattern, junction, quantity
from ephs.solve.result.entries import Entry
from ephs.solve.result.labels import Labels, labels_of


@final
@dataclass(frozen=True)
class Record:
    """A few named arrays."""

    fields: dict[str, Any]

    def __getattr__(self, name: str) -> Any:
        return self.fields[name]


@final
@dataclass(frozen=True)
class FakeScene:
    bodies: dict[str, Any]
    joints: dict[str, Any]
    springs: dict[str, Any]

    def all_bodies(self) -> list[tuple[str, Any]]:
        return list(self.bodies.items())

    def all_joints(self) -> list[tuple[str, Any]]:
        return list(self.joints.items())

    def all_springs(self) -> list[tuple[str, Any]]:
        return list(self.springs.items())

    def all_thermal(self) -> list[tuple[str, Any]]:
        return [("housing", None)]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("all_") or name == "levels":
            return list  # there is nothing of that kind
        raise AttributeError(name)

    @property
    def world(self) -> Record:
        return Record({"temperature": 293.15})


@final
@dataclass(frozen=True)
class FakeSystem:
    pattern: Pattern
    fillings: dict[Any, Any]

    def flatten(self) -> "FakeSystem":
        return self


@final
@dataclass(frozen=True)
class FakeSolution:
    name: str
    t: Any
    scene: Any
    system: Any
    ledgers: dict[str, Any]
    states: dict[str, Any]
    body_records: dict[str, Any] = field(default_factory=dict)
    joint_records: dict[str, Any] = field(default_factory=dict)
    thermal_records: dict[str, Any] = field(default_factory=dict)

    @property
    def outline(self) -> Any:
        return self.scene

    @property
    def labels(self) -> dict[str, Any]:
        quantities = {"pe.q": quantity.displacement, "ke.p": quantity.momentum, "env.s": quantity.entropy}
        return {path: labels_of(quantities.get(path, quantity.body_momentum)) for path in self.states}

    @property
    def problem(self) -> None:
        return None

    @property
    def freedoms(self) -> dict[str, Labels]:
        return {name: Labels("revolute", ("angle",), ("rad",)) for name in self.joint_records}

    def __getattr__(self, name: str) -> Any:
        if name in self.__dict__["ledgers"]:
            return self.__dict__["ledgers"][name]
        raise AttributeError(name)

    def ledger(self, path: Any) -> Any:
        """One storage that gives its exergy to one friction."""
        rest = np.exp(-self.t)
        nothing = np.zeros_like(self.t)
        store = Entry(Path.of("store"), rest, rest, *[nothing] * 7)
        friction = Entry(Path.of("friction"), *[nothing] * 5, (1.0 - rest) / 300.0, 1.0 - rest, nothing, nothing)
        made, lost = friction.made, friction.destroyed
        parts = {"store": store, "friction": friction}
        return Entry(Path.of(path), rest, rest, nothing, nothing, nothing, made, lost, nothing, nothing, parts)

    def body(self, name: str) -> Any:
        return self.body_records[name]

    def joint(self, name: str) -> Any:
        return self.joint_records[name]

    def thermal(self, name: str) -> Any:
        return self.thermal_records[name]

    def summary(self) -> dict[str, Any]:
        return {
            "scene": f"{self.name}.toml",
            "method": "natural",
            "form": "reduced",
            "t_end": float(self.t[-1]),
            "steps": len(self.t) - 1,
            "rejected": 0,
            "unknowns": {"paper": 31, "used": 2},
            "mobility": 1,
            "redundant_constraints": 0,
            "max_energy_error": float(np.abs(self.energy_error).max()),
            "heat": float(self.heat[-1]),
            "work": float(self.work[-1]),
            "bodies": {
                name: {"position": list(body.position[-1]), "velocity": list(body.velocity[-1])}
                for name, body in self.body_records.items()
            },
            "joints": {
                name: {"coordinate": list(joint.coordinate[-1]), "rate": list(joint.rate[-1])}
                for name, joint in self.joint_records.items()
            },
            "thermal": {name: {"temperature": float(r.temperature[-1])} for name, r in self.thermal_records.items()},
        }


def damped_system() -> FakeSystem:
    pattern = Pattern(
        junctions={
            "q": junction(quantity.displacement),
            "p": junction(quantity.momentum),
            "s": junction(quantity.entropy),
        },
        boxes={
            "pe": {"q": "q"},
            "ke": {"p": "p"},
            "pkc": {"q": "q", "p": "p"},
            "mf": {"p": "p", "s": "s"},
            "env": {"s": "s"},
        },
    )
    kinds = {
        "pe": "storage",
        "ke": "storage",
        "pkc": "reversible",
        "mf": "irreversible",
        "env": "environment",
    }
    return FakeSystem(pattern, {path: Record({"kind": kinds[str(path)]}) for path in pattern.boxes})


def ledgers(t: Any, loss: Any) -> dict[str, Any]:
    return {
        "energy": np.full_like(t, 5.0),
        "exergy": 5.0 - loss,
        "entropy": loss / 293.15,
        "heat": loss,
        "work": np.zeros_like(t),
        "energy_error": 1e-16 * (1.0 + np.sin(40.0 * t) ** 2),
        "entropy_production": np.diff(loss, prepend=0.0) / 293.15,
        "constraint_error": np.zeros_like(t),
        "velocity_error": 1e-15 * (1.0 + t),
    }


@pytest.fixture(scope="session")
def circuit() -> FakeSolution:
    """A damped oscillator: states and ledgers, no scene."""
    t = np.linspace(0.0, 10.0, 501)
    loss = 5.0 * (1.0 - np.exp(-0.1 * t))
    swing = np.exp(-0.05 * t)
    states = {"pe.q": swing * np.cos(t), "ke.p": -swing * np.sin(t), "env.s": loss / 293.15}
    totals = ledgers(t, loss) | {"kinetic": None, "potential": None}
    return FakeSolution("damped oscillator", t, None, damped_system(), totals, states)


@pytest.fixture(scope="session")
def pendulum() -> FakeSolution:
    """A rod on a pin that swings about the x axis, held by a spring; a small weight without a shape rides beside it."""
    t = np.linspace(0.0, 4.0, 401)
    loss = 0.4 * (1.0 - np.exp(-0.5 * t))
    angle = 1.2 * np.exp(-0.15 * t) * np.cos(4.0 * t)
    rate = np.gradient(angle, t)
    zero = np.zeros_like(t)
    place = np.stack([zero, 0.25 * np.sin(angle), 1.0 - 0.25 * np.cos(angle)], axis=1)
    turn = np.stack([np.cos(angle / 2), np.sin(angle / 2), zero, zero], axis=1)
    tip = np.stack([zero, 0.6 * np.sin(angle), 1.0 - 0.6 * np.cos(angle)], axis=1)
    still = [1.0, 0.0, 0.0, 0.0]
    along_x = [math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0]
    rod = {
        "name": "rod",
        "mass": 0.5,
        "inertia": np.diag([0.01, 0.01, 1e-4]),
        "shape": {"box": [0.03, 0.04, 0.5]},
        "shapes": (),
    }
    weight = {"name": "weight", "mass": 1.0, "inertia": np.diag([1e-3, 2e-3, 2.5e-3]), "shape": None, "shapes": ()}
    joint = {
        "kind": "revolute",
        "body1": "ground",
        "body2": "rod",
        "frame1": np.array([*along_x, 0.0, 0.0, 1.0]),
        "frame2": np.array([*along_x, 0.0, 0.0, 0.25]),
        "heat": "housing",
        "pitch": 0.0,
        "middle": None,
    }
    slide = {
        "kind": "prismatic",
        "body1": "rod",
        "body2": "arm.weight",
        "frame1": np.array([*still, 0.0, 0.0, -0.2]),
        "frame2": np.array([*still, 0.0, 0.0, 0.0]),
        "heat": "environment",
        "pitch": 0.0,
        "middle": None,
    }
    spring = {
        "bodies": ["ground", "rod"],
        "at1": [0.0, 0.5, 1.0],
        "at2": [0.0, 0.0, -0.25],
        "heat": "environment",
    }
    scene = FakeScene(
        {"rod": Record(rod), "arm.weight": Record(weight)},
        {"pin": Record(joint), "slide": Record(slide)},
        {"s": Record(spring)},
    )
    spin = np.stack([rate, zero, zero], axis=1)
    bodies = {
        name: Record(
            {
                "position": at,
                "quaternion": turn,
                "velocity": np.gradient(at, t, axis=0),
                "angular_velocity": spin,
            }
        )
        for name, at in (("rod", place), ("arm.weight", tip))
    }
    joints = {
        "pin": Record({"coordinate": angle[:, None], "rate": rate[:, None]}),
        "slide": Record({"coordinate": 0.15 + zero[:, None], "rate": zero[:, None]}),
    }
    kinetic = 0.5 * 0.04 * rate**2
    totals = ledgers(t, loss) | {"kinetic": kinetic, "potential": kinetic[0] - kinetic - loss}
    heat = {"housing": Record({"temperature": 300.0 + loss})}
    states = {"rod.ke.p": np.zeros((len(t), 6))}
    return FakeSolution("pendulum", t, scene, damped_system(), totals, states, bodies, joints, heat)
