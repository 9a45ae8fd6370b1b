"""Registry of methods: description, applicability, and constructor of each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, final
from warnings import warn

from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.codes import VECTOR
from ephs.solve.equations.model import Model
from ephs.solve.march.control import Policy, Proportional
from ephs.solve.methods import own
from ephs.solve.methods.natural import Natural
from ephs.solve.posing.errors import OptionError, nearest_of
from ephs.solve.posing.problem import Problem
from ephs.solve.running.control import Control, Symmetric
from ephs.solve.running.stepping import Stepper


@final
@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """Class of problems of a method.

    Parameters
    ----------
    t0
        Start time in s.
    control
        Tolerances and limits; without ``control.step`` the method has to choose its steps.
    options
        Options of the method, by name.
    equations
        The reduced form of the problem, if it was made before.
    method
        Name of the method, for messages.
    """

    problem: Problem
    t0: float
    control: Control
    options: Mapping[str, Any]
    equations: Any = None
    method: str = ""


@final
@dataclass(frozen=True, slots=True)
class MethodEntry:
    """Properties of a method for its choice, and its constructor.

    Parameters
    ----------
    order
        Order of the error in the step size.
    adaptive, fixed
        Whether the method chooses steps by rtol and atol; whether it takes constant steps.
    systems, scenes
        Whether the method solves any System; whether it solves mechanisms: scenes, and systems with joint coordinates.
    summary
        Description in words.
    make
        Constructor of the method and of its step control for a setting; the control is None for constant steps.
    options
        Names of the method's options.
    forms
        Forms of the equations that the method solves besides the smallest, ``"reduced"``.
    lawful
        Whether every step keeps the energy balance to rounding, whatever its length.
    undamped
        For a method without damping at infinity: constructor, for a compiled model, of the method that estimates the
        error of constant steps; None for other methods.
    impacts
        Whether the method accepts hard contacts: its steps may begin and end at any time.
    posed
        Whether the method needs bodies: systems whose states are numbers are refused.
    """

    name: str
    order: int
    adaptive: bool
    fixed: bool
    systems: bool
    scenes: bool
    summary: str
    make: Callable[[Setting], tuple[Stepper[Any], Policy | None]]
    options: tuple[str, ...] = ()
    forms: tuple[str, ...] = ()
    lawful: bool = False
    undamped: Callable[[Model], Natural] | None = None
    impacts: bool = False
    posed: bool = False


def on_joints(make: Callable[..., Any]) -> Callable[[Setting], tuple[Stepper[Any], Policy | None]]:
    """Constructor of a method on the reduced form of a problem, from ``make(equations, control, **options)``.

    Its steps follow proportional-integral control by its ``exponent`` and its ``share``.
    """

    def made(setting: Setting) -> tuple[Stepper[Any], Policy | None]:
        # systems without bodies need none of these, whose kernels take a quarter of a second to load
        from ephs.mechanics.tree.equations.equations import ReducedEquations
        from ephs.mechanics.tree.finding.frames import Unplaced

        hard = setting.problem.descriptor.strikes
        try:
            equations = setting.equations or ReducedEquations(setting.problem, setting.t0, pushed=hard is not None)
        except Unplaced as error:
            serving = ", ".join(m.name for m in METHODS.values() if m.systems and m.name != setting.method)
            raise OptionError("method", setting.method, f"{serving}: {error}") from None
        stepper = make(equations, setting.control, **setting.options)
        if hard is not None:
            from ephs.mechanics.impacts.stepping import Impacts

            stepper = Impacts(stepper)
        return stepper, None if setting.control.step is not None else Proportional(stepper)

    return made


def _corrected(make: Callable[[Any, Control], Any]) -> Callable[..., Any]:
    """Constructor of a method with corrected steps, with the option of what is conserved."""

    def made(equations: Any, control: Control, keep: str = "energy") -> Any:
        equations.accounts.keep(keep)
        return make(equations, control)

    return made


def _tableau(of: str | own.Method) -> Callable[..., Any]:
    def make(equations: Any, control: Control) -> Any:
        from ephs.mechanics.methods.explicit import Explicit, tableau

        return Explicit(equations, control, tableau(of, chosen=control.step is None))

    return make


def entry_of(method: own.Method) -> MethodEntry:
    """The properties of an explicit method of one's own.

    Raises
    ------
    OptionError
        Its stages or its estimate are none.
    """
    order = own.coefficients_of(method).order
    make = on_joints(_corrected(_tableau(method)))
    return MethodEntry(
        method.name, order, True, True, False, True, f"{method.name}, explicit", make, ("keep",), impacts=True
    )


def _implicit(equations: Any, control: Control) -> Any:
    from ephs.mechanics.methods.radau import Implicit

    return Implicit(equations, control)


def _semi(equations: Any, control: Control) -> Any:
    from ephs.mechanics.methods.semi import semi_implicit

    return semi_implicit(equations, control)


def _variational(equations: Any, control: Control, **options: Any) -> Any:
    from ephs.mechanics.methods.variational import Variational

    return Variational(equations, control, **options)


def _auto(equations: Any, control: Control) -> Any:
    from ephs.mechanics.methods.auto import Auto

    return Auto(equations, control)


def _component_wise(
    make: Callable[[Model], Natural],
) -> Callable[[Setting], tuple[Stepper[Any], Policy | None]]:
    def made(setting: Setting) -> tuple[Stepper[Any], Policy | None]:
        from ephs.solve.methods.paced import Paced

        paced, free = Paced(setting.problem, setting.t0, setting.control, make), setting.control.step is None
        return paced, Symmetric(paced.method.order + 1.0) if free else None

    return made


def _natural4(model: Model) -> Natural:
    from ephs.solve.methods.records import WORKING

    if (model.tables.kind == WORKING).any():
        raise OptionError("method", "natural4", "natural: at stages of a step stabilised joints close nothing")
    return Natural(model, 3)


def _radau(setting: Setting) -> tuple[Stepper[Any], Policy | None]:
    if not _flat(setting.problem):
        return on_joints(_corrected(_implicit))(setting)
    if setting.options:
        raise OptionError("options", ", ".join(setting.options), "none: a system without bodies has no momenta")
    from ephs.solve.methods.radau import Radau

    stepper = Radau(setting.problem, setting.t0, setting.control)
    return stepper, None if setting.control.step is not None else Proportional(stepper)


METHODS: dict[str, MethodEntry] = {}
"""The registered methods."""
REPLACED: Mapping[str, str] = MappingProxyType(
    {"alpha": "radau", "ida": "radau", "gauss4": "rk87", "gauss6": "rk87", "gauss8": "rk87"}
)
"""Names of former methods -> what is taken in their place."""


def register_method(method: own.Method | MethodEntry) -> None:
    """Register a method for `simulate` by name: one of one's own, or the properties of one.

    Raises
    ------
    OptionError
        The name is in use, or the method supports neither chosen nor constant steps.
    """
    entry = entry_of(method) if isinstance(method, own.Method) else method
    if entry.name in METHODS or entry.name == "auto":
        raise OptionError("method", entry.name, "a name that is not taken")
    if not (entry.adaptive or entry.fixed) or not (entry.systems or entry.scenes):
        raise OptionError("method", entry.name, "steps chosen or constant, systems or scenes")
    METHODS[entry.name] = entry


for _method in (
    MethodEntry(
        "natural",
        2,
        True,
        True,
        True,
        True,
        "balances and positions of joints exact, any system",
        _component_wise(Natural),
        forms=("paper", "folded"),
        lawful=True,
        undamped=Natural,
    ),
    MethodEntry(
        "natural4",
        4,
        True,
        True,
        True,
        True,
        "the same of order 4",
        _component_wise(_natural4),
        forms=("paper", "folded"),
        lawful=True,
        undamped=_natural4,
    ),
    MethodEntry(
        "variational",
        2,
        False,
        True,
        False,
        True,
        "symplectic, momentum maps exact or energy",
        on_joints(_variational),
        ("keep",),
        undamped=Natural,
    ),
    MethodEntry("radau", 5, True, True, True, True, "Radau IIA, stiff", _radau, ("keep",), impacts=True),
    *(
        MethodEntry(
            name,
            order,
            True,
            True,
            False,
            True,
            f"Dormand and Prince, explicit{more}",
            on_joints(_corrected(_tableau(name))),
            ("keep",),
            impacts=True,
        )
        for name, order, more in (("rk54", 5, ""), ("rk87", 8, ", many digits"))
    ),
    MethodEntry(
        "semi",
        3,
        True,
        True,
        False,
        True,
        "losses implicit, all else explicit",
        on_joints(_corrected(_semi)),
        ("keep",),
        posed=True,
    ),
):
    register_method(_method)


def _for_scenes(setting: Setting) -> tuple[Stepper[Any], Policy | None]:
    try:
        return on_joints(_corrected(_auto))(setting)
    except OptionError:  # joints without a reduced form, such as loops of prescribed ones
        if setting.options:
            raise
        return METHODS["natural"].make(setting)


AUTO = MethodEntry(
    "auto", 8, True, False, False, True, "rk54 or rk87, radau where stiff", _for_scenes, ("keep",), impacts=True
)
"""MethodEntry behind `auto` for mechanisms in joint coordinates."""


def chosen(name: str | own.Method | MethodEntry, problem: Problem, *, step: float | None) -> tuple[MethodEntry, str]:
    """The method of a name, and for ``auto`` the reason; a method as a value is taken as it is.

    Raises
    ------
    OptionError
        There is no such method, or it does not serve this problem.
    """
    hard = problem.descriptor.strikes
    if name == "auto":
        if hard is not None:
            return (AUTO, "a mechanism with hard contacts") if step is None else (METHODS["rk54"], "hard contacts")
        return _for_all(problem, step)
    if isinstance(name, own.Method):
        name = entry_of(name)
    if isinstance(name, str) and name in REPLACED and name not in METHODS:
        warn(f"method {name!r} is gone; {REPLACED[name]!r} is taken in its place", FutureWarning, 4)
        name = REPLACED[name]
    if not isinstance(name, MethodEntry) and name not in METHODS:
        known = ("auto", *METHODS)
        raise OptionError("method", name, f"one of {', '.join(known)}, or an ephs.Method" + nearest_of(name, known))
    method = name if isinstance(name, MethodEntry) else METHODS[name]
    name = method.name
    if problem.scene is not None and not method.scenes:
        raise OptionError("method", name, f"{', '.join(m.name for m in METHODS.values() if m.scenes)} for a scene")
    if method.posed and _flat(problem):
        raise OptionError("method", name, "radau, which took its place for systems without bodies")
    if hard is not None and not method.impacts:
        known = ", ".join(m.name for m in (*METHODS.values(), AUTO) if m.impacts)
        raise OptionError("method", name, f"{known}: {hard} acts by impulses")
    if step is not None and not method.fixed:
        raise OptionError("step", step, f"none: {name} chooses its steps")
    if step is None and not method.adaptive:
        raise OptionError("step", step, f"a number of seconds: {name} takes constant steps")
    return method, ""


def _for_all(problem: Problem, step: float | None) -> tuple[MethodEntry, str]:
    if step is not None:
        return METHODS["natural"], "a constant step is given"
    if _flat(problem):
        return METHODS["radau"], "a system on vector spaces without a constant step"
    from ephs.mechanics.tree.finding.frames import Unplaced
    from ephs.mechanics.tree.finding.parts import parts_of

    try:
        parts_of(problem)
    except Unplaced as error:
        return METHODS["natural4"], f"a system on Lie groups without a constant step, where {error}"
    return AUTO, "a mechanism without a constant step"


def _flat(problem: Problem) -> bool:
    """Whether all states lie in vector spaces."""
    return all(manifold(slot.quantity.space).code == VECTOR for slot in problem.descriptor.states)


def __getattr__(name: str) -> Any:
    if name == "Method":
        warn("registry.Method is called MethodEntry; ephs.Method is a method of one's own", DeprecationWarning, 2)
        return MethodEntry
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
