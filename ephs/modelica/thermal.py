"""Heat: losses go to the heat port; capacities and conductors have heat ports only."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ephs.modelica.errors import ModelicaError
from ephs.modelica.expressions import Expr, Matrix, Symbol, derivative, sp
from ephs.modelica.flat import Connector, Flat, ZeroResidual
from ephs.modelica.relation import PortRelation
from ephs.operad import Interface, quantity
from ephs.semantics import library
from ephs.semantics.library.formulas import heat_transfer
from ephs.semantics.primitives.constructors import irreversible
from ephs.semantics.primitives.primitives import Primitive, Reversible, power_ports
from ephs.semantics.primitives.structures import constant_structure


def warm_of(flat: Flat) -> dict[Symbol, Expr]:
    """The start temperatures of heat ports, where signs are looked at."""
    return {
        port.potential: sp.Rational(repr(flat.starts.get(port.potential) or 293.15)) for port in flat.ports if port.heat
    }


def require_heat(flat: Flat, relation: PortRelation, form: Matrix) -> None:
    """Refuse a component whose heat port does not receive the power dissipated at the other ports.

    Parameters
    ----------
    form
        The power that the ports take and the states do not store.
    """
    ports = [port for port in flat.ports if port.heat]
    count = form.rows
    point = sp.Matrix(sp.symbols(f"w:{count}", real=True))
    lost = sp.expand((point.T * form * point)[0]) if count else sp.Integer(0)
    values = {symbol: (row * point)[0] if count else 0 for symbol, row in relation.every.items()}
    residuals = [sp.expand(each.residual.subs(values, simultaneous=True)) for each in relation.powers]
    unknown = sorted(
        set().union(*(each.free_symbols for each in residuals)) - set(point) - {p.potential for p in ports}, key=str
    )
    solved = sp.solve(residuals, unknown, dict=True) if residuals else []
    flows = [solved[0].get(port.flow, port.flow) if solved else port.flow for port in ports]
    taken = sp.cancel(sum(flows, sp.Integer(0)))
    if len(ports) > 1 or (residuals and not solved) or (ports and sp.cancel(taken + lost) != 0):
        texts = ", ".join(each.text for each in relation.powers)
        raise ModelicaError("heat", where=flat.name, equation=texts or "there are none of powers")


def heated(flat: Flat, equations: tuple[ZeroResidual, ...]) -> tuple[Primitive, dict[str, str]]:
    """A component with heat ports only: the primitive, and its ports by those of the component.

    Raises
    ------
    ModelicaError
        It is neither a capacity nor a conductor, nor joins its ports without a loss.
    """
    same = _same(flat, equations)
    residuals = [each for each in (sp.expand(each.residual.subs(same)) for each in equations) if each != 0]
    flat.require_started([*same, *same.values()] if len(flat.ports) == 1 else ())
    ideal = _ideal(flat, residuals)
    if ideal is not None:
        return ideal, {port.name: port.name for port in flat.ports}
    flows = _solved(flat, residuals, equations)
    if len(flat.ports) == 1:
        return _capacity(flat, flows, same)
    if len(flat.ports) == 2:
        return _conductor(flat, flows)
    raise _refused(flat, flows)


def _ideal(flat: Flat, residuals: list[Expr]) -> Primitive | None:
    """Ports of one temperature that share their heat, or through which none flows."""
    temperatures, flows = ([getattr(port, of) for port in flat.ports] for of in ("potential", "flow"))
    symbols = [*temperatures, *flows]
    if any(each.free_symbols - set(symbols) or sp.Poly(each, *symbols).total_degree() > 1 for each in residuals):
        return None
    matrix, constant = sp.linear_eq_to_matrix(residuals, symbols)
    n, found = len(flat.ports), matrix.rref()[0]
    if any(constant) or matrix.rank() != n:
        return None
    equal = sp.Matrix([[1] * k + [-k] + [0] * (n - k - 1) for k in range(1, n)]).reshape(n - 1, n)
    joined = sp.diag(equal, sp.ones(1, n)) if n > 1 else None
    ports = power_ports(**{port.name: quantity.entropy for port in flat.ports})
    if found[:n, :] == sp.Matrix.hstack(sp.zeros(n), sp.eye(n)).rref()[0]:
        return flowless(ports)
    if joined is not None and found[:n, :] == joined.rref()[0]:
        return constant_structure("joined", ports, np.zeros((n, n)), np.array(equal.tolist(), dtype=float))
    return None


def flowless(ports: Interface) -> Reversible:
    """Equations of zero flow at all ports."""
    n = len(ports)
    return constant_structure("open", ports, np.zeros((n, n)), np.zeros((0, n)))


def _same(flat: Flat, equations: tuple[ZeroResidual, ...]) -> dict[Symbol, Symbol]:
    """Of each temperature that is a port's, and of its derivative, those of the port."""
    potentials = {port.potential for port in flat.ports}
    same: dict[Symbol, Symbol] = {}
    for each in equations:
        symbols = each.residual.free_symbols
        inner = symbols - potentials
        if len(symbols) == 2 and len(inner) == 1:
            (symbol,), (port,) = inner, symbols & potentials
            if sp.expand(each.residual.subs(symbol, port)) == 0:
                same |= {symbol: port, derivative(symbol): derivative(port)}
    return same


def _solved(flat: Flat, residuals: list[Expr], equations: tuple[ZeroResidual, ...]) -> dict[Connector, Expr]:
    """Heat flows as functions of temperatures and their derivatives."""
    potentials = {port.potential for port in flat.ports}
    given = potentials | {derivative(symbol) for symbol in potentials}
    unknown = sorted(set().union(*(each.free_symbols for each in residuals)) - given, key=str)
    found = sp.solve(residuals, unknown, dict=True) if unknown else []
    if any(each.free_symbols <= potentials for each in residuals) or len(found) != 1:
        raise ModelicaError("source", where=flat.name, equation=", ".join(each.text for each in equations))
    flows = {port: found[0].get(port.flow, port.flow) for port in flat.ports}
    if any(flow.free_symbols - given for flow in flows.values()) or len(residuals) != len(found[0]):
        raise _refused(flat, flows, equations)
    return flows


def _capacity(flat: Flat, flows: dict[Connector, Expr], same: dict[Symbol, Symbol]) -> tuple[Primitive, dict[str, str]]:
    """C θ̇ = Q: E = C θ, s = C log(θ/θ₁) with the start temperature θ₁."""
    (port,) = flat.ports
    rate = derivative(port.potential)
    capacity = sp.cancel(flows[port] / rate)
    if flows[port].is_number:
        raise ModelicaError("source", where=flat.name, equation=_flow_equations(flows))
    if not capacity.is_number or not capacity > 0:
        raise _refused(flat, flows)
    named = sorted([*same, port.potential], key=lambda each: each not in flat.held)
    start = next((flat.starts[each] for each in named if flat.starts.get(each)), 293.15)
    c = float(capacity)
    return library.thermal_capacity(c1=c * start, c2=c), {port.name: "s"}


def _conductor(flat: Flat, flows: dict[Connector, Expr]) -> tuple[Primitive, dict[str, str]]:
    """Q₁ = −Q₂ = h(θ₁, θ₂) (θ₁ − θ₂) with h ≥ 0."""
    first, second = flat.ports
    taken = sp.expand(flows[first] + flows[second])
    if taken != 0:
        raise ModelicaError("first", where=flat.name, found=taken, equation=_flow_equations(flows))
    one, two = sp.symbols("one two", positive=True)
    there = {first.potential: one, second.potential: two}
    h = sp.cancel(flows[first].subs(there, simultaneous=True) / (one - two))
    names = {first.name: "s1", second.name: "s2"}
    if h.is_negative:
        raise ModelicaError("second", where=flat.name, equation=_flow_equations(flows))
    if sp.simplify(h.subs(two, one)).has(sp.zoo, sp.nan, sp.oo):
        raise _refused(flat, flows)
    if h.is_number:
        return library.heat_transfer(h=float(h)), names
    value: Callable[..., Any] = sp.lambdify((one, two), h, modules=np)

    def matrix(s1: Any, s2: Any) -> Any:
        return heat_transfer(s1, s2, value(s1, s2))

    ports = {"s1": quantity.entropy, "s2": quantity.entropy}
    return irreversible(ports, matrix, name="heat_transfer"), names


def _flow_equations(flows: dict[Connector, Expr]) -> str:
    return ", ".join(f"{port.flow} = {flow}" for port, flow in flows.items() if flow != port.flow)


def _refused(flat: Flat, flows: dict[Connector, Expr], equations: tuple[ZeroResidual, ...] = ()) -> ModelicaError:
    said = _flow_equations(flows) or ", ".join(each.text for each in equations)
    return ModelicaError("thermal", where=flat.name, equation=said)
