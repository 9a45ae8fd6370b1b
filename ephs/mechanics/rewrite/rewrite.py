"""Rewrites of systems: rules, their conditions, and the maps of states.

A rewrite makes of a system a smaller one that says the same of what is kept. Each names its strength, the condition
that it has checked, in words, and a map of states in both directions.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import final

from ephs.operad import Directory, Path, Pattern, PortType
from ephs.operad.parts import Junction, Port
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import AssemblyError
from ephs.semantics.primitives.primitives import Primitive, Storage
from ephs.semantics.systems.system import System
from ephs.solve.posing.errors import OptionError

State = Mapping[Path, Array]
MOST = 20
"""Number of rewrites for each box and junction: rules take away, and each of them meets a part a few times at most."""


class Strength(StrEnum):
    """Strength of a rewrite."""

    RELATION = "same relation"
    """All values of the kept variables at every state."""
    TRAJECTORIES = "same trajectories"
    """Motion of the kept variables, without reactions."""
    MOTION = "same motion"
    """The motion; kept reactions differ."""


def _same(state: State) -> dict[Path, Array]:
    return dict(state)


@final
@dataclass(frozen=True, slots=True, eq=False)
class StateMap:
    """Map of states in both directions.

    Parameters
    ----------
    forward
        States of the system before -> states of the system after.
    back
        States of the system after, and those before at the start -> states of the system before at that instant.
    """

    forward: Callable[[State], dict[Path, Array]] = _same
    back: Callable[[State, State], dict[Path, Array]] = lambda state, _start: dict(state)

    def then(self, other: "StateMap") -> "StateMap":
        """This map, then another one."""

        def back(state: State, start: State) -> dict[Path, Array]:
            return self.back(other.back(state, self.forward(start)), start)

        return StateMap(lambda state: other.forward(self.forward(state)), back)


@final
class SystemDraft:
    """Draft of a flat system under rewriting, which rules read and change, so that many sites cost one new pattern.

    Attributes
    ----------
    junctions, wires, fillings
        By path: junctions; ports of each box; what fills it.
    links
        Classes of junctions that share their state.
    """

    def __init__(self, system: System) -> None:
        flat = system.flatten()
        pattern = flat.pattern
        self.junctions: dict[Path, Junction] = dict(pattern.junctions.items())
        self.wires = {box: dict(content.ports.items()) for box, content in pattern.boxes.items()}
        self.fillings: dict[Path, Primitive] = dict(flat.leaves())
        self.links = pattern.links
        self._at: dict[Path, dict[tuple[Path, Path], bool]] = {}
        for box, ports in self.wires.items():
            for port, where in ports.items():
                self._at.setdefault(where.junction, {})[box, port] = where.power

    def on(self, junction: Path) -> list[tuple[Path, Path]]:
        """The power ports on a junction: (box, port)."""
        return [place for place, power in self._at.get(junction, {}).items() if power]

    def reading(self, junction: Path) -> list[tuple[Path, Path]]:
        """The state ports that read the state of a junction, linked ones included."""
        classes = [group for group in self.links if junction in group]
        members = {junction}.union(*classes)
        return [place for j in members for place, power in self._at.get(j, {}).items() if not power]

    def stored(self, junction: Path) -> Path | None:
        """The storage on a junction, None where there is none."""
        return next((box for box, _ in self.on(junction) if isinstance(self.fillings[box], Storage)), None)

    def replace(self, box: Path, filling: Primitive, ports: Mapping[Path, Path]) -> None:
        """Replace a box's filling; ports without a new junction keep theirs, absent ports are removed."""
        before = self.wires[box]
        self._unwire(box)
        kinds = filling.interface
        self.wires[box] = {port: Port(ports.get(port) or before[port].junction, kinds[port].power) for port in kinds}
        self.fillings[box] = filling
        for port, where in self.wires[box].items():
            self._at.setdefault(where.junction, {})[box, port] = where.power

    def add(self, box: Path, filling: Primitive, ports: Mapping[Path, Path]) -> None:
        """Add a box with its ports on junctions."""
        self.wires[box] = {}
        self.replace(box, filling, ports)

    def remove(self, boxes: Iterable[Path], junctions: Iterable[Path] = ()) -> None:
        """Remove boxes, and junctions left without ports."""
        for box in boxes:
            self._unwire(box)
            del self.wires[box], self.fillings[box]
        for path in junctions:
            del self.junctions[path]
            self.links = frozenset(rest for group in self.links if len(rest := group - {path}) > 1)

    def system(self) -> System:
        """The present system."""
        pattern = Pattern(self.junctions, self.wires, [tuple(group) for group in self.links])
        return System(pattern, Directory(dict(self.fillings)))

    def kind(self, junction: Path) -> PortType:
        """The type of a power port on a junction."""
        return PortType(self.junctions[junction].quantity, True)

    def _unwire(self, box: Path) -> None:
        for port, where in self.wires[box].items():
            del self._at[where.junction][box, port]


@final
@dataclass(frozen=True, slots=True, eq=False)
class RuleSite:
    """A place where a rule applies, or would if its condition held.

    Parameters
    ----------
    rule
        The rule's name.
    where
        The component, or the junction, that it is about.
    reason
        Why it may be done, in words.
    refusal
        Why it may not, in words; "" where its condition holds.
    make
        Does it to a draft in which the site still is, and gives the map of states.
    """

    rule: str
    where: Path
    strength: Strength
    reason: str
    refusal: str
    make: Callable[[SystemDraft], StateMap]

    def apply(self, system: System) -> "Rewritten":
        """The system rewritten at this site.

        Raises
        ------
        AssemblyError
            The rule's condition does not hold; the message says why.
        """
        if self.refusal:
            raise AssemblyError("rewrite", self.where, rule=self.rule, found=self.refusal)
        draft = SystemDraft(system)
        states = self.make(draft)
        return Rewritten(_begun(draft.system(), system, states), states, (self,))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Rewritten:
    """A system after rewrites.

    Parameters
    ----------
    system
        Flat.
    states
        From the states before all of them to those after, and back.
    done
        What was done, in order.
    """

    system: System
    states: StateMap
    done: tuple[RuleSite, ...]

    def then(self, other: "Rewritten") -> "Rewritten":
        """These rewrites, then others."""
        return Rewritten(other.system, self.states.then(other.states), (*self.done, *other.done))


@final
@dataclass(frozen=True, slots=True)
class Rule:
    """A kind of rewrite.

    Parameters
    ----------
    why
        On what condition, and why it may be done then, in words for all its sites.
    places
        Where in a draft it may be worth a look.
    at
        The site at such a place of a draft that may have changed since, refused or not; None where there is none.
    """

    name: str
    strength: Strength
    why: str
    places: Callable[[SystemDraft], Iterable[tuple[Path, ...]]]
    at: Callable[[SystemDraft, tuple[Path, ...]], RuleSite | None]


def sites_of(system: System, rule: Rule) -> tuple[RuleSite, ...]:
    """Matches of a rule, and its refusals, anywhere in a hierarchical system; paths are those of its flat form."""
    draft = SystemDraft(system)
    found = (rule.at(draft, place) for place in rule.places(draft))
    return tuple(site for site in found if site is not None)


def rewrite(system: System, rules: Iterable[Rule]) -> Rewritten:
    """Rewrite a system by rules until none applies; the order makes no difference but for names.

    Raises
    ------
    OptionError
        Rules do not come to an end: they were used `MOST` times for each box and junction.
    """
    draft = SystemDraft(system)
    states, done, known = StateMap(), list[RuleSite](), tuple(rules)
    size = len(draft.fillings) + len(draft.junctions)
    again = True
    while again:
        again = False
        for rule in known:
            for place in tuple(rule.places(draft)):
                site = rule.at(draft, place)
                if site is not None and not site.refusal:
                    if len(done) >= MOST * size:
                        used = f"{rule.name}, used at {site.where} after {len(done)} rewrites of {size} parts"
                        raise OptionError("rules", used, "rules that end: with each use less of the system is left")
                    states = states.then(site.make(draft))
                    done.append(site)
                    again = True
    return Rewritten(_begun(draft.system(), system, states), states, tuple(done))


def _begun(made: System, system: System, states: StateMap) -> System:
    """The system that was made of another one, in the start that belongs to that one's."""
    return made.with_initial(states.forward(system.state())) if system.initial else made
