"""What joint coordinates are made of: read from the structure of a flat system, whatever its names and its nesting."""

import ast
from dataclasses import replace
from pathlib import Path as File

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import Pattern, junction, quantity
from ephs.mechanics import joint, rigid_body
from ephs.mechanics.elements import components
from ephs.mechanics.elements.offset import frame_change
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.tree.finding.frames import Unplaced, inertia_of
from ephs.mechanics.tree.finding.mechanism import reduce_system
from ephs.operad import Path
from ephs.semantics.primitives import structures
from ephs.semantics.primitives.primitives import power_ports
from ephs.solve.equations.model import compile_model
from ephs.testing import mechanisms
from tests.mechanics.methods.systems import problem_of, renamed
from tests.numerics import generators, largest, seeds

TREE = File(ephs.__file__).parent / "mechanics" / "tree"
FROM_MODEL = ("address", "dims", "parameters", "parameter_at")


def reduced_of(problem):
    model = compile_model(problem.descriptor, problem.reference, problem.inputs(0.0, problem.initial), matrix=False)
    return reduce_system(problem, model)


@settings(max_examples=40)
@given(mechanisms(max_bodies=3), st.sampled_from(["x", "pe", "a-b"]), seeds)
def test_names_and_nesting_do_not_matter(scene, word, seed):
    one, other = reduced_of(problem_of_scene(scene)), reduced_of(renamed(scene, word, seed)[0])
    for name, first, second in zip(one.tables._fields, one.tables, other.tables, strict=True):
        if name not in FROM_MODEL:
            assert np.array_equal(first, second), name
    assert np.array_equal(one.gravity, other.gravity)
    assert all(np.array_equal(a, b) for a, b in zip(one.twists, other.twists, strict=True))
    heavier = {name: replace(b, mass=2.0 * b.mass) for name, b in scene.bodies.items()}
    control = reduced_of(problem_of_scene(replace(scene, bodies=heavier)))
    assert not np.array_equal(one.tables.inertia, control.tables.inertia)


def test_no_module_of_joint_coordinates_knows_scenes():
    files = sorted(TREE.rglob("*.py"))
    assert len(files) > 10
    found = {
        (file.name, name)
        for file in files
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.ImportFrom | ast.Import)
        for name in [getattr(node, "module", None) or "", *(alias.name for alias in node.names)]
        if name.startswith("ephs.mechanics.scene") or name == "ephs.mechanics.scene.build"
    }
    assert not found


# ---- by hand ---------------------------------------------------------------------------------------------------

MOMENTUM = quantity.body_momentum
ROPE = ephs.transformer({"p": MOMENTUM, "x": quantity.momentum}, [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]])


def hung(of, **more):
    """A body on the ground by a joint; ``more`` are further boxes: their filling, and their ports' junctions."""
    junctions = {"g": junction(MOMENTUM), "p": junction(MOMENTUM)}
    boxes = {"ground": {"p": "g"}, "body": {"p": "p"}, "hinge": {"p1": "g", "p2": "p"}}
    parts = {"ground": components.ground(), "body": of, "hinge": joint("revolute", friction=0.1)}
    for name, (filling, ports) in more.items():
        boxes[name], parts[name] = ports, filling
        for port, at in ports.items():
            junctions.setdefault(at, junction(filling.interface[Path.of(port)].quantity))
    return Pattern(junctions=junctions, boxes=boxes)(**parts)


def test_bodies_and_joints_of_a_system_have_the_names_of_their_boxes():
    found = reduced_of(problem_of(hung(rigid_body(1.0, [0.3, 0.4, 0.5]))))
    assert found.bodies == ("body",)
    assert [(edge.name, str(edge.path)) for edge in found.edges] == [("hinge", "hinge")]
    assert found.gravity.tolist() == [0.0, 0.0, -9.81]


def test_weights_that_differ_are_forces_of_their_own():
    pattern = Pattern.from_text("p: body_momentum; q: body_momentum; a(p); b(p=q)")
    system = pattern(a=rigid_body(1.0, [1, 1, 1]), b=rigid_body(2.0, [1, 1, 1], gravity=(0, 0, 0)))
    found = reduced_of(problem_of(system))
    assert not found.gravity.any()
    assert found.tables.weight.tolist() == [-1, -1]
    assert [str(edge.path) for edge in found.edges[2:]] == ["a.pe"]


@pytest.mark.parametrize(
    ("name", "filling", "ports", "words"),
    [
        ("rope", ROPE, {"p": "p", "x": "x"}, "acts on the twist of a body"),
        ("many", structures.quadratic("many", power_ports(p=MOMENTUM), np.eye(6), ()), {"p": "x"}, "no number|belongs"),
        ("weld", frame_change([1, 0, 0, 0, 1, 0, 0], "p_j", "p"), {"p": "p", "p_j": "g"}, "without a joint"),
    ],
)
def test_what_has_no_place_is_refused_by_path(name, filling, ports, words):
    system = hung(rigid_body(1.0, [0.3, 0.4, 0.5]), **{name: (filling, ports)})
    with pytest.raises(Unplaced, match=words) as refused:
        reduced_of(problem_of(system))
    assert str(refused.value.path).startswith(name)


@given(generators)
def test_an_inertia_is_read_from_the_energy_itself(rng):
    root, mass = rng.standard_normal((3, 3)), rng.uniform(0.1, 9.0)
    inertia = root @ root.T + 0.1 * np.eye(3)
    inverse = np.linalg.inv(np.block([[inertia, np.zeros((3, 3))], [np.zeros((3, 3)), mass * np.eye(3)]]))
    plain = structures.quadratic("store", power_ports(p=MOMENTUM), inverse, (), trusted=True)
    found, exact = inertia_of(plain), inertia_of(components.kinetic(mass, inertia))
    assert largest(found - exact) <= 4e-15 * np.linalg.cond(inverse) * largest(exact)
    turned = np.array(inverse)
    turned[0, 3] = turned[3, 0] = 0.3 * np.sqrt(inverse[0, 0] * inverse[3, 3])
    assert inertia_of(structures.quadratic("store", power_ports(p=MOMENTUM), turned, (), trusted=True)) is None
