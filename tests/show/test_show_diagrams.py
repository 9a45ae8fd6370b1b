"""Laws of the pictures: nothing overlaps, wires keep off what they do not join, same pattern, same picture."""

import math
import re
import xml.etree.ElementTree as Xml
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ephs.operad import Pattern
from ephs.show import Drawing, ShowError, draw, place
from ephs.show.diagrams.geometry import Placement, Wire, crossings, distances, faults, overlaps, trespasses
from ephs.show.diagrams.graph import read, short_names, subscripted
from ephs.show.diagrams.legend import legend, title
from ephs.show.diagrams.positions import proposals
from ephs.show.shared.palette import FILLS
from ephs.testing import nestings, patterns
from tests.show.baselines import FOLDER, drawings
from tests.show.pictures_of_patterns import KINDS, PICTURES, flat, joint, kinds_of

BASELINES = drawings()
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module", params=list(PICTURES))
def drawn(request):
    pattern = PICTURES[request.param]()
    return pattern, draw(pattern, kinds=kinds_of(pattern))


# Patterns of twelve boxes are large to draw, and placing them takes its time: both are meant here.
calm = settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large], deadline=None)
SMALL = patterns(max_boxes=12, max_inner_junctions=8)


@settings(calm, max_examples=settings().max_examples // 2)
@given(SMALL)
def test_nothing_lies_on_anything_else(pattern):
    """No name on a wire, a box, a junction or another name; no wire through what it is not attached to."""
    assert faults(place(pattern)) == []


@settings(calm, max_examples=settings().max_examples // 2)
@given(SMALL, st.permutations([(x, y) for x in range(7) for y in range(5)]), st.booleans())
def test_nothing_lies_on_anything_else_where_the_author_places(pattern, points, junctions):
    named = [*pattern.boxes, *(pattern.junctions if junctions else ())]
    at = {str(path): point for path, point in zip(named, points, strict=False)}
    assert faults(place(pattern, positions=at)) == []


@settings(calm, max_examples=settings().max_examples // 5)
@given(nestings(max_depth=2, max_boxes=3))
def test_an_opened_composite_encloses_its_own(nesting):
    picture = place(nesting, opened=True)
    assert trespasses(picture) == [] and overlaps(picture) == []
    nodes = picture.nodes()
    for region in picture.regions:
        assert region.members == {path for path in nodes if path.startswith(f"{region.path}.")}
        assert all(math.dist(region.at, nodes[p][0]) + nodes[p][1] < region.radius for p in region.members)


def test_a_picture_says_how_much_of_it_is_wrong():
    good = place(PICTURES["body"]())
    nodes = good.nodes()
    across = Wire("port pe.q on junction p", ("pe",), "port", True, (nodes["pe"][0], nodes["p"][0]), None)
    heap = replace(good, wires=(across,), junctions=(*good.junctions, replace(good.junctions[0], path="again")))
    found = "; ".join(Drawing(heap).faults)
    assert "port pe.q on junction p runs through pkc" in found
    assert "q overlaps again" in found and "the name q lies on" in found


@pytest.mark.parametrize("name", sorted(file.stem for file in FOLDER.glob("*.svg")))
def test_pictures_stay_as_they_were_looked_at(name):
    drawing = BASELINES[name]
    assert drawing.faults == []
    assert drawing.svg == (FOLDER / f"{name}.svg").read_text(encoding="utf-8")


def test_every_kept_picture_is_compared():
    assert set(BASELINES) == {file.stem for file in FOLDER.glob("*.svg")} and len(BASELINES) == 7


def test_every_port_has_its_wire(drawn):
    pattern, drawing = drawn
    ports = {(str(b), str(p.junction), p.power) for b, box in pattern.boxes.items() for p in box.ports.values()}
    wires = drawing.placement.wires
    assert {(*w.ends, w.power) for w in wires if w.role == "port"} == ports
    assert sum(w.role == "port" for w in wires) == sum(len(box.ports) for box in pattern.boxes.values())
    exposed = {(str(name), j.power) for name, j in pattern.junctions.items() if j.exposed}
    assert {(w.ends[0], w.power) for w in wires if w.role == "outer"} == exposed


def test_wires_end_where_they_belong(drawn):
    _, drawing = drawn
    picture = drawing.placement
    nodes = picture.nodes()
    left, top, width, height = picture.rectangle
    for wire in picture.wires:
        if wire.role == "outer":
            assert wire.points[0] == nodes[wire.ends[0]][0]
            x, y = wire.points[-1]
            assert min(abs(x - left), abs(x - left - width), abs(y - top), abs(y - top - height)) < 1e-6
            continue
        centre, radius = nodes[wire.ends[0]]
        assert math.dist(wire.points[0], centre) == pytest.approx(radius, abs=1e-6)
        assert math.dist(wire.points[-1], nodes[wire.ends[1]][0]) < 1e-6


def test_everything_lies_in_the_rectangle(drawn):
    _, drawing = drawn
    picture = drawing.placement
    left, top, width, height = picture.rectangle
    for (x, y), radius in picture.nodes().values():
        assert left < x - radius and x + radius < left + width
        assert top < y - radius and y + radius < top + height
    for text in (j.label for j in picture.junctions):
        a, b, c, d = text.bounds
        assert left < a and top < b and c < left + width and d < top + height


def test_names_fit_their_boxes(drawn):
    _, drawing = drawn
    for box in drawing.placement.boxes:
        assert all(text.width <= 2 * box.radius for text in box.lines)


def test_same_pattern_same_files(drawn):
    pattern, drawing = drawn
    again = draw(PICTURES["flat"](), kinds=kinds_of(PICTURES["flat"]())) if len(pattern.boxes) == 15 else None
    again = again or draw(pattern, kinds=kinds_of(pattern))
    assert (again.svg, again.tikz, again.png) == (drawing.svg, drawing.tikz, drawing.png)


def test_two_ports_on_one_junction_are_two_lines():
    wires = [w for w in place(PICTURES["awkward"]()).wires if w.ends == ("two_ports", "a")]
    assert len(wires) == 2
    assert wires[0].points[len(wires[0].points) // 2] != wires[1].points[len(wires[1].points) // 2]


def test_kinds_are_coloured():
    pattern = joint()
    root = Xml.fromstring(draw(pattern, kinds=kinds_of(pattern)).svg)
    for group in root.iter(f"{SVG}g"):
        if group.get("class", "").startswith("box"):
            name = (group.findtext(f"{SVG}title") or "").partition(" ")[0]
            circle = group.find(f"{SVG}circle")
            assert circle is not None and circle.get("fill") == FILLS[KINDS[name]]
            assert bool(group.findall(f"{SVG}path")) == (KINDS[name] == "environment")
    assert {FILLS[kind] for kind in ("storage", "reversible", "irreversible", "composite", "unknown")} == set(
        FILLS.values()
    )


def test_boxes_of_a_kind_are_of_one_size_and_in_the_legend(drawn):
    _, drawing = drawn
    picture = drawing.placement
    sizes = {(box.kind, box.radius) for box in picture.boxes}
    assert len(sizes) == len({kind for kind, _ in sizes})
    explained = [box.kind for box, _ in picture.legend]
    assert sorted(explained) == sorted({kind for kind, _ in sizes} - {"unknown"})
    left, top, _, height = picture.rectangle
    wide, high = picture.size
    for box, word in picture.legend:
        assert top + height < box.at[1] - box.radius and word.bounds[3] < high
        assert left <= box.at[0] - box.radius and word.bounds[2] < wide


def test_a_wide_legend_takes_rows():
    kinds = ("storage", "environment", "reversible", "irreversible", "composite")
    entries = legend(kinds, (0.0, 0.0), 100.0)
    assert len({box.at[1] for box, _ in entries}) > 1 and max(word.bounds[2] for _, word in entries) <= 100.0


def test_names_of_the_literature_are_explained():
    assert title("b1.pkc", "reversible") == "b1.pkc (reversible): coupling of potential and kinetic energy"
    assert title("j.o_1", "reversible").endswith("the joint") and title("crank", "unknown") == "crank"


def test_only_state_ports_and_links_are_dashed():
    pattern = PICTURES["awkward"]()
    root = Xml.fromstring(draw(pattern).svg)
    paths = list(root.iter(f"{SVG}path"))
    assert {path.get("stroke-dasharray") is not None for path in paths} == {True, False}
    for group in root.iter(f"{SVG}g"):
        for path in group.findall(f"{SVG}path"):
            assert ("state" in str(group.get("class"))) == (path.get("stroke-dasharray") is not None)


def test_full_names_stand_in_the_titles():
    pattern = flat()
    svg = draw(pattern).svg
    assert all(f"<title>{title(str(box), 'unknown')}</title>" in svg for box in pattern.boxes)


def test_a_port_is_named_at_its_box_only_if_its_junction_does_not_say_it():
    named = {w.title: w.label for w in place(PICTURES["mbs"]()).wires}
    assert named["port b1.p on junction p_1"].base == "p"
    assert named["port j.p_1 on junction p_1"] is None


def test_short_names_are_the_shortest_that_differ():
    paths = ["a.b.x", "c.b.x", "b.y", "y.z", "w"]
    assert short_names(paths) == {"a.b.x": "a.b.x", "c.b.x": "c.b.x", "b.y": "y", "y.z": "z", "w": "w"}
    assert len(set(short_names(["x", "a.x", "b.a.x"]).values())) == 3


def test_symbols_have_subscripts_and_words_have_none():
    assert subscripted("q_r") == ("q", "r")
    assert subscripted("b1.p_j1") == ("b1.p", "j1")
    assert subscripted("left_hip") == ("left_hip", "")


def test_given_positions_are_kept():
    points = {"pe": (0, 0), "pkc": (2, 0), "ke": (4, 1), "lp": (4, -1), "q": (1, 0), "p": (3, 0)}
    nodes = place(PICTURES["body"](), positions=points).nodes()
    origin = nodes["pe"][0]
    unit = (nodes["q"][0][0] - origin[0]) / 1.0
    for name, (x, y) in points.items():
        assert nodes[name][0] == pytest.approx((origin[0] + unit * x, origin[1] - unit * y))


def test_wires_between_given_positions_are_led_round_what_is_in_the_way():
    pattern = Pattern.from_text("p: momentum; a(p); b(p); c(p); between()")
    points = {"a": (0, 0), "between": (1, 0), "p": (2, 0), "b": (3, 0), "c": (2, 1)}
    picture = place(pattern, positions=points)
    assert trespasses(picture) == []
    assert len(next(w for w in picture.wires if w.ends[0] == "a").points) > 2


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"positions": {"nobody": (0, 0)}}, "'nobody'"),
        ({"positions": {"pe": (0, 0)}}, "box pkc has none"),
        (
            {"positions": {"pe": (0, 0), "pkc": (0, 0), "ke": (1, 1), "lp": (2, 2), "q": (5, 5)}},
            "pe and pkc are at the same",
        ),
        ({"positions": {"pe": (1e17, 0)}}, r"pe is at \(1e\+17, 0.0\), expected finite numbers up to"),
        ({"positions": {"pe": (0, float("nan"))}}, "pe is at"),
        ({"kinds": {"pe": "motor"}}, "found kind 'motor'"),
    ],
)
def test_faults_are_named(asked, words):
    with pytest.raises(ShowError, match=words):
        draw(PICTURES["body"](), **asked)


def test_files_are_written_by_their_names(tmp_path):
    drawing = draw(joint(), tmp_path / "joint.svg")
    assert (tmp_path / "joint.svg").read_text(encoding="utf-8") == drawing.svg == drawing._repr_svg_()
    assert drawing.save(tmp_path / "joint.png").read_bytes().startswith(b"\x89PNG")
    assert drawing.save(tmp_path / "joint.tex").read_text(encoding="utf-8") == drawing.tikz
    with pytest.raises(ShowError, match=r"joint\.gif"):
        drawing.save(tmp_path / "joint.gif")


def test_tikz_names_all_and_escapes_what_tex_would_read(drawn):
    pattern, drawing = drawn
    text = drawing.tikz
    assert text.count("\\begin{") == text.count("\\end{") and r"\documentclass{article}" in text
    circles = len(pattern.boxes) + len(drawing.placement.legend) + len(drawing.placement.junctions)
    assert text.count("circle[radius=") == circles
    body = re.sub(r"%.*", "", text.partition(r"\begin{tikzpicture}")[2])
    assert not re.search(r"(?<!\\)[_&#$]", body)
    whole = re.sub(r"(?<!\\)%.*", "", text)
    assert whole.count("{") == whole.count("}")


def test_layouts_keep_nodes_apart_and_wires_short():
    """Wires are shorter than the nodes are apart on average, which they are not where nodes change places."""
    for pattern in (make() for make in PICTURES.values()):
        graph = read(pattern)
        paths, radii = list(graph.radii()), list(graph.radii().values())
        ends = [[paths.index(end) for end in edge.ends] for edge in graph.edges if len(edge.ends) == 2]
        for points in proposals(graph):
            far = {(i, j): math.dist(points[i], points[j]) for i, j in combinations(range(len(paths)), 2)}
            assert all(length > radii[i] + radii[j] for (i, j), length in far.items())
            if len(ends) < 4:
                continue
            share, moved = (
                np.mean([math.dist(at[i], at[j]) for i, j in ends]) / np.mean([*far.values()])
                for at in (points, np.roll(points, len(points) // 2, axis=0))
            )
            assert share < min(0.75, moved), (pattern, share, moved)


def test_the_checks_see_a_bad_picture():
    good = place(PICTURES["body"]())
    nodes = good.nodes()
    across = Wire("bad", ("pe", "p"), "port", True, (nodes["pe"][0], nodes["p"][0]), None)
    line = np.array(across.points)
    assert distances(np.array(nodes["p"][0]), line[:-1], line[1:]).min() == 0.0
    through = Wire("bad", (), "port", True, (nodes["pe"][0], nodes["pkc"][0]), None)
    bad = Placement(good.boxes, good.junctions, (through,), good.rectangle, good.corner)
    assert {path for _, path in trespasses(bad)} >= {"pe", "pkc"}
    cross = (
        Wire("x", ("1",), "port", True, ((0, 0), (2, 2)), None),
        Wire("y", ("2",), "port", True, ((0, 2), (2, 0)), None),
    )
    assert crossings(Placement((), (), cross, good.rectangle, 0.0)) == 1
