"""What others may rely on: the public names as they are written down, and those that are promised."""

import inspect

import pytest

import ephs
from ephs.cli import app
from ephs.mechanics.methods.registry import METHODS
from tests.public import FILE, lines, named, options

REQUIRED = inspect.Parameter.empty
UPDATE = "If this is meant, run `python -m tests.public`, and say in CHANGELOG.md what is new, changed or gone."


@pytest.fixture(scope="module")
def found():
    return lines()


def test_public_names_are_as_written_down(found):
    written = FILE.read_text(encoding="utf-8").splitlines()
    gone, new = [x for x in written if x not in found], [x for x in found if x not in written]
    assert written == found, f"gone or changed: {gone}\nnew or changed: {new}\n{UPDATE}"


# What is promised, whatever else there is: a name, its arguments in order (keywords where ``*`` went before), defaults.
PROMISED = {
    "ephs.Pattern": "junctions, boxes",
    "ephs.junction": "quantity, exposed=False, power=True",
    "ephs.Pattern.identity": "interface",
    "ephs.Pattern.from_json": "text",
    "ephs.Pattern.isomorphic": "self, other",
    "ephs.Pattern.to_json": "self",
    "ephs.Pattern.to_networkx": "self",
    "ephs.System.flatten": "self",
    "ephs.System.relation": "self, reference=None",
    "ephs.System.check": "self, reference=None",
    "ephs.System.equations": "self",
    "ephs.Relation.at": "self, state",
    "ephs.Reference": "temperature=293.15, pressure=101325.0",
    "ephs.library.spring": "*, k",
    "ephs.library.point_mass": "*, m",
    "ephs.library.rotor": "*, j",
    "ephs.library.capacitor": "*, c",
    "ephs.library.inductor": "*, l",
    "ephs.library.thermal_capacity": "*, c1, c2",
    "ephs.library.ideal_gas": "*, c1, c2, v0, c",
    "ephs.library.environment": "",
    "ephs.library.pkc": "",
    "ephs.library.emc": "",
    "ephs.library.mkc": "",
    "ephs.library.lever": "*, r",
    "ephs.library.series_springs": "",
    "ephs.library.rigid_link": "",
    "ephs.library.piston": "*, a",
    "ephs.library.friction": "*, d",
    "ephs.library.rotational_friction": "*, d",
    "ephs.library.resistor": "*, r",
    "ephs.library.heat_transfer": "*, h",
    "ephs.storage": "ports, energy",
    "ephs.gyrator": "ports, matrix",
    "ephs.transformer": "ports",
    "ephs.constraint": "ports",
    "ephs.irreversible": "ports, matrix",
    "ephs.mechanics.rigid_body": "mass, inertia, *, gravity",
    "ephs.mechanics.joint": "kind, *, frame1, frame2, friction, stiffness",
    "ephs.load": "path, base='fixed', adjust=False",
    "ephs.Scene.system": "self",
    "ephs.Scene.with_state": "self, coordinates, rates",
    "ephs.Scene.at": "self, solution, time",
    "ephs.simulate": "model, until, *, t0=0.0, initial=None, method='auto', rtol=1e-6, atol=1e-9, step=None, "
    "max_step=None, min_step=None, max_steps=None, save_at=None, form='reduced', inputs=None, events=None, "
    "options=None, reference=None, progress=None",
    "ephs.Solution.body": "self, name",
    "ephs.Solution.point": "self, body, xyz",
    "ephs.Solution.joint": "self, name",
    "ephs.Solution.ledger": "self, path",
    "ephs.Solution.summary": "self",
    "ephs.Solution.to_xarray": "self",
    "ephs.Solution.save": "self, path",
    "ephs.Solution.animate": "self",
    "ephs.Solution.plot": "self",
    "ephs.load_solution": "path",
    "ephs.dynamics": "scene",
    "ephs.mechanics.dynamics.Dynamics.acceleration": "self, state, forces=None",
    "ephs.mechanics.dynamics.Dynamics.inverse_dynamics": "self, state",
    "ephs.mechanics.dynamics.Dynamics.mass_matrix": "self, state",
    "ephs.mechanics.dynamics.Dynamics.jacobian": "self, state",
    "ephs.mechanics.dynamics.Dynamics.bias": "self, state",
    "ephs.mechanics.dynamics.Dynamics.derivatives": "self, state",
    "ephs.mechanics.dynamics.Dynamics.step": "self, state, h, method",
    "ephs.mechanics.dynamics.Dynamics.bodies": "self, state",
    "ephs.linearize": "model, state",
    "ephs.equilibrium": "model",
    "ephs.sensitivity": "model, parameters, until",
    "ephs.fit": "",
    "ephs.sweep": "model, vary, until, *, client=None",
    "ephs.cite": "solution",
    "ephs.testing.quantities": "",
    "ephs.testing.interfaces": "",
    "ephs.testing.patterns": "",
    "ephs.testing.systems": "",
    "ephs.testing.mechanisms": "",
    "ephs.testing.check_operad_laws": "",
    "ephs.testing.check_functoriality": "system",
    "ephs.testing.check_power_balance": "system",
    "ephs.testing.check_entropy_production": "system",
    "ephs.testing.check_primitive": "primitive",
    "ephs.testing.check_natural": "system",
}
ATTRIBUTES = {
    "ephs.Pattern": "interface boxes junctions substitute rename __eq__ __call__ _repr_svg_",
    "ephs.Quantity": "kind space",
    "ephs.System": "pattern ledger",
    "ephs.Solution": "t energy exergy entropy stats __getitem__",
    "ephs.SimulationError": "partial",
    "ephs.semantics.meaning.Instant": "projector empty determined",
    "ephs.mechanics.dynamics.Dynamics": "state0",
    "ephs.mechanics.dynamics.State": "array",
    "ephs.mechanics.motion.motion.BodyMotion": "position quaternion rotation velocity angular_velocity",
    "ephs.mechanics.motion.motion.JointMotion": "coordinate rate wrench",
}
QUANTITIES = (
    "displacement momentum angle angular_momentum charge flux_linkage entropy volume pose body_momentum relative_pose "
    "joint_momentum"
)
COMMANDS = {
    "run": "SCENE --until --method --rtol --atol --step --form --out --resume --base --adjust",
    "check": "SCENE --base --adjust",
    "draw": "SCENE --flat -o --base --adjust",
    "equations": "SCENE --form --latex",
    "reduce": "SCENE",
    "chart work-precision": "SCENES -o",
    "chart stability": "-o",
    "animate": "FOLDER -o",
    "convert": "MODEL -o",
    "linearize": "SCENE --at -o",
    "sweep": "SCENE --vary --until -o --dask",
    "new": "NAME",
}


OPEN = (
    "ephs.transformer",
    "ephs.constraint",
    "ephs.fit",
    "ephs.mechanics.dynamics.Dynamics.inverse_dynamics",
    "ephs.mechanics.dynamics.Dynamics.jacobian",
)
"""Promised without a word on all that they need."""


def arguments(text: str) -> list[inspect.Parameter]:
    namespace: dict = {}
    exec(f"def promised({text}): ...", namespace)
    return list(inspect.signature(namespace["promised"]).parameters.values())


def member(path: str):
    """A name of a module, or of a class in one."""
    try:
        return named(path)
    except ModuleNotFoundError:
        owner, _, name = path.rpartition(".")
        return getattr(named(owner), name)


@pytest.mark.parametrize("path", PROMISED)
def test_promised_names_take_what_they_promise(path):
    found = inspect.signature(member(path)).parameters
    places = [name for name, p in found.items() if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    promised = arguments(PROMISED[path])
    ordered = [wanted.name for wanted in promised if wanted.kind is wanted.POSITIONAL_OR_KEYWORD]
    assert places[: len(ordered)] == ordered
    for wanted in promised:
        assert wanted.name in found, f"{path} takes no {wanted.name}"
        if wanted.default is not REQUIRED:
            assert found[wanted.name].default == wanted.default, f"{path}: {wanted.name}"
    if path not in OPEN:
        needed = {
            n for n, p in found.items() if p.default is REQUIRED and p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)
        }
        assert needed <= {wanted.name for wanted in promised}, f"{path} needs what was not said"


@pytest.mark.parametrize("path", ATTRIBUTES)
def test_promised_attributes_are_there(path, found):
    names = {line.rpartition(".")[2].partition("(")[0] for line in found if line.startswith(path + ".")}
    for name in ATTRIBUTES[path].split():
        assert name in names or (name.startswith("_") and callable(getattr(named(path), name, None))), f"no {name}"


@pytest.mark.parametrize("name", QUANTITIES.split())
def test_promised_quantities_are_there(name):
    assert getattr(ephs.quantity, name)


@pytest.mark.parametrize("command", COMMANDS)
def test_promised_commands_take_their_options(command):
    at = app
    for name in command.split():
        at = at[name]
    found = " ".join(options(at)).split()
    assert set(COMMANDS[command].split()) <= set(found)


def test_promised_methods_are_there():
    assert {"natural", "natural4", "variational", "radau", "rk54", "rk87"} <= set(METHODS)
