"""Runs that fail, one at least for every way in which a run can fail, with the methods that meet it.

The page on failures is made of them, and the tests run all of them.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import ephs
from ephs import Outcome
from ephs.mechanics.methods.registry import METHODS
from examples.failing import (
    CORD,
    beyond,
    chilled,
    cooled,
    cylinder,
    doubled,
    driven,
    driving,
    four_bar,
    frame,
    linked,
    loose,
    off,
    oscillator,
    pendulum,
    slide,
    truss,
)

ALL = tuple(METHODS)
SYSTEMS = tuple(m.name for m in METHODS.values() if m.systems)
CHOOSING = tuple(m.name for m in METHODS.values() if m.adaptive)


@dataclass(frozen=True)
class Case:
    """A run that fails.

    Parameters
    ----------
    words
        What it is.
    methods
        Those that meet it.
    path, equation
        What the error names, as regular expressions; empty where it names none.
    step
        A constant step for the methods that take one; None: chosen.
    within
        Between which times it ends.
    options
        Further ones of `ephs.simulate`, made anew for each run.
    """

    outcome: Outcome
    words: str
    model: Callable[[], Any]
    methods: tuple[str, ...]
    path: str = ""
    equation: str = ""
    until: float = 1.0
    step: float | None = 0.01
    within: tuple[float, float] = (0.0, 0.0)
    options: Callable[[], Mapping[str, Any]] = dict

    def run(self, method: str, until: float | None = None, **more: Any) -> ephs.Solution:
        """The run, which fails unless it ends before; such a one tells no progress."""
        step = {"step": self.step} if self.step is not None and METHODS[method].fixed else {}
        options = {key: value for key, value in self.options().items() if until is None or key != "progress"}
        return ephs.simulate(self.model(), until or self.until, method=method, **step, **options, **more)


def late(raised: BaseException | float) -> Callable[[float], Any]:
    """A function of time that is zero until 0.055 s, and then this."""

    def function(t: float) -> Any:
        if t <= 0.055:
            return [0.0]
        if isinstance(raised, BaseException):
            raise raised
        return [raised]

    return function


def pushed(raised: BaseException | float, at: str = "joints.pin") -> Callable[[], Mapping[str, Any]]:
    """An input that turns into this."""
    return lambda: {"inputs": {at: late(raised) if "." in at else {"flow": late(raised)}}}


def watched(raised: BaseException | float) -> Callable[[], Mapping[str, Any]]:
    """An event whose function turns into this."""

    def height(t: float, _state: Any) -> float:
        if t <= 0.055:
            return 1.0
        if isinstance(raised, BaseException):
            raise raised
        return raised

    return lambda: {"events": [height]}


def told(_t: float, _until: float, _stats: Mapping[str, Any]) -> None:
    """A function for progress that does not work."""
    raise ValueError("no display")


def fixed(**options: Any) -> Callable[[], Mapping[str, Any]]:
    """Options that are the same at every run."""
    return lambda: options


LATE = (0.0, 0.06)
HERE = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
CASES = (
    Case(
        Outcome.INPUT, "a force whose function raises an exception", pendulum, ALL, r"joints\.pin", "lost", 0.2,
        within=LATE, options=pushed(ValueError("lost")),
    ),
    Case(
        Outcome.INPUT, "a force that is not a number", pendulum, ALL, r"joints\.pin", "nan", 0.2, within=LATE,
        options=pushed(np.nan),
    ),
    Case(
        Outcome.INPUT, "a flow whose function raises an exception", driven, SYSTEMS, "p", "ValueError: lost", 0.2,
        within=LATE, options=pushed(ValueError("lost"), "p"),
    ),
    Case(
        Outcome.EVENT, "an event whose function raises an exception", pendulum, ALL, "", "height: ValueError", 0.2,
        within=LATE, options=watched(ValueError("lost")),
    ),
    Case(
        Outcome.EVENT, "an event that is not a number", pendulum, ALL, "", "height = nan", 0.2, within=LATE,
        options=watched(np.nan),
    ),
    Case(
        Outcome.PROGRESS, "a display that does not work", pendulum, ALL, "", "ValueError: no display", 50.0,
        within=(0.0, 50.0), options=fixed(progress=told),
    ),
    Case(
        Outcome.INTERRUPTED, "Ctrl-C", pendulum, ALL, until=0.2, within=LATE, options=pushed(KeyboardInterrupt()),
    ),
    Case(
        Outcome.MEMORY, "a state that there is no room for", pendulum, ALL, until=0.2, within=LATE,
        options=pushed(MemoryError()),
    ),
    Case(
        Outcome.MANY, "max_steps", pendulum, CHOOSING, "", "3", step=None, within=(1e-13, 0.01),
        options=fixed(max_steps=3),
    ),
    Case(
        Outcome.TINY, "min_step, where the tolerance asks for less", pendulum,
        CHOOSING, r"(joints\.pin\.\w+\.\w+)?", r" s\b", step=None,
        within=(0.0, 0.9), options=fixed(min_step=0.1, rtol=1e-10, atol=1e-12),
    ),
    Case(
        Outcome.TURN, "1000 rad/s in steps of 10 ms", lambda: pendulum(1000.0), ("natural", "natural4"),
        r"joints\.pin\.hc",
    ),
    Case(
        Outcome.TEMPERATURE, "surroundings that are cooled to 0 K", chilled, SYSTEMS, "mf",
        within=(0.28, 0.3), options=fixed(inputs={"s": {"effort": lambda t, x: [-1000.0 * t]}}, initial={"ke.p": 1.0}),
    ),
    Case(
        Outcome.ENTROPY, "friction that drives in a narrow band of speeds", driving, SYSTEMS, "mf",
        r"-\d.* J/K in the step to t = 0\.\d+ s", step=1e-4, within=(0.0, 0.01), options=fixed(initial={"ke.p": 7.75}),
    ),
    Case(
        Outcome.LAWLESS, "explicit steps that are too long for a brake", lambda: slide("friction = 25.0", 1.0),
        ("rk54",), r"joints\.rail.*", step=0.1,
    ),
    Case(
        Outcome.DOMAIN, "a spring that has no length to begin with", lambda: slide(CORD), ALL, r"springs\.cord.*",
        options=fixed(initial={"joints.rail.pe.q_r": -0.5, "bodies.block.pe.q": HERE, "springs.cord.pe.q_r": HERE}),
    ),
    Case(
        Outcome.EXTENT, "a gas that is pressed to nothing", cylinder, SYSTEMS, "left|right", within=(0.0, 0.1),
        step=0.1, options=fixed(initial={"left.v": 1.0, "right.v": 1.0, "mass.p": 50.0}),
    ),
    Case(
        Outcome.DOMAIN, "the square root of a negative number", lambda: oscillator(beyond, 1.0), SYSTEMS, "pe",
        within=(0.3, 0.35), options=fixed(initial={"ke.p": 3.0}),
    ),
    Case(
        Outcome.DOMAIN, "entropy drawn from a body beyond the domain of its energy", cooled, SYSTEMS, "hot",
        within=(0.28, 0.3), options=fixed(inputs={"s": {"flow": -10.0}}),
    ),
    Case(
        Outcome.PYTHON, "an energy's function that raises an exception", lambda: oscillator(off), SYSTEMS, "pe",
        "ZeroDivisionError: off the table", 20.0, 0.5, (9.0, 10.0), fixed(initial={"ke.p": 1.0}),
    ),
    Case(
        Outcome.RANGE, "a force of 1e149 N", slide, ("natural", "natural4", "variational", "rk54", "rk87"),
        r"bodies\.block.*|joints\.rail", until=20.0, step=0.5, within=(3.0, 5.0),
        options=fixed(inputs={"joints.rail": 1e149}),
    ),
    Case(
        Outcome.RANGE, "a spring drawn to 9e149 m", driven, SYSTEMS, r"ke\.p", until=5.0, step=0.1, within=(0.5, 1.5),
        options=fixed(initial={"pe.q": 9e149}, inputs={"p": {"flow": 0.0}}),
    ),
    Case(
        Outcome.DIVERGED, "a spring that pushes, the more the farther", lambda: oscillator(lambda q: -(q**3)), SYSTEMS,
        r"pe\.q|ke\.p", ".", 2.0, 0.05, (1.2, 1.5), fixed(initial={"pe.q": 1.0, "ke.p": 1.0}),
    ),
    Case(
        Outcome.DIVERGED, "a step of 20 s for what swings in one", pendulum, ("radau",), r"joints\.pin", "its",
        2000.0, 20.0, (0.0, 1000.0),
    ),
    Case(
        Outcome.DIVERGED, "a spring far too stiff for the step",
        lambda: pendulum(more="stiffness = 1e7\nrest = 0.3"), ("variational",), r"joints\.pin", "its", 2.0, 0.3,
    ),
    Case(Outcome.SINGULAR, "a link that repeats another", doubled, ("radau",), "", "a multiplier of (link|again)"),
    Case(
        Outcome.UNDETERMINED, "a link between ends that nothing moves", loose, ("natural", "natural4"),
        "left|right|link", "the effort|a multiplier",
    ),
    Case(
        Outcome.UNDETERMINED, "a frame without mass that turns freely", frame, ALL, r"bodies\.frame.*|joints\.pin",
        "the rate of",
    ),
    Case(
        Outcome.CONTRADICTION, "two cranks with one degree of freedom, both turned evenly",
        lambda: four_bar(2.5, "motion = { rate = 1.0 }"), ("natural", "natural4", "radau", "rk54", "rk87"),
        r"joints\.(left|right).*", "left|right", within=(0.0, 0.1),
    ),
    Case(
        Outcome.OPEN, "a crank turned farther than its linkage goes", lambda: four_bar(1.2), ("rk54", "rk87"),
        r"joints\.hip", "hip", 6.0, 0.02, (4.0, 4.1),
    ),
    Case(
        Outcome.SHAKY, "two bars in line that carry a weight", truss,
        ("natural", "rk54", "rk87", "radau", "variational"), r"ground|joints\.\w+(\.hc)?", ".", step=0.01,
        within=(0.0, 1.0),  # rounding decides in which of its steps natural has no solution any more
    ),
    Case(
        Outcome.INCONSISTENT, "velocities that a rigid link does not allow", linked, SYSTEMS, r"(ke|other)\.p",
        "constraints", options=fixed(initial={"ke.p": 1.0}),
    ),
)  # fmt: skip

ELSEWHERE = {
    Outcome.DEPTH: "a ball dropped on a soft, thin plate",
    Outcome.UNLAWFUL: "explicit steps that are too long for a stiff brake",
    Outcome.RESTLESS: "what only falls, asked for its rest by ephs.equilibrium",
    Outcome.UNWRITTEN: "a journal on a disk that is full",
}
"""What no case brings about: other functions do, or the machine."""


def runs() -> Iterator[tuple[Case, str]]:
    """Every case with every method that meets it."""
    for case in CASES:
        for method in case.methods:
            yield case, method
