"""Values of ``summary.json``."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.solve.result.temperatures import heated

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution


def summary_of(solution: "Solution") -> dict[str, Any]:
    """Steps, largest errors, heat, work, and values at the end."""
    last = -1 if len(solution) else slice(0)
    out: dict[str, Any] = {
        "scene": solution.name,
        "method": solution.stats["method"],
        "form": solution.stats["form"],
        "t_end": float(solution.t[-1]) if len(solution) else None,
        "steps": solution.stats["steps"],
        "rejected": solution.stats["rejected"],
        "setup_s": solution.stats["setup_s"],
        "integrate_s": solution.stats["integrate_s"],
        "unknowns": {
            "paper": solution.stats.get("paper_unknowns", solution.stats["unknowns"]),
            "used": solution.stats["unknowns"],
        },
        "max_energy_error": float(solution.energy_error.max(initial=0.0)),
        "max_constraint_error": float(solution.constraint_error.max(initial=0.0)),
        "max_velocity_error": float(solution.velocity_error.max(initial=0.0)),
        "min_entropy_production": float(solution.stats["least_production"]),
        "heat": float(np.sum(solution.heat[last])),
        "work": float(np.sum(solution.work[last])),
        "audit": solution.audit.record(),
    }
    if solution.motion is not None:
        return out | solution.motion.summary()
    if not len(solution):
        return out | {"states": {}}
    if solution.problem is not None and solution.problem.linked is not None:
        out |= solution.problem.linked(solution).summary()
    if warm := heated(solution):
        out["thermal"] = {name: {"temperature": float(values[-1])} for name, values in warm.items()}
    return out | {"states": {str(path): values[-1].tolist() for path, values in solution.states.items()}}
