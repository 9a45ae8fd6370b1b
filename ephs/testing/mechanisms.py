"""Strategies for mechanisms: scenes of rigid bodies and joints in consistent states."""

from collections.abc import Sequence
from typing import final

import numpy as np
from hypothesis import strategies as st
from hypothesis.errors import InvalidArgument

from ephs.mechanics.scene.conduction import Conduction
from ephs.mechanics.scene.geometry import coupling
from ephs.mechanics.scene.model import ENVIRONMENT, GROUND, IDENTITY_POSE, Body, Joint, Scene, World, frozen
from ephs.mechanics.scene.springs import Spring
from ephs.mechanics.scene.thermal import ThermalNode
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.testing.primitives import generators

KINDS = ("revolute", "prismatic", "screw", "cylindrical", "spherical", "planar", "fixed", "free", "universal")
LOOPS = (
    ("revolute", "revolute", "revolute", "revolute"),
    ("revolute", "spherical", "cylindrical", "revolute"),
    ("revolute", "revolute", "revolute", "prismatic"),
    ("revolute", "planar", "revolute", "revolute"),
)


@st.composite
def mechanisms(
    draw: st.DrawFn,
    *,
    max_bodies: int = 3,
    kinds: Sequence[str] = KINDS,
    loops: bool = True,
    friction: bool = True,
    springs: bool = True,
    heat: bool = True,
) -> Scene:
    """Scenes that can move: trees of joints of all kinds, moving; or closed loops of four joints, at rest.

    Parameters
    ----------
    max_bodies
        How many bodies a tree has at most.
    kinds
        Joint types of trees.
    loops
        Whether closed loops occur.
    friction, springs, heat
        Whether joints rub; whether they have stiffness, and springs occur between points; whether friction heats a
        thermal node that conducts to the environment.

    Raises
    ------
    InvalidArgument
        ``max_bodies`` is less than 1, or there are no kinds.
    """
    if max_bodies < 1:
        raise InvalidArgument(f"max_bodies={max_bodies}: expected at least 1")
    if not kinds:
        raise InvalidArgument(f"kinds={kinds!r}: expected at least one")
    rng = draw(generators())
    sinks = [ENVIRONMENT, "node"] if heat and draw(st.booleans()) else [ENVIRONMENT]
    maker = _Maker(rng, draw(st.booleans()) and friction, draw(st.booleans()) and springs, sinks)
    if loops and draw(st.booleans()):
        maker.loop(draw(st.sampled_from(LOOPS)))
    else:
        count = draw(st.integers(1, max_bodies))
        for i in range(count):
            parent = draw(st.sampled_from([GROUND, *maker.bodies]))
            maker.hang(f"body{i}", parent, draw(st.sampled_from(kinds)))
    return maker.scene()


@final
class _Maker:
    """Collects bodies and joints; the random numbers do not shrink, the choices do."""

    def __init__(self, rng: np.random.Generator, friction: bool, springs: bool, sinks: list[str]) -> None:
        self.rng, self.friction, self.springs, self.sinks = rng, friction, springs, sinks
        self.bodies: dict[str, Body] = {}
        self.joints: dict[str, Joint] = {}

    def hang(self, name: str, parent: str, kind: str) -> None:
        """A body on a parent, at random offsets, coordinates and rates."""
        rng = self.rng
        pitch = float(rng.uniform(0.05, 0.5)) if kind == "screw" else 0.0
        middle = frozen(SE3.exp(np.array([np.pi / 2, 0.2, 0.1, 0.0, 0.0, 0.0]))) if kind == "universal" else None
        of = coupling(kind, pitch, middle)
        frame1, frame2 = SE3.exp(0.5 * rng.standard_normal(6)), SE3.exp(0.5 * rng.standard_normal(6))
        x = of.element(0.5 * rng.standard_normal(of.dim))
        rate = 0.5 * rng.standard_normal(of.dim)
        pose, twist = self._motion(parent)
        carried = SE3.adjoint(SE3.inverse(SE3.compose(frame1, of.include(x)))) @ twist + of.basis(x) @ rate
        there = SE3.compose(SE3.compose(SE3.compose(pose, frame1), of.include(x)), SE3.inverse(frame2))
        self._body(name, there, SE3.adjoint(frame2) @ carried)
        self._joint(f"joint{len(self.joints)}", kind, (parent, name), (frame1, frame2), x, rate, pitch, middle)

    def loop(self, kinds: tuple[str, str, str, str]) -> None:
        """Three bars and the ground, joined at the corners of a quadrangle in a tilted plane; at rest.

        All axes are normal to the plane, a prismatic one lies in it along the ground.
        """
        rng = self.rng
        tilt = SE3.exp(np.concatenate([0.5 * rng.standard_normal(3), np.zeros(3)]))
        flat = np.array([[0.0, 0.0], [0.2, 1.0], [1.3, 1.1], [1.0, 0.1]]) + 0.1 * rng.standard_normal((4, 2))
        corners = [SE3.compose(tilt, np.array([1.0, 0.0, 0.0, 0.0, *corner, 0.0])) for corner in flat]
        for i in range(3):
            middle = 0.5 * (corners[i][4:] + corners[i + 1][4:])
            self._body(f"bar{i}", np.concatenate([tilt[:4], middle]), np.zeros(6))
        names = [GROUND, "bar0", "bar1", "bar2", GROUND]
        for i, kind in enumerate(kinds):
            at = corners[i]
            if kind == "prismatic":
                at = SE3.compose(at, SE3.exp(np.array([0.0, np.pi / 2, 0.0, 0.0, 0.0, 0.0])))
            of = coupling(kind)
            frames = tuple(SE3.compose(SE3.inverse(self._motion(name)[0]), at) for name in names[i : i + 2])
            pair = (names[i], names[i + 1])
            self._joint(f"joint{i}", kind, pair, (frames[0], frames[1]), of.identity(), np.zeros(of.dim), 0.0, None)

    def scene(self) -> Scene:
        """The collected scene."""
        springs: dict[str, Spring] = {}
        if self.springs:
            last = list(self.bodies)[-1]
            far = self.bodies[last].pose[4:] + np.array([1.0, 0.5, 2.0])
            at = 0.1 * self.rng.standard_normal(3)
            damping, heat = 0.3 if self.friction else 0.0, self.sinks[-1]
            made = Spring(
                bodies=[GROUND, last], at1=far.tolist(), at2=at.tolist(), stiffness=5.0, length=1.5, damping=damping,
                heat=heat,
            )  # fmt: skip
            springs["spring"] = made.called("spring")
        heated = len(self.sinks) > 1
        return Scene(
            "mechanism",
            World(gravity=frozen([0.0, 0.5, -9.81])),
            self.bodies,
            self.joints,
            springs,
            {"node": ThermalNode("node", 20.0, 310.0)} if heated else {},
            {"fins": Conduction(between=["node", ENVIRONMENT], conductance=0.5).called("fins")} if heated else {},
        )

    def _motion(self, name: str) -> tuple[Array, Array]:
        if name == GROUND:
            return np.array(IDENTITY_POSE), np.zeros(6)
        return np.array(self.bodies[name].pose), np.array(self.bodies[name].twist)

    def _body(self, name: str, pose: Array, twist: Array) -> None:
        points = self.rng.standard_normal((8, 3)) * self.rng.uniform(0.2, 0.6)
        points -= points.mean(axis=0)
        mass = float(self.rng.uniform(0.5, 3.0))
        inertia = sum((p @ p) * np.eye(3) - np.outer(p, p) for p in points) * mass / 8.0
        self.bodies[name] = Body(name, mass, frozen(inertia), frozen(SE3.normalise(pose)), frozen(twist))

    def _joint(
        self,
        name: str,
        kind: str,
        bodies: tuple[str, str],
        frames: tuple[Array, Array],
        x: Array,
        rate: Array,
        pitch: float,
        middle: Array | None,
    ) -> None:
        d = rate.shape[0]
        mu = np.diag(self.rng.uniform(0.05, 0.5, d)) if self.friction else np.zeros((d, d))
        stiff = np.full(d, float(self.rng.uniform(0.5, 3.0)) if self.springs else 0.0)
        self.joints[name] = Joint(
            name=name,
            kind=kind,
            body1=bodies[0],
            body2=bodies[1],
            frame1=frozen(SE3.normalise(frames[0])),
            frame2=frozen(SE3.normalise(frames[1])),
            pitch=pitch,
            friction=frozen(mu),
            stiffness=frozen(stiff),
            rest=frozen(np.zeros(d)),
            heat=self.sinks[-1],
            drive=frozen(np.zeros(d)),
            motion=None,
            coordinate=frozen(x),
            rate=frozen(rate),
            middle=middle,
        )
