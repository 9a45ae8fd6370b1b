"""Programs of sweeps over a tree: what is known of a class is left out, and rows of links stand after their parents."""

from benchmarks import families
from ephs.mechanics.road.programs import sweeps
from ephs.mechanics.tree.engine.links import links_of
from tests.scenes import equations_of


def packed(family, size):
    """The records of the links of a tree."""
    eq = equations_of(families.scene(family, size))
    return links_of(eq.reduced).packed(eq.reduced.gravity)


def test_a_plane_leaves_the_third_dimension_out():
    """What is known of a class is left out of its program, and that changes no number."""
    plane, space = (packed(family, 4).kind for family in ("planar-chain", "revolute-chain"))
    assert plane != space
    plane, space = sweeps(plane), sweeps(space)
    assert plane.width <= 34 and space.width <= 69
    assert plane.program.text().count("fmul") <= 0.4 * space.program.text().count("fmul")


def test_rows_of_links_stand_after_their_parents():
    links = packed("revolute-chain", 3).links
    assert [links[i].parent for i in range(3)] == [3, 0, 1]
