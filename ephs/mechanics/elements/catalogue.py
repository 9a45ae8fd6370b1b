"""The parts of mechanics for documents, each restored from its ports and numbers."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ephs.mechanics.elements import beam, components, springs
from ephs.mechanics.elements.closing import Q1, Q2, closing
from ephs.mechanics.elements.cylinder import oil
from ephs.mechanics.elements.gear import belt_spring
from ephs.mechanics.elements.motor import armature
from ephs.mechanics.elements.offset import frame_change
from ephs.mechanics.elements.shell.system import shell_damper, shell_spring
from ephs.mechanics.elements.tendon import tension_spring
from ephs.operad import Interface, Path, Quantity
from ephs.semantics import library
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.documents.catalogue import LibraryPart
from ephs.semantics.primitives.primitives import Primitive
from ephs.semantics.spaces import Pair, pair

Numbers = Mapping[str, Any]


def _port(ports: Interface, *, parity: int) -> tuple[str, Quantity]:
    """The first power port whose quantity has this parity."""
    return next((str(p), t.quantity) for p, t in ports.items() if t.power and t.quantity.parity == parity)


def _group(ports: Interface) -> str:
    direct = {port.quantity.space.name for port in ports.values()} & {"SO(3)xR3", "so(3)xR3*"}
    return "SO3xR3" if direct else "SE3"


def _pair(ports: Interface, port: str) -> Pair:
    """The pair that a port of relative poses or joint momenta belongs to."""
    space = ports[Path.of(port)].quantity.space
    return pair(space.name.rstrip("*"), **dict(space.parameters))


def _no_potential(ports: Interface, _numbers: Numbers) -> Primitive:
    (port, kind), *_ = ports.items()
    return components.no_potential(kind.quantity, str(port))


def _coupling(ports: Interface, _numbers: Numbers) -> Primitive:
    (q_port, q), (p_port, p) = _port(ports, parity=1), _port(ports, parity=-1)
    return components.kinematic_coupling(q, p, q_port, p_port)


def _frame_change(ports: Interface, numbers: Numbers) -> Primitive:
    outer, inner = map(str, ports)
    return frame_change(numbers["offset"], inner, outer)


def _friction(ports: Interface, numbers: Numbers) -> Primitive:
    return components.joint_friction(_pair(ports, "p_r"), np.array(numbers["mu"]))


def _kinetic(ports: Interface, numbers: Numbers) -> Primitive:
    return components.kinetic(numbers["mass"], np.array(numbers["inertia"]).reshape(3, 3), _group(ports))


def _pair_spring(ports: Interface, numbers: Numbers) -> Primitive:
    return components.pair_spring(_pair(ports, "q_r"), numbers["stiffness"], numbers["rest"])


def _closing(ports: Interface, numbers: Numbers) -> Primitive:
    ends = [
        (np.array(numbers[f"offset {port}"]), np.array(numbers[f"inertia {port}"]).reshape(6, 6))
        if port in ports
        else None
        for port in (Q1, Q2)
    ]
    return closing(_pair(ports, "q_r"), ends[0], ends[1])


def _beam_damper(_ports: Interface, n: Numbers) -> Primitive:
    return beam.beam_damper(n["length"], n["stiffness"], n["rest"], n["damping"], n.get("order", 2))


def _beam_spring(_ports: Interface, n: Numbers) -> Primitive:
    return beam.beam_spring(n["length"], n["stiffness"], n["rest"], n.get("order", 2))


def _shell_numbers(n: Numbers) -> tuple[Array, Array]:
    return np.array(n["rest"]).reshape(4, 6), np.array(n["stiffness"]).reshape(24, 24)


def _shell_spring(_ports: Interface, n: Numbers) -> Primitive:
    return shell_spring(*_shell_numbers(n))


def _shell_damper(_ports: Interface, n: Numbers) -> Primitive:
    return shell_damper(*_shell_numbers(n), n["damping"])


def _thermoelastic(_ports: Interface, n: Numbers) -> Primitive:
    return beam.thermoelastic(n["capacity"], n["temperature"], n["pull"], n["reference"])


def _reservoir(ports: Interface, _numbers: Numbers) -> Primitive:
    return library.environment(**{str(port): kind.quantity for port, kind in ports.items()})


PARTS: tuple[LibraryPart, ...] = (
    LibraryPart("armature", "armature", lambda ports, n: armature(_port(ports, parity=-1)[1], n["inertia"])),
    LibraryPart("beam_damper", "beam_damper", _beam_damper),
    LibraryPart("beam_spring", "beam_spring", _beam_spring),
    LibraryPart("beam_stretch", "beam_stretch", lambda _, n: beam.beam_stretch(n["length"], tuple(n["rest"]))),
    LibraryPart("belt_spring", "spring", lambda ports, n: belt_spring(_port(ports, parity=1)[1], n["k"])),
    LibraryPart("closing", "closing", _closing),
    LibraryPart("frame_change", "frame_change", _frame_change),
    LibraryPart("gravity", "gravity", lambda ports, numbers: components.gravity(numbers["weight"], _group(ports))),
    LibraryPart("ground", "ground", lambda ports, _: components.ground(next(iter(ports.values())).quantity)),
    LibraryPart("hinge_damper", "hinge_damper", lambda _, n: beam.hinge_damper(np.array(n["mu"]))),
    LibraryPart("holonomic", "holonomic", lambda ports, _: components.holonomic(_pair(ports, "q_r"))),
    LibraryPart("joint_friction", "joint_friction", _friction),
    LibraryPart("kinematic_coupling", "pkc", _coupling),
    LibraryPart("kinetic", "kinetic", _kinetic),
    LibraryPart("lie_poisson", "lie_poisson", lambda ports, _: components.lie_poisson(_group(ports))),
    LibraryPart("no_potential", "no_potential", _no_potential),
    LibraryPart("oil", "oil", lambda ports, n: oil(ports[Path.of("q")].quantity, n)),
    LibraryPart("pair_spring", "pair_spring", _pair_spring),
    LibraryPart("point_damper", "point_damper", lambda _, numbers: springs.point_damper(numbers["damping"])),
    LibraryPart("point_spring", "point_spring", lambda _, n: springs.point_spring(n["stiffness"], n["length"])),
    LibraryPart("point_stretch", "point_stretch", lambda _ports, _numbers: springs.point_stretch()),
    LibraryPart("reservoir", "environment", _reservoir),
    LibraryPart("shell_damper", "shell_damper", _shell_damper),
    LibraryPart("shell_spring", "shell_spring", _shell_spring),
    LibraryPart("slack_spring", "slack_spring", lambda _, n: tension_spring(n["stiffness"], n["length"], slack=True)),
    LibraryPart(
        "velocity_relation",
        "velocity_relation",
        lambda ports, _: components.holonomic(_pair(ports, "q_r"), on_group=False),
    ),
    LibraryPart("tension_spring", "tension_spring", lambda _, n: tension_spring(n["stiffness"], n["length"])),
    LibraryPart("thermal_node", "thermal_node", lambda _, n: components.thermal_node(n["capacity"], n["temperature"])),
    LibraryPart("thermoelastic", "thermoelastic", _thermoelastic),
)
