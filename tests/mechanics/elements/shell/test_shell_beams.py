"""Sheets along beams and at their ends in scene files: composite sections, stiff beams, parts, refused ones."""

import numpy as np
import pytest

import ephs
from tests.written import scene_of_text

WIDE, THICK, YOUNG, RHO = 0.05, 0.01, 1e9, 1000.0
DEEP, BROAD = 0.04, 0.01
HALF = """
[shells.{name}]
corners = [[0.0, {low}, 0.0], [1.0, {low}, 0.0], [1.0, {high}, 0.0], [0.0, {high}, 0.0]]
elements = [{n}, 1]
thickness = 1e-2
E = 1e9
rho = 1000.0
edges = {edges}
{more}
"""
RIB = """
[beams.rib]
from = [0.0, 0.0, 0.0]
to = [1.0, 0.0, 0.0]
elements = {k}
section = {{ rectangle = [0.01, 0.04], E = 1e9, nu = 0.0, rho = 1000.0 }}
ends = ["ground"]
"""


def ribbed(n, k=None, more="", edges='["rib", "free", "free", "ground"]'):
    """A strip clamped at x = 0, in two halves at the sides of a rib."""
    left = HALF.format(name="left", low=0.0, high=WIDE, n=n, edges=edges, more=more)
    right = HALF.format(name="right", low=-WIDE, high=0.0, n=n, edges='["free", "free", "rib", "ground"]', more=more)
    return "format = 1\n" + left + right + RIB.format(k=k or n)


def lowest(text):
    return np.abs(ephs.linearize(scene_of_text(text)).eigenvalues.imag).min()


def test_a_strip_with_a_rib_vibrates_as_its_composite_section():
    """Lumped masses and elements of order 2; shear and rotary inertia of the rib are about 3 (DEEP/length)²/4 of it."""
    second = 2.0 * WIDE * THICK**3 / 12.0 + BROAD * DEEP**3 / 12.0
    area = 2.0 * WIDE * THICK + BROAD * DEEP
    known = 1.8751040687**2 * np.sqrt(YOUNG * second / (RHO * area))
    coarse, fine = lowest(ribbed(4)) / known, lowest(ribbed(8)) / known
    assert (4.0 * fine - coarse) / 3.0 == pytest.approx(1.0, abs=4e-3)
    assert abs(fine - 1.0) < 0.5 * abs(coarse - 1.0)
    # the control: of the strip a quarter of the mass is at the rib
    assert abs(np.sqrt(1.0 - 0.5 * 2.0 * WIDE * THICK / area) - 1.0) > 0.1


def test_a_beam_may_have_more_nodes_than_the_side():
    scene = scene_of_text(ribbed(2, 4))
    assert scene.shells["left"].edges[:3] == ["rib.0", "rib.2", "rib.4"]


def test_a_sheet_and_the_beam_along_its_side_do_not_touch():
    touching = "surface = { stiffness = 1e3, radius = 0.02 }\n"
    skin = '[surfaces.skin]\nbody = "left"\nstiffness = 1e3\n'
    floor = '[surfaces.floor]\nbody = "ground"\nshape = { plane = {} }\nposition = [0.0, 0.0, -1.0]\n'
    text = ribbed(2, edges='["rib", "free", "free", "free"]') + touching + skin + floor
    pairs = [set(each.surfaces) for each in scene_of_text(text).contacts.values()]
    assert [pair for pair in pairs if "skin" in pair] == [{"skin", "floor"}]
    with pytest.raises(ephs.SceneError, match=r"shells.left.edges\[0\]: found 0.25 m from a point"):
        scene_of_text(text.replace("elements = [2, 1]", "elements = [4, 1]", 1))


def test_a_sheet_at_the_end_of_a_stiff_beam_vibrates_as_one_that_is_clamped():
    """To the order of 1/E of the beam; one of the sheet's material is much softer than the ground."""

    def beyond(edge, beam=""):
        edges = f'["free", "free", "free", "{edge}"]'
        sheet = HALF.format(name="left", low=-0.5 * WIDE, high=0.5 * WIDE, n=2, more="", edges=edges)
        return lowest("format = 1\n" + sheet + beam)

    short = (
        RIB.format(k=1).replace("[0.0, 0.0, 0.0]", "[-0.05, 0.0, 0.0]").replace("[1.0, 0.0, 0.0]", "[0.0, 0.0, 0.0]")
    )
    clamped = beyond("ground")
    off = [abs(beyond("rib.1", short.replace("E = 1e9", f"E = {young}")) / clamped - 1.0) for young in ("1e9", "1e11")]
    assert off[1] < 0.02 * off[0] and off[0] > 1e-4
