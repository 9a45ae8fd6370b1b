"""`simulate`: from a system or a scene to its motion."""

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.mechanics.methods.options import options_of
from ephs.mechanics.methods.registry import METHODS, MethodEntry, chosen
from ephs.mechanics.runs.journaling import journaled
from ephs.mechanics.runs.pace import longest_step
from ephs.mechanics.runs.running import Course, seen_from
from ephs.mechanics.runs.signals import asked_of, check_mappings, jumps_of, times_of
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.operad import Pattern
from ephs.semantics.bundles.bundle import Reference
from ephs.semantics.primitives.primitives import Irreversible
from ephs.semantics.systems.system import System
from ephs.semantics.verdicts.checks import random_efforts
from ephs.solve.auditing.audit import Bounds
from ephs.solve.auditing.findings import POLICIES, judged
from ephs.solve.methods.own import Method, coefficients_of
from ephs.solve.posing.breakpoints import Breakpoints
from ephs.solve.posing.errors import OptionError, count_of, failing_at, nearest_of, number_of
from ephs.solve.posing.events import events_of
from ephs.solve.posing.problem import Problem
from ephs.solve.posing.sampled import Sampling, holding
from ephs.solve.result.solution import Solution
from ephs.solve.running.control import ATOL, RTOL, Control, Tolerance, told_apart
from ephs.solve.running.journal import Journal
from ephs.solve.running.request import RunRequest
from ephs.solve.running.threads import in_one_thread
from ephs.solve.running.watching import guarded

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ephs.mechanics.scene.model import Scene

FORMS = ("paper", "folded", "reduced")


@in_one_thread
def simulate(
    model: "System | Scene",
    until: float,
    *,
    t0: float = 0.0,
    initial: Mapping[str, "ArrayLike"] | None = None,
    method: str | Method | MethodEntry = "auto",
    rtol: "float | Mapping[str, float]" = RTOL,
    atol: "float | Mapping[str, float]" = ATOL,
    step: float | None = None,
    max_step: float | None = None,
    min_step: float | None = None,
    max_steps: int | None = None,
    save_at: "ArrayLike | None" = None,
    form: str = "reduced",
    inputs: Mapping[Any, Any] | None = None,
    jumps: "ArrayLike | Mapping[str, ArrayLike] | None" = None,
    events: Sequence[Any] | None = None,
    options: Mapping[str, Any] | None = None,
    reference: Reference | None = None,
    progress: Callable[[float, float, Mapping[str, Any]], None] | None = None,
    journal: "Journal | str | PathLike[str] | None" = None,
    audit: str = "fail",
) -> Solution:
    """Simulate a system or a scene.

    Parameters
    ----------
    until, t0
        End and start in s. An end before the start runs backward in time; then no component may produce entropy.
    initial
        Values of states by path. Other states start at the identity in a system, and as the scene says in a scene.
    method
        One of `ephs.mechanics.methods.registry.METHODS`: ``"natural"``, ``"natural4"``, ``"variational"``, ``"radau"``,
        ``"rk54"``, ``"rk87"``, ``"semi"``; a method of one's own, an instance of `ephs.Method`; or ``"auto"``: with
        ``step`` natural, with hard contacts rk54; without it rk54 or rk87 for mechanisms, semi where surfaces may touch
        and tolerances are coarse, and radau when stability limits the steps, radau for systems on vector spaces,
        natural4 for others.
    rtol, atol
        Tolerances without ``step``: the error of each state x should be at most ``atol + rtol·|x|``. The unit of atol
        is that of the state; for a mechanism far from 1 m, 1 kg and 1 s it is made of the mechanism's own length, mass
        and time. Either may be a mapping from kinds of quantities or paths to numbers, ``"*"`` for all others.
    step
        Constant steps in s: the grid is t₀ + k·step, and the last step ends at ``until``.
    max_step, min_step, max_steps
        Limits of chosen steps in s, and of the number of steps, each of every independent part.
    save_at
        Times at which to save the solution, each reached by a shorter step from the same start (radau on systems: by
        its collocation polynomial, where no prescribed effort changes); independent parts then take steps of their own.
        None saves every step.
    form
        ``"paper"``: the flat system, for natural methods; ``"folded"``: the same without transformers and the
        junctions behind them, for natural methods; ``"reduced"``, the default: the smallest form of the method.
    events
        `ephs.Event` values or functions f(t, state) -> number, whose zeros are located; terminal ones end the run.
    options
        Options of the method, such as ``{"keep": "energy and momenta"}``.
    inputs
        ``{port: {"effort": f}}`` or ``{"flow": f}`` at outer ports; of a scene also ``{"joints.pin": f}``, a
        generalised force on u_r, ``{"bodies.crank": f}``, a wrench in the body frame, and ``{"markers.tip": f}``, a
        force in world axes; f is a constant, f(t), f(t, state), or `ephs.Sampled`. For a tuple of such names, f gives
        the numbers of all in order. The state is read by path, in a scene also by name: ``state.joints.pin.rate``; see
        `ephs.mechanics.motion.views.StateView`.
    jumps
        Ascending times in s at which inputs jump, or a mapping from inputs to such times: steps end there, and restart
        on the other side. Functions are searched for further jumps; see `ephs.solve.posing.probe`.
    reference
        The reference environment of a system; a scene has its own.
    progress
        Called as progress(t, until, stats) a few times a second.
    journal
        File that records the run; after an interruption the same call resumes it, to the same numbers.
    audit
        Treatment of findings of the run's audit: ``"fail"`` raises an `AuditError`, ``"warn"`` gives an
        `AuditWarning`, ``"off"`` only makes them when ``sol.audit`` or the summary is asked for.

    Raises
    ------
    AuditError
        The run is complete, but its result violates a law; ``.partial`` is the whole solution.
    SimulationError
        The run failed; ``.partial`` is the solution up to the failure.
    SemanticsError
        The equations of the model are not square, or a state or an input does not fit.
    OptionError
        An option is unknown, or not possible with the method; a ValueError.
    """
    if form not in FORMS:
        raise OptionError("form", form, f"one of {', '.join(FORMS)}" + nearest_of(form, FORMS))
    if audit not in POLICIES:
        raise OptionError("audit", audit, f"one of {', '.join(POLICIES)}" + nearest_of(audit, POLICIES))
    start, end = number_of("t0", t0), number_of("until", until)
    if not (np.isfinite(start) and np.isfinite(end) and end != start):
        raise OptionError("until", until, f"a finite time other than t0 = {t0!r} s")
    check_mappings(inputs=inputs, initial=initial)
    given = inputs or {}
    inputs, held = holding(given, start, end)
    if isinstance(model, System | Pattern):
        problem = problem_of_system(model, initial, inputs, reference)
    else:
        from ephs.mechanics.runs.scene_problem import check_motions, problem_of_scene  # systems are run without scenes
        from ephs.mechanics.scene.own_units import in_own_units

        if reference is not None:
            raise OptionError("reference", reference, "none: a scene's [world] has its own")
        problem = problem_of_scene(model, initial, inputs, start)
        if not initial:
            check_motions(model, start)
        problem = in_own_units(problem)
    method_of = METHODS["natural4"] if method == "auto" and form != "reduced" and step is None else None
    chosen_method, reason = (method_of, f"the {form} form") if method_of else chosen(method, problem, step=step)
    _fits(form, chosen_method)
    if form == "folded":
        from ephs.mechanics.rewrite.folded import folded_problem

        problem = folded_problem(problem)
    if end < start:
        _reversible(problem, end)
    order, unit = chosen_method.order, problem.seconds
    control = control_of(problem, order, rtol, atol, step, min_step, max_step, max_steps, (start / unit, end / unit))
    told_apart(start / unit, end / unit, control.step)
    own = options_of(chosen_method, problem, options)
    times, watched = times_of(save_at, start, end), events_of(events)
    declared = np.unique(np.concatenate([jumps_of(jumps, inputs, start, end), *(one.times for one in held)]))
    asked = {
        "until": end, "t0": start, "method": chosen_method.name, "form": form, "rtol": rtol, "atol": atol,
        "step": step, "min_step": min_step, "max_step": max_step, "save_at": times,
        "options": options, "inputs": given, "jumps": jumps, "events": watched,
    }  # fmt: skip
    if isinstance(method, Method):  # another method may have the same name
        asked["coefficients"] = coefficients_of(method, chosen=step is None).numbers
    for one in held:
        if one.sampled.period < control.least * unit:
            raise OptionError("min_step", min_step, f"at most the period of {one.name}, {one.sampled.period!r} s")
    functions, sampled = asked_of(problem, inputs), [Sampling(one, problem) for one in held]
    breakpoints = Breakpoints(start / unit, end / unit, declared / unit, functions, sampled)
    with failing_at(start):
        breakpoints.enter(start / unit, lambda: problem.initial)
        problem.inputs(start / unit, problem.initial)
    watched, told = seen_from(problem, watched, guarded(progress))
    course = Course(problem, chosen_method, start / unit, end / unit, control, own)
    repeatable = not (held or any(each.stateful for each in functions))
    again = course.again(breakpoints) if repeatable else None
    bounds = Bounds(
        control.tolerance,
        step,
        lawful=chosen_method.lawful,
        undamped=chosen_method.undamped,
        order=order,
        again=again,
        repeatable=repeatable,
        serves=course.serves,
    )
    with journaled(journal, problem, asked) as written:
        saved = None if times is None else times / unit
        remarks = {"auto": reason} if method == "auto" else {}
        solution = course.run(breakpoints, RunRequest(watched, saved, told, remarks, written, bounds))
    return judged(solution, audit)


def _fits(form: str, method: MethodEntry) -> None:
    forms = (*method.forms, "reduced")
    if form not in forms:
        raise OptionError("form", form, f"{' or '.join(forms)}, which {method.name} solves")


def control_of(
    problem: Problem,
    order: int,
    rtol: "float | Mapping[str, float]",
    atol: "float | Mapping[str, float]",
    step: float | None,
    min_step: float | None,
    max_step: float | None,
    max_steps: int | None,
    span: tuple[float, float] = (0.0, 0.0),
) -> Control:
    """Control of the steps of a problem, by a method of an order, over a span in the problem's own unit of time.

    Raises
    ------
    OptionError
        A tolerance is no number, or is given for what the problem does not have.
    """
    relative, absolute = Tolerance.of("rtol", rtol, RTOL), Tolerance.of("atol", atol, ATOL)
    states = [(slot.path, slot.quantity.kind) for slot in problem.descriptor.states]
    relative.known("rtol", states)
    absolute.known("atol", states)
    unit = problem.seconds
    least = 0.0 if min_step is None else number_of("min_step", min_step) / unit
    most = np.inf if max_step is None else number_of("max_step", max_step) / unit
    if step is None:
        tightest = min(relative.value, *relative.special.values(), np.inf)
        most = min(most, max(longest_step(problem, order, tightest, span), least))
    return Control(
        relative,
        absolute,
        None if step is None else number_of("step", step) / unit,
        least,
        most,
        None if max_steps is None else count_of("max_steps", max_steps),
    )


def _reversible(problem: Problem, until: float) -> None:
    """Raise an error for backward runs of systems that produce entropy.

    Raises
    ------
    OptionError
        It names the component.
    """
    rng, d = np.random.default_rng(1), problem.descriptor
    x = problem.point
    for slot in d.components:
        if isinstance(slot.primitive, Irreversible):
            e = random_efforts(slot.primitive.bundle, rng)
            if slot.primitive.impulse or np.any(slot.primitive.flow(d.point(slot, x), e, problem.reference)):
                expected = f"a time after t0: {slot.path} produces entropy, which does not run backward"
                raise OptionError("until", until, expected)
