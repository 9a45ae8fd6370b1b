"""Strategies for systems, and checks of their laws."""

from collections.abc import Mapping
from typing import Any

from hypothesis import strategies as st
from hypothesis.errors import InvalidArgument

from ephs.operad import Directory, Nesting, Path, Pattern, PortType, Quantity, junction, quantity
from ephs.semantics import Irreversible, Reference, Reversible, Storage, System
from ephs.semantics.laws import Probe, random_probe, system_law
from ephs.semantics.system import Filling
from ephs.testing.primitives import irreversibles, reversibles, storages

__all__ = [
    "check_functoriality",
    "check_natural",
    "check_power_balance",
    "fillings",
    "systems",
]

SCALARS = (
    (quantity.displacement, quantity.momentum, quantity.entropy),
    (quantity.charge, quantity.flux_linkage, quantity.entropy),
    (quantity.volume, quantity.momentum, quantity.entropy),
    (quantity.flux_linkage, quantity.angular_momentum, quantity.entropy, quantity.charge),
)
GROUPS = (
    (quantity.pose, quantity.body_momentum, quantity.entropy),
    (quantity.direct_pose, quantity.direct_momentum, quantity.entropy),
    (quantity.relative_pose("spherical"), quantity.joint_momentum("spherical"), quantity.entropy),
    (quantity.joint_momentum("planar"), quantity.displacement, quantity.entropy),
)
"""Quantities that have something to exchange: of either parity, and heat."""
Ports = Mapping[str, PortType]


@st.composite
def systems(
    draw: st.DrawFn,
    *,
    max_depth: int = 3,
    max_junctions: int = 3,
    isolated: bool | None = None,
    groups: bool = True,
) -> System:
    """Hierarchical systems that have a motion: each state has one storage, at the level where its junction is inside.

    Parameters
    ----------
    max_depth
        How many levels.
    max_junctions
        How many junctions a level adds.
    isolated
        Whether there are no outer ports; either where None.
    groups
        Whether states on Lie groups occur beside real ones.

    Raises
    ------
    InvalidArgument
        A bound is less than 1.
    """
    for name, value in (("max_depth", max_depth), ("max_junctions", max_junctions)):
        if value < 1:
            raise InvalidArgument(f"{name}={value}: expected at least 1")
    pool = draw(st.sampled_from(SCALARS + GROUPS if groups else SCALARS))
    alone = draw(st.booleans()) if isolated is None else isolated
    top = _levels(depth=max_depth, most=max_junctions, pool=pool, ports={}, open_count=0 if alone else 1)
    return draw(top)


@st.composite
def _levels(
    draw: st.DrawFn, *, depth: int, most: int, pool: tuple[Quantity, ...], ports: Ports, open_count: int
) -> System:
    """One level with the given outer ports; it stores the states of the junctions that it adds."""
    junctions: dict[str, Any] = {
        name: junction(port.quantity, exposed=True, power=port.power) for name, port in ports.items()
    }
    boxes: dict[str, dict[str, str]] = {}
    parts: dict[str, Filling] = {}
    count = draw(st.integers(1, most))
    first = draw(st.integers(0, len(pool) - 1))
    for i in range(count):
        # neighbours of the pool, as junctions of one quantity only have little to exchange
        name, drawn = f"j{i}", pool[(first + i) % len(pool)]
        junctions[name] = junction(drawn, exposed=i < open_count)
        interface = Directory({"x": PortType(drawn)})
        boxes[f"store{i}"], parts[f"store{i}"] = {"x": name}, draw(storages(interface))
    powers = [name for name, j in junctions.items() if j.power]
    waiting = list(ports)
    for i in range(draw(st.integers(1, 2))):
        # every outer port needs something on it inside: the first box takes them all
        names = waiting + draw(st.lists(st.sampled_from(powers), min_size=min(3, len(powers)), unique=True))
        # now and then two ports of one box on one junction
        names += draw(st.lists(st.sampled_from(powers), max_size=1))
        waiting = []
        read = draw(st.lists(st.sampled_from(sorted(junctions)), max_size=1))
        wires: dict[str, str] = {}
        content: dict[str, PortType] = {}
        for k, name in enumerate([*names, *read]):
            power = junctions[name].power and k < len(names)
            wires[f"p{k}"] = name if power else f"~{name}"
            content[f"p{k}"] = PortType(junctions[name].quantity, power)
        box = f"box{i}"
        boxes[box], parts[box] = wires, draw(_process(depth, most, pool, content))
    return System.of(Pattern(junctions=junctions, boxes=boxes), parts)


def _process(depth: int, most: int, pool: tuple[Quantity, ...], content: Ports) -> st.SearchStrategy[Filling]:
    interface = Directory(dict(content))
    reads = tuple(port for port, port_type in interface.items() if not port_type.power)
    choices: list[st.SearchStrategy[Filling]] = [
        # velocities only: a constraint on temperatures that an environment gives anyway leaves its flow undetermined
        reversibles(interface, reads=reads, constrained=(-1,)),
        irreversibles(interface, reads=reads),
    ]
    if depth > 1:
        choices.append(_levels(depth=depth - 1, most=most, pool=pool, ports=content, open_count=0))
    return st.one_of(choices)


@st.composite
def fillings(draw: st.DrawFn, nesting: Nesting) -> System:
    """Systems on a drawn nesting of patterns, well-posed or not: they have a relation, if not always a motion."""
    flat = nesting.top_down()
    stored: set[frozenset[Path]] = set()
    leaves: dict[Path, Storage | Reversible | Irreversible] = {}
    for box, content in flat.boxes.items():
        interface = content.interface
        classes = [flat.state_class(port.junction) for port in content.ports.values()]
        single = len(classes) == 1 and all(port.power for port in content.ports.values())
        if single and classes[0] not in stored and draw(st.booleans()):
            stored.add(classes[0])
            leaves[box] = draw(storages(interface))
        else:
            leaves[box] = draw(st.one_of(reversibles(interface), irreversibles(interface)))
    return _filled(nesting, leaves, Path())


def _filled(nesting: Nesting, leaves: Mapping[Path, Filling], path: Path) -> System:
    inner = nesting.children
    parts: dict[Path, Filling] = {
        box: _filled(inner[box], leaves, path / box) if box in inner else leaves[path / box]
        for box in nesting.pattern.boxes
    }
    return System.of(nesting.pattern, parts)


def check_functoriality(system: System, *, seed: int = 0, reference: Reference | None = None) -> None:
    """Check the relation at a random state.

    Flattening before filling means the same as filling before composing, patterns and Dirac structures compose to
    Dirac structures, and names of boxes mean nothing.

    Raises
    ------
    AssertionError
        With the law that fails, and how far.
    """
    _check(random_probe(system, seed, reference=reference), "functoriality", "Tellegen", "Dirac", "renaming")


def check_power_balance(system: System, *, seed: int = 0, reference: Reference | None = None) -> None:
    """Check that over a step energy, exergy and volume change by what outer ports supply, less the destruction.

    Raises
    ------
    AssertionError
        With the law that fails, and how far.
    """
    _check(random_probe(system, seed, reference=reference), "power balance", "exergy balance", "conservation")


def check_natural(system: System, *, seed: int = 0, reference: Reference | None = None) -> None:
    """Check that a step of the nested system is the step of the flat one.

    Raises
    ------
    AssertionError
        With how far they are apart.
    """
    _check(random_probe(system, seed, reference=reference), "naturality")


def _check(probe: Probe, *names: str) -> None:
    for name in names:
        law = system_law(name)
        verdict = law(probe)
        if not verdict.holds:
            allowed = f"{verdict.detail}; allowed {verdict.tolerance:.1e}"
            raise AssertionError(f"{law.name}: {law.statement}\n{allowed}\n{probe.system}")
