"""Check report of a system: structure, equations, and laws at random states."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, final

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Reference
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.semantics.primitives.forms import obstacle
from ephs.semantics.systems.laws import SYSTEM_LAWS, Probe, SystemLaw, random_probe
from ephs.semantics.systems.markup import table
from ephs.semantics.systems.system import System
from ephs.semantics.verdicts.search import search

PROBES = 3
"""States and efforts at which a structure is evaluated again, whatever its verdict."""
DOUBTS = "doubts"
"""Name of the check of likely mistakes, which never fails."""


@final
class CheckItem(NamedTuple):
    """A check: name, verdict, and detail."""

    name: str
    ok: bool
    detail: str

    @property
    def verdict(self) -> str:
        """In a word."""
        return ("doubt" if self.name == DOUBTS else "holds") if self.ok else "FAILS"


@final
@dataclass(frozen=True, slots=True)
class CheckReport:
    """All checks of a model; as text, a line for each."""

    items: tuple[CheckItem, ...]

    @property
    def ok(self) -> bool:
        """Whether all hold."""
        return all(item.ok for item in self.items)

    def _repr_html_(self) -> str:  # pyright: ignore[reportUnusedFunction] - notebooks call it
        rows = ((item.name, item.verdict, item.detail) for item in self.items)
        return table("Check: all hold" if self.ok else "Check: some fail", (), rows)

    def __repr__(self) -> str:
        return "\n".join(f"{item.verdict}  {item.name}: {item.detail}" for item in self.items)


def check_system(
    system: System,
    reference: Reference | None = None,
    *,
    state: Mapping[str, object] | None = None,
    probes: int = 3,
    h: float = 1e-3,
) -> CheckReport:
    """Check the structure of the components, that there are equations, and the laws.

    Parameters
    ----------
    state
        Where the laws are measured. Where None, at random states, the first of which is the start of a system that
        carries one. Outer ports have random flows.
    probes
        How many states, or how many flows at the one state.
    h
        The step in s over which balances are measured.
    """
    return CheckReport(tuple(_items(system, reference or Reference(), state, probes, h)))


def check_structure(system: System) -> CheckItem:
    """Verdicts on all components; those not proved are searched for counterexamples once more."""
    count = 0
    slow: list[str] = []
    searched: list[Path] = []
    known: set[int] = set()  # of values that fill several boxes, which the system keeps alive
    for path, primitive in system.leaves():
        count += 1
        if primitive.kernel is None:
            slow.append(f"{path} ({obstacle(primitive)})")
        try:
            if id(primitive) not in known:
                search(primitive, PROBES)
                known.add(id(primitive))
            if primitive.verdict != "proved":
                searched.append(path)
        except SemanticsError as error:
            return CheckItem("structure", False, f"{path}: {error}")
    detail = f"{count} components have the structure that they declare, {count - len(searched)} of them by proof"
    if searched:
        detail += f"; searched for counterexamples, and watched in runs: {', '.join(map(str, searched))}"
    if slow:
        detail += f"; evaluated in Python, which is slow: {', '.join(slow)}"
    return CheckItem("structure", True, detail)


def check_types(system: System) -> CheckItem:
    """Number of boxes and junctions, with remarks on junctions that do nothing."""
    flat = system.flatten().pattern
    remarks = "".join(f"; {remark}" for remark in flat.lint())
    return CheckItem("types", True, f"{len(flat.boxes)} boxes at {len(flat.junctions)} junctions{remarks}")


def check_assembly(d: Descriptor, inputs: Mapping[Path, Any]) -> CheckItem:
    """Number of states and equations."""
    unknowns = d.unknowns(inputs)
    return CheckItem("assembly", True, f"{len(d.states)} states, {unknowns} equations in {unknowns} unknowns")


def check_motion(system: System, reference: Reference, state: Mapping[str, object] | None) -> CheckItem:
    """Whether a motion exists from the given state, else from the start, and what does not determine it."""
    where = "the start" if state is None else "the state"
    try:
        found = system.relation(reference).at(system.state(state))
    except SemanticsError as error:
        return CheckItem("motion", state is None, f"{where}: {error}")
    return CheckItem("motion", not found.empty, f"from {where} {found.doubt or 'the motion is determined'}")


def _items(
    system: System, reference: Reference, state: Mapping[str, object] | None, probes: int, h: float
) -> Iterator[CheckItem]:
    yield check_types(system)
    yield check_structure(system)
    try:
        d = system.descriptor()
        found = [_probe_at(random_probe(system, seed, reference=reference, h=h), state) for seed in range(probes)]
        if state is None and system.initial:  # random states of what has loops contradict them, and have no step
            found[0] = _probe_at(found[0], {})
    except SemanticsError as error:
        yield CheckItem("assembly", False, str(error))
        return
    yield check_assembly(d, found[0].inputs)
    yield check_motion(system, reference, state)
    # probe after probe, as one step serves all its laws
    verdicts = [[_verdict(law, probe) for law in SYSTEM_LAWS] for probe in found]
    for law, measured in zip(SYSTEM_LAWS, zip(*verdicts, strict=True), strict=False):
        holds, _, detail = max(measured, key=lambda verdict: (not verdict[0], verdict[1]))
        yield CheckItem(f"{law.name}: {law.statement}", holds, detail)


def _probe_at(probe: Probe, state: Mapping[str, object] | None) -> Probe:
    if state is None:
        return probe
    return replace(probe, state={**probe.state, **probe.system.state(state)})


def _verdict(law: SystemLaw, probe: Probe) -> tuple[bool, float, str]:
    """Whether the law holds, its defect, what was found; a state outside a component's domain is a finding, too."""
    try:
        verdict = law(probe)
    except SemanticsError as error:
        return False, 0.0, str(error)
    return verdict.holds, verdict.defect, verdict.detail
