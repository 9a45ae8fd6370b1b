"""The programs whose object code comes with the package."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Final

from ephs.semantics.stage import Program
from ephs.semantics.stage.objects import FITTING, emitted
from ephs.semantics.stage.shipping import ship

SHIPPED: Final = (
    "ephs.semantics.stage.functions:ELEMENTARY",
    "ephs.semantics.stage.gradients:reading_program",
    "ephs.semantics.derive.linear:linear_program",
    "ephs.semantics.linear.rows:row_program",
    "ephs.semantics.spaces.differentials:differentials",
    "ephs.semantics.linear.sparse:sparse_lu",
    "ephs.mechanics.road.programs:common_sweeps",
    "ephs.mechanics.road.loops:common_loops",
    "ephs.mechanics.tree.engine.programs:motion_of_loops",
    "ephs.mechanics.tree.engine.programs:motion_of_trees",
    "ephs.mechanics.tree.engine.programs:stiff_program",
    "ephs.mechanics.tree.engine.programs:lagged_steps_of_trees",
    "ephs.mechanics.tree.engine.slopes:rate_slopes_of_loops",
    "ephs.mechanics.tree.engine.slopes:rate_slopes_of_trees",
    "ephs.mechanics.tree.engine.residuals:point_program",
    "ephs.mechanics.tree.sweeps.balances:network_program",
    "ephs.mechanics.sensitivity.implicit:tangent_program",
    "ephs.mechanics.elements.shell.edges:edge_program",
    "ephs.solve.methods.residuals:evaluation_program",
    "ephs.solve.methods.newton:natural_programs",
    "ephs.solve.methods.integral:integral_program",
    "ephs.solve.methods.settling:settling_program",
    "ephs.exporting.image:outputs_program",
)
"""Module and name of each program, or of a function that returns one or several. To ship a program, list it here."""


def programs() -> list[Program]:
    """Return the programs of `SHIPPED`."""
    found: list[Program] = []
    for entry in SHIPPED:
        module, _, name = entry.partition(":")
        given: Program | Callable[[], Program | tuple[Program, ...]] = getattr(import_module(module), name)
        made = given if isinstance(given, Program) else given()
        found += [made] if isinstance(made, Program) else made
    return found


def write_objects(folder: Path) -> None:
    """Write the object code of `SHIPPED` for the targets of `FITTING`, with headers and index, into a folder."""
    made = programs()
    modules = {one.name: (one.text(), {target: emitted(one.text(), target) for target in FITTING}) for one in made}
    ship(modules, {one.name: one.header() for one in made}, folder)
