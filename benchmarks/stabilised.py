"""What a stabilised joint buys: drift, energy and cost of the ways to keep constraints, at the same steps.

``natural`` keeps joints by their own discrete relation; the midpoint rule holds velocities alone and drifts; with
second multipliers it moves poses so that joints stay closed, and their power changes the energy; ``rk87`` has joint
coordinates, and projects loops and energy.
"""

from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np

import ephs
from benchmarks import families
from benchmarks.report import Report, table_of
from ephs import System
from ephs.mechanics.elements.components import holonomic
from ephs.mechanics.rewrite.frames import CONSTRAINED, joint_at
from ephs.mechanics.rewrite.rewrite import SystemDraft
from ephs.mechanics.rewrite.stabilised import stabilised
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.semantics.bundles.bundle import Array

__all__ = ["report"]

SCENES = {"revolute-chain-4": 2.0, "spherical-chain-2": 2.0, "heavy-top": 0.2, "four-bar-windows-1": 2.0}
"""Scene -> end in s."""
STEPS = (200, 400, 800)
REPEATS = 5
TIGHT = 1e-12


def drifting(system: System) -> System:
    """The flattened system whose joints hold between velocities in the middle of a step, and no more."""
    draft = SystemDraft(system)
    for box in [box for box, part in draft.fillings.items() if part.name == CONSTRAINED]:
        joint = joint_at(draft, box)
        if joint is not None:
            draft.replace(box, holonomic(joint.pair, on_group=False), {})
    return draft.system()


FORMS: dict[str, Callable[[System], System] | None] = {
    "`natural`": None,
    "midpoint, velocities": drifting,
    "midpoint, stabilised": stabilised,
    "`rk87`": None,
}


def _ends(sol: ephs.Solution, names: list[str]) -> Array:
    return np.array([sol[f"bodies.{name}.pe.q"][-1, 4:] for name in names])


def measure(name: str, form: str, steps: int) -> dict[str, Any]:
    """Error of positions and gap in m, defect and supplied energy relative to the gross energies, seconds."""
    scene, until = families.named(name), SCENES[name]
    bodies, make = list(scene.bodies), FORMS[form]
    problem = problem_of_scene(scene)
    tight = ephs.simulate(scene, until, method="rk87", rtol=TIGHT, atol=TIGHT, save_at=[until])
    model = scene if make is None else make(problem.system)
    options: dict[str, Any] = {"method": form.strip("`") if make is None else "natural", "audit": "off"}
    if make is not None:
        options["initial"] = {str(path): value for path, value in problem.initial.items()}
    sol = ephs.simulate(model, until, step=until / steps, **options)
    walls = [ephs.simulate(model, until, step=until / steps, **options).stats["integrate_s"] for _ in range(REPEATS)]
    supplied = sum((np.abs(work) for work in sol.ledgers.workers.values()), np.zeros(1))
    return {
        "scene": name, "form": form, "steps": steps,
        "error": float(np.abs(_ends(sol, bodies) - _ends(tight, bodies)).max()),
        "gap": float(sol.constraint_error.max(initial=0.0)),
        "defect": float(sol.energy_error.max()),
        "supplied": float(supplied.max() / sol.ledgers.scale),
        "step": median(walls) / steps,
    }  # fmt: skip


def report() -> Report:
    """A row a scene, a way to keep its constraints, and a number of steps."""
    rows = [measure(name, form, steps) for name in SCENES for form in FORMS for steps in STEPS]
    for row in rows:
        row |= {key: f"{row[key]:.0e}" for key in ("error", "gap", "defect", "supplied")}
    columns = {
        "scene": ("scene", 1.0), "constraints": ("form", 1.0), "steps": ("steps", 1.0), "error [m]": ("error", 1.0),
        "gap [m]": ("gap", 1.0), "energy defect": ("defect", 1.0), "supplied by the joints": ("supplied", 1.0),
        "µs a step": ("step", 1e6),
    }  # fmt: skip
    return Report(table_of(rows, columns), rows)
