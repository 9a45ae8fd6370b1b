"""Levels of drawn systems: parts, inputs, and states exposed to the enclosing level."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, final

from hypothesis import strategies as st

from ephs.operad import ROOT, Directory, Interface, Junction, Pattern, PortType, Quantity
from ephs.semantics import System
from ephs.semantics.primitives.primitives import state_ports
from ephs.semantics.systems.system import Filling
from ephs.testing.patterns import CHAIN
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
    if draw(st.booleans()):
        level.tie()
    level.loosen()
    level.leave(ports)
    level.exchange([*ports, *level.bare])
    found = System.of(Pattern(level.junctions, level.boxes, level.links), level.parts)
    for _ in range(draw(CHAIN)):
        found = System.of(Pattern.identity(found.interface), {ROOT: found})
    return found


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
    relayed: list[str] = field(default_factory=list[str])
    """Junctions that the first box reads."""

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
            self.inside(f"giver_{name}", (name,), port.same)
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

    def inside(self, box: str, names: Sequence[str], same: str) -> None:
        """A box that gives the junctions one state, that of another junction or one of its own."""
        first, *others = (same, *names) if same else names
        quantity = self.junctions[first].quantity
        ports = {"a": Outer(quantity, power=False, wanted=not same)}
        ports |= {f"b{k}": Outer(quantity, power=False, wanted=True, same="a") for k in range(len(others))}
        self.boxes[box] = {port: f"~{name}" for port, name in zip(ports, (first, *others), strict=True)}
        self.parts[box] = self.draw(self.below(ports, most=1))

    def below(self, ports: Mapping[str, Outer], most: int) -> st.SearchStrategy[System]:
        """A further level with these ports."""
        return levels(depth=self.depth - 1, most=most, pool=self.pool, ports=ports, posed=self.posed)

    def relay(self, exposed: bool) -> None:
        """Junctions to which a box gives one state: read here, and where there is one at outer ports."""
        same = self.draw(st.sampled_from(list(self.junctions))) if self.draw(st.booleans()) else ""
        quantity = self.junctions[same].quantity if same else self.draw(st.sampled_from(self.pool))
        shown = exposed and self.draw(st.booleans())
        self.relayed = ["k", "l"][: self.draw(st.integers(1, 2))]
        for name in self.relayed:
            self.junctions[name] = Junction(quantity, True, False) if shown else Junction(quantity)
        self.inside("relay", self.relayed, same)

    def tie(self) -> None:
        """Two more names for the state of a junction, by one link, without a frame of their own."""
        of = self.draw(st.sampled_from(list(self.junctions)))
        ties = ["tie0", "tie1"]
        self.junctions |= dict.fromkeys(ties, Junction(self.junctions[of].quantity.in_frame(None)))
        self.links.append([of, *ties])
        self.relayed += ties

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

    def leave(self, ports: Mapping[str, Outer]) -> None:
        """An outer power port without power inside, which is then open: its state alone is read."""
        used = {name for wires in self.boxes.values() for name in wires.values()}
        if unused := [name for name, port in ports.items() if port.power and name not in used]:
            left = self.draw(st.sampled_from(["", "", *unused]))
            self.bearing = [name for name in self.bearing if name != left]

    def exchange(self, waiting: list[str]) -> None:
        """Boxes between the junctions; every outer port needs something on it, so the first one takes them all."""
        draw, bearing = self.draw, self.bearing
        for i in range(draw(st.integers(1, 2))):
            names = waiting + draw(st.lists(st.sampled_from(bearing), min_size=min(3, len(bearing)), unique=True))
            # now and then two ports of one box on one junction
            names += draw(st.lists(st.sampled_from(bearing), max_size=1))
            read = draw(st.lists(st.sampled_from(sorted(self.junctions)), max_size=1))
            read += self.relayed if i == 0 else []
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
        reads = state_ports(interface)
        choices: list[st.SearchStrategy[Any]] = [
            # velocities only: a constraint on temperatures that an environment gives leaves its flow undetermined
            reversibles(interface, reads=reads, constrained=(-1,)),
            irreversibles(interface, reads=reads),
        ]
        if self.depth > 1:
            choices.append(self.below(ports, self.most))
        return st.one_of(choices)
