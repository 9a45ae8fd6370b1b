"""Result folder of a run: solution, summary, report."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

from ephs.cli.input import EXTRAS, TEXTS, complain, say

if TYPE_CHECKING:
    from ephs import Solution

_FIGURES = {
    "steps": ("steps", "d"),
    "rejected": ("rejected steps", "d"),
    "mobility": ("mobility", "d"),
    "redundant_constraints": ("redundant constraints", "d"),
    "max_energy_error": ("energy defect, relative", ".1e"),
    "max_constraint_error": ("joint gap, m or rad", ".1e"),
    "min_entropy_production": ("least entropy production, J/K a step", ".1e"),
    "heat": ("heat, J", ".4g"),
    "work": ("work, J", ".4g"),
    "integrate_s": ("time stepping, s", ".2f"),
}


def write_results(solution: "Solution", folder: Path, *, report: bool = True) -> bool:
    """Write the result folder and print the summary; whether a report was written."""
    from ephs.solve.result.durable import durable

    summary = solution.summary()
    solution.save(folder / "solution.nc")
    with durable(folder / "summary.json") as temporary:
        temporary.write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    for key, (label, form) in _FIGURES.items():
        if summary.get(key) is not None:
            say(f"{label:38}{summary[key]:>12{form}}")
    if solution.scene is not None and solution.scene.adjusted is not None:
        say(str(solution.scene.adjusted))
    if not report:
        return False
    try:
        from ephs.show.report import write_report

        write_report(solution, folder)
    except ModuleNotFoundError as error:
        module = (error.name or "").partition(".")[0]
        if module not in EXTRAS:
            raise
        complain(TEXTS["no-report"].format(found=module, extra=EXTRAS[module]))
        return False
    return True
