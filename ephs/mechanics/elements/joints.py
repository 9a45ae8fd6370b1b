"""Joints as systems of seven boxes, and their composites: springs between points, universal joints."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.mechanics.elements import components, springs
from ephs.mechanics.elements.limit import limited_friction, limited_spring, stops
from ephs.mechanics.elements.offset import frame_change
from ephs.mechanics.shapes.dry import Dry
from ephs.mechanics.shapes.impact import Impact
from ephs.mechanics.shapes.law import ConstitutiveLaw
from ephs.operad import Pattern, junction, quantity
from ephs.semantics import library
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError, listed
from ephs.semantics.primitives.primitives import Irreversible, Reversible, Storage
from ephs.semantics.spaces import PAIRS, SE3, Pair, pair, translation
from ephs.semantics.systems.system import System

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

UNIT = 1e-6
"""Deviation of a quaternion's length from 1 that is normalised: rounding to six digits."""

Friction = Callable[[Array, Array, float], Array]


@cache
def joint_pattern(
    of: Pair, *, reading: bool = False, heat: bool = False, driven: bool = False, stretching: bool = False
) -> Pattern:
    """The joint of a pair: offsets o1, o2, the holonomic relation hc, energy pe with its coupling pkc, friction mf.

    Parameters
    ----------
    reading
        Friction reads the relative pose.
    heat
        The friction heat leaves through the port s, in place of the box env.
    driven
        The momentum p_r is exposed.
    stretching
        A box st makes a length of the relative pose's rate; it leaves through the port e.
    """
    parameters = dict(of.parameters)
    momentum = quantity.body_momentum
    q_r, p_r = quantity.relative_pose(of.name, **parameters), quantity.joint_momentum(of.name, **parameters)
    friction = {"p_r": "p_r", "s": "s"} | ({"q_r": "~q_r"} if reading else {})
    boxes = {
        "o1": {"p1": "p1", "p_j1": "p_j1"},
        "o2": {"p2": "p2", "p_j2": "p_j2"},
        "hc": {"p_j1": "p_j1", "p_j2": "p_j2", "p_r": "p_r", "q_r": "~q_r"},
        "pe": {"q_r": "q_r"},
        "pkc": {"q_r": "q_r", "p_r": "p_r"},
        "mf": friction,
    }
    if not heat:
        boxes["env"] = {"s": "s"}
    if stretching:
        boxes["st"] = {"p_r": "p_r", "e": "e", "q_r": "~q_r"}
    return Pattern(
        junctions=({"e": junction(quantity.displacement, exposed=True)} if stretching else {})
        | {
            "p1": junction(momentum, exposed=True),
            "p2": junction(momentum, exposed=True),
            "p_j1": junction(momentum),
            "p_j2": junction(momentum),
            "p_r": junction(p_r, exposed=driven),
            "q_r": junction(q_r),
            "s": junction(quantity.entropy, exposed=heat),
        },
        boxes=boxes,
    )


def mbs_pattern() -> Pattern:
    """Two bodies and a joint between them."""
    momentum = quantity.body_momentum
    return Pattern(
        junctions={"p1": junction(momentum), "p2": junction(momentum)},
        boxes={"body1": {"p": "p1"}, "body2": {"p": "p2"}, "joint": {"p1": "p1", "p2": "p2"}},
    )


def joint(
    kind: str,
    frame1: Any = None,
    frame2: Any = None,
    friction: "ArrayLike | Friction" = 0.0,
    stiffness: "ArrayLike" = 0.0,
    rest: "ArrayLike" = 0.0,
    potential: Callable[[Array], float] | None = None,
    pitch: float = 0.0,
    *,
    heat: bool = False,
    driven: bool = False,
    limits: "ArrayLike | None" = None,
    stop: ConstitutiveLaw | Impact | None = None,
    dry: Dry | None = None,
) -> System:
    """A joint between two bodies; its ports p1, p2 carry the bodies' momenta.

    Parameters
    ----------
    kind
        A name in `ephs.semantics.spaces.PAIRS`: revolute, prismatic, screw, cylindrical, planar, spherical, fixed,
        free.
    frame1, frame2
        Joint frames in bodies 1 and 2: poses (7,), or ``{"position": …, "rotation": …}``; the body's own where None.
    friction
        μ on u_r: a number, (d,), (d, d), or a Python function of (coordinates, u_r, θ) that gives (d, d).
    stiffness, rest
        Of the potential ½ k (coordinate − rest)²: a number or (d,).
    potential
        Any further potential in J, a Python function of the coordinates (d,).
    pitch
        Of a screw, m/rad.
    heat
        The friction heat leaves through a port s; else an environment inside takes it.
    driven
        The momentum of u_r is a port p_r: its flow is a generalised force.
    limits, stop
        Least and largest coordinate of a joint with one degree of freedom in rad or m, nan for none, and the law of its
        stops, elastic or hard.
    dry
        Dry friction of a joint with one degree of freedom, beside μ as a number.

    Raises
    ------
    StructureError
        A parameter of a wrong shape or value, or a structure that its checks refuse.
    """
    if kind not in PAIRS:
        raise StructureError("parameter", "joint", key="kind", found=kind, expected=listed(kind, PAIRS))
    of = pair(kind, pitch=pitch) if "pitch" in PAIRS[kind].parameters else pair(kind)
    k, zero = _vector(of, "stiffness", stiffness), _vector(of, "rest", rest)
    spring = components.pair_spring(of, k, zero) if np.any(k) else None
    if potential is not None:
        given, base = potential, spring
        q_r = components.relative(of)
        if base is None:
            spring = components.potential(q_r, "q_r", given)
        else:
            spring = components.potential(q_r, "q_r", lambda x: given(x) + 0.5 * float(k @ (x - zero) ** 2))
    if spring is None:
        spring = components.no_potential(components.relative(of), "q_r")
    mu = friction if callable(friction) else _matrix(of, friction)
    if dry is not None and callable(mu):
        found = "dry friction and a function"
        raise StructureError("parameter", "joint", key="dry", found=found, expected="dry friction, and a number")
    if limits is None and dry is not None:
        loss = components.dry_friction(of, float(np.asarray(mu).ravel()[0]), dry)
    elif limits is None:
        loss = components.joint_friction(of, mu)
    elif stop is None or potential is not None or callable(mu):
        found = "limits without the law of their stops" if stop is None else "limits and a function"
        raise StructureError("parameter", "joint", key="limits", found=found, expected="limits, their law, and numbers")
    else:
        held = stops(of, limits)
        spring = limited_spring(of, k, zero, held, stop) if isinstance(stop, ConstitutiveLaw) else spring
        loss = limited_friction(of, mu, held, stop, dry)
    return _joint(of, _frame(frame1), _frame(frame2), spring, loss, heat, driven)


def spring_damper(
    at1: "ArrayLike",
    at2: "ArrayLike",
    stiffness: float,
    length: float,
    damping: float = 0.0,
    *,
    heat: bool = False,
) -> System:
    """A massless spring-damper between points (3,) of two bodies: a free joint with a potential of the distance.

    Parameters
    ----------
    stiffness, length, damping
        k in N/m, L in m of ½ k (distance − L)², c in N s/m.
    """
    damper = springs.point_damper(damping) if damping else components.joint_friction(pair("free"), np.zeros((6, 6)))
    one, two = map(translation, (at1, at2))
    return between_frames(one, two, springs.point_spring(stiffness, length), damper, heat=heat)


def between_frames(
    frame1: Array,
    frame2: Array,
    energy: Storage,
    loss: Irreversible,
    *,
    heat: bool = False,
    stretch: Reversible | None = None,
    kind: str = "free",
    driven: bool = False,
) -> System:
    """Energy and loss of the relative pose of two frames: a joint, free unless said, with this storage and friction.

    Parameters
    ----------
    frame1, frame2
        (7,) poses in bodies 1 and 2.
    energy, loss
        Ports q_r, and p_r, s and perhaps q_r, of the joint's pair.
    stretch
        Ports p_r, e and state port q_r: of a length that leaves through the port e.
    """
    return _joint(pair(kind), frame1, frame2, energy, loss, heat, driven, stretch)


def universal_joint(
    frame1: Any,
    middle: Any,
    frame2: Any,
    friction: "ArrayLike" = 0.0,
    stiffness: "ArrayLike" = 0.0,
    rest: "ArrayLike" = 0.0,
    *,
    heat: bool = False,
    driven: bool = False,
) -> System:
    """Two revolute joints with a massless frame between them; boxes ``first`` and ``second``.

    Parameters
    ----------
    middle
        Pose from the frame after the first revolute to the frame before the second.
    friction, stiffness, rest
        Numbers, or one for each of the two angles (friction also as a diagonal (2, 2) matrix).
    """
    revolute = pair("revolute")
    mu = np.asarray(friction, dtype=float)
    if mu.ndim == 2 and np.any(mu - np.diag(np.diag(mu))):
        raise StructureError(
            "parameter",
            "universal_joint",
            key="friction",
            found=mu.tolist(),
            expected="no coupling of the two angles",
        )
    damp = np.broadcast_to(np.diag(mu) if mu.ndim == 2 else mu, 2)
    k, zero = (
        np.broadcast_to(np.asarray(stiffness, dtype=float), 2),
        np.broadcast_to(np.asarray(rest, dtype=float), 2),
    )
    frames = ((frame1, None), (middle, frame2))
    halves = {
        name: joint("revolute", *frames[i], damp[i], k[i], zero[i], heat=heat, driven=driven)
        for i, name in enumerate(("first", "second"))
    }
    momentum = quantity.body_momentum
    junctions = {
        "p1": junction(momentum, exposed=True),
        "p_m": junction(momentum),
        "p2": junction(momentum, exposed=True),
    }
    boxes = {"first": {"p1": "p1", "p2": "p_m"}, "second": {"p1": "p_m", "p2": "p2"}}
    if heat:
        junctions["s"] = junction(quantity.entropy, exposed=True)
        for ports in boxes.values():
            ports["s"] = "s"
    if driven:
        p_r = quantity.joint_momentum(revolute.name)
        for i, ports in enumerate(boxes.values(), 1):
            junctions[f"p_r{i}"] = junction(p_r, exposed=True)
            ports["p_r"] = f"p_r{i}"
    return System.of(Pattern(junctions=junctions, boxes=boxes), halves)


def _joint(
    of: Pair,
    frame1: Array,
    frame2: Array,
    energy: Storage,
    friction: Irreversible,
    heat: bool,
    driven: bool,
    stretch: Reversible | None = None,
) -> System:
    parts: dict[str, Any] = {
        "o1": frame_change(frame1, "p_j1", "p1"),
        "o2": frame_change(frame2, "p_j2", "p2"),
        "hc": components.holonomic(of),
        "pe": energy,
        "pkc": components.pair_coupling(of),
        "mf": friction,
    }
    if not heat:
        parts["env"] = library.environment()
    if stretch is not None:
        parts["st"] = stretch
    pattern = joint_pattern(of, reading=bool(friction.reads), heat=heat, driven=driven, stretching=stretch is not None)
    return System.of(pattern, parts)


def _frame(given: Any) -> Array:
    if given is None:
        return SE3.identity()
    if isinstance(given, Mapping):
        unknown = set(given) - {"position", "rotation"}
        if unknown:
            raise StructureError(
                "parameter",
                "joint",
                key="frame",
                found=", ".join(sorted(unknown)),
                expected="position, rotation",
            )
        rotation, position = (
            given.get("rotation", (1.0, 0.0, 0.0, 0.0)),
            given.get("position", (0.0, 0.0, 0.0)),
        )
        given = np.concatenate([np.asarray(rotation, dtype=float), np.asarray(position, dtype=float)])
    pose = np.asarray(given, dtype=float)
    if pose.shape != (7,) or not np.all(np.isfinite(pose)) or abs(np.linalg.norm(pose[:4]) - 1.0) > UNIT:
        raise StructureError(
            "parameter",
            "joint",
            key="frame",
            found=pose.tolist(),
            expected="a unit quaternion and a position",
        )
    return SE3.normalise(pose)


def _vector(of: Pair, key: str, given: "ArrayLike") -> Array:
    value = np.asarray(given, dtype=float)
    if value.shape not in ((), (of.dim,)) or not np.all(np.isfinite(value)):
        expected = f"a number or {of.dim} numbers"
        raise StructureError("parameter", f"joint {of.name}", key=key, found=value.tolist(), expected=expected)
    return np.broadcast_to(value, (of.dim,))


def _matrix(of: Pair, given: "ArrayLike") -> Array:
    value = np.asarray(given, dtype=float)
    if value.ndim == 2 and value.shape == (of.dim, of.dim):
        return value
    if value.ndim == 2:
        raise StructureError(
            "parameter",
            f"joint {of.name}",
            key="friction",
            found=value.tolist(),
            expected=f"({of.dim}, {of.dim})",
        )
    return np.diag(_vector(of, "friction", value))
