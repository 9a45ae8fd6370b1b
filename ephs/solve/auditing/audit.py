"""Audit of a run: laws of its result, and findings where they fail.

Sizes are relative to the run's own: energies to the largest K + |V − V₀| + |heat| + |work|, entropies to what was made
and exchanged, positions to the length of the mechanism. A law without anything to hold is kept.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.rank import CLOSED
from ephs.solve.auditing.findings import Audit, Finding
from ephs.solve.auditing.growth import Again, GlobalError, energy_error, global_error
from ephs.solve.auditing.passing import passed_over
from ephs.solve.auditing.resolution import STILL, StepError, Trials
from ephs.solve.auditing.retaken import Missed
from ephs.solve.auditing.rounding import exchanged, isolated, rounded, trembling
from ephs.solve.equations.model import Model
from ephs.solve.methods.natural import Natural
from ephs.solve.posing.breakpoints import MOST_FOUND
from ephs.solve.posing.errors import Other, or_take, serves_not, worst_entry

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

Tests = Trials | Missed
"""Repeated steps: constant ones, or the error of chosen ones."""

LAWFUL, LEAST, COARSE, MANY_TIMES = 1e-10, 1e-9, 1e-2, 100.0
"""Allowed fractions of the gross energies: for steps that keep the balance; the least and the constant steps'
otherwise; and the multiple of rtol for chosen steps."""
MOTION = 0.1
"""Allowed estimated error of bodies at the end with constant steps, in lengths of the mechanism or rad: the estimate
adds errors of steps, which may cancel, so that fewer digits would be guesses."""
LEAP = 0.5
"""Fraction of a surface's thickness that a step may cross, so that some instant is inside."""
PRODUCTION = 1e-12
"""Rounding of a difference of entropy flows, relative to their scale."""
DAMPING: Other = ("radau", "damps fast modes")
INSTANTS = 125
"""Number of evenly spaced instants for the residuals of joint positions."""


@final
@dataclass(frozen=True, slots=True)
class Bounds:
    """Allowed errors of a run, relative to its scales.

    Parameters
    ----------
    tolerance
        That chosen steps are held to.
    step
        The length of constant steps in s; None where they are chosen.
    lawful
        Whether every step of the method keeps the balance.
    undamped
        Makes the natural method that estimates the error of constant steps, of a method that damps nothing at
        infinity; None of others, which do so by steps of their own.
    order
        With which power of the step the method's error falls.
    again
        Further runs of the same problem; None where its inputs cannot be given again.
    repeatable
        Whether inputs may be asked again: then some chosen steps are retaken.
    serves
        Whether a method by its name is another one than that of the run, and accepts the problem.
    """

    tolerance: float
    step: float | None = None
    lawful: bool = False
    undamped: Callable[[Model], Natural] | None = None
    order: int = 1
    again: Again | None = None
    repeatable: bool = False
    serves: Callable[[str], bool] = serves_not

    @property
    def energy(self) -> float:
        """Of the gross energies."""
        return LAWFUL if self.lawful else self.accuracy

    @property
    def accuracy(self) -> float:
        """Of what moves: the estimated error."""
        return self.ledger if self.step is None else COARSE

    @property
    def ledger(self) -> float:
        """Of what is booked."""
        return max(MANY_TIMES * self.tolerance, LEAST)

    @property
    def retaken(self) -> bool:
        """Whether some chosen steps are taken again."""
        return self.step is None and self.repeatable


@final
@dataclass(frozen=True, slots=True)
class Breach:
    """Largest excess over a law in a run: size, allowance, instant, component, end of the advice, a better method.

    What is allowed beyond a law's own limit is asked where a size is beyond that: it may take longer than the audit.
    """

    size: float
    slack: Callable[[], float]
    instant: int
    path: Path | None = None
    hint: str = ""
    other: Other | None = None


def _nothing() -> float:
    return 0.0


def _energy(solution: "Solution", bounds: Bounds, _trials: Tests | None) -> Iterator[Breach]:
    """The balance of kinetic + potential + heat − work, and of all energies − work.

    Energy that corrected steps miss and no state can take up is an error of the method, with its tolerance.
    """
    ledgers, left = solution.ledgers, solution.stats.get("plain_defect", {}).get("left", 0.0)
    worst = worst_entry(solution.energy_error)
    if (size := float(solution.energy_error[worst])) <= bounds.energy:
        return
    # destroyed exergy counts as energy; the environment's is its inflow
    destroyed = {path: ledgers.temperature * made for path, made in ledgers.makers.items()}
    parts = {path: energy for path, energy in ledgers.storages.items() if ledgers.exergies[path].any()} | destroyed
    jump = 1 + int(np.argmax(np.abs(np.diff(solution.energy_error)))) if len(solution) > 1 else 0
    busiest = max(parts, key=lambda path: _step(parts[path], jump), default=None)
    allowed = min(left / ledgers.scale, bounds.accuracy)
    yield Breach(size, lambda: rounded(solution) / ledgers.scale + allowed, worst, busiest)


def _step(values: Array, instant: int) -> float:
    return abs(float(values[instant] - values[instant - 1])) if instant else 0.0


def _accuracy(solution: "Solution", bounds: Bounds, trials: Tests | None) -> Iterator[Breach]:
    """Accuracy of the bodies' positions, and resolution of the motion by steps."""
    plain = solution.stats.get("plain_defect")
    if plain is not None:
        instant = _instant(solution, plain["at"])
        scale = solution.ledgers.scale
        yield Breach(plain["largest"] / scale, lambda: rounded(solution) / scale, instant)
    longest = abs(float(solution.stats.get("longest_step", bounds.step or 0.0)))
    for path, instant, size in solution.linked.leaps(longest) if solution.linked is not None else ():
        short = f"{0.9 * longest * LEAP / size:.2g} s: a contact was passed"
        hint = f" of {short}" if bounds.step else f", or max_step = {short}"
        yield Breach(size, lambda: LEAP - min(LEAP, bounds.accuracy), instant, path, hint)
    for path, instant, size in solution.linked.length_errors() if solution.linked is not None else ():
        yield Breach(size, _nothing, instant, path, ": segments of tendons must not pass the length zero")
    if isinstance(trials, Missed):
        yield Breach(trials.size * bounds.tolerance, _nothing, _instant(solution, trials.at))
        yield from _passed(solution, longest, bounds)
    if bounds.step is None or not isinstance(trials, Trials):
        return
    steps = int(solution.stats["steps"])
    found, off = trials.error(bounds.step, steps, solution.ledgers.scale), None
    if found is not None and found.size > bounds.accuracy:
        found = trials.error(bounds.step, steps, max(solution.ledgers.scale, trembling(solution) / STILL))
    falls = found is None or found.size <= bounds.accuracy or trials.converges(bounds.step, bounds.accuracy)
    if found is not None and falls:
        found = replace(found, size=found.size / (2.0**trials.order - 1.0))
    coarse = found is not None and found.size > bounds.accuracy
    yield from _passed(solution, bounds.step, bounds) if found is None else ()
    if coarse and falls and trials.again is not None:
        off = energy_error(solution, bounds.order, bounds.step, trials.again)
    grown = _grown(solution, bounds, trials)
    if grown is not None and (grown.resolved or not coarse):
        slack, hint = MOTION - min(MOTION, bounds.accuracy), grown.shorter(bounds.step, bounds.order, MOTION)
        yield Breach(grown.size, lambda: slack, grown.instant, grown.path, hint)
    if off is not None:
        hint = off.shorter(bounds.step, bounds.order, bounds.accuracy)
        yield Breach(off.size, _nothing, off.instant, off.path, hint)
    elif found is not None:
        h = trials.sufficient(found.trial, bounds.step, bounds.accuracy) if coarse else None
        hint, other = "" if h is None else f" of {h:.1g} s", DAMPING if bounds.undamped else None
        instant = _instant(solution, trials.times[found.trial])
        yield Breach(found.size, _nothing, instant, found.path, hint, other)


def _passed(solution: "Solution", h: float, bounds: Bounds) -> Iterator[Breach]:
    if (found := passed_over(solution, h, bounds.accuracy)) is not None:
        yield Breach(found.size, _nothing, found.instant, found.path, found.hint(bounds.step))


def _grown(solution: "Solution", bounds: Bounds, trials: Trials) -> GlobalError | None:
    """Error of the bodies' poses at the end: by another run, or else the sum of the steps' error estimates."""
    h, steps, own = bounds.step or 0.0, int(solution.stats["steps"]), trials.own or trials

    def summed() -> StepError | None:
        return own.motion(h, steps)

    if trials.again is not None:
        grown = global_error(solution, bounds.order, h, lambda: getattr(summed(), "size", 0.0), MOTION, trials.again)
        if grown is not None:
            return grown
    off = summed()
    if off is None:
        return None
    # of order p + 1 in a step, over as many steps more where it is shorter
    return GlobalError(off.size, _instant(solution, own.times[off.trial]), off.path, resolved=True)


def _entropy(solution: "Solution", _bounds: Bounds, _trials: Tests | None) -> Iterator[Breach]:
    """No component, and no system without entropy's outer ports, loses entropy in a step."""
    ledgers = solution.ledgers
    least = -float(solution.stats["least_production"])
    scale, rounding = exchanged(solution, "entropy")
    if not scale:
        return
    if not least / scale <= PRODUCTION:
        falls = {path: -np.diff(made, prepend=made[:1]) for path, made in ledgers.makers.items()}
        path = max(falls, key=lambda each: float(falls[each].max()), default=None)
        instant = worst_entry(falls[path]) if path is not None else 0
        yield Breach(least / scale, rounding, instant, path)
    if isolated(solution, "entropy"):
        fall = -np.diff(ledgers.entropy, prepend=ledgers.entropy[:1])
        # times inside a step are ends of shorter ones from its start: less may be made until its own end
        fall += np.minimum(np.diff(ledgers.made, prepend=ledgers.made[:1]), 0.0)
        instant = worst_entry(fall)
        yield Breach(float(fall[instant]) / scale, rounding, instant)


def _constraint(solution: "Solution", _bounds: Bounds, _trials: Tests | None) -> Iterator[Breach]:
    """Joints are closed."""
    every = len(solution) // INSTANTS + 1
    for path, residual in solution.linked.gaps(every).items() if solution.linked is not None else ():
        worst = worst_entry(residual)
        yield Breach(float(residual[worst]), _nothing, len(solution) - 1 - worst * every, path)


def _ledger(solution: "Solution", bounds: Bounds, _trials: Tests | None) -> Iterator[Breach]:
    """Stored entropies and volumes change by what was made; work is a sum of power."""
    ledgers = solution.ledgers
    if "work_apart" in solution.stats:
        instant = _instant(solution, solution.stats["work_apart_at"])
        size, hint = float(solution.stats["work_apart"]) / ledgers.scale, ": near a dead centre of what is prescribed"
        slack = COARSE - min(COARSE, bounds.ledger)
        yield Breach(size, lambda: slack + rounded(solution) / ledgers.scale, instant, hint=hint)
    for kind, held, made in (("entropy", ledgers.entropies, ledgers.made), ("volume", ledgers.volumes, None)):
        scale, rounding = exchanged(solution, kind)
        if not scale or not isolated(solution, kind):
            continue
        rest = sum((values - values[0] for values in held.values()), start=np.zeros(len(solution)))
        if made is not None:
            rest = rest - (made - made[0])
        worst = worst_entry(np.abs(rest))
        path = max(held, key=lambda each: abs(float(held[each][worst] - held[each][0])))
        yield Breach(abs(float(rest[worst])) / scale, rounding, worst, path)


def _input(solution: "Solution", _bounds: Bounds, _trials: Tests | None) -> Iterator[Breach]:
    """Inputs are piecewise smooth."""
    found = solution.stats.get("jumps", {}).get("found", ())
    if found:
        last = _instant(solution, found[-1]["t"])
        yield Breach(float(len(found)), _nothing, last, Path.of(found[-1]["input"]))


def _instant(solution: "Solution", t: float) -> int:
    """The index of the instant nearest to a time in s."""
    return int(np.argmin(np.abs(solution.t - t)))


@final
@dataclass(frozen=True, slots=True)
class AuditLaw:
    """A law of the audit.

    Parameters
    ----------
    holds, scale, limit
        In words what it holds, what sizes are relative to, and how much is allowed.
    breaches
        Of a solution, the largest excesses.
    allowed
        What the bounds of a run allow.
    advice
        What to do where steps are constant, and where they are chosen.
    other
        A method that keeps the law.
    """

    holds: str
    scale: str
    limit: str
    breaches: "Callable[[Solution, Bounds, Tests | None], Iterator[Breach]]"
    allowed: Callable[[Bounds], float]
    advice: tuple[str, str]
    other: Other | None = None


LAWS: Mapping[str, AuditLaw] = {
    "energy": AuditLaw(
        "energy changes by heat and work only",
        "largest K + |V − V₀| + |heat| + |work|",
        f"{LAWFUL:g} where a method's steps are lawful, or corrected, beside energy that no state can take up; "
        f"else {MANY_TIMES:g} rtol (atol where that is 0), "
        f"at least {LEAST:g}; {COARSE:g} at constant steps",
        _energy,
        lambda bounds: bounds.energy,
        ("take a smaller step", "lower rtol"),
        ("natural", "keeps the balance"),
    ),
    "accuracy": AuditLaw(
        "steps resolve the motion, and the positions of bodies are accurate. Constant steps: the difference between "
        "two steps and four of half the length, and between the run and one with longer or shorter steps. Chosen steps "
        "of natural methods: the difference between a step and three of a third of its length. Corrected steps: the "
        "defect of energy before correction",
        "energy that such steps exchange; length of the mechanism, 1 rad; sizes of states; gross energies",
        f"{COARSE:g}, and {MOTION:g} at the end, at constant steps; {MANY_TIMES:g} rtol at chosen ones",
        _accuracy,
        lambda bounds: bounds.accuracy,
        ("take a shorter step", "lower rtol"),
    ),
    "entropy": AuditLaw(
        "no component, and no system without entropy from outside, loses entropy in a step",
        "entropy produced and exchanged",
        f"{PRODUCTION:g}",
        _entropy,
        lambda _: PRODUCTION,
        ("take a smaller step", "lower rtol"),
        ("natural", "makes entropy only"),
    ),
    "constraint": AuditLaw(
        "joints are closed",
        "length of the mechanism; 1 rad",
        f"{CLOSED:g}",
        _constraint,
        lambda _: CLOSED,
        ("take a smaller step, or check that the joints fit together", "lower rtol, or check that the joints fit"),
    ),
    "ledger": AuditLaw(
        "stored entropy and volume change by production and supply; where prescribed motions leave no degree of "
        "freedom, their work, the gain of energies plus heat, is the integral of their power",
        "amounts produced and exchanged; gross energies",
        f"{MANY_TIMES:g} rtol, at least {LEAST:g}; of work {COARSE:g}",
        _ledger,
        lambda bounds: bounds.ledger,
        ("take a smaller step", "lower rtol"),
    ),
    "input": AuditLaw(
        "inputs are smooth but for some jumps: functions of time are searched for these",
        "jumps that were found; the search ends with more",
        f"{MOST_FOUND}",
        _input,
        lambda _: float(MOST_FOUND),
        ("say in jumps where it jumps, or give a function that is smooth", "say in jumps where it jumps, or smooth it"),
    ),
}
"""The laws by name."""


def _size(breach: Breach) -> float:
    """Its size for files; the largest float on overflow."""
    return float(np.nan_to_num(breach.size, nan=np.finfo(float).max))


def audit(solution: "Solution", bounds: Bounds, trials: Tests | None = None) -> Audit:
    """Hold a solution, whose first instant is the start of its run, against the laws.

    ``trials`` are those of its constant steps.
    """
    if not len(solution):
        return Audit()
    if "plain_defect" in solution.stats:  # steps are corrected: the balance is kept up to the defect
        bounds = replace(bounds, lawful=True)
    found: list[Finding] = []
    with np.errstate(all="ignore"):
        for name, law in LAWS.items():
            allowed = law.allowed(bounds)
            sizes = [b for b in law.breaches(solution, bounds, trials) if not b.size <= allowed]
            broken = [(b, most) for b in sizes if not b.size <= (most := allowed + b.slack()) < np.inf]
            if broken:
                worst, most = max(broken, key=lambda each: _size(each[0]) / each[1])
                where = str(worst.path) if worst.path is not None else ""
                at, advice = float(solution.t[worst.instant]), law.advice[int(bounds.step is None)] + worst.hint
                advice += or_take(worst.other or law.other, bounds.serves)
                found.append(Finding(name, _size(worst), most, at, where, advice))
    return Audit(tuple(found))
