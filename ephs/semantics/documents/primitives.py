"""Primitives as parts of documents: library parts by name and numbers, others by their formula."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from functools import partial
from typing import Any, cast

import numpy as np

from ephs.operad import Directory, Interface, Path, PortType
from ephs.operad.documents import domain_from, domain_record, port_from, port_record
from ephs.operad.errors import PatternError
from ephs.operad.reading import Reader
from ephs.semantics.bundles.bundle import Array, Bundle, Reference
from ephs.semantics.bundles.domains import Bounds
from ephs.semantics.bundles.errors import SemanticsError, StructureError
from ephs.semantics.bundles.extents import between
from ephs.semantics.derive.recording import Untraceable
from ephs.semantics.derive.recording import record as recording
from ephs.semantics.documents.catalogue import find_part, part_of
from ephs.semantics.library.chemistry import Species
from ephs.semantics.primitives import constructors, structures
from ephs.semantics.primitives.forms import stacked
from ephs.semantics.primitives.primitives import (
    Formula,
    Irreversible,
    Point,
    Primitive,
    Reversible,
    Storage,
    state_ports,
)
from ephs.semantics.symbols.terms import (
    StructureFunction,
    Term,
    TermMatrix,
    WrittenFunction,
    record,
    recorded,
    simple,
    term_from,
)
from ephs.semantics.verdicts.checks import random_efforts, random_point
from ephs.semantics.verdicts.proving import proof_of, replay

FLAGS = {"reversible": "external_field", "irreversible": "one_sided"}
"""Key that says that a structure need not be invariant under time reversal, by kind."""
KINDS = ("part", "storage", "reversible", "irreversible")
AGREEMENT = 1e-9
"""Largest relative difference between a primitive and its document read back: rounding of formulas with 10⁴ terms."""
_FAULTS = (ArithmeticError, LookupError, TypeError, ValueError)


def primitive_record(path: Path, primitive: Primitive, proofs: bool = False) -> dict[str, Any]:
    """A primitive as part of a document, with the proof of its structure if asked for.

    Raises
    ------
    SemanticsError
        It is no part of the library, and has no formula that can be traced, written and read back.
    """
    entry = _primitive(path, primitive)
    proof = proof_of(primitive) if proofs else {}
    return entry | ({"proof": proof} if proof else {})


def _primitive(path: Path, primitive: Primitive) -> dict[str, Any]:
    ports = [[str(port), port_record(kind)] for port, kind in primitive.interface.items()]
    part = part_of(primitive)
    if part is not None:
        numbers = {name: _plain(path, primitive, value) for name, value in primitive.parameters}
        return {"part": part.word, "ports": ports, "parameters": numbers} | _started(primitive)
    try:
        entry = {primitive.kind: primitive.name, "ports": ports} | _formula(primitive) | _started(primitive)
        flag = FLAGS.get(primitive.kind, "")
        if flag and getattr(primitive, flag):
            entry[flag] = True
        if primitive.domain:
            entry["domain"] = {str(port): domain_record((low, high)) for port, low, high in primitive.domain}
        again = primitive_from(Reader("system"), str(path), entry)
    except (Untraceable, PatternError) as error:
        raise SemanticsError("unwritten", path, name=primitive.name, found=str(error)) from None
    if again != primitive or not _agree(primitive, again):
        found = "a formula that does not say what the component does"
        raise SemanticsError("unwritten", path, name=primitive.name, found=found)
    return entry


def primitive_from(reader: Reader, where: str, value: object) -> Primitive:
    """Read a primitive; the inverse of `primitive_record`.

    Raises
    ------
    PatternError
        What is no primitive, with its place.
    """
    found = dict(reader.mapping(where, value))
    kinds = [kind for kind in KINDS if kind in found]
    if len(kinds) != 1:
        reader.refuse(where, f"the keys {', '.join(sorted(found)) or 'none'}", f"one of {', '.join(KINDS)}")
    kind = kinds[0]
    name = reader.text(f"{where}.{kind}", found[kind])
    domain: Bounds = _bounds(reader, f"{where}.domain", found.pop("domain", {})) if kind != "part" else {}
    flag = FLAGS.get(kind, "")
    flagged = found.pop(flag, False) if flag else False
    if not isinstance(flagged, bool):
        reader.refuse(f"{where}.{flag}", str(flagged), "true or false")
    proof = found.pop("proof", None)
    initial = found.pop("initial", None) if kind in ("part", "storage") else None
    read = {"part": _part, "storage": _storage, "reversible": _reversible, "irreversible": _irreversible}[kind]
    keys = {"part": {"parameters"}, "storage": {"energy"}, "reversible": set[str](), "irreversible": {"M"}}[kind]
    more = {"storage": {"function"}, "reversible": {"L", "C"}}.get(kind, set())
    reader.record(where, found, {kind, "ports"} | keys, more)
    ports = _ports(reader, f"{where}.ports", found["ports"])
    make = read(reader, where, name, ports, found | ({flag: flagged} if flag else {}), domain)
    try:
        made = make()
    except PatternError:
        raise
    except _FAULTS as error:  # numbers of which no such part can be made
        reader.refuse(where, str(error), f"a {kind} that can be made")
    if list(made.interface.items()) != list(ports.items()):
        expected = ", ".join(f"{port}: {kind}" for port, kind in made.interface.items())
        reader.refuse(f"{where}.ports", ", ".join(f"{port}: {kind}" for port, kind in ports.items()), expected)
    made = made if initial is None else _starting(reader, f"{where}.initial", made, initial)
    if proof is not None:
        _require_proved(reader, f"{where}.proof", made, dict(reader.mapping(f"{where}.proof", proof)))
    return made


def _require_proved(reader: Reader, where: str, made: Primitive, proof: Mapping[str, object]) -> None:
    shown = replay(made, proof)
    for statement, evidence in proof.items():
        if statement not in shown:
            found = json.dumps(evidence, ensure_ascii=False)
            reader.refuse(f"{where}.{statement}", found if len(found) < 80 else f"{found[:77]}…", "a proof of it")


def _started(primitive: Primitive) -> dict[str, Any]:
    """Initial values of a primitive as an entry, where it has any."""
    if not isinstance(primitive, Storage) or not primitive.initial:
        return {}
    return {"initial": {str(port): list(numbers) for port, numbers in primitive.initial}}


def _starting(reader: Reader, where: str, made: Primitive, value: object) -> Primitive:
    """The primitive with initial values; the inverse of `_started`."""
    if not isinstance(made, Storage):
        reader.refuse(where, f"initial values of the {made.kind} part {made.name}", "none: it has no states")
    numbers = {
        port: [reader.finite(f"{where}.{port}[{i}]", x) for i, x in enumerate(reader.list(f"{where}.{port}", given))]
        for port, given in reader.mapping(where, value)
    }
    try:
        return made.with_initial(numbers)
    except SemanticsError as error:
        reader.refuse(where, str(error), "a state of each port")


def _ports(reader: Reader, where: str, value: object) -> Interface:
    pairs: list[tuple[str, PortType]] = []
    for i, pair in enumerate(reader.list(where, value)):
        at = f"{where}[{i}]"
        both = reader.list(at, pair)
        if len(both) != 2:
            reader.refuse(at, f"{len(both)} entries", "a name and a quantity")
        pairs.append((reader.text(f"{at}[0]", both[0]), port_from(f"{at}[1]", both[1])))
    return Directory(pairs, what=where)


Make = Callable[[], Primitive]
Entry = Mapping[str, object]


def _part(reader: Reader, where: str, word: str, ports: Interface, found: Entry, _: Bounds) -> Make:
    part = find_part(word)
    if part is None:
        reader.refuse(f"{where}.part", word, "the name of a library part")
    at = f"{where}.parameters"
    numbers = {name: _parameter(reader, f"{at}.{name}", v) for name, v in reader.mapping(at, found["parameters"])}

    def make() -> Primitive:
        made = part.make(ports, numbers)
        if dict(made.parameters) != numbers:
            named = ", ".join(f"{name}={value}" for name, value in made.parameters) or "none"
            reader.refuse(at, ", ".join(sorted(numbers)) or "none", named)
        return made

    return make


def _storage(reader: Reader, where: str, name: str, ports: Interface, found: Entry, domain: Bounds) -> Make:
    function = reader.text(f"{where}.function", found.get("function", "energy"))
    names = {str(port): kind.quantity.space.size for port, kind in ports.items()}
    term = term_from(reader, f"{where}.energy", found["energy"], names)
    return lambda: constructors.storage(_named(ports), WrittenFunction(term, function), domain=domain, name=name)


def _reversible(reader: Reader, where: str, name: str, ports: Interface, found: Entry, domain: Bounds) -> Make:
    n, reads = Bundle.of(ports).size, state_ports(ports)
    names = {str(port): ports[port].quantity.space.size for port in reads}
    skew, constraint = (
        _matrix(reader, f"{where}.{key}", found[key], names, n) if key in found else None for key in ("L", "C")
    )
    if skew is not None and len(skew.rows) != n:
        reader.refuse(f"{where}.L", f"{len(skew.rows)} rows", f"{n}")
    zero, k = np.zeros((n, n)), 0 if constraint is None else len(constraint.rows)
    external_field = bool(found["external_field"])

    def structure(x: Point) -> tuple[Array, Array]:
        values = {str(port): float(v[0]) if v.size == 1 else v for port, v in x.items()}
        upper = zero if skew is None else np.array(skew(**values), dtype=float)
        lower = [] if constraint is None else constraint(**values)
        return upper.reshape(n, n), np.array(lower, dtype=float).reshape(k, n)

    def make() -> Primitive:
        if not domain and all(part is None or part.numbers for part in (skew, constraint)):
            return structures.constant_structure(name, ports, *structure({}), external_field=external_field)
        formula = Formula(StructureFunction(skew, constraint))
        return constructors.reversible(name, ports, structure, formula, k, domain, external_field)

    return make


def _irreversible(reader: Reader, where: str, name: str, ports: Interface, found: Entry, domain: Bounds) -> Make:
    n = Bundle.of(ports).size
    spaces = {port: (kind.power, kind.quantity.space) for port, kind in ports.items()}
    names = {str(port): space.dim if power else space.size for port, (power, space) in spaces.items()}
    matrix = _matrix(reader, f"{where}.M", found["M"], names, n)
    one_sided = bool(found["one_sided"])
    return lambda: constructors.irreversible(_named(ports), matrix, domain=domain, one_sided=one_sided, name=name)


def _bounds(reader: Reader, where: str, value: object) -> Bounds:
    return {port: domain_from(f"{where}.{port}", ends) for port, ends in reader.mapping(where, value)}


def _matrix(reader: Reader, where: str, value: object, names: Mapping[str, int], columns: int) -> TermMatrix:
    rows: list[tuple[Term, ...]] = []
    for i, row in enumerate(reader.list(where, value)):
        entries = reader.list(f"{where}[{i}]", row)
        if len(entries) != columns:
            reader.refuse(f"{where}[{i}]", f"{len(entries)} entries", f"{columns}")
        rows.append(tuple(term_from(reader, f"{where}[{i}][{j}]", each, names) for j, each in enumerate(entries)))
    return TermMatrix(tuple(rows))


def _named(ports: Interface) -> dict[str, Any]:
    """The ports as constructors take them."""
    return {f"{'' if kind.power else '~'}{port}": kind.quantity for port, kind in ports.items()}


def _parameter(reader: Reader, where: str, value: object) -> object:
    if isinstance(value, str):
        return value
    if isinstance(value, list | tuple):
        entries = reader.list(where, cast("object", value))
        made = [(f"{where}[{i}]", entry) for i, entry in enumerate(entries)]
        if any(isinstance(entry, Mapping) for entry in entries):
            return tuple(_species(reader, at, entry) for at, entry in made)
        return tuple(reader.finite(at, entry) for at, entry in made)
    return reader.finite(where, value)


def _species(reader: Reader, where: str, value: object) -> Species:
    """A substance; the inverse of `_plain`."""
    found = dict(reader.mapping(where, value))
    numbers = {field.name for field in fields(Species)} - {"name", "elements"}
    reader.record(where, found, {"name", "elements"}, numbers)
    elements = {
        key: reader.finite(f"{where}.elements.{key}", n)
        for key, n in reader.mapping(f"{where}.elements", found["elements"])
    }
    given = {key: reader.finite(f"{where}.{key}", found[key]) for key in numbers & found.keys()}
    try:
        return Species(reader.text(f"{where}.name", found["name"]), tuple(elements.items()), **given)
    except StructureError as error:
        reader.refuse(where, str(error), "a substance that there can be")


def _plain(path: Path, primitive: Primitive, value: object) -> object:
    """A parameter as JSON has it."""
    if isinstance(value, tuple):
        return [_plain(path, primitive, entry) for entry in cast("tuple[object, ...]", value)]
    if isinstance(value, Species):
        return asdict(value) | {"elements": dict(value.elements)}
    if not (isinstance(value, str) or (isinstance(value, int | float) and np.isfinite(value))):
        raise SemanticsError("unwritten", path, name=primitive.name, found=f"the parameter {value}")
    return value


def _formula(primitive: Primitive) -> dict[str, Any]:
    """Definition of a primitive in terms of its ports."""
    if primitive.formula is None:
        raise Untraceable("a primitive without a formula")
    function, numbers = primitive.formula.function, dict(primitive.parameters)
    given = {name: numbers[name] for name in primitive.formula.parameters}
    match primitive:
        case Storage():
            if isinstance(function, WrittenFunction):
                return {"energy": record(function.term), "function": function.name}
            names = dict.fromkeys(map(str, primitive.interface), True)
            (energy,) = _terms(primitive, function, given, names)
            return {"energy": record(energy), "function": str(getattr(function, "__name__", type(function).__name__))}
        case Reversible():
            names = {str(port): True for port in primitive.reads}
            if isinstance(function, StructureFunction):
                parts = {"L": function.skew, "C": function.constraint}
                return {key: _rows(part.rows) for key, part in parts.items() if part is not None}
            n, k = primitive.bundle.size, primitive.multipliers
            both = _terms(primitive, stacked(primitive.formula, n, k), given, names)
            rows = [both[i : i + n] for i in range(0, len(both), n)]
            return {"L": _rows(rows[:n])} | ({"C": _rows(rows[n:])} if k else {})
        case Irreversible():
            if isinstance(function, TermMatrix):
                return {"M": _rows(function.rows)}
            names = {str(port): not kind.power for port, kind in primitive.interface.items()}
            n = primitive.bundle.size
            entries = _terms(primitive, function, given, names)
            return {"M": _rows([entries[i : i + n] for i in range(0, n * n, n)])}


def _rows(rows: Any) -> list[list[Any]]:
    return [[record(entry) for entry in row] for row in rows]


def _terms(
    primitive: Primitive, function: Callable[..., Any], numbers: Mapping[str, object], names: Mapping[str, bool]
) -> tuple[Term, ...]:
    """Terms of a function's values; of each named port it takes the state, or the effort where that is False."""
    sizes: dict[str, int | None] = {}
    inputs: list[Term] = []
    for name, state in names.items():
        space = primitive.interface[name].quantity.space
        size = space.size if state else space.dim
        sizes[name] = None if size == 1 else size
        inputs += [name] if size == 1 else [("entry", name, i) for i in range(size)]
    found = recorded(recording(partial(function, **numbers), sizes), inputs)
    return tuple(map(simple, found))


def _agree(one: Primitive, two: Primitive) -> bool:
    """Whether two primitives agree at some states and efforts."""
    return all(
        bool(np.allclose(a, b, rtol=AGREEMENT, atol=AGREEMENT * float(np.abs(a).max(initial=0.0)), equal_nan=True))
        for seed in range(3)
        for a, b in zip(_evaluations(one, seed), _evaluations(two, seed), strict=True)
    )


def _evaluations(primitive: Primitive, seed: int) -> tuple[Array, ...]:
    rng, bundle = np.random.default_rng(seed), primitive.bundle
    x, e = random_point(bundle, primitive.reads, rng), random_efforts(bundle, rng)
    efforts, intensive = bundle.split(e), bundle.split(bundle.intensive(Reference()))  # views of e
    for port, low, high in primitive.domain:
        numbers = between(low, high, rng.standard_normal(bundle.interface[port].quantity.space.dim))
        if port in x:
            x[port] = numbers
        else:
            efforts[port][:] = numbers - intensive[port]
    match primitive:
        case Storage():
            return np.array([primitive.energy(x)]), primitive.energy_gradient(x)
        case Reversible():
            return primitive.structure(x)
        case Irreversible():
            return (primitive.matrix(x, e, Reference()),)
