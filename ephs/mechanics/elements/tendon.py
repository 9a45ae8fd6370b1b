"""Tendons: straight from point to point of bodies, sliding through them, with one tension throughout.

A segment is the relative pose of two frames, free and without energy, and a box that turns its twist into the rate of
its length. All segments meet at the junction e: their rates add up to that of the tendon, and they share its effort,
the tension. A gyrator makes of it the junction p, whose effort is the rate of the length: there a spring, a damper and
what pulls act side by side.
"""

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from ephs.mechanics.elements import components, springs
from ephs.mechanics.elements.offset import frame_change
from ephs.mechanics.shapes.gap import ramp
from ephs.operad import Path, Pattern, junction, quantity
from ephs.semantics import library
from ephs.semantics.primitives.constructors import gyrator
from ephs.semantics.primitives.forms import stored
from ephs.semantics.primitives.primitives import Storage, power_ports
from ephs.semantics.spaces import pair, translation
from ephs.semantics.systems.system import Filling, System
from ephs.semantics.verdicts.checks import STATEMENTS
from ephs.semantics.verdicts.verdict import proved

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def tendon(
    segments: "Sequence[tuple[ArrayLike, ArrayLike]]",
    stiffness: float = 0.0,
    length: float = 0.0,
    damping: float = 0.0,
    *,
    slack: bool = False,
    heat: bool = False,
) -> System:
    """A tendon without mass; ports a1, b1, a2, b2, … of the bodies at the ends of its segments, and p.

    The effort of p is the rate of its length, its flow a force that makes it longer: a tension, if negative. With
    stiffness the state of the box ``spring`` is the length.

    Parameters
    ----------
    segments
        Pairs of points (3,) in m, each in the frame of its body; the two bodies differ.
    stiffness, length, damping
        Of the whole: k in N/m, length without force in m, less that of segments within bodies; c in N s/m.
    slack
        It exerts no elastic force where it is shorter.
    heat
        The heat of damping leaves through the port s, in place of the box env.
    """
    place, momentum = quantity.displacement, quantity.momentum
    junctions = {"e": junction(place), "p": junction(momentum, exposed=True)}
    boxes: dict[str, dict[str, str]] = {"reel": {"q": "e", "p": "p"}}
    fillings: dict[str, Filling] = {
        "reel": gyrator({"q": place, "p": momentum}, [[0.0, 1.0], [-1.0, 0.0]], name="reel")
    }
    for k, (one, two) in enumerate(segments, 1):
        junctions |= {name: junction(quantity.body_momentum, exposed=True) for name in (f"a{k}", f"b{k}")}
        boxes[f"segment{k}"] = {"p1": f"a{k}", "p2": f"b{k}", "e": "e"}
        fillings[f"segment{k}"] = _segment(one, two)
    if stiffness:
        junctions["q"] = junction(place)
        boxes |= {"pkc": {"q": "q", "p": "p"}, "spring": {"q": "q"}}
        fillings["pkc"] = gyrator({"q": place, "p": momentum}, [[0.0, -1.0], [1.0, 0.0]], name="pkc")
        fillings["spring"] = tension_spring(stiffness, length, slack=slack)
    if damping:
        junctions["s"] = junction(quantity.entropy, exposed=heat)
        boxes["damper"], fillings["damper"] = {"p": "p", "s": "s"}, library.friction(d=damping)
        if not heat:
            boxes["env"], fillings["env"] = {"s": "s"}, library.environment()
    return System.of(
        Pattern(junctions=junctions, boxes=boxes), {Path.of(name): filling for name, filling in fillings.items()}
    )


def tension_spring(stiffness: float, length: float, *, slack: bool = False) -> Storage:
    """½ k (q − L)² of a length q; zero below L where it may be slack. Port q, k in N/m, L in m."""
    return stored(
        "slack_spring" if slack else "tension_spring",
        power_ports(q=quantity.displacement),
        _slack if slack else _taut,
        {"stiffness": float(stiffness), "length": float(length)},
        printed=not slack,
        proof=(lambda: proved("a length is even; E is once differentiable", *STATEMENTS["storage"])) if slack else None,
    )


def _taut(q: Any, stiffness: Any, length: Any) -> Any:
    return 0.5 * stiffness * (q - length) ** 2


def _slack(q: Any, stiffness: Any, length: Any) -> Any:
    return 0.5 * stiffness * ramp(q - length) ** 2


def _segment(one: "ArrayLike", two: "ArrayLike") -> System:
    """The relative pose of frames at two points (3,) without energy, and the rate of its length at the port e."""
    free = pair("free")
    q_r, p_r = components.relative(free), components.joint_momentum(free)
    first, second = map(translation, (one, two))
    return System.of(
        _segment_pattern(),
        {
            "o1": frame_change(first, "p_j1", "p1"),
            "o2": frame_change(second, "p_j2", "p2"),
            "hc": components.holonomic(free),
            "pe": components.no_potential(q_r, "q_r"),
            "pkc": components.kinematic_coupling(q_r, p_r, "q_r", "p_r"),
            "st": springs.point_stretch(),
        },
    )


@cache
def _segment_pattern() -> Pattern:
    momentum = quantity.body_momentum
    return Pattern(
        junctions={
            "p1": junction(momentum, exposed=True),
            "p2": junction(momentum, exposed=True),
            "p_j1": junction(momentum),
            "p_j2": junction(momentum),
            "p_r": junction(quantity.joint_momentum("free")),
            "q_r": junction(quantity.relative_pose("free")),
            "e": junction(quantity.displacement, exposed=True),
        },
        boxes={
            "o1": {"p1": "p1", "p_j1": "p_j1"},
            "o2": {"p2": "p2", "p_j2": "p_j2"},
            "hc": {"p_j1": "p_j1", "p_j2": "p_j2", "p_r": "p_r", "q_r": "~q_r"},
            "pe": {"q_r": "q_r"},
            "pkc": {"q_r": "q_r", "p_r": "p_r"},
            "st": {"p_r": "p_r", "e": "e", "q_r": "~q_r"},
        },
    )
