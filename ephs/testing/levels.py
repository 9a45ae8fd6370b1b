"""Levels of drawn systems: parts, inputs, and states exposed to the enclosing level."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, final

from hypothesis import strategies as st

from ephs.operad import Directory, Interface, Junction, Pattern, PortType, Quantity
from ephs.semantics import System
from ephs.semantics.system import Filling
from ephs.testing.primitives import irreversibles, reversibles, storages


@final
@dataclass(frozen=True, slots=True)
class Outer:
    """An outer port of a level.

    Parameters
    ----------
    wanted
        Whether the level has to give it its state: one that it stores, or that of the outer port ``same``. The state
        of any other port is stored outside.
    """

    quantity: Quantity
    power: bool = True
    wanted: bool = False
    same: str = ""


@st.composite
def levels(
    draw: st.DrawFn,
    *,
    depth: int,
    most: int,
    pool: tuple[Quantity, ...],
    ports: Mapping[str, Outer],
    open_count: int = 0,
    posed: bool = True,
) -> System:
    """A level with the given outer ports and so many open junctions of its own, and at most ``depth - 1`` below it.

    Not ``posed``: states may also be stored twice, or by nobody.
    """
    level = _Level(draw, depth, most, pool, posed)
    for name, port in ports.items():
        level.junctions[name] = Junction(port.quantity, True, port.power)
    level.own(open_count)
    for name, port in ports.items():
        if port.wanted:
            level.give(name, port)
    if depth > 1 and draw(st.booleans()):
        level.relay(open_count > 0)
    level.loosen()
    level.exchange([*ports, *level.bare])
    return System.of(Pattern(level.junctions, level.boxes, level.links), level.parts)


@dataclass(slots=True)
class _Level:
    """Collects the parts of a level."""

    draw: st.DrawFn
    depth: int
    most: int
    pool: tuple[Quantity, ...]
    posed: bool
    junctions: dict[str, Junction] = field(default_factory=dict[str, Junction])
    boxes: dict[str, dict[str, str]] = field(default_factory=dict[str, dict[str, str]])
    parts: dict[str, Filling] = field(default_factory=dict[str, Filling])
    links: list[list[str]] = field(default_factory=list[list[str]])
    bearing: list[str] = field(default_factory=list[str])
    """Junctions with a balance of flows that a storage or friction gives an effort."""
    bare: list[str] = field(default_factory=list[str])
    """Junctions on which nothing is yet."""

    def own(self, open_count: int) -> None:
        """Junctions whose states are stored here; neighbours of the pool, as equal ones have little to exchange."""
        first = self.draw(st.integers(0, len(self.pool) - 1))
        for i in range(self.draw(st.integers(1, self.most))):
            quantity = self.pool[(first + i) % len(self.pool)]
            name = f"j{i}"
            self.junctions[name] = Junction(quantity, i < open_count)
            count = 1 if self.posed else self.draw(st.sampled_from((1, 2, 0)))
            if count:
                self.store(f"store{i}", name)
            else:
                self.bare.append(name)
            if count > 1:
                twin = name
                if self.draw(st.booleans()):
                    twin = f"twin{i}"
                    self.junctions[twin] = Junction(quantity)
                    self.links.append([name, twin])
                self.store(f"again{i}", twin)
        self.bearing = [name for name, each in self.junctions.items() if each.power]

    def store(self, box: str, junction: str) -> None:
        """A storage at a junction."""
        interface = Directory({"x": PortType(self.junctions[junction].quantity)})
        self.boxes[box], self.parts[box] = {"x": junction}, self.draw(storages(interface))

    def give(self, name: str, port: Outer) -> None:
        """Give an outer port its state: from another one or a storage, here or further inside."""
        if not self.posed and self.draw(st.booleans()):
            return
        if self.depth > 1 and self.draw(st.booleans()):
            self.inside(f"giver_{name}", name, port.same)
        elif port.same:
            self.links.append([port.same, name])
        elif self.draw(st.booleans()):
            self.store(f"store_{name}", name)
            self.bearing.append(name)
        else:
            kept = f"{name}_kept"
            self.junctions[kept] = Junction(port.quantity)
            self.store(f"store_{name}", kept)
            self.bearing.append(kept)
            self.links.append([name, kept])

    def inside(self, box: str, name: str, same: str) -> None:
        """A box that gives the junction its state, that of another junction or one of its own."""
        ports = {"b": Outer(self.junctions[name].quantity, power=False, wanted=True, same="a" if same else "")}
        self.boxes[box] = {"b": f"~{name}"}
        if same:
            ports = {"a": Outer(self.junctions[same].quantity, power=False), **ports}
            self.boxes[box]["a"] = f"~{same}"
        inner = levels(depth=self.depth - 1, most=1, pool=self.pool, ports=ports, posed=self.posed)
        self.parts[box] = self.draw(inner)

    def relay(self, exposed: bool) -> None:
        """A junction whose state a box gives it: read here, and where there is one at an outer port."""
        same = self.draw(st.sampled_from(list(self.junctions))) if self.draw(st.booleans()) else ""
        quantity = self.junctions[same].quantity if same else self.draw(st.sampled_from(self.pool))
        shown = exposed and self.draw(st.booleans())
        self.junctions["k"] = Junction(quantity, True, False) if shown else Junction(quantity)
        self.inside("relay", "k", same)

    def loosen(self) -> None:
        """A second balance of flows for a state: its effort is an unknown, which friction determines."""
        hot = [name for name in self.bearing if self.junctions[name].quantity.kind == "entropy"]
        cold = [name for name, each in self.junctions.items() if not each.quantity.environment]
        if not (hot and cold and self.draw(st.booleans())):
            return
        of, heat = self.draw(st.sampled_from(cold)), self.draw(st.sampled_from(hot))
        name = of
        if of in self.bearing:
            name = "loose"
            self.junctions[name] = Junction(self.junctions[of].quantity)
            self.links.append([of, name])
        wires = {"p": name, "s": heat}
        interface = Directory({port: PortType(self.junctions[on].quantity) for port, on in wires.items()})
        self.boxes["drag"], self.parts["drag"] = wires, self.draw(irreversibles(interface))
        self.bearing.append(name)

    def exchange(self, waiting: list[str]) -> None:
        """Boxes between the junctions; every outer port needs something on it, so the first one takes them all."""
        draw, bearing = self.draw, self.bearing
        for i in range(draw(st.integers(1, 2))):
            names = waiting + draw(st.lists(st.sampled_from(bearing), min_size=min(3, len(bearing)), unique=True))
            # now and then two ports of one box on one junction
            names += draw(st.lists(st.sampled_from(bearing), max_size=1))
            read = draw(st.lists(st.sampled_from(sorted(self.junctions)), max_size=1))
            read += ["k"] if i == 0 and "k" in self.junctions else []
            ports: dict[str, Outer] = {}
            wires: dict[str, str] = {}
            for k, name in enumerate([*names, *read]):
                power = name in bearing and k < len(names)
                wires[f"p{k}"] = name if power else f"~{name}"
                ports[f"p{k}"] = Outer(self.junctions[name].quantity, power)
            waiting = []
            self.boxes[f"box{i}"], self.parts[f"box{i}"] = wires, draw(self.process(ports))

    def process(self, ports: Mapping[str, Outer]) -> st.SearchStrategy[Filling]:
        """A component with these ports, or a further level."""
        interface: Interface = Directory({name: PortType(port.quantity, port.power) for name, port in ports.items()})
        reads = tuple(name for name, port_type in interface.items() if not port_type.power)
        choices: list[st.SearchStrategy[Any]] = [
            # velocities only: a constraint on temperatures that an environment gives leaves its flow undetermined
            reversibles(interface, reads=reads, constrained=(-1,)),
            irreversibles(interface, reads=reads),
        ]
        if self.depth > 1:
            inner = levels(depth=self.depth - 1, most=self.most, pool=self.pool, ports=ports, posed=self.posed)
            choices.append(inner)
        return st.one_of(choices)
