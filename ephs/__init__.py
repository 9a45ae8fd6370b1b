"""Exergetic port-Hamiltonian systems: physical models composed by pattern, with both laws of thermodynamics exact.

Names are imported where they are first used, so that ``import ephs`` is fast.
"""

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ephs.exporting.errors import ExportError as ExportError
    from ephs.exporting.fmu import export_fmu as export_fmu
    from ephs.exporting.page import live_page as live_page
    from ephs.exporting.write import export as export
    from ephs.mechanics.dynamics import dynamics as dynamics
    from ephs.mechanics.linear import equilibrium as equilibrium
    from ephs.mechanics.linear import linearize as linearize
    from ephs.mechanics.methods.registry import register_method as register_method
    from ephs.mechanics.runs.check import check_model as check_model
    from ephs.mechanics.runs.citing import cite as cite
    from ephs.mechanics.runs.reading import load_solution as load_solution
    from ephs.mechanics.runs.reduce import reduce as reduce
    from ephs.mechanics.runs.simulate import simulate as simulate
    from ephs.mechanics.scene import ModelWarning as ModelWarning
    from ephs.mechanics.scene import Scene as Scene
    from ephs.mechanics.scene import SceneError as SceneError
    from ephs.mechanics.scene import SceneWarning as SceneWarning
    from ephs.mechanics.scene.load import load as load
    from ephs.mechanics.sensitivity import fit as fit
    from ephs.mechanics.sensitivity import gradient as gradient
    from ephs.mechanics.sensitivity import sensitivity as sensitivity
    from ephs.mechanics.sweep.sweep import SweepInterrupted as SweepInterrupted
    from ephs.mechanics.sweep.sweep import sweep as sweep
    from ephs.modelica.errors import ModelicaError as ModelicaError
    from ephs.modelica.library import ModelicaLibrary as ModelicaLibrary
    from ephs.operad import Directory as Directory
    from ephs.operad import Path as Path
    from ephs.operad import Pattern as Pattern
    from ephs.operad import PatternError as PatternError
    from ephs.operad import Quantity as Quantity
    from ephs.operad import Space as Space
    from ephs.operad import junction as junction
    from ephs.operad import quantity as quantity
    from ephs.semantics import AssemblyError as AssemblyError
    from ephs.semantics import Reference as Reference
    from ephs.semantics import Relation as Relation
    from ephs.semantics import SemanticsError as SemanticsError
    from ephs.semantics import StructureError as StructureError
    from ephs.semantics import System as System
    from ephs.semantics import library as library
    from ephs.semantics.primitives.constructors import constraint as constraint
    from ephs.semantics.primitives.constructors import gyrator as gyrator
    from ephs.semantics.primitives.constructors import irreversible as irreversible
    from ephs.semantics.primitives.constructors import storage as storage
    from ephs.semantics.primitives.constructors import transformer as transformer
    from ephs.solve.auditing.findings import AuditError as AuditError
    from ephs.solve.auditing.findings import AuditWarning as AuditWarning
    from ephs.solve.auditing.findings import CostWarning as CostWarning
    from ephs.solve.exchange.coupling import Bond as Bond
    from ephs.solve.exchange.errors import ExchangeError as ExchangeError
    from ephs.solve.exchange.exchange import Exchange as Exchange
    from ephs.solve.methods.own import Method as Method
    from ephs.solve.posing.errors import Interrupted as Interrupted
    from ephs.solve.posing.errors import OptionError as OptionError
    from ephs.solve.posing.errors import SimulationError as SimulationError
    from ephs.solve.posing.events import Event as Event
    from ephs.solve.posing.motion_law import HarmonicMotion as HarmonicMotion
    from ephs.solve.posing.motion_law import PolynomialMotion as PolynomialMotion
    from ephs.solve.posing.motion_law import TabulatedMotion as TabulatedMotion
    from ephs.solve.posing.sampled import Sampled as Sampled
    from ephs.solve.result.solution import Solution as Solution

_HOMES = {
    "ephs.operad": (
        "Directory",
        "Path",
        "Pattern",
        "PatternError",
        "Quantity",
        "Space",
        "junction",
        "quantity",
    ),
    "ephs.semantics": (
        "AssemblyError",
        "Reference",
        "Relation",
        "SemanticsError",
        "StructureError",
        "System",
        "library",
    ),
    "ephs.semantics.primitives.constructors": ("constraint", "gyrator", "irreversible", "storage", "transformer"),
    "ephs.mechanics.scene": ("ModelWarning", "Scene", "SceneError", "SceneWarning"),
    "ephs.mechanics.scene.load": ("load",),
    "ephs.mechanics.runs.check": ("check_model",),
    "ephs.mechanics.runs.citing": ("cite",),
    "ephs.mechanics.dynamics": ("dynamics",),
    "ephs.mechanics.linear": ("equilibrium", "linearize"),
    "ephs.mechanics.methods.registry": ("register_method",),
    "ephs.mechanics.runs.reduce": ("reduce",),
    "ephs.mechanics.runs.reading": ("load_solution",),
    "ephs.mechanics.runs.simulate": ("simulate",),
    "ephs.mechanics.sensitivity": ("fit", "gradient", "sensitivity"),
    "ephs.solve.posing.errors": ("Interrupted", "OptionError", "Outcome", "SimulationError"),
    "ephs.solve.posing.events": ("Event",),
    "ephs.solve.exchange.coupling": ("Bond",),
    "ephs.solve.exchange.errors": ("ExchangeError",),
    "ephs.solve.exchange.exchange": ("Exchange",),
    "ephs.solve.methods.own": ("Method",),
    "ephs.solve.posing.motion_law": ("HarmonicMotion", "PolynomialMotion", "TabulatedMotion"),
    "ephs.solve.posing.sampled": ("Sampled",),
    "ephs.modelica.errors": ("ModelicaError",),
    "ephs.modelica.library": ("ModelicaLibrary",),
    "ephs.solve.auditing.findings": ("AuditError", "AuditWarning", "CostWarning"),
    "ephs.solve.result.solution": ("Solution",),
    "ephs.mechanics.sweep.sweep": ("SweepInterrupted", "sweep"),
    "ephs.exporting.errors": ("ExportError",),
    "ephs.exporting.fmu": ("export_fmu",),
    "ephs.exporting.page": ("live_page",),
    "ephs.exporting.write": ("export",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}
_PACKAGES = ("mechanics", "operad", "semantics", "show", "testing")

__all__ = sorted([*_HOME, *_PACKAGES])  # pyright: ignore[reportUnsupportedDunderAll] - the names above

try:
    __version__ = version("ephs")
except PackageNotFoundError:  # a source tree that was never installed
    __version__ = "0"


def __getattr__(name: str) -> Any:
    if name in _HOME:
        home = import_module(_HOME[name])
        return import_module(f"{_HOME[name]}.{name}") if name == "library" else getattr(home, name)
    if name in _PACKAGES:
        return import_module(f"ephs.{name}")
    from ephs.operad.messages import nearest_of

    raise AttributeError(f"module 'ephs' has no attribute {name!r}{nearest_of(name, __all__)}")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
