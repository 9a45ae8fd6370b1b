"""The sweeps over a tree: Pinocchio and the engine accelerate alike, and all ways to run them agree."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import ephs
from benchmarks import families
from ephs.mechanics.engine.engine_kernels import _turn_forces, fall
from ephs.mechanics.reduced.equations import Equations
from ephs.mechanics.simulate import problem_of_scene
from ephs.mechanics.tree.pack import packed
from ephs.mechanics.tree.programs import sweeps
from ephs.mechanics.tree.unrolled import unrolled
from ephs.testing import mechanisms
from tests.mechanics.dynamics.pinocchio_models import KINDS, PinModel
from tests.mechanics.engine.test_engine import SCENES

EPS = np.finfo(float).eps
seeds = st.integers(0, 2**32 - 1)
slow = settings(max_examples=12, suppress_health_check=[HealthCheck.too_slow], deadline=None)


class Tree:
    """A scene's tree: its equations, its records and a state aside of the initial one."""

    def __init__(self, scene, seed=0):
        self.equations = eq = Equations(scene, problem_of_scene(scene), 0.0)
        self.packed = packed(eq.engine)
        self.sweeps = sweeps(self.packed.kind)
        rng = np.random.default_rng(seed)
        self.q = eq.moved(eq._paper.initial()[0], 0.5 * rng.standard_normal(eq.n))
        self.r, self.force = rng.standard_normal((2, eq.n))
        bodies = [body for _, body in scene.all_bodies()]
        reach = 1.0 + sum(
            np.abs(joint.frame1[4:]).max() + np.abs(joint.frame2[4:]).max() for _, joint in scene.all_joints()
        )
        self.weight = sum(body.mass for body in bodies) * (10.0 + reach) * reach

    def run(self, calls):
        """(ṙ, status) of the sweeps as a program's functions."""
        links, rate = self.packed.links, np.zeros(self.equations.n)
        memory = np.zeros((links.size + 1) * self.sweeps.width)
        state = self.q, self.r, self.force
        tables = links.size, links.integers.array, links.reals.array, memory, self.packed.gravity
        return rate, calls["accelerations"](*tables, *state, rate)

    def unrolled(self, calls):
        """The same of the program that is written out."""
        rate = np.zeros(self.equations.n)
        return rate, calls["accelerations"](self.q, self.r, self.force, rate)

    def engine(self):
        """The same of the engine."""
        e, m, rate, force = self.equations.engine, self.equations.memory, np.zeros(self.equations.n), self.force.copy()
        fall(e, m, self.q, self.r, m.zero, rate)
        if e.basis.size and not e.flag[0]:
            _turn_forces(e, m, force)
        return rate, fall(e, m, self.q, self.r, force, rate)

    def alike(self, one, other):
        """Equal to rounding: forces of the difference against the sizes of all that are summed."""
        mass = self.equations.mass(self.q, self.r)
        free = np.flatnonzero(self.equations.reduced.tables.driven == 0)
        condition = np.linalg.cond(mass[np.ix_(free, free)]) if free.size else 1.0
        speed = 1.0 + np.abs(self.r).sum()
        size = np.abs(mass).max(initial=0.0) * (speed**2 + np.abs(other).max(initial=0.0))
        size += self.weight * speed**2 + np.abs(self.force).max(initial=0.0)
        assert np.abs(mass @ (one - other)).max(initial=0.0) <= 10 * EPS * condition * size


@st.composite
def drawn(draw, **options):
    scene = draw(mechanisms(max_bodies=5, **options))
    return Tree(scene, draw(seeds))


@pytest.mark.parametrize("name", SCENES)
def test_scenes_accelerate_as_the_engine_has_it(name):
    tree = Tree(ephs.load(SCENES[name]))
    if not tree.packed.kind.joints:
        return
    found, status = tree.run(tree.sweeps.program.plain())
    expected, also = tree.engine()
    assert status == also == 0
    tree.alike(found, expected)


@settings(slow, max_examples=8)
@given(tree=drawn(loops=False))
def test_so_do_drawn_trees_and_all_ways_to_run_them_agree(tree):
    """The looped program's float run and machine code have the same bits, and so have those of the unrolled one."""
    assume(tree.packed.kind.joints)
    found, status = tree.run(tree.sweeps.program.plain())
    machine, also = tree.run(tree.sweeps.program.compiled())
    assert np.array_equal(found, machine) and status == also == 0
    tree.alike(found, tree.engine()[0])
    one = unrolled(tree.packed)
    (known, _), (coded, _) = tree.unrolled(one.plain()), tree.unrolled(one.compiled())
    assert np.array_equal(known, coded)
    tree.alike(found, known)


@pytest.mark.parametrize("kinds", [*((kind,) for kind in KINDS), tuple(KINDS)], ids="-".join)
@slow
@given(data=st.data())
def test_pinocchio_accelerates_alike(kinds, data):
    options = {"kinds": kinds, "loops": False, "friction": False, "springs": False, "heat": False}
    scene = data.draw(mechanisms(max_bodies=6, **options))
    tree, dynamics = Tree(scene, data.draw(seeds)), ephs.dynamics(scene)
    assume(tree.packed.kind.joints)
    other = PinModel(scene, dynamics)
    state = dynamics.unpack(np.concatenate([tree.q, tree.r, dynamics.state0.array[tree.q.size + tree.r.size :]]))
    q, v = other.configuration(dynamics, state), other.vector(tree.r)
    expected = other.back(pin.aba(other.model, other.data, q, v, other.vector(tree.force)))
    tree.alike(tree.run(tree.sweeps.program.plain())[0], expected)


def test_a_plane_leaves_the_third_dimension_out():
    """What is known of a class is left out of its program, and that changes no number."""
    plane, space = (Tree(families.scene(family, 4)) for family in ("planar-chain", "revolute-chain"))
    assert plane.packed.kind != space.packed.kind
    assert plane.sweeps.width <= 27 and space.sweeps.width <= 64
    assert plane.sweeps.program.text.count("fmul") <= 0.3 * space.sweeps.program.text.count("fmul")


def test_a_link_without_mass_is_named():
    tree = Tree(families.scene("revolute-chain", 3))
    tree.equations.engine.const[1:, 12:] = 0.0
    tree.packed = packed(tree.equations.engine)
    tree.sweeps = sweeps(tree.packed.kind)
    assert tree.run(tree.sweeps.program.plain())[1] == 2
    assert tree.run(tree.sweeps.program.compiled())[1] == 2


def test_rows_of_links_stand_after_their_parents():
    tree = Tree(families.scene("revolute-chain", 3))
    links = tree.packed.links
    assert [links[i].parent for i in range(3)] == [3, 0, 1]
