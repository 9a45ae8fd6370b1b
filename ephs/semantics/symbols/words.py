"""Notation of formulas: symbols with a name in text and one in LaTeX, and operators between spaces.

Scalars commute. Vectors and the linear operators before them do not, so that SymPy's products read like compositions:
``Ad(o1^-1) lambda``. Both kinds print themselves, as text and as LaTeX.
"""

from typing import Any, final

from ephs.operad import Path, Quantity
from ephs.semantics.symbols.algebra import Expr, sp

OPERATORS: dict[str, tuple[str, str]] = {
    "tangent": ("TL({0})", r"\mathrm{{T}}_e L_{{{0}}}"),
    "cotangent": ("T*L({0})", r"\mathrm{{T}}^*_e L_{{{0}}}"),
    "differential": ("dE[{0}]({1})", r"\mathrm{{d}} E_{{{0}}}({1})"),
    "partial": ("dE[{0}]/d{1}({2})", r"\mathrm{{d}}_{{{1}}} E_{{{0}}}({2})"),
    "inertia": ("I[{0}]^-1", r"\mathbb{{I}}_{{{0}}}^{{-1}}"),
    "Ad": ("Ad({0}^-1)", r"\mathrm{{Ad}}_{{{0}^{{-1}}}}"),
    "Ad*": ("Ad*({0}^-1)", r"\mathrm{{Ad}}^*_{{{0}^{{-1}}}}"),
    "ad*": ("ad*({0})", r"\mathrm{{ad}}^*_{{{0}}}"),
    "group": ("I({0})", r"\mathrm{{I}}({0})"),
    "include": ("i[{0}]", r"\mathrm{{i}}_{{{0}}}"),
    "include*": ("i*[{0}]", r"\mathrm{{i}}^*_{{{0}}}"),
    "metric": ("mu[{0}]", r"\mu_{{{0}}}"),
    "lengthen": ("w[{0}]", r"w_{{{0}}}"),
    "lengthen*": ("w*[{0}]", r"w^*_{{{0}}}"),
    "block": ("{0}[{1}, {2}]", r"{0}_{{{1}, {2}}}"),
    "dual block": ("{0}*[{1}, {2}]", r"{0}^*_{{{1}, {2}}}"),
    "flow of": ("f[{0}]({1})", r"f_{{{0}}}({1})"),
}
"""Name -> notation as text and as LaTeX, with places for its arguments."""

_Function: Any = sp.Function


class Operator(_Function):
    """A linear operator, or a covector that depends on a state: its first argument is its name in `OPERATORS`."""

    is_commutative = False

    @classmethod
    def eval(cls, *_: Any) -> None:
        """Nothing is evaluated."""

    def _sympystr(self, printer: Any) -> str:
        text, _ = OPERATORS[self.args[0].name]
        return text.format(*(printer.doprint(a) for a in self.args[1:]))

    def _latex(self, printer: Any, **_options: Any) -> str:
        _, latex = OPERATORS[self.args[0].name]
        return latex.format(*(printer.doprint(a) for a in self.args[1:]))


class Pairing(_Function):
    """A number made of two vectors by a bilinear form, μ(u, u): the form's label, then the vectors."""

    is_commutative = True
    is_real = True

    @classmethod
    def eval(cls, *_: Any) -> None:
        """Nothing is evaluated."""

    def _sympystr(self, printer: Any) -> str:
        label, *vectors = (printer.doprint(a) for a in self.args)
        return f"mu[{label}]({', '.join(vectors)})"

    def _latex(self, printer: Any, **_: Any) -> str:
        label, *vectors = (printer.doprint(a) for a in self.args)
        return rf"\mu_{{{label}}}({', '.join(vectors)})"


def operator(name: str, *arguments: Expr) -> Expr:
    """An operator of `OPERATORS` with its arguments."""
    return Operator(sp.Symbol(name, commutative=False), *arguments)


def pairing(label: Expr, one: Expr, other: Expr) -> Expr:
    """The number μ(one, other)."""
    return Pairing(label, one, other)


def plain(quantity: Quantity) -> bool:
    """Whether flows and efforts are numbers."""
    return quantity.space.name == "real" and quantity.space.dim == 1


def curved(quantity: Quantity) -> bool:
    """Whether states are elements of a group, and rates and covectors left-trivialised."""
    return quantity.space.name != "real" and not quantity.space.name.endswith("*")


@final
class Words:
    """The symbols of one system, each with its LaTeX name."""

    def __init__(self) -> None:
        self.latex: dict[Expr, str] = {}

    def symbol(self, text: str, latex: str, *, scalar: bool, positive: bool = False) -> Expr:
        """A symbol of this name, a scalar or a vector."""
        kind = {"real": True, "positive": positive or None} if scalar else {"commutative": False}
        found = sp.Symbol(text, **kind)
        self.latex[found] = latex
        return found

    def state(self, junction: Path, quantity: Quantity) -> Expr:
        """The state of a junction."""
        scalar = plain(quantity)
        return self.symbol(str(junction), latex_name(junction), scalar=scalar, positive=quantity.positive)

    def rate(self, junction: Path, quantity: Quantity) -> Expr:
        """Its derivative by time."""
        base, separator, index = latex_name(junction).partition("_{")
        return self.symbol(f"d{junction}/dt", rf"\dot{{{base}}}{separator}{index}", scalar=plain(quantity))

    def port(self, path: Path, side: str, quantity: Quantity) -> Expr:
        """The flow (side f) or the effort (side e) of a port, or of a junction."""
        return self.symbol(f"{path}.{side}", rf"\mathtt{{{escaped(str(path))}.{side}}}", scalar=plain(quantity))

    def multiplier(self, path: Path, number: int | None, *, scalar: bool) -> Expr:
        """A multiplier of a component."""
        index = "" if number is None else f"_{number + 1}"
        upper = "" if number is None else f", {number + 1}"
        return self.symbol(f"lambda{index}[{path}]", rf"\lambda_{{{_label(path)}{upper}}}", scalar=scalar)

    def label(self, path: Path) -> Expr:
        """The path of a component, as a subscript."""
        return self.symbol(str(path), _label(path), scalar=False)

    def parameter(self, name: str, owner: Path | None, *, positive: bool) -> Expr:
        """A component's parameter; with its owner's path where others have one of this name."""
        greek = {"mu": r"\mu", "theta": r"\theta"}.get(name, latex_name(Path.of(name)))
        text = name if owner is None else f"{owner}.{name}"
        latex = greek if owner is None else _beside(greek, _label(owner))
        return self.symbol(text, latex, scalar=True, positive=positive)


_SPELLED = {letter: f"\\{letter}" for letter in "{}_&%$#"} | {"<": "{<}"}  # pages take < for an element's start
_IN_FORMULAS = {"\\": r"\backslash ", "~": r"\sim ", "^": r"\wedge "}
_IN_TEXT = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}


def latex_name(path: Path) -> str:
    r"""The name of a junction: ``joint.q_r`` is q_{r, \mathrm{joint}}."""
    *owner, last = path
    base, _, index = last.partition("_")
    digits = len(base) - len(base.rstrip("0123456789"))
    if not index and digits and digits < len(base):
        base, index = base[:-digits], base[-digits:]
    base = escaped(base) if len(base) == 1 else rf"\mathit{{{escaped(base)}}}"
    subscripts = [escaped(index.replace("_", ","))] if index else []
    if owner:
        subscripts.append(rf"\mathrm{{{escaped('.'.join(owner))}}}")
    return f"{base}_{{{', '.join(subscripts)}}}" if subscripts else base


def _label(path: Path) -> str:
    return rf"\mathrm{{{escaped(str(path))}}}"


def escaped(name: str, *, formula: bool = True) -> str:
    """A name for the inside of a formula, or for text beside it: whatever its letters, LaTeX sets and obeys none."""
    spelled = _SPELLED | (_IN_FORMULAS if formula else _IN_TEXT)
    return "".join(spelled.get(letter, letter) for letter in name)


def _beside(name: str, subscript: str) -> str:
    head, separator, rest = name.partition("_{")
    return f"{head}_{{{rest[:-1]}, {subscript}}}" if separator else f"{name}_{{{subscript}}}"
