"""The gallery: every system of docs/gallery.md by name, with what it is and how it is run for two seconds.

    python examples/gallery.py

runs all of them and prints their balances.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, final

import ephs
from ephs import Scene, Solution, System

ROOT = Path(__file__).parents[1]
UNTIL = 2.0


@final
@dataclass(frozen=True, slots=True)
class Entry:
    """One system of the gallery.

    Parameters
    ----------
    source
        The file it is in, as the command line takes it.
    text
        What it shows.
    model, run
        Make it, and its motion until a time in s.
    start
        Initial values of a system; a scene says its own.
    """

    source: str
    text: str
    model: Callable[[], Scene | System]
    run: Callable[[float], Solution]
    start: Mapping[str, Any] | None = None


def _scene(name: str, step: float, text: str) -> Entry:
    file = f"scenes/{name}.toml"

    def model() -> Scene:
        return ephs.load(ROOT / file)

    return Entry(file, text, model, lambda until: ephs.simulate(model(), until, step=step))


def _oscillator(name: str, text: str) -> Entry:
    from examples import oscillator

    system: System = getattr(oscillator, name)
    start = {"osc.pe.q": 1.0, "osc.ke.p": 0.0}
    run = partial(ephs.simulate, system, initial=start, step=0.01)
    return Entry(f"examples/oscillator.py:{name}", text, lambda: system, run, start)


def _arm(text: str) -> Entry:
    def model() -> Scene:
        angles = {"shoulder": 0.6, "elbow": 1.1, "roll": 0.4, "bend": 0.7}
        return ephs.load(ROOT / "examples" / "arm.urdf").with_state(coordinates=angles, rates={"waist": 1.5})

    return Entry("examples/arm.urdf", text, model, lambda until: ephs.simulate(model(), until, step=2e-3))


def _cylinder(text: str) -> Entry:
    from examples.physics import CYLINDER_START, cylinder

    run = partial(ephs.simulate, cylinder, initial=CYLINDER_START, step=0.01)
    return Entry("examples/physics.py:cylinder", text, lambda: cylinder, run, CYLINDER_START)


def _motor_crank(text: str) -> Entry:
    from examples.motor_crank import START, motor_crank, simulate

    return Entry("examples/motor_crank.py:motor_crank", text, lambda: motor_crank, simulate, START)


def _gas_engine(text: str) -> Entry:
    from examples.gas_engine import START, gas_engine, simulate

    return Entry("examples/gas_engine.py:gas_engine", text, lambda: gas_engine, simulate, START)


def entries() -> dict[str, Entry]:
    """All systems by name, the paper's four first."""
    return {
        "oscillator": _oscillator("free_oscillator", "A spring and a mass exchange energy without loss."),
        "damped oscillator": _oscillator(
            "damped_oscillator", "The same oscillator as one box of a larger pattern; friction heats the environment."
        ),
        "body": _scene(
            "body", 2e-3, "A thrown rigid body, in four boxes: its centre of mass moves on a parabola while it tumbles."
        ),
        "two bodies and a joint": _scene(
            "mbs", 2e-3, "The multibody system of the paper: friction in a ball joint, until both bodies turn as one."
        ),
        "Dzhanibekov body": _scene(
            "dzhanibekov", 1e-3, "Spin about the middle axis of inertia is unstable: the wing nut flips over, and back."
        ),
        "heavy top": _scene(
            "heavy-top", 4e-4, "A disc on a stick spins, dives, precesses and rises again; its spin is constant."
        ),
        "four-bar": _scene("four-bar", 2e-3, "A crank-rocker; three of its 24 constraint equations are redundant."),
        "slider-crank": _scene("slider-crank", 1e-3, "A small engine on a starter; friction warms the housing."),
        "N-four-bar": _scene(
            "n-four-bar",
            1e-3,
            "Two four-bars of equal bars. With all bars in line, the constraints lose further ranks.",
        ),
        "Bricard": _scene(
            "bricard",
            4e-3,
            "Six bars, six hinges. By Grübler's count it cannot move, but it turns, here by half a turn.",
        ),
        "screw press": _scene("screw-press", 1e-3, "A small torque on a fine screw gives a large force on the platen."),
        "Cardan shaft": _scene(
            "cardan-shaft", 1e-3, "Two hinges and a massless cross; the driven shaft alternately leads and lags."
        ),
        "robot arm": _arm("Six hinges, read from a URDF and released: the arm falls against gear friction."),
        "biped": _scene("biped", 2e-3, "Two legs from one file, with a parallelogram each: three loops, mobility 3."),
        "motor and crank": _motor_crank("A circuit, a magnet and a gear drive the slider-crank."),
        "gas engine": _gas_engine("Hot gas pushes a piston that turns a crank: gases, heat and bodies in one pattern."),
        "two gases": _cylinder("A piston between two gases: volume and heat oscillate, and entropy only increases."),
        "hot brake": _scene("hot-brake", 2e-3, "Nine kilojoules of kinetic energy become heat and warm the disc."),
    }


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    print(f"{'':24}{'energy error':>14}{'joint gap':>11}{'heat, J':>10}{'work, J':>10}{'entropy, J/K':>14}")
    for name, entry in entries().items():
        sol = entry.run(UNTIL)
        gap, made = sol.constraint_error.max(), sol.entropy[-1] - sol.entropy[0]
        print(f"{name:24}{sol.energy_error.max():14.1e}{gap:11.1e}{sol.heat[-1]:10.4g}{sol.work[-1]:10.4g}{made:14.3e}")
