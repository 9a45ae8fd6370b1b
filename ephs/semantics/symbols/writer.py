"""A flat system with symbols for all its variables, and its square form in them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, final

from ephs.operad import Path, Quantity
from ephs.semantics.bundles.errors import AssemblyError
from ephs.semantics.primitives.primitives import Primitive, Storage
from ephs.semantics.symbols.algebra import Expr, sp
from ephs.semantics.symbols.calculus import PRESSURE, TEMPERATURE
from ephs.semantics.symbols.voices import Said, Voice, say
from ephs.semantics.symbols.words import Words, plain
from ephs.semantics.systems.system import System


class SymbolicJunction(NamedTuple):
    """A power junction."""

    path: Path
    quantity: Quantity
    exposed: bool


@final
class Writer:
    """A flat system with its symbols."""

    def __init__(self, flat: System) -> None:
        self.flat = flat
        self.words = Words()
        self.words.latex |= {TEMPERATURE: r"\theta_0", PRESSURE: r"\pi_0"}
        leaves = list(flat.leaves())
        count: dict[str, int] = {}
        for _, primitive in leaves:
            for name in () if primitive.formula is None else primitive.formula.parameters:
                count[name] = count.get(name, 0) + 1
        self._stored = {
            min(flat.pattern.state_class(junction)): junction
            for path, primitive in leaves
            if isinstance(primitive, Storage)
            for port in primitive.bundle.ports
            for junction in [flat.pattern.boxes[path].ports[port].junction]
        }
        self._shared = {name for name, times in count.items() if times > 1}

    def components(self) -> Iterator[tuple[Path, Primitive]]:
        """All primitives."""
        return self.flat.leaves()

    def junction(self, box: Path, port: Path) -> Path:
        """The junction of a port."""
        return self.flat.pattern.boxes[box].ports[port].junction

    def state(self, box: Path, port: Path) -> tuple[Path, Quantity]:
        """The junction that names the state at a port: the one of its storage, if any."""
        key = min(self.flat.pattern.state_class(self.junction(box, port)))
        return self._stored.get(key, key), self.flat.pattern.boxes[box].interface[port].quantity

    def voice(self, path: Path, primitive: Primitive, effort: Callable[[Path, Quantity], Expr]) -> Voice:
        """A component with the symbols of its surroundings."""

        values = dict(primitive.parameters)

        def parameter(name: str) -> Expr:
            value = values[name]
            positive = isinstance(value, (int, float)) and value > 0.0  # the symbol stands for this number
            return self.words.parameter(name, path if name in self._shared else None, positive=positive)

        x = {str(port): self.words.state(*self.state(path, port)) for port in primitive.reads}
        e = {str(port): effort(port, primitive.bundle.quantity(port)) for port in primitive.bundle.ports}
        return Voice(path, primitive, self.words, x, e, parameter)

    def junctions(self) -> list[SymbolicJunction]:
        """The power junctions.

        Raises
        ------
        AssemblyError
            A state is stored twice; or it is read, stored nowhere, and not offered by an outer port.
        """
        pattern = self.flat.pattern
        try:
            self.flat.descriptor()
        except AssemblyError as error:
            read = Path.of(str(error.facts.get("junction", "")))
            if error.kind != "unread-state" or not any(pattern.junctions[j].exposed for j in pattern.state_class(read)):
                raise
        bearing = {port.junction for box in pattern.boxes.values() for port in box.ports.values() if port.power}
        return [
            SymbolicJunction(path, j.quantity, exposed)
            for path, j in pattern.junctions.items()
            if (exposed := j.exposed and j.power) or path in bearing
        ]

    def effort(self, junction: Path, quantity: Quantity) -> Expr:
        """The effort of a junction."""
        return self.words.port(junction, "e", quantity)


@final
@dataclass(frozen=True, slots=True, eq=False)
class SquareForm:
    """Square form: equations of storages, balances by junction, conditions."""

    storages: dict[Path, tuple[Expr, Quantity, Path]]  # junction -> effort, quantity, component
    rates: dict[Path, Expr]  # junction -> left-trivialised rate
    balances: dict[Path, Expr]  # junction -> what vanishes
    conditions: list[tuple[Path, Expr]]  # component, what vanishes
    said: dict[Path, Said]


def parts_of(writer: Writer, junctions: list[SymbolicJunction]) -> SquareForm:
    """The square form of a flat system."""
    parts = SquareForm({}, {}, {slot.path: sp.Integer(0) for slot in junctions}, [], {})
    for path, primitive in writer.components():

        def effort(port: Path, quantity: Quantity, path: Path = path) -> Expr:
            return writer.effort(writer.junction(path, port), quantity)

        said = parts.said[path] = say(writer.voice(path, primitive, effort))
        for port, expression in said.efforts.items():
            junction, quantity = writer.junction(path, port), primitive.bundle.quantity(port)
            parts.storages[junction] = (expression, quantity, path)
            rate = writer.words.symbol(f"w[{junction}]", "w", scalar=plain(quantity))
            parts.rates[junction] = rate
            parts.balances[junction] += rate
        for port, expression in said.flows.items():
            parts.balances[writer.junction(path, port)] += expression
        parts.conditions.extend((path, condition) for condition in said.conditions)
    for slot in junctions:
        if slot.exposed:
            parts.balances[slot.path] -= writer.words.port(slot.path, "f", slot.quantity)
    return parts
