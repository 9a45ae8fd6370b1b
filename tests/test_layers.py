"""Who may know whom: the rooms of the package form a house without stairs upwards."""

import pytest

from tests.processes import printed
from tests.rooms import DOORS, PLACE, SOURCES, house, imported, imports_of, module_name, room_of, within

HEAVY = (
    "scipy",
    "networkx",
    "llvmlite",
    "sympy",
    "pydantic",
    "xarray",
    "matplotlib",
    "viser",
    "mujoco",
    "hypothesis",
)


def faults(found):
    return [f"{i.module}:{i.line} imports {i.target}" for i in found if within(i.target, "ephs") and not i.allowed]


def test_no_room_knows_what_is_above_it():
    assert not [fault for file in SOURCES for fault in faults(imports_of(file))]


def test_every_package_is_a_room_and_every_room_is_lived_in():
    packages = {module_name(file) for file in SOURCES if file.name == "__init__.py"}
    assert packages == set(PLACE)
    assert packages == {room_of(module_name(file)) for file in SOURCES}


def test_every_door_is_used():
    assert {(one.module, one.rooms[1]) for one in house() if one.upward} == set(DOORS)


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("ephs.operad.pattern", "import ephs.semantics"),
        ("ephs.operad.normal", "from ephs.show import draw"),
        ("ephs.operad.pattern", "from ephs import Pattern"),
        ("ephs.operad.pattern", "from ..semantics import relation"),
        ("ephs.semantics.spaces.pairs", "from ephs.semantics.bundle import Bundle"),
        ("ephs.semantics.system", "def f():\n    from ephs.mechanics import scene"),
        ("ephs.solve.equations.model", "from ephs.mechanics.elements.bodies import body"),
        ("ephs.solve.equations.model", "from ... import body"),
        ("ephs.mechanics.tree.equations.equations", "from ephs.mechanics.dynamics import dynamics"),
        ("ephs.mechanics.linear.modes", "from ephs.mechanics.sensitivity import fit"),
        ("ephs.mechanics.elements.bodies", "from ephs import show"),
        ("ephs.mechanics.elements.bodies", "import importlib\nimportlib.import_module('ephs.show')"),
        ("ephs.testing.systems", "from ephs.show import draw"),
        ("ephs.show.plots.curves", "from ephs.cli import main"),
        ("ephs.show.plots.curves", "from ephs import Solution"),
    ],
)
def test_an_import_upwards_is_seen(module, source):
    assert faults(imported(source, module))


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("ephs.operad.pattern", "from .names import Path\nimport json"),
        ("ephs.semantics.system", "from ..operad import Pattern\nfrom .relations import Relation"),
        ("ephs.mechanics.elements.bodies", "from .solve.model import Model"),
        ("ephs.mechanics.tree.engine.build", "from ephs.mechanics.tree.finding.tables import Table"),
        ("ephs.operad.pattern", "def f():\n    from ephs.show import draw"),
        ("ephs.show.plots.curves", "from ephs.solve.result.solution import Solution"),
        ("ephs.cli.input", "import ephs\nfrom ephs.testing import patterns"),
    ],
)
def test_an_import_downwards_is_allowed(module, source):
    assert not faults(imported(source, module))


def test_the_syntax_needs_no_numpy():
    operad = [file for file in SOURCES if within(module_name(file), "ephs.operad")]
    assert not [one for file in operad for one in imports_of(file) if within(one.target, "numpy")]


def test_import_loads_nothing_heavy():
    script = f"import sys, ephs; print(*[name for name in {HEAVY!r} if name in sys.modules])"
    assert printed(script) == "\n"


SYSTEM = "from examples.oscillator import damped_oscillator as model"
SCENE = "model = ephs.load('scenes/heavy-top.toml')"


def loaded(model):
    """Names of the modules that a process has loaded which runs a model."""
    script = f"import sys, ephs; {model}; ephs.simulate(model, 0.01, step=0.005, audit='off'); print(*sys.modules)"
    return printed(script).split()


@pytest.mark.parametrize(("model", "known"), [(SYSTEM, False), (SCENE, True)])
def test_a_system_without_bodies_is_run_without_scenes(model, known):
    found = loaded(model)
    scenes = [name for name in found if within(name, "ephs.mechanics.scene") or within(name, "ephs.mechanics.tree")]
    assert bool(scenes) == ("pydantic" in found) == known
    assert known or len([name for name in found if within(name, "ephs")]) <= 250
