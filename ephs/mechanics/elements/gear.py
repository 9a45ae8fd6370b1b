"""Gears, belts, mimics and tendons: relations between rates of joints, rigid or elastic."""

from collections.abc import Sequence

import numpy as np

from ephs.operad import Path, Pattern, Quantity, junction, quantity
from ephs.semantics import library
from ephs.semantics.primitives.constructors import constraint, gyrator, transformer
from ephs.semantics.primitives.primitives import Storage, power_ports
from ephs.semantics.primitives.structures import quadratic
from ephs.semantics.spaces import pair
from ephs.semantics.systems.system import Filling, System


def gear(
    of: Sequence[Quantity],
    ratio: Sequence[float],
    *,
    stiffness: float = 0.0,
    damping: float = 0.0,
    stretch: float = 0.0,
    friction: float = 0.0,
    heat: bool = False,
) -> System:
    """A gear, a belt or a differential; ports p0, p1, … of joints: the rate of the first is Σ ratio · rate of others.

    Without stiffness the rates are tied: a constraint. With it what the first joint is ahead by stretches a spring, the
    box ``spring``, in rad or m of the first joint.

    Parameters
    ----------
    of
        Momenta of the joints, each of one degree of freedom.
    ratio
        One number for each joint but the first.
    stiffness, damping
        Of a belt or a tendon, in N m/rad and N m s/rad or N/m and N s/m.
    stretch
        Of the spring at the start, in rad or m of the first joint.
    friction
        On the first joint's rate, in N m s/rad or N s/m: what the gear loses.
    heat
        The heat leaves through the port s, in place of the box env.
    """
    shafts = [f"p{k}" for k in range(len(of))]
    ports = dict(zip(shafts, of, strict=True))
    row = [1.0, *(-float(x) for x in ratio)]
    momentum, place = (
        (quantity.angular_momentum, quantity.angle) if turns(of[0]) else (quantity.momentum, quantity.displacement)
    )
    junctions = {name: junction(each, exposed=True) for name, each in ports.items()}
    boxes: dict[str, dict[str, str]] = {"mesh": {name: name for name in shafts}}
    fillings: dict[str, Filling] = {}
    if stiffness:
        junctions |= {"p": junction(momentum), "q": junction(place)}
        boxes["mesh"]["p"] = "p"
        boxes |= {"pkc": {"q": "q", "p": "p"}, "spring": {"q": "q"}}
        fillings = {
            "mesh": constraint({**ports, "p": momentum}, [[*row, -1.0]], name="mesh"),
            "pkc": gyrator({"q": place, "p": momentum}, [[0.0, -1.0], [1.0, 0.0]], name="pkc"),
            "spring": belt_spring(place, stiffness).with_initial({"q": stretch}),
        }
    else:
        fillings = {"mesh": constraint(ports, [row], name="mesh")}
    losses = {"damper": (damping if stiffness else 0.0, "p"), "loss": (friction, "first")}
    for name, (size, at) in losses.items():
        if size:
            boxes[name] = {"p": at, "s": "s"}
            fillings[name] = library.rotational_friction(d=size) if turns(of[0]) else library.friction(d=size)
    if friction:
        junctions["first"] = junction(momentum)
        boxes["shaft"] = {"p0": "p0", "p": "first"}
        fillings["shaft"] = transformer({"p0": of[0], "p": momentum}, [[1.0]], name="shaft")
    if any(size for size, _ in losses.values()):
        junctions["s"] = junction(quantity.entropy, exposed=heat)
        if not heat:
            boxes["env"], fillings["env"] = {"s": "s"}, library.environment()
    return System.of(
        Pattern(junctions=junctions, boxes=boxes), {Path.of(name): filling for name, filling in fillings.items()}
    )


def belt_spring(place: Quantity, stiffness: float) -> Storage:
    """½ k q² of a stretch q, an angle or a displacement."""
    parameters = (("k", stiffness),)
    return quadratic("spring", power_ports(q=place), np.array([[stiffness]]), parameters, trusted=True)


def turns(of: Quantity) -> bool:
    """Whether the rate that belongs to a joint's momentum is an angular one."""
    space = of.space
    return bool(np.any(pair(space.name.removesuffix("*"), **dict(space.parameters)).basis[:3]))
