"""Systems of a scene's attachments: their boxes, their outer ports, the states in which they start."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.elements.cylinder import gas_spring, hydraulic_cylinder
from ephs.mechanics.elements.gear import gear
from ephs.mechanics.elements.motor import motor
from ephs.mechanics.scene.attached import Attachment, Cylinder, GasSpring, Gear, Motor
from ephs.mechanics.scene.element import Number
from ephs.mechanics.scene.model import ENVIRONMENT, Joint, Scene
from ephs.operad import Path, Quantity, quantity
from ephs.semantics.bundle import Array
from ephs.semantics.system import System

SUPPLIED = {"voltages": quantity.charge, "pressures": quantity.liquid}
"""First names of the outer ports of attachments -> the quantity there."""


@final
@dataclass(frozen=True, slots=True)
class Supply:
    """An outer port of an attachment whose effort is prescribed.

    Parameters
    ----------
    port
        Of the attachment's system.
    outer
        Of the scene's.
    value
        (1,) the effort where no input is given.
    flow
        Dimension of its flow.
    """

    port: str
    outer: Path
    value: Array
    flow: Number


def supplies_of(of: Attachment) -> tuple[Supply, ...]:
    """The supplies of an attachment, in the order of the numbers of its input."""
    names = of.name.split(".")
    match of:
        case Motor():
            return (Supply("q", Path(["voltages", *names]), np.array([of.voltage]), Number(time=-1)),)
        case Cylinder():
            return tuple(
                Supply(port, Path(["pressures", *names, port]), np.array([value]), Number(length=3, time=-1))
                for port, value in zip(("a", "b"), of.pressure.tolist(), strict=True)
            )
        case _:
            return ()


def supplies(scene: Scene) -> Iterator[Supply]:
    """The supplies of all attachments of a scene."""
    for _, _, of in scene.all_attachments():
        yield from supplies_of(of)


def system_of(of: Attachment, joints: Sequence[Quantity]) -> tuple[System, tuple[str, ...]]:
    """An attachment's system, and its ports of the joints' momenta."""
    heat = of.warms and of.heat != ENVIRONMENT
    match of:
        case Motor():
            made = motor(
                joints[0], constant=of.constant, resistance=of.resistance, gear=of.gear, inductance=of.inductance,
                inertia=of.inertia, current=of.current, heat=heat,
            )  # fmt: skip
        case Cylinder():
            made = hydraulic_cylinder(
                joints[0], area=of.area.tolist(), volume=of.volume.tolist(), bulk=of.bulk, conductance=of.conductance,
                leak=of.leak, pressure=of.started.tolist(), travel=of.travel, heat=heat,
            )  # fmt: skip
        case GasSpring():
            made = gas_spring(
                joints[0], area=of.area, volume=of.volume, pressure=of.pressure, temperature=of.temperature,
                gamma=of.gamma, conductance=of.conductance, heat=heat,
            )  # fmt: skip
        case Gear():
            made = gear(
                joints, of.ratio.tolist(), stiffness=of.stiffness, damping=of.damping, stretch=of.stretch,
                friction=of.friction, heat=heat,
            )  # fmt: skip
            return made, tuple(f"p{k}" for k in range(len(joints)))
        case _:
            raise TypeError(of.name)
    return made, ("p_r",)


def starts_of(of: Attachment, joints: Sequence[Joint]) -> dict[str, Array]:
    """States of an attachment at the start, by their paths in its system."""
    zero = np.zeros(1)
    out: dict[str, Array] = {}
    match of:
        case Motor():
            out["field.b"] = np.array([of.constant])
            if of.inductance:
                out["coil.b"] = np.array([of.inductance * of.current])
            if of.inertia:
                out["rotor.p"] = of.inertia * of.gear * joints[0].rate
        case Cylinder():
            held = of.volume * (1.0 + of.started / of.bulk) + of.area * [of.travel, -of.travel]
            out |= {"oil.v_a": held[:1], "oil.v_b": held[1:], "oil.q": np.array([of.travel])}
        case GasSpring():
            out |= {"gas.s": zero, "gas.v": np.array([of.volume]), "atmosphere.v": zero}
        case Gear():
            if of.stiffness:
                out["spring.q"] = np.array([of.stretch])
        case _:
            pass
    return out | ({"env.s": zero} if of.warms and of.heat == ENVIRONMENT else {})
