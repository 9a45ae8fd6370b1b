"""The part that a primitive can play in a mechanism, read from its structure."""

from enum import Enum, auto

import numpy as np

from ephs.operad import quantity
from ephs.semantics.primitives.primitives import Irreversible, Primitive, Reversible, Storage
from ephs.semantics.primitives.pullback import pulled_ports
from ephs.solve.equations.heats import exponential_law

FREE, RATE = quantity.relative_pose("free"), quantity.joint_momentum("free")


class Role(Enum):
    """Part of a primitive in a mechanism."""

    KINETIC = auto()
    """Stores the momentum of a body, quadratically."""
    POSE = auto()
    """Stores the pose of a body, with a potential or none."""
    GYROSCOPIC = auto()
    """The Lie–Poisson structure of a body's momentum."""
    COUPLING = auto()
    """Kinematics: a pose, or a relative pose, from its twist."""
    OFFSET = auto()
    """Carries a momentum to a frame at a constant offset."""
    GROUND = auto()
    """Holds a frame still."""
    JOINT = auto()
    """The relation of a joint between two frames."""
    RELATIVE = auto()
    """Stores the relative pose of a joint, with a potential or none."""
    SEVERAL = auto()
    """Stores the relative poses of several free joints, with one potential."""
    FRICTION = auto()
    """Resists the rate of a joint, and heats."""
    RESISTANCE = auto()
    """Resists the rates of several free joints, and heats."""
    DRAG = auto()
    """Resists the twist of a body, and heats."""
    CONDUCTION = auto()
    """Conducts heat between two stores of it."""
    HEAT = auto()
    """Stores heat: E = c₁ (exp(s/c₂) − 1)."""
    ENVIRONMENT = auto()
    """Takes up heat at the temperature of the reference."""
    OTHER = auto()
    """Components that may be attached."""


def offset_of(primitive: Primitive) -> np.ndarray | None:
    """(7,) the pose of the frame that a frame change leads to, in the frame of its first port; None of others."""
    kernel = primitive.kernel
    return np.array(kernel.parameters) if kernel is not None and kernel.name == "frame_change" else None


def role_of(primitive: Primitive) -> Role:
    """The role of a primitive."""
    quantities = [q for _, _, q in primitive.bundle.items()]
    kinds, on_bodies = [q.kind for q in quantities], [q == quantity.body_momentum for q in quantities]
    if isinstance(primitive, Storage):
        return _of_storage(primitive, kinds, on_bodies)
    if isinstance(primitive, Irreversible):
        return _of_irreversible(primitive, kinds, on_bodies)
    return _of_reversible(primitive, kinds, on_bodies)


def _of_storage(primitive: Storage, kinds: list[str], on_bodies: list[bool]) -> Role:
    kernel = primitive.kernel
    if kernel is not None and len(kinds) > 1 and {q for _, _, q in primitive.bundle.items()} == {FREE}:
        return Role.SEVERAL
    if len(kinds) != 1 or kernel is None:
        return Role.OTHER
    if on_bodies[0]:
        return Role.KINETIC if kernel.name == "quadratic" else Role.OTHER
    if kinds[0] == "entropy":
        return Role.ENVIRONMENT if primitive.environment else Role.HEAT if exponential_law(primitive) else Role.OTHER
    if kinds[0] == "pose" and next(iter(primitive.bundle.items()))[2] == quantity.pose:
        return Role.POSE
    return Role.RELATIVE if kinds[0] == "relative_pose" else Role.OTHER


def _of_irreversible(primitive: Irreversible, kinds: list[str], on_bodies: list[bool]) -> Role:
    if primitive.kernel is None or len(kinds) < 2 or kinds[-1] != "entropy":
        return Role.OTHER
    if len(kinds) > 2:
        resisted = {q for _, _, q in primitive.bundle.items()} == {RATE, quantity.entropy}
        alike = {primitive.interface[port].quantity for port in primitive.reads} == {FREE}
        return Role.RESISTANCE if resisted and alike and kinds.count("entropy") == 1 else Role.OTHER
    read = {primitive.interface[port].quantity.kind for port in primitive.reads}
    if kinds[0] == "entropy":
        return Role.OTHER if read else Role.CONDUCTION
    if kinds[0] != "momentum":
        return Role.OTHER
    if on_bodies[0]:
        return Role.DRAG if read <= {"pose"} and len(primitive.reads) < 2 else Role.OTHER
    joint = next(iter(primitive.bundle.items()))[2].space.name.endswith("*")
    return Role.FRICTION if joint and read <= {"relative_pose"} and len(primitive.reads) < 2 else Role.OTHER


def _of_reversible(primitive: Reversible, kinds: list[str], on_bodies: list[bool]) -> Role:
    if primitive.kernel is not None and primitive.kernel.name == "holonomic":
        whole = {"p_j1", "p_j2", "p_r"} == {str(port) for port in primitive.bundle.ports}
        return Role.JOINT if whole and not list(pulled_ports(primitive.kernel)) else Role.OTHER
    if offset_of(primitive) is not None:
        return Role.OFFSET if on_bodies == [True, True] else Role.OTHER
    if primitive.name == "lie_poisson" and on_bodies == [True]:
        return Role.GYROSCOPIC
    if primitive.reads or primitive.discrete is not None:
        return Role.OTHER
    skew, constraint = primitive.structure({})
    n = primitive.bundle.size
    if on_bodies == [True] and not np.any(skew) and np.array_equal(constraint, np.eye(6)):
        return Role.GROUND
    if kinds in (["pose", "momentum"], ["relative_pose", "momentum"]) and not constraint.size:
        half = np.eye(n // 2)
        zero = np.zeros_like(half)
        if np.array_equal(skew, np.block([[zero, -half], [half, zero]])):
            return Role.COUPLING
    return Role.OTHER
