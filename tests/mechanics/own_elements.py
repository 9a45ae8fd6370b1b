"""Elements as users register them: a spring on a joint, oil of two supplies, a coil; and a scene with them."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

import ephs
from ephs import quantity as Q
from ephs.mechanics import Element, key, register_element, rule
from ephs.mechanics.scene.registry import REGISTERED

__all__ = ["OWN", "Fan", "Pump", "Push", "registered"]


class Push(Element, section="pushes", said="springs on joints"):
    """½ k q² of the integral of a joint's rate."""

    joint: str = key("the joint", names="axis")
    stiffness: float = key("stiffness", unit="N m/q²", ge=0.0)
    stretch: float = key("at the start", 0.0, unit="q")
    way: list[float] = key("two numbers", [0.0, 0.0], unit="m", min_length=2, max_length=2)
    ratio: float | None = key("a ratio", None, unit="1", gt=0.0)
    turns: int = key("a count", 1, ge=1)
    open: bool = key("a flag", False)

    def continued(self, states):
        return self.changed(stretch=float(states["spring.q"][0])) if self.turns == 1 else self

    @rule("stretch", expected="below 10", found="the stretch {stretch:g}")
    def small(self) -> bool:
        return self.stretch < 10.0

    def build(self, site):
        at, q = site.quantity(self.joint), site.inner("q", Q.displacement)
        site.add(ephs.library.spring(k=self.stiffness), {"q": q}, "spring", initial={"q": [self.stretch]})
        turn = ephs.gyrator({"q": Q.displacement, "p": at}, [[0.0, -1.0], [1.0, 0.0]])
        site.add(turn, {"q": q, "p": site.drive(self.joint)}, "turn")


class Pump(Element, section="pumps", said="two pressures that are one input"):
    """Oil between two supplies, shared among joints by ratios that one number may stand for."""

    joints: list[str] = key("joints", names="single", min_length=1)
    ratio: float | list[float] = key("a ratio for each", 1.0, unit="m³/qᵢ")
    leak: float = key("conductance between the supplies", 1e-3, unit="m³/(s Pa)")
    pressure: list[float] = key("of the supplies", [0.0, 0.0], unit="Pa", min_length=2, max_length=2)

    def normalised(self):
        return self.changed(ratio=np.resize(self.ratio, len(self.joints)).tolist())

    @rule("joints", at="", expected="at most {most} joints")
    def few(self):
        return len(self.joints) < 3 or {"most": 2}

    def build(self, site):
        ends = {f"v{k}": site.input(Q.liquid, p, f"v{k}", at="oil") for k, p in enumerate(self.pressure, 1)}
        site.add(ephs.library.laminar_leak(c=self.leak), ends | {"s": site.entropy()}, "line")
        for joint, ratio in zip(self.joints, self.ratio, strict=True):
            skew = [[0.0, 0.0, ratio], [0.0, 0.0, -ratio], [-ratio, ratio, 0.0]]
            flow = ephs.gyrator({"v1": Q.liquid, "v2": Q.liquid, "p": site.quantity(joint)}, skew)
            site.add(flow, ends | {"p": site.drive(joint)}, f"piston.{joint}")


class Fan(Element, section="fans", said="a voltage on a resistor on a coil"):
    """A coil that an input drives."""

    inductance: float = key("inductance", unit="H", gt=0.0)
    voltage: float = key("without an input", 0.0, unit="V")
    flux: float = key("at the start", 0.0, unit="Wb")

    def continued(self, states):
        return self.changed(flux=float(states["coil.b"][0]))

    def build(self, site):
        at, coil = site.input(Q.charge, self.voltage), site.inner("b", Q.flux_linkage)
        inductance = self.inductance
        site.add(
            ephs.storage({"b": Q.flux_linkage}, lambda b: 0.5 * b**2 / inductance),
            {"b": coil},
            "coil",
            initial={"b": [self.flux]},
        )
        site.add(
            ephs.gyrator({"q": Q.charge, "b": Q.flux_linkage}, [[0.0, 1.0], [-1.0, 0.0]]), {"q": at, "b": coil}, "emc"
        )


OWN = """
[bodies.cart]
mass = 2.0
inertia = [1.0, 1.0, 1.0]
[joints.rail]
type = "prismatic"
bodies = ["ground", "cart"]
at = [0.0, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
rate = 0.5
[thermal.box]
capacity = 5.0
temperature = 300.0
[pushes.s]
joint = "rail"
stiffness = 8.0
stretch = 0.5
[pumps.p]
joints = ["rail"]
ratio = 0.5
pressure = [3.0, 1.0]
[fans.f]
inductance = 2.0
voltage = 3.0
"""
"""Tables of a scene with all of them."""


@contextmanager
def registered() -> Iterator[None]:
    """They are registered inside, and what was before is so after."""
    before = dict(REGISTERED)
    for kind in (Push, Pump, Fan):
        register_element(kind)
    yield
    REGISTERED.clear()
    REGISTERED.update(before)
