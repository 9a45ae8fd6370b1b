"""The picture of the architecture: it says of who knows whom all that is so, and nothing that is not."""

import re
from itertools import pairwise

import networkx as nx
import pytest

from tests.rooms import DOORS, PLACE, house
from tests.scenes import ROOT


@pytest.fixture
def drawing(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    import house

    return house


def test_arrows_say_who_knows_whom(drawing):
    drawn, whole = nx.DiGraph(), nx.DiGraph()
    drawn.add_nodes_from(PLACE)
    whole.add_nodes_from(PLACE)
    doors = set()
    for kind, a, b, way in drawing.arrows(house()):
        ways = [(a, b)] * (way != "back") + [(b, a)] * (way != "forward")
        (doors.update if kind == "door" else drawn.add_edges_from)(ways)
    known = {one.rooms for one in house() if not one.upward}
    whole.add_edges_from(known)
    for room in PLACE:
        assert nx.descendants(drawn, room) == nx.descendants(whole, room)
    assert set(drawn.edges) <= known
    assert doors == {one.rooms for one in house() if one.upward}


def test_higher_storeys_are_drawn_higher(drawing):
    boxes = re.findall(r"<title>(ephs[\w.]*)</title>\n<path [^>]*/>\n<text [^>]* y=\"(-?[\d.]+)\"", drawing.picture())
    heights = {room: -float(y) for room, y in boxes}
    assert set(heights) == set(PLACE)
    levels = sorted({(PLACE[room][0], height) for room, height in heights.items()})
    assert all(low < high for (_, low), (_, high) in pairwise(levels))


def test_rooms_and_doors_are_told(drawing):
    assert re.findall(r"^\| `(ephs[\w.]*)`", drawing.rooms(), re.MULTILINE)[0] == "ephs"
    assert set(re.findall(r"^\| `(ephs[\w.]*)` \| \w", drawing.rooms(), re.MULTILINE)) == set(PLACE)
    assert set(re.findall(r"^\| `([\w.]+)` \| `([\w.]+)`", drawing.doors(), re.MULTILINE)) == set(DOORS)
