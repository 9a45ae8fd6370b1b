"""The sweeps over a tree: the mass matrix accelerates alike, and all ways to run them agree."""

import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from benchmarks import families
from ephs.mechanics.road.programs import sweeps
from ephs.mechanics.tree.engine.links import links_of
from ephs.mechanics.tree.equations.tangent import Linearised
from ephs.semantics.stage import Program
from ephs.testing import mechanisms
from tests.numerics import EPS, largest, seeds
from tests.scenes import equations_of

slow = settings(max_examples=12, suppress_health_check=[HealthCheck.too_slow])


class Tree:
    """A scene's tree: its equations, its records and a state aside of the initial one."""

    def __init__(self, scene, seed=0):
        self.equations = eq = equations_of(scene)
        self.packed = links_of(eq.reduced).packed(eq.gravity)
        self.sweeps = sweeps(self.packed.kind)
        rng = np.random.default_rng(seed)
        self.q = eq.moved(eq._paper.initial()[0], 0.5 * rng.standard_normal(eq.n))
        self.r, self.force = rng.standard_normal((2, eq.n))
        bodies = [body for _, body in scene.all_bodies()]
        reach = 1.0 + sum(largest(joint.frame1[4:]) + largest(joint.frame2[4:]) for _, joint in scene.all_joints())
        self.weight = sum(body.mass for body in bodies) * (10.0 + reach) * reach

    @property
    def tables(self):
        links = self.packed.links
        memory = np.zeros((links.size + 1) * self.sweeps.width)
        names = "size", "integers", "reals", "memory", "gravity"
        given = links.size, links.integers.array, links.reals.array, memory, self.packed.gravity
        return dict(zip(names, given, strict=True))

    def run(self, calls):
        """(ṙ, status) of the sweeps as a program's functions."""
        rate = np.zeros(self.equations.n)
        return rate, calls["accelerations"](*self.tables.values(), self.q, self.r, self.force, rate)

    def unrolled(self, calls):
        """The same of the program that is unrolled over the tables."""
        rate = np.zeros(self.equations.n)
        return rate, calls["accelerations"](self.q, self.r, self.force, rate)

    def dense(self):
        """ṙ by the mass matrix and the inverse dynamics of the scene, without loops."""
        eq, driven = self.equations, self.equations.reduced.tables.driven
        linear = Linearised(eq)
        eq.drive[:], eq.wrench[:] = 0.0, 0.0
        need = linear.inverse(self.q, self.r, np.full(eq.ns, 300.0), np.zeros(eq.n))
        free = np.flatnonzero(driven == 0)
        rate, mass = np.zeros(eq.n), eq.mass(self.q, self.r)
        rate[free] = np.linalg.solve(mass[np.ix_(free, free)], (self.force - need)[free])
        return rate

    def alike(self, one, other):
        """Equal to rounding: forces of the difference against the sizes of all that are summed."""
        mass = self.equations.mass(self.q, self.r)
        free = np.flatnonzero(self.equations.reduced.tables.driven == 0)
        condition = np.linalg.cond(mass[np.ix_(free, free)]) if free.size else 1.0
        speed = 1.0 + np.abs(self.r).sum()
        size = largest(mass, initial=0.0) * (speed**2 + largest(other, initial=0.0))
        size += self.weight * speed**2 + largest(self.force, initial=0.0)
        assert largest(mass @ (one - other), initial=0.0) <= 10 * EPS * condition * size


@st.composite
def drawn(draw, **options):
    scene = draw(mechanisms(max_bodies=5, **options))
    return Tree(scene, draw(seeds))


@settings(slow, max_examples=8)
@given(tree=drawn(loops=False, friction=False, springs=False, heat=False))
def test_all_ways_to_run_the_sweeps_agree(tree):
    """The looped program's float run and machine code have the same bits, and so has that program unrolled."""
    assume(tree.packed.kind.joints)
    found, status = tree.run(tree.sweeps.program.plain())
    machine, also = tree.run(tree.sweeps.program.compiled())
    assert np.array_equal(found, machine) and status == also == 0
    tree.alike(found, tree.dense())
    entry = tree.sweeps.program.entries["accelerations"]
    one = Program("unrolled", accelerations=entry.given(**tree.tables))
    (known, _), (coded, _) = tree.unrolled(one.plain()), tree.unrolled(one.compiled())
    assert np.array_equal(known, coded)
    tree.alike(found, known)


def test_a_plane_leaves_the_third_dimension_out():
    """What is known of a class is left out of its program, and that changes no number."""
    plane, space = (Tree(families.scene(family, 4)) for family in ("planar-chain", "revolute-chain"))
    assert plane.packed.kind != space.packed.kind
    assert plane.sweeps.width <= 34 and space.sweeps.width <= 69
    assert plane.sweeps.program.text().count("fmul") <= 0.4 * space.sweeps.program.text().count("fmul")


def test_a_link_without_mass_is_named():
    tree = Tree(families.scene("revolute-chain", 3))
    found = links_of(tree.equations.reduced)
    for part in found.parts[1:]:
        part.numbers[12:] = 0.0
    tree.packed = found.packed(tree.equations.gravity)
    tree.sweeps = sweeps(tree.packed.kind)
    assert tree.run(tree.sweeps.program.plain())[1] == 3
    assert tree.run(tree.sweeps.program.compiled())[1] == 3


def test_rows_of_links_stand_after_their_parents():
    tree = Tree(families.scene("revolute-chain", 3))
    links = tree.packed.links
    assert [links[i].parent for i in range(3)] == [3, 0, 1]
