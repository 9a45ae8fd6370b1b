"""Components as systems: a storage, a Dirac structure and an Onsager structure on the component's ports."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.modelica.errors import ModelicaError
from ephs.modelica.expressions import Matrix, Symbol, derivative, sp
from ephs.modelica.flat import Flat
from ephs.modelica.relation import PortRelation, needed, relation_of
from ephs.modelica.structure import PortStructure, power_of, stored_energy, structure_of
from ephs.modelica.thermal import flowless, heated, require_heat, warm_of
from ephs.operad import Directory, Path, Pattern, PortType, Quantity, junction, quantity
from ephs.semantics import library
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.primitives.constructors import irreversible
from ephs.semantics.primitives.primitives import Primitive, Reversible, power_ports
from ephs.semantics.primitives.structures import constant_structure, onsager, quadratic
from ephs.semantics.systems.system import System


@final
@dataclass(frozen=True, slots=True)
class ModelicaComponent:
    """A component of Modelica that satisfies both laws.

    Parameters
    ----------
    name
        In Modelica.
    system
        The system in its start: ports as connectors, of charge, momentum, angular momentum or entropy. Its boxes are
        ``stored``, ``dirac``, ``loss`` as far as it has them, and ``field`` where its coefficients change sign under
        time reversal, as a magnet's do.
    initial
        States at the start by box and port, from the component's start values.
    """

    name: str
    system: System
    initial: Mapping[str, float]

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of its primitives: ``"storage"``, ``"reversible"``, ``"irreversible"``."""
        boxes = (each for path, each in self.system.fillings.items() if str(path) != "field")
        return tuple(sorted({each.kind for each in boxes}, key=("storage", "reversible", "irreversible").index))


@dataclass(slots=True)
class _AssembledBoxes:
    """Boxes of the system that is put together: ports by junction, and fillings."""

    ports: dict[str, Quantity]
    inner: dict[str, Quantity]
    boxes: dict[str, tuple[dict[str, str], Primitive]]

    def system(self) -> System:
        """The system of the boxes."""
        junctions = {name: junction(of, exposed=True) for name, of in self.ports.items()}
        junctions |= {name: junction(of) for name, of in self.inner.items()}
        pattern = Pattern(junctions=junctions, boxes={name: dict(ports) for name, (ports, _) in self.boxes.items()})
        return System.of(pattern, {Path.of(name): filling for name, (_, filling) in self.boxes.items()})


def component_of(flat: Flat) -> ModelicaComponent:
    """The component, classified by its structure.

    Raises
    ------
    ModelicaError
        It is not taken; the text says why.
    """
    equations = needed(flat)
    known = {*flat.units, *(derivative(symbol) for symbol in flat.units)}
    for symbol in sorted(set().union(*(each.residual.free_symbols for each in equations)) - known, key=str):
        raise ModelicaError("signal", where=flat.name, found=symbol)
    if all(port.heat for port in flat.ports):
        try:
            primitive, names = heated(flat, equations)
        except StructureError as error:
            raise ModelicaError("structure", where=flat.name, found=error) from error
        box = {"storage": "stored", "reversible": "dirac"}.get(primitive.kind, "loss")
        parts = _AssembledBoxes({port.name: quantity.entropy for port in flat.ports}, {}, {})
        parts.boxes[box] = ({inner: outer for outer, inner in names.items()}, primitive)
        start = {"stored.s": 0.0} if box == "stored" else {}
        return ModelicaComponent(flat.name, parts.system().with_initial(start), start)
    relation, warm = relation_of(flat, equations), warm_of(flat)
    hessian = stored_energy(flat.name, relation, warm)
    found = structure_of(flat.name, relation, hessian, warm)
    require_heat(flat, relation, power_of(relation, hessian))
    try:
        return _built(flat, relation, hessian, found)
    except StructureError as error:
        raise ModelicaError("structure", where=flat.name, found=error) from error


def _built(flat: Flat, relation: PortRelation, hessian: Matrix, found: PortStructure) -> ModelicaComponent:
    """The boxes of the structure."""
    heat = next((port.name for port in flat.ports if port.heat), "heat")
    states = {each.symbol.name.replace(".", "_"): each.quantity for each in relation.states}
    outer = {port.name: port.domain.quantity for port in relation.ports}
    stores = {name if name not in outer else f"{name}_": of for name, of in states.items()}
    parts = _AssembledBoxes(dict(outer), dict(stores), {})
    ports = {**outer, **stores}
    same = {name: name for name in ports}
    initial: dict[str, float] = {}
    if stores:
        matrix = _dual(relation, hessian)
        parts.boxes["stored"] = (
            {name: name for name in stores},
            quadratic("stored", power_ports(**stores), matrix, ()),
        )
        starts = [flat.starts[each.symbol] - float(each.rest) for each in relation.states]
        amounts = _numbers(hessian) @ np.array(starts)
        for place, (name, state) in enumerate(zip(stores, relation.states, strict=True)):
            initial[f"stored.{name}"] = float(amounts[place]) if state.effort else starts[place]
    if any(found.skew) or found.constraint.rows:
        dirac, magnetic = _dirac(ports, _numbers(found.skew), _numbers(found.constraint))
        read = {"field": "~flux"} if magnetic else {}
        parts.boxes["dirac"] = ({**same, **read}, dirac)
        if magnetic:
            parts.inner["flux"] = quantity.flux_linkage
            parts.boxes["field"] = ({"b": "flux"}, library.inductor(l=1.0))
            initial["field.b"] = 1.0
    if any(found.loss):
        temperature = next((port.potential for port in flat.ports if port.heat), sp.Symbol("T"))
        lossy = {name: of for row, (name, of) in enumerate(ports.items()) if any(found.loss[row, :])}
        rows = [row for row, name in enumerate(ports) if name in lossy]
        start = float(warm_of(flat).get(temperature, 300.0))
        loss = _loss(lossy, heat, temperature, found.loss.extract(rows, rows), start)
        parts.boxes["loss"] = ({**{name: name for name in lossy}, heat: heat}, loss)
        parts.ports[heat] = quantity.entropy
    joined = {name for ports, _ in parts.boxes.values() for name in ports}
    warm = {port.name: quantity.entropy for port in flat.ports if port.heat}
    free = {name: of for name, of in (outer | warm).items() if name not in joined}
    if free:
        parts.ports |= free
        parts.boxes["open"] = ({name: name for name in free}, flowless(power_ports(**free)))
    return ModelicaComponent(flat.name, parts.system().with_initial(initial), initial)


def _numbers(matrix: Matrix) -> np.ndarray:
    return np.array(matrix.tolist(), dtype=float).reshape(matrix.shape)


def _dual(relation: PortRelation, hessian: Matrix) -> np.ndarray:
    """The energy's second derivative by the stored amounts: H⁻¹ among states that are efforts, else H."""
    out = np.zeros(hessian.shape)
    for effort in (True, False):
        rows = [row for row, state in enumerate(relation.states) if state.effort == effort]
        block = hessian.extract(rows, rows)
        out[np.ix_(rows, rows)] = _numbers(block.inv() if effort and rows else block)
    return out


def _dirac(ports: Mapping[str, Quantity], skew: np.ndarray, constraint: np.ndarray) -> tuple[Reversible, bool]:
    """f = A e + Cᵀλ, 0 = C e; entries that change sign under time reversal are multiplied by a field of one weber."""
    parity = np.array([of.parity for of in ports.values()])
    first = np.array([parity[np.flatnonzero(row)[0]] for row in constraint], dtype=int)
    odd_skew = (skew != 0.0) & np.equal.outer(parity, parity)
    odd_rows = (constraint != 0.0) & ~np.equal.outer(first, parity)
    if not (odd_skew.any() or odd_rows.any()):
        return constant_structure("dirac", power_ports(**ports), skew, constraint), False
    from ephs.semantics.primitives.forms import coupled

    interface = Directory(
        {name: PortType(of, True) for name, of in ports.items()} | {"field": PortType(quantity.flux_linkage, False)}
    )

    def matrices(field: Any) -> Any:
        return _times(skew, odd_skew, field) if skew.any() else None, (
            _times(constraint, odd_rows, field) if len(constraint) else None
        )

    return coupled("dirac", interface, matrices, len(constraint), (Path.of("field"),)), True


def _times(matrix: np.ndarray, odd: np.ndarray, field: Any) -> list[list[Any]]:
    return [
        [entry * field if flips else entry for entry, flips in zip(row, flipping, strict=True)]
        for row, flipping in zip(matrix.tolist(), odd.tolist(), strict=True)
    ]


def _loss(ports: Mapping[str, Quantity], heat: str, temperature: Symbol, matrix: Matrix, start: float) -> Primitive:
    """M = [[θ S, −S e], [−(S e)ᵀ, eᵀS e/θ]] with S (n, n) at the temperature θ."""
    entries: Callable[..., Any] = sp.lambdify(temperature, matrix.tolist(), modules=np)
    names = list(ports)

    def written(**given: Any) -> Any:
        return onsager(entries(given[heat]), [given[name] for name in names], given[heat])

    warm = {heat: _range(matrix, temperature, start)} if matrix.free_symbols else None
    return irreversible({**ports, heat: quantity.entropy}, written, domain=warm, name="loss")


def _range(matrix: Matrix, temperature: Symbol, start: float) -> tuple[float, float]:
    """Temperatures about the start between which no entry of the diagonal vanishes or has a pole."""
    ends = [0.0, math.inf]
    for entry in matrix.diagonal():
        for part in sp.fraction(sp.cancel(entry)):
            ends += [float(root) for root in sp.real_roots(sp.Poly(part, temperature))] if part.free_symbols else []
    return max(end for end in ends if end < start), min(end for end in ends if end >= start)
