"""Families of scenes of growing difficulty, with the recommended methods of each."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, final

from ephs.mechanics.scene.model import Scene
from ephs.show.charts import family_scenes as scenes

IMPLICIT = ("natural", "natural4", "radau")
EXPLICIT = ("rk87", "rk54")


@final
@dataclass(frozen=True, slots=True)
class Family:
    """Scenes with one parameter.

    Parameters
    ----------
    name, summary
        What it is, in words.
    parameter, unit
        What is varied.
    values
        Of the parameter, the difficult end last.
    make
        Scene of a value.
    until
        End of the simulated time in s; not used where the parameter is this time.
    steps
        Constant steps in s that are tried, large ones first; empty where the parameter is the step.
    recommended
        Methods that one should take here.
    role
        Whether the parameter makes the scene, is the step, or the time.
    labels
        In place of the values, where these say little.
    meant
        Scene of a value for the reference, where another than the one that is run.
    rests
        The mechanism cannot move, so that its initial state is the reference.
    """

    name: str
    summary: str
    parameter: str
    unit: str
    values: tuple[float, ...]
    make: Callable[[float], Scene]
    until: float
    steps: tuple[float, ...]
    recommended: tuple[str, ...]
    role: Literal["scene", "step", "time"] = "scene"
    labels: tuple[str, ...] = ()
    meant: Callable[[float], Scene] | None = None
    rests: bool = False

    def end(self, value: float) -> float:
        """The simulated time in s at a value of the parameter."""
        return value if self.role == "time" else self.until

    def steps_at(self, value: float) -> tuple[float, ...]:
        """The constant steps in s at a value of the parameter."""
        return (value,) if self.role == "step" else self.steps

    def label(self, value: float) -> str:
        """A value as the label of an axis."""
        return self.labels[self.values.index(value)] if self.labels else f"{value:g}"


def scene_family(scene: Scene, until: float) -> Family:
    """A family of one scene, whose parameter is the step."""
    values = tuple(until / count for count in (1000, 300, 100, 30, 10))
    return Family(
        scene.name, f"{scene.name}, by step", "step", "s", values, lambda _: scene, until, (), IMPLICIT, role="step"
    )


_FAMILIES = (
    Family("stiffness", "a flyball governor whose sleeve hangs on springs",
           "spring stiffness", "N/m", (1e2, 1e4, 1e6, 1e9), scenes.governor, 0.1, (1e-2, 1e-3), IMPLICIT),
    Family("large-steps", "a pendulum, of a period of 1.9 s",
           "step", "s", (0.01, 0.05, 0.2, 0.5), lambda _: scenes.pendulum(), 4.0, (), IMPLICIT, role="step"),
    Family("spin", "a heavy top",
           "spin rate", "rad/s", (1.0, 1e2, 1e3, 1e4), scenes.heavy_top, 0.1, (1e-2, 1e-3), EXPLICIT),
    Family("mass-ratio", "a double pendulum with a heavy lower rod",
           "mass of the lower rod over the upper", "1", (1.0, 1e3, 1e6, 1e8),
           lambda ratio: scenes.double_pendulum(lower=ratio), 1.0, (2e-2, 2e-3), EXPLICIT),
    Family("massless-link", "a double pendulum with a light upper rod",
           "mass of the upper rod", "kg", (1e-2, 1e-5, 1e-8, 1e-12),
           lambda mass: scenes.double_pendulum(upper=mass), 1.0, (2e-2, 2e-3), EXPLICIT),
    Family("slender", "a rod on a ball joint with hardly any inertia about itself",
           "least over largest moment of inertia", "1", (1e-2, 1e-5, 1e-8, 1e-12),
           scenes.slender_top, 1.0, (2e-2, 2e-3), EXPLICIT),
    Family("redundant", "a four-bar in space, a door on two hinges, a slider on three guides, a door on five hinges",
           "redundant constraints", "1", (3.0, 5.0, 10.0, 20.0),
           scenes.redundant, 0.5, (2e-2, 2e-3), (*IMPLICIT, *EXPLICIT),
           labels=("four-bar: 3", "door: 5", "guides: 10", "door: 20")),
    Family("in-line", "a parallelogram on its way through the position where all links are in line",
           "angle from there at the start", "rad", (0.1, 1e-3, 1e-6, 0.0),
           scenes.parallelogram, 0.5, (2e-2, 2e-3), EXPLICIT),
    Family("universal", "two shafts and the universal joint between them; at 90° none turns the other",
           "bend", "°", (30.0, 60.0, 85.0, 90.0), scenes.cardan_shaft, 0.5, (2e-2, 2e-3), EXPLICIT),
    Family("stretched", "three rods between two pins, nearly stretched",
           "slack", "1", (1e-1, 1e-2, 1e-4, 1e-6), scenes.stretched_chain, 0.5, (1e-2, 1e-3), (*IMPLICIT, *EXPLICIT)),
    Family("toggle", "a slider-crank pressed into its dead point",
           "angle from there at the start", "rad", (1e-1, 1e-3, 1e-6, 0.0), scenes.toggle, 0.5, (2e-2, 2e-3), EXPLICIT),
    Family("friction", "a pendulum in oil",
           "friction", "N m s/rad", (0.0, 1.0, 1e2, 1e6),
           lambda friction: scenes.pendulum(friction=friction), 1.0, (5e-2, 5e-3), IMPLICIT),
    Family("chaos", "a double pendulum; in cells, how long digits hold",
           "angle of release", "rad", (0.5, 1.5, 2.5, 3.1), scenes.double_pendulum, 8.0, (1e-2, 2e-3), EXPLICIT),
    Family("long-spin", "a free body that tumbles about its middle axis at 2 rad/s",
           "time", "s", (10.0, 50.0, 200.0), lambda _: scenes.free_body(2.0), 0.0, (1e-1, 2e-2), EXPLICIT, role="time"),
    Family("half-turn", "a free body that turns this much of π in a step of 0.1 s",
           "h ω / π", "1", (0.5, 0.9, 0.999, 1.1),
           lambda part: scenes.free_body(part * scenes.TURN / 0.2, wobble=1e-3), 1.0, (0.1,), EXPLICIT),
    Family("immobile", "a truss of two rods and three different joints",
           "load over weight", "1", (0.0, 1.0, 1e3),
           scenes.truss, 0.5, (2e-2, 2e-3), (*IMPLICIT, *EXPLICIT), rests=True),
    # radau refuses states too far from consistency
    Family("inconsistent", "a four-bar whose coupler starts off its place",
           "gap", "m, m/s", (1e-9, 1e-6, 1e-3, 1e-1),
           scenes.four_bar_off, 0.3, (1e-2, 1e-3), ("radau", *EXPLICIT), meant=scenes.four_bar_back),
)  # fmt: skip
FAMILIES = {family.name: family for family in _FAMILIES}
