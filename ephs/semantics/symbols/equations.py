"""The equations of a system, written with the names of its junctions, in three forms.

*relation*: junction by junction what the pattern says, component by component what its filling says.
*descriptor*: the square form: efforts of storages, balances of flows, conditions.
*reduced*: what is left when interface variables are eliminated.

A warning follows the equations where the initial state admits no motion, or where the motion is not determined.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Literal, final

from ephs.operad import Path, Quantity
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.symbols.algebra import Expr, sp, text_of
from ephs.semantics.symbols.voices import say
from ephs.semantics.symbols.words import curved, escaped, operator
from ephs.semantics.symbols.writer import SquareForm, SymbolicJunction, Writer, parts_of
from ephs.semantics.systems.system import System

# Elimination of unknowns from equations that are linear in them.


def tidy(expression: Expr) -> Expr:
    """A shorter equal expression, if one is found; of operators the expanded one."""
    expanded = sp.expand(expression)
    if not expanded.is_commutative:
        return expanded
    return min((expanded, sp.simplify(expanded)), key=sp.count_ops)


def settled(expression: Expr, known: Mapping[Expr, Expr]) -> Expr:
    """An expression after repeated substitution of all known values.

    Raises
    ------
    ArithmeticError
        A value contains its own symbol, if only by way of others.
    """
    for _ in range(len(known) + 1):  # each substitution ends chains of values that are one longer
        new = expression.subs(known)
        if new == expression:
            return sp.expand(new)
        expression = new
    raise ArithmeticError(f"the values of {', '.join(map(str, known))} contain each other")


def eliminate(equations: list[Expr], unknowns: list[Expr]) -> tuple[dict[Expr, Expr], list[Expr]]:
    """Solve equations (expressions equal to zero) for unknowns that occur once, with a nonzero factor.

    Returns what was solved, and the expressions left.
    """
    left = list(equations)
    solved: dict[Expr, Expr] = {}
    for unknown in unknowns:
        for number, expression in enumerate(left):
            coefficient = coefficient_of(expression, unknown)
            if coefficient is None:
                continue
            value = sp.expand(unknown - expression / coefficient)
            del left[number]
            left = [sp.expand(other.subs(unknown, value)) for other in left]
            solved = {symbol: sp.expand(entry.subs(unknown, value)) for symbol, entry in solved.items()}
            solved[unknown] = value
            break
    return solved, left


def coefficient_of(expression: Expr, unknown: Expr) -> Expr | None:
    """The factor of an unknown that occurs linearly, if it is a nonzero number or parameter."""
    terms = [term for term in sp.Add.make_args(expression) if term.has(unknown)]
    if len(terms) != 1:
        return None
    factor, rest = terms[0].as_independent(unknown)
    if rest != unknown or factor == 0:
        return None
    if factor.is_number or (factor.is_commutative and factor.is_nonzero):
        return factor
    return None


Form = Literal["relation", "descriptor", "reduced"]


@final
@dataclass(frozen=True, slots=True)
class SymbolicEquation:
    """The equation left = right between SymPy expressions, and its origin."""

    left: Expr
    right: Expr
    about: str


@final
@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """The equations of a system; as text by ``str``, as LaTeX by ``latex()``.

    Parameters
    ----------
    names
        Symbol -> how LaTeX writes it.
    doubt
        Why no motion exists from the initial state, or why it is not known to be determined; empty where it is.
    """

    form: Form
    rows: tuple[SymbolicEquation, ...]
    names: Mapping[Expr, str]
    doubt: str = ""

    def __iter__(self) -> Iterator[SymbolicEquation]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, left: str) -> Expr:
        """The right side of the equation with this left side.

        Raises
        ------
        KeyError
            There is none; the message lists the left sides.
        """
        for row in self.rows:
            if text_of(row.left) == left:
                return row.right
        raise KeyError(f"{left}: the left sides are {', '.join(text_of(row.left) for row in self.rows)}")

    def __repr__(self) -> str:
        lines: list[str] = []
        for about, rows in groupby(self.rows, lambda row: row.about):
            lines += [f"{about}:", *(f"  {text_of(row.left)} = {text_of(row.right)}" for row in rows)]
        return "\n".join([*lines, f"at the start {self.doubt}"] if self.doubt else lines)

    def latex(self) -> str:
        """An ``align`` environment with a line for each equation."""
        lines: list[str] = []

        def say_between(words: str) -> None:
            lines.append(rf"  \intertext{{{escaped(words, formula=False)}}}")

        for about, rows in groupby(self.rows, lambda row: row.about):
            say_between(about)
            lines.extend(rf"  {self._tex(row.left)} &= {self._tex(row.right)} \\" for row in rows)
        if self.doubt:
            say_between(f"at the start {self.doubt}")
        return "\n".join([r"\begin{align*}", *lines, r"\end{align*}"])

    def _tex(self, expression: Expr) -> str:
        return str(sp.latex(expression, symbol_names=dict(self.names), mul_symbol=r" \, "))

    def _repr_latex_(self) -> str:  # pyright: ignore[reportUnusedFunction] - notebooks call it
        rows = "".join(rf"{self._tex(row.left)} &= {self._tex(row.right)} \\" for row in self.rows)
        warning = rf"& \text{{at the start {self.doubt}}}" if self.doubt else ""
        return rf"$\displaystyle \begin{{aligned}}{rows}{warning}\end{{aligned}}$"


def equations_of(system: System, form: Form) -> Equations:
    """The equations of a system, see the module.

    Raises
    ------
    AssemblyError
        The descriptor and the reduced form of what has no square system of equations.
    ValueError
        There is no such form.
    """
    writers: dict[str, Callable[[Writer], Iterator[SymbolicEquation]]] = {
        "relation": _relation,
        "descriptor": _descriptor,
        "reduced": _reduced,
    }
    if form not in writers:
        raise ValueError(f"form is {form!r}, expected one of {', '.join(writers)}")
    writer = Writer(system.flatten())
    return Equations(form, tuple(writers[form](writer)), writer.words.latex, _doubt(system))


def _doubt(system: System) -> str:
    try:
        return system.relation().at(system.state()).doubt
    except SemanticsError as error:
        return str(error)


def _moving(writer: Writer, junction: Path, quantity: Quantity, flow: Expr) -> Expr:
    """Time derivative of a state from its left-trivialised flow."""
    if curved(quantity):
        return operator("tangent", writer.words.state(junction, quantity)) * flow
    return flow


# ---- the relation ----------------------------------------------------------------------------------------------


def _relation(writer: Writer) -> Iterator[SymbolicEquation]:
    pattern, words = writer.flat.pattern, writer.words
    for path, junction in pattern.junctions.items():
        about = f"junction {path}"
        on = [
            (box / port, where.power)
            for box, b in pattern.boxes.items()
            for port, where in b.ports.items()
            if where.junction == path
        ]
        states = [words.port(name, "x", junction.quantity) for name, _ in on]
        if junction.exposed:
            states.append(words.port(path, "x", junction.quantity))
        for one, other in pairwise(states):
            yield SymbolicEquation(one, other, about)
        inner = [name for name, power in on if power]
        outer = junction.exposed and junction.power
        net = sum((words.port(name, "f", junction.quantity) for name in inner), sp.Integer(0))
        if inner or outer:
            yield SymbolicEquation(net, words.port(path, "f", junction.quantity) if outer else sp.Integer(0), about)
        efforts = [words.port(name, "e", junction.quantity) for name in inner]
        if outer:
            efforts.append(words.port(path, "e", junction.quantity))
        for one, other in pairwise(efforts):
            yield SymbolicEquation(one, other, about)
    for path, primitive in writer.components():
        about = f"{path} ({primitive.name}, {primitive.kind})"

        def effort(port: Path, quantity: Quantity, path: Path = path) -> Expr:
            return words.port(path / port, "e", quantity)

        said = say(writer.voice(path, primitive, effort))
        for port, expression in said.efforts.items():
            junction, quantity = writer.state(path, port)
            yield SymbolicEquation(words.port(path / port, "x", quantity), words.state(junction, quantity), about)
            yield SymbolicEquation(words.port(path / port, "f", quantity), _flow_of(writer, junction, quantity), about)
            yield SymbolicEquation(words.port(path / port, "e", quantity), sp.expand(expression), about)
        for port, expression in said.flows.items():
            quantity = primitive.bundle.quantity(port)
            yield SymbolicEquation(words.port(path / port, "f", quantity), sp.expand(expression), about)
        for condition in said.conditions:
            yield SymbolicEquation(sp.Integer(0), sp.expand(condition), about)


def _flow_of(writer: Writer, junction: Path, quantity: Quantity) -> Expr:
    """The left-trivialised derivative of a state by time."""
    rate = writer.words.rate(junction, quantity)
    if curved(quantity):
        return operator("tangent", writer.words.state(junction, quantity)) ** -1 * rate
    return rate


# ---- the descriptor form ---------------------------------------------------------------------------------------


def _descriptor(writer: Writer) -> Iterator[SymbolicEquation]:
    parts = parts_of(writer, writer.junctions())
    for junction, (expression, quantity, path) in parts.storages.items():
        yield SymbolicEquation(writer.effort(junction, quantity), sp.expand(expression), f"effort of {path}")
    for junction, balance in parts.balances.items():
        rate = parts.rates.get(junction)
        about = f"flows at {junction}"
        if rate is None:
            yield SymbolicEquation(sp.Integer(0), sp.expand(balance), about)
        else:
            quantity = parts.storages[junction][1]
            right = _moving(writer, junction, quantity, sp.expand(rate - balance))
            yield SymbolicEquation(writer.words.rate(junction, quantity), right, about)
    for path, condition in parts.conditions:
        yield SymbolicEquation(sp.Integer(0), sp.expand(condition), f"condition of {path}")


# ---- the reduced form ------------------------------------------------------------------------------------------


def _reduced(writer: Writer) -> Iterator[SymbolicEquation]:
    junctions = writer.junctions()
    parts = parts_of(writer, junctions)
    outer = [slot for slot in junctions if slot.exposed]
    known = {writer.effort(j, quantity): e for j, (e, quantity, _) in parts.storages.items()}
    open_flows = {slot.path: writer.words.port(slot.path, "f", slot.quantity) for slot in outer}
    idle = [b for j, b in parts.balances.items() if j not in parts.rates and j not in open_flows]
    algebraic = [sp.expand(e.subs(known)) for e in [*idle, *(condition for _, condition in parts.conditions)]]
    solved, algebraic = eliminate(algebraic, _candidates(writer, junctions, parts))
    known = {symbol: settled(e, solved) for symbol, e in known.items()} | solved

    def final(expression: Expr) -> Expr:
        return tidy(settled(expression, known))

    for junction, rate in parts.rates.items():
        quantity = parts.storages[junction][1]
        flow = final(rate - parts.balances[junction])
        yield SymbolicEquation(
            writer.words.rate(junction, quantity), _moving(writer, junction, quantity, flow), "states"
        )
    for expression in algebraic:
        if final(expression) != 0:
            yield SymbolicEquation(sp.Integer(0), final(expression), "conditions")
    for slot in outer:
        effort = writer.effort(slot.path, slot.quantity)
        if effort in known:
            yield SymbolicEquation(effort, final(effort), "outer ports")
        if slot.path not in parts.rates:
            flow = open_flows[slot.path]
            yield SymbolicEquation(flow, final(flow + parts.balances[slot.path]), "outer ports")


def _candidates(writer: Writer, junctions: list[SymbolicJunction], parts: SquareForm) -> list[Expr]:
    """Unknowns in the order in which they should go: flows through transformers, inner efforts, other multipliers."""
    transformers: list[Expr] = []
    others: list[Expr] = []
    for path, primitive in writer.components():
        said = parts.said[path]
        own = list(said.multipliers)
        efforts = [writer.effort(writer.junction(path, port), q) for port, _, q in primitive.bundle.items()]
        solvable = any(
            coefficient_of(sp.expand(condition), effort) is not None
            for condition in said.conditions
            for effort in efforts
            if len(said.conditions) == 1 and len(efforts) == 2
        )
        (transformers if solvable else others).extend(own)
    inner = [
        writer.effort(slot.path, slot.quantity)
        for slot in junctions
        if slot.path not in parts.storages and not slot.exposed
    ]
    return [*transformers, *inner, *others]
