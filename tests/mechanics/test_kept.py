"""Results kept with scenes and systems change no number of a run: the next one, one beside it, one after changes."""

from dataclasses import replace
from hashlib import sha256

import numpy as np
import pytest

import ephs
from benchmarks.touching import boxes
from ephs.mechanics.elements.joints import spring_damper
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.scene.build import initial_state, scene_system
from ephs.mechanics.scene.contacts import contact_points
from ephs.mechanics.scene.site import Site
from ephs.mechanics.scene.springs import Spring
from ephs.mechanics.tree.finding.mechanism import reduce_system
from ephs.operad import Path, Pattern
from ephs.operad import quantity as Q
from ephs.solve.equations.model import compile_model
from tests.mechanics.ball import BALL
from tests.mechanics.drawn_scenes import drawn, toml
from tests.mechanics.tree import machines
from tests.scenes import equations_of, shipped
from tests.written import scene_of_text


def ran(scene, method, **more):
    step = {} if METHODS[method].adaptive else {"step": 2e-3}
    sol = ephs.simulate(scene, 0.01, method=method, audit="off", **step, **more)
    return sol.t, sol["bodies.crank.ke.p"], sol["bodies.coupler.pe.q"], sol.heat


def same(one, other):
    return all(np.array_equal(first, second) for first, second in zip(one, other, strict=True))


def digest(equations):
    """Of all tables that equations share with others of their scene."""
    parameters = [equations.model.tables.parameters, equations.model.tables.dims]
    arrays = [*equations.engine.arrays(), *equations.reduced.tables, *parameters]
    own = {id(equations.drive), id(equations.wrench), id(equations.scal), id(equations.given.supply)}
    return sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays if id(a) not in own)).hexdigest()


@pytest.mark.parametrize("method", METHODS)
def test_the_next_run_has_the_digits_of_the_first(method):
    scene = shipped("four-bar")
    first, kept = ran(scene, method), equations_of(scene)
    before = digest(kept)
    assert same(ran(scene, method), first)
    assert same(ran(shipped("four-bar"), method), first)
    assert digest(equations_of(scene)) == before
    kept.reduced.tables.inertia[0] *= 1.5  # written where all read: seen in the digest and in the next run
    assert digest(equations_of(scene)) != before


def test_what_is_found_is_found_once():
    scene = shipped("four-bar")
    one, other = (equations_of(scene) for _ in range(2))
    assert one.reduced is other.reduced
    assert one.model.tables is other.model.tables
    assert one.problem.system is other.problem.system
    assert one.engine.work["force"] is not other.engine.work["force"]
    assert equations_of(shipped("four-bar")).reduced is not one.reduced


@pytest.mark.parametrize("method", ["rk87", "natural"])
def test_a_changed_scene_is_another_one(method):
    """Bodies, states, motions and inputs that differ from those of a run before it are those of the next run."""
    scene = shipped("four-bar")
    first = ran(scene, method)

    def heavier(of):
        crank = of.bodies["crank"]
        return replace(of, bodies={**of.bodies, "crank": replace(crank, mass=2.0 * crank.mass)})

    changes = {
        "mass": heavier,
        "gravity": lambda of: replace(of, world=replace(of.world, gravity=np.array([0.0, -1.6, 0.0]))),
        "rate": lambda of: of.with_state(rates={"main": 2.0}, adjust=True),
    }
    for change in changes.values():
        found = ran(change(scene), method)
        assert same(found, ran(change(shipped("four-bar")), method))
        assert not same(found, first)
    for inputs in ({"joints.main": 3.0}, {"joints.main": 5.0}, {"bodies.coupler": np.arange(6.0)}):
        found = ran(scene, method, inputs=inputs)
        assert same(found, ran(shipped("four-bar"), method, inputs=inputs))
        assert not same(found, first)
    assert same(ran(scene, method), first)


def made_anew(scene):
    """The same values, without anything that was kept with them."""
    return replace(scene, parts={name: made_anew(part) for name, part in scene.parts.items()})


def later(scene):
    return scene.at(ephs.simulate(scene, 0.02, audit="off", save_at=np.array([0.02])), 0.02)


def parts_of(scene):
    """Digits of all that a run begins with: states by path, and tables."""
    return {str(k): v.tobytes() for k, v in initial_state(scene).items()}, digest(equations_of(scene))


BOUNCING = BALL.format(slip=0.01)


@pytest.mark.parametrize("seed", [*range(6), None])
def test_a_scene_in_another_state_has_the_digits_of_one_made_anew(seed):
    """Systems are shared by scenes that differ in how bodies and joints move alone; states are not."""
    scene = scene_of_text(BOUNCING if seed is None else toml(drawn(seed)))
    moved = later(scene)
    own = seed is not None and {"thermal", "shells", "motors", "gears"} & drawn(seed).keys()
    assert own or scene_system(moved) is scene_system(scene)
    assert parts_of(moved) == parts_of(made_anew(moved))
    assert parts_of(moved) != parts_of(scene)
    assert scene_system(made_anew(moved)) is not scene_system(scene)


def test_tables_are_made_once_for_all_states_of_a_tree():
    """The control: where a loop closes, rows depend on where it stands."""
    tree, loop = scene_of_text(BOUNCING), shipped("four-bar")
    assert equations_of(later(tree)).reduced is equations_of(tree).reduced
    assert equations_of(later(loop)).reduced is not equations_of(loop).reduced


def test_poses_at_contacts_are_to_the_bit_those_of_one_point_alone():
    scene = later(scene_of_text(boxes(2).scene))
    start = initial_state(scene)
    for name, contact in scene.contacts.items():
        points = contact_points(scene, contact)
        assert len(points) > 1
        for i, point in enumerate(points):
            (one, other), (first, second) = point.bodies, point.frames
            alone = Site(scene, contact).between(one, first, other, second)
            assert np.array_equal(start[Path(["contacts", name, f"point{i}", "pe", "q_r"])], alone)


def test_a_part_that_was_heated_is_another_one(tmp_path):
    """The scene above shares its system with no scene of before; another part does."""
    hot, cold = "[thermal.box]\ncapacity = 5.0\ntemperature = 300.0\n", BOUNCING.replace("[1.0, 0.0, 0.0]", "[0, 0, 0]")
    (tmp_path / "hot.toml").write_text(
        cold + hot + '[conduction.out]\nbetween = ["box", "environment"]\nconductance = 1.0\n'
    )
    (tmp_path / "cold.toml").write_text(cold)
    parts = '[parts.hot]\nuse = "hot.toml"\n[parts.cold]\nuse = "cold.toml"\nposition = [3.0, 0.0, 0.0]\n'
    (tmp_path / "whole.toml").write_text("format = 1\n" + parts)
    scene = ephs.load(tmp_path / "whole.toml")
    moved = later(scene)
    assert moved.parts["hot"].thermal["box"].temperature < 300.0
    assert scene_system(moved) is not scene_system(scene)
    assert scene_system(moved.parts["cold"]) is scene_system(scene.parts["cold"])
    assert parts_of(moved) == parts_of(made_anew(moved))


def test_elements_that_read_motions_for_more_than_their_start_are_made_anew(monkeypatch):
    """The control: read while it is built, the start of a spring is that of the scene for which it was built."""
    text = (
        BOUNCING
        + '[springs.s]\nbodies = ["ground", "ball"]\nat1 = [1.0, 0.0, 1.0]\nat2 = [0.0, 0.0, 0.0]\nstiffness = 20.0\n'
    )
    scene = scene_of_text(text)
    moved = later(scene)
    assert scene_system(moved) is scene_system(scene)
    assert not same_start(moved, scene)

    def build(self, site):
        made = spring_damper(self.at1, self.at2, self.stiffness, self.length, self.damping)
        site.add(
            made, {f"p{k}": site.momentum(body) for k, body in enumerate(self.bodies, 1)}, initial=self._start(site)
        )

    monkeypatch.setattr(Spring, "build", build)
    scene = scene_of_text(text)
    moved = later(scene)
    assert scene_system(moved) is not scene_system(scene)
    assert not same_start(moved, scene)


def same_start(one, other):
    path = Path.of("springs.s.pe.q_r")
    return np.array_equal(initial_state(one)[path], initial_state(other)[path])


def test_a_sweep_leaves_the_scene_as_it_is():
    scene = shipped("four-bar")
    before = ran(scene, "rk87"), digest(equations_of(scene))
    ephs.sweep(scene, {"bodies.crank.mass": [1.0, 2.0, 5.0]}, 0.01, method="rk87")
    assert same(ran(scene, "rk87"), before[0])
    assert digest(equations_of(scene)) == before[1]


def test_tables_call_the_functions_of_their_own_run():
    """An energy that cannot be recorded is called at an address, which goes with the model of its run."""
    linkage, _ = machines.four_bar()
    turning = linkage.interface[Path.of("drives.main")].quantity
    text = "p: joint_momentum(revolute); q: angle; linkage(drives.main=p); pkc(q, p); spring(q)"
    sprung = Pattern.from_text(text)(
        linkage=linkage,
        pkc=ephs.gyrator({"q": Q.angle, "p": turning}, [[0.0, -1.0], [1.0, 0.0]]),
        spring=ephs.storage({"q": Q.angle}, lambda q: 2.0 * float(q) ** 2),
    )
    problem = problem_of_system(sprung)
    models = [compile_model(problem.descriptor, problem.reference, {}, matrix=False) for _ in range(2)]
    found = [reduce_system(problem, model).tables.address for model in models]
    called = sorted(models[0].callbacks)
    assert called and set(found[0][called]).isdisjoint(found[1][called])
    for address, model in zip(found, models, strict=True):
        assert [model.callbacks[i].address for i in called] == address[called].tolist()
