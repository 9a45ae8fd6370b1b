"""The linear relation between efforts, flows, states and rates defined by a component's equations.

Equations of positions are differentiated, so that the efforts of flanges are rates. What is known by the temperature of
a heat port is a coefficient; equations of powers in watt are kept aside.
"""

from dataclasses import dataclass
from typing import Any, final

from ephs.modelica.errors import ModelicaError
from ephs.modelica.expressions import Expr, Matrix, Symbol, derivative, sp
from ephs.modelica.flat import LENGTHS, Connector, Flat, ZeroResidual
from ephs.operad import Quantity, quantity

STATES: dict[str, tuple[Quantity, bool]] = {
    "V": (quantity.charge, True),
    "A": (quantity.flux_linkage, True),
    "rad/s": (quantity.angular_momentum, True),
    "m/s": (quantity.momentum, True),
    "C": (quantity.charge, False),
    "Wb": (quantity.flux_linkage, False),
    "rad": (quantity.angle, False),
    "m": (quantity.displacement, False),
}
"""By the unit of a state: stored quantity, and whether the state is its effort instead of the stored amount."""


@final
@dataclass(frozen=True, slots=True)
class DifferentiatedVariable:
    """A variable that is differentiated, or a position that forces depend on."""

    symbol: Symbol
    quantity: Quantity
    effort: bool
    rest: Expr


@final
@dataclass(frozen=True, slots=True)
class PortRelation:
    """Possible joint values of the variables of n ports and k states: columns of matrices with n + k columns.

    Parameters
    ----------
    efforts, flows
        (n, n + k), of the ports.
    values, rates
        (k, n + k), of the states, from where they rest.
    every
        Each variable's row, for what is not linear.
    powers
        Equations with powers in watt.
    laws
        The relation as equations, for errors.
    """

    ports: tuple[Connector, ...]
    states: tuple[DifferentiatedVariable, ...]
    efforts: Matrix
    flows: Matrix
    values: Matrix
    rates: Matrix
    every: dict[Symbol, Matrix]
    powers: tuple[ZeroResidual, ...]
    laws: str


def needed(flat: Flat) -> tuple[ZeroResidual, ...]:
    """The equations without definitions of otherwise unused variables."""
    kept = {symbol for port in flat.ports for symbol in (port.potential, port.flow, derivative(port.potential))}
    equations = list(flat.equations)
    while True:
        for place, equation in enumerate(equations):
            others = set().union(*(each.residual.free_symbols for each in equations if each is not equation))
            alone = {each for each in equation.residual.free_symbols - others - kept if derivative(each) not in others}
            said = equation.text.split(" = ")
            alone -= {each for each in alone - flat.units.keys() if each.name not in said}  # signals that are read
            if any(_defines(equation.residual, symbol) for symbol in alone):
                del equations[place]
                break
        else:
            return tuple(equations)


def _defines(residual: Expr, symbol: Symbol) -> bool:
    """Whether the residual is solved for the symbol, which is no derivative, whatever else is known."""
    if symbol.name.startswith("der(") or derivative(symbol) in residual.free_symbols:
        return False
    slope = sp.diff(residual, symbol)
    return slope.is_number and slope != 0


def relation_of(flat: Flat, equations: tuple[ZeroResidual, ...]) -> PortRelation:
    """The relation between the ports that carry no heat.

    Raises
    ------
    ModelicaError
        Equations that are not linear, too few or too many, a state of an unknown unit, or a source.
    """
    ports = tuple(port for port in flat.ports if not port.heat)
    hot = {port.potential for port in flat.ports if port.heat}
    equations, moving = _differentiated(flat, equations)
    equations = _warmed(flat, equations, hot)
    watts = {symbol for symbol, unit in flat.units.items() if unit == "W"}
    powers = tuple(each for each in equations if each.residual.free_symbols & watts)
    linear = [each for each in equations if not each.residual.free_symbols & watts]
    seen = set().union(*(each.residual.free_symbols for each in equations))
    symbols = tuple(_states(flat, seen, moving))
    flat.require_started(symbols)
    efforts = [derivative(port.potential) if port.domain.position else port.potential for port in ports]
    flows = [port.flow for port in ports]
    rates = [derivative(symbol) for symbol in symbols]
    shown = list(dict.fromkeys([*efforts, *flows, *symbols, *rates]))
    columns = [*sorted(seen - hot - watts - set(shown), key=str), *shown]
    matrix, constant = _linear(flat, linear, columns)
    rest = _rest(flat, matrix, constant, columns, symbols, shown)
    basis = _null(matrix)
    count = len(ports) + len(symbols)
    if basis.shape[1] != count:
        found = 2 * count - basis.shape[1]
        raise ModelicaError("count", where=flat.name, found=found, expected=count)
    every = {symbol: basis[place, :] for place, symbol in enumerate(columns)}

    def rows(chosen: list[Symbol]) -> Matrix:
        return sp.Matrix.vstack(sp.zeros(0, count), *(every[symbol] for symbol in chosen))

    states = tuple(DifferentiatedVariable(s, *STATES[flat.units[s]], rest.get(s, sp.Integer(0))) for s in symbols)
    laws = _laws(matrix, constant, columns, shown)
    return PortRelation(
        ports, states, rows(efforts), rows(flows), rows(list(symbols)), rows(rates), every, powers, laws
    )


def _differentiated(flat: Flat, equations: tuple[ZeroResidual, ...]) -> tuple[tuple[ZeroResidual, ...], set[Symbol]]:
    """Equations between positions only, differentiated; and the positions in other equations."""
    out: list[ZeroResidual] = []
    moving: set[Symbol] = set()
    for equation in equations:
        symbols = equation.residual.free_symbols
        if symbols and all(flat.units.get(symbol) in LENGTHS for symbol in symbols):
            slopes = {symbol: sp.diff(equation.residual, symbol) for symbol in sorted(symbols, key=str)}
            if any(slope.free_symbols for slope in slopes.values()):
                raise ModelicaError("constraint", where=flat.name, equation=equation.text)
            rate = sum((slope * derivative(symbol) for symbol, slope in slopes.items()), sp.Integer(0))
            out.append(ZeroResidual(rate, equation.text))
        else:
            out.append(equation)
            moving |= {symbol for symbol in symbols if flat.units.get(symbol) in LENGTHS}
    return tuple(out), moving


def _warmed(flat: Flat, equations: tuple[ZeroResidual, ...], hot: set[Symbol]) -> tuple[ZeroResidual, ...]:
    """Substitute known numbers and the temperatures of heat ports, such as in resistances."""
    shown = {port.potential for port in flat.ports} | {port.flow for port in flat.ports}
    left = list(equations)
    while True:
        for place, equation in enumerate(left):
            unknown = equation.residual.free_symbols - hot
            symbol = next(iter(unknown)) if len(unknown) == 1 else None
            if symbol is None or symbol in shown or symbol not in flat.units or flat.units[symbol] in LENGTHS:
                continue
            if any(derivative(symbol) in each.residual.free_symbols for each in left):
                continue
            slope = sp.diff(equation.residual, symbol)
            if slope.free_symbols - hot or slope == 0:
                continue
            value = sp.cancel(-equation.residual.subs(symbol, 0) / slope)
            del left[place]
            left = [ZeroResidual(sp.expand(each.residual.subs(symbol, value)), each.text) for each in left]
            break
        else:
            return tuple(left)


def _states(flat: Flat, seen: set[Symbol], moving: set[Symbol]) -> list[Symbol]:
    """Variables with a derivative, and positions that forces depend on."""
    out: list[Symbol] = []
    for symbol, unit in flat.units.items():
        if not (symbol in moving if unit in LENGTHS else derivative(symbol) in seen):
            continue
        if unit not in STATES:
            raise ModelicaError(
                "state", where=flat.name, found=symbol.name, unit=unit or "no unit", expected=", ".join(STATES)
            )
        out.append(symbol)
    return out


def _linear(flat: Flat, equations: list[ZeroResidual], columns: list[Symbol]) -> tuple[Matrix, Matrix]:
    """The coefficients of equations, and their constants on the right."""
    rows: list[list[Any]] = []
    constants: list[Any] = []
    for equation in equations:
        slopes = [sp.diff(equation.residual, symbol) for symbol in columns]
        if any(slope.free_symbols & set(columns) for slope in slopes) or not _closed(equation.residual, columns):
            raise ModelicaError("nonlinear", where=flat.name, equation=equation.text)
        rows.append(slopes)
        constants.append(-equation.residual.subs(dict.fromkeys(columns, 0)))
    entries = [entry for row in rows for entry in row]
    return sp.Matrix(len(rows), len(columns), entries), sp.Matrix(len(rows), 1, constants)


def _closed(residual: Expr, columns: list[Symbol]) -> bool:
    """Whether no function or branch hides a variable."""
    return not any(part.free_symbols & set(columns) for part in residual.atoms(sp.Function, sp.Piecewise))


def _rest(
    flat: Flat,
    matrix: Matrix,
    constant: Matrix,
    columns: list[Symbol],
    states: tuple[Symbol, ...],
    shown: list[Symbol],
) -> dict[Symbol, Expr]:
    """States at rest: values for which all else vanishes.

    Raises
    ------
    ModelicaError
        There are none: something drives the component.
    """
    if not any(constant):
        return {}
    places = [place for place, symbol in enumerate(columns) if symbol in states or symbol not in shown]
    try:
        solution, free = matrix[:, places].gauss_jordan_solve(constant)
    except ValueError:
        if matrix.rank() < sp.Matrix.hstack(matrix, constant).rank():
            raise ModelicaError("contradiction", where=flat.name) from None
        raise ModelicaError("source", where=flat.name, equation=_laws(matrix, constant, columns, shown)) from None
    solution = solution.subs(dict.fromkeys(free, 0))
    return {columns[place]: solution[row] for row, place in enumerate(places) if columns[place] in states}


def _null(matrix: Matrix) -> Matrix:
    """A basis of the matrix's null space, as columns; over numbers, or functions of temperatures."""
    if not matrix.rows:
        return sp.eye(matrix.cols)
    rows = sp.polys.matrices.DomainMatrix.from_Matrix(matrix).to_field().nullspace().to_Matrix()
    return rows.T.applyfunc(sp.cancel)


def _laws(matrix: Matrix, constant: Matrix, columns: list[Symbol], shown: list[Symbol]) -> str:
    """The relation between ports and states in the letters of the component."""
    inner = len(columns) - len(shown)
    if not matrix.rows:
        return ""
    reduced, pivots = sp.Matrix.hstack(matrix, constant).rref()
    out: list[str] = []
    for row, pivot in enumerate(pivots):
        if pivot >= inner:
            terms = [reduced[row, place] * columns[place] for place in range(inner, len(columns))]
            out.append(f"{sum(terms, sp.Integer(0))} = {reduced[row, len(columns)]}")
    return ", ".join(out)
