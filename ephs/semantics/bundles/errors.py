"""Errors of the semantics, with their texts in one table."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, final

from ephs.operad.messages import nearest_of as nearest_of

if TYPE_CHECKING:
    from ephs.semantics.verdicts.trials import Witness

_TEXTS = {
    "fillings": ("{path}: the boxes to fill are {expected}, the fillings given are {found}; fill each box once"),
    "interface": ("{path}: the filling's interface is {found}, expected {expected}; rename the filling's ports"),
    "finite": "{path}: {what} is {found}, expected finite numbers (witness: {witness})",
    "unlike": (
        "{path}: the function says {found}, expected {expected} as its record of operations says, in entry {entry} "
        "(witness: {witness}); runs use the record: the function must not ask what kind of numbers it is given"
    ),
    "changing": (
        "{path}: the function says {found}, expected {expected} as in the call before, in entry {entry} (witness: "
        "{witness}); it must depend on its arguments alone"
    ),
    "no-value": (
        "{path}: {what} has no value at {witness}; declare a domain that excludes it, of the component or of the "
        "port's quantity"
    ),
    "undefined": "{path}: {key} is {found}, expected {expected}",
    "isotropy": ("{path}: not reversible: entry {entry} of L + Lᵀ is {found}, expected 0 (witness: {witness})"),
    "gyrator-shape": "{path}: the matrix L is {found}, expected {expected} for its ports",
    "constraint-shape": "{path}: the matrix C is {found}, expected {expected} for its ports",
    "conservation": ("{path}: {quantity} is not conserved: entry {entry} is {found}, expected 0 (witness: {witness})"),
    "parity": (
        "{path}: not invariant under time reversal: defect {found}, expected 0 (witness: {witness}); declare {flag}"
    ),
    "onsager-shape": "{path}: the matrix M is {found}, expected {expected} for its ports",
    "symmetry": ("{path}: not Onsager symmetric: entry {entry} of M − Mᵀ is {found}, expected 0 (witness: {witness})"),
    "definite": ("{path}: M has the negative eigenvalue {found}; the second law expects none (witness: {witness})"),
    "energy": ("{path}: energy is not conserved: entry {entry} of M·eᴱ is {found}, expected 0 (witness: {witness})"),
    "even": ("{path}: the energy is not even under time reversal: {found} against {expected} (witness: {witness})"),
    "rotation-sign": (
        "{path}: {what} the quaternions q and −q of port {port} apart, which are one rotation (witness: "
        "{witness}); use products of two of its entries, or a rotation matrix"
    ),
    "gradient-shape": "{path}: the gradient is {found}, expected {expected} for its ports",
    "gradient": (
        "{path}: the gradient's entry {entry} is {found}, expected the energy's slope {expected} (witness: {witness})"
    ),
    "temperature": (
        "{path}: the absolute temperature is {found} K, expected > 0; check the state or the energy function"
    ),
    "cold": (
        "{path}: the absolute temperature ∂E/∂{port} is {found} K, expected > 0 (witness: {witness}); check the "
        "sign of the energy function"
    ),
    "rotation": "{path}: a rotation of π or more in one step; take a smaller step",
    "storage-ports": (
        "{path}: the storage has the state port {found}; a storage owns its states, expected power ports only"
    ),
    "parameter": "{path}: parameter {key} is {found}, expected {expected}",
    "two-storages": (
        "{path}: the state of junction {junction} is stored twice, by {found}; expected one storage for a "
        "state. Connect the two storages by a constraint component"
    ),
    "unread-state": (
        "{path}: port {port} reads the state of junction {junction}, which no storage provides; connect a "
        "storage there, or expose the junction as a power port to one"
    ),
    "state": "{path}: the initial value has shape {found}, expected {expected} ({quantity})",
    "state-number": "{path}: the initial value is {found}, expected finite numbers ({quantity})",
    "outside": ("{path}: the initial {quantity} is {found}, expected {expected}; give initial={{'{path}': …}}"),
    "domain": (
        "{path}: {what} has no value ({found}, witness state {witness}); declare the domain of a port's quantity, as "
        "in Quantity(…, domain=(0.0, inf)), if states are limited to it"
    ),
    "open-joint": (
        "{path}: the initial states leave a joint open by {found}; give all states of one configuration, "
        "or scene.with_state(coordinates=…)"
    ),
    "off-joint": (
        "{path}: the initial value contradicts the joints by {found:.1e}; give all states of one motion, or "
        "scene.with_state(rates=…)"
    ),
    "unknown-state": "{path}: no such state; the states are {expected}",
    "unknown-component": "{path}: no such component; the components are {expected}",
    "efforts": "{path}: the efforts are {found!r}, expected finite numbers of shape {expected}",
    "no-time": "{path}: the solution has no state at {found!r} s; it has times from {first!r} to {last!r} s",
    "unknown-port": "{path}: no such outer port; the outer ports are {expected}",
    "not-constant": "{path}: its structure depends on {found}; only constant structure has an exact relation",
    "references": (
        "{path}: the relation is relative to {found}, the others to {expected}; take relations to one reference"
    ),
    "unknown-parameter": "{path}: neither a number of a library component nor a state; {hint}",
    "entry": "{path}: expected an entry {shape}; give the index of one entry",
    "elements": (
        "{path}: {equation} does not conserve {element}: {found} of it in a reaction, expected 0; mend the equation or "
        "the elements of the species"
    ),
    "missing-input": ("{path}: the outer port is open: give inputs={{'{path}': {{'flow': …}}}} or {{'effort': …}}"),
    "reference": (
        "{path}: the reference is {found}, expected a Reference of the environment; states are given as state=…"
    ),
    "unfilled": "{path}: found a pattern, expected a system or a scene; fill its boxes by pattern(box=…)",
    "unknown-input": "{path}: no such outer power port; the open ports are {expected}",
    "unnamed": "{path}: it is built on {found}, expected {expected}",
    "input": "{path}: the input is {found}, expected {expected}",
    "joined": "{path}: joined to {port}, found {found}, expected {expected}; only equal quantities share a state",
    "units": "{path}: found {found}, expected {expected}",
    "bounds": "{path}: the conductance is {found}, expected bounds {expected}",
    "no-state": "{path}: the port shows the state {found}, expected {expected}",
    "unwritten": (
        "{path}: {name} cannot be written: found {found}, expected a part of the library or a formula that can be "
        "traced"
    ),
    "rewrite": "{path}: {rule} would change the meaning of the system: {found}",
}


class SemanticsError(ValueError):
    """A system or a primitive that cannot mean anything.

    Parameters
    ----------
    kind
        The key of the message.
    path
        The component's or the port's dotted path.
    **facts
        What the message names: found, expected, entry, witness, …
    """

    kind: str
    path: str
    facts: dict[str, object]

    def __init__(self, kind: str, path: object, **facts: object) -> None:
        self.kind, self.path, self.facts = kind, str(path), facts
        super().__init__(_TEXTS[kind].format(path=path, **facts))

    def __reduce__(self) -> tuple[object, ...]:
        return (_rebuild, (type(self), self.kind, self.path, self.facts))


def listed(found: object, known: Iterable[object]) -> str:
    """Known names for a message, with the one nearest to a misspelled name."""
    names = list(map(str, known))
    return f"{', '.join(names) or 'none'}{nearest_of(found, names)}"


def _rebuild(cls: type[SemanticsError], kind: str, path: str, facts: dict[str, object]) -> SemanticsError:
    return cls(kind, path, **facts)


@final
class StructureError(SemanticsError):
    """A primitive whose data are not the structure that they claim to be."""

    @property
    def witness(self) -> "Witness | None":
        """The smallest counterexample found: states, efforts, entry, size; None where a parameter is at fault."""
        from ephs.semantics.verdicts.trials import Witness

        found = self.facts.get("witness")
        return found if isinstance(found, Witness) else None


@final
class AssemblyError(SemanticsError):
    """A system that has a relation but no square system of equations."""
