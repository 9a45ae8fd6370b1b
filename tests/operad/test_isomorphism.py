"""Isomorphism up to renaming, symmetries, the canonical hash, and patterns as graphs."""

import itertools
import math

import networkx as nx
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ephs.operad import Path, Pattern, PortType, junction, quantity
from ephs.testing import fresh_names, patterns

Q = quantity.displacement


@st.composite
def renamed(draw, f):
    """The pattern with all of its names shuffled or new."""
    if f.is_identity:
        new = draw(fresh_names(f.junctions))
        return f.rename(junctions=new)
    names = draw(fresh_names([*f.boxes, *(p for p in f.junctions)]))
    boxes = {old: new for old, new in names.items() if old in f.boxes}
    junctions = {old: new for old, new in names.items() if old in f.junctions}
    ports = {box: draw(fresh_names(content.ports)) for box, content in f.boxes.items()}
    return f.rename(boxes=boxes, junctions=junctions, ports=ports)


@given(st.data(), patterns())
def test_renaming_makes_isomorphic_patterns_and_is_found(data, f):
    g = data.draw(renamed(f))
    found = f.isomorphic(g)
    assert found is not None and found(f) == g
    assert f.canonical_hash() == g.canonical_hash()
    assert f.automorphisms() == g.automorphisms()


@given(patterns(), patterns())
def test_an_isomorphism_is_a_renaming(f, g):
    found = f.isomorphic(g)
    assert (found is None) == (g.isomorphic(f) is None)
    if found is None:
        return
    assert found(f) == g and f.canonical_hash() == g.canonical_hash()


@given(patterns(max_boxes=2, max_inner_junctions=2))
def test_the_same_interface_may_be_asked_for(f):
    found = f.isomorphic(f, fix_interface=True)
    assert found is not None and found(f) == f
    assert all(found.junctions[path] == path for path in f.interface)


@pytest.mark.parametrize(
    ("f", "g"),
    [
        ("q: displacement; a(q)", "q: momentum; a(q)"),
        ("q: displacement; a(q)", "q: displacement, exposed; a(q)"),
        ("q: displacement, exposed as state; a(q)", "q: displacement, exposed; a(q)"),
        ("q: displacement; a(q)", "q: displacement; a(~q)"),
        ("q: displacement; a(q)", "q: displacement; a(q); b()"),
        ("q: displacement; a(x=q, y=q)", "q: displacement; a(q); b(q)"),
        ("q: displacement; r: displacement; a(q, r)", "q: displacement; r: displacement; a(q, r); q ~ r"),
        ("q: displacement; a(q)", "q: displacement @ B; a(q)"),
    ],
)
def test_what_differs_is_not_isomorphic(f, g):
    one, two = Pattern.from_text(f), Pattern.from_text(g)
    assert one.isomorphic(two) is None and two.isomorphic(one) is None


def test_a_ring_of_six_is_not_two_rings_of_three():
    """Refinement alone does not tell them apart."""
    two = rings(3, 3)
    assert rings(6).isomorphic(two) is None and rings(6).canonical_hash() == two.canonical_hash()


def test_cells_of_refinement_need_not_be_orbits():
    """A ring of six beside two of three: all boxes look alike, but not every one can take the place of each other."""
    assert rings(6, 3, 3).automorphisms() == 12 * (6 * 6 * 2)


def test_symmetries_may_have_to_keep_outer_names():
    outer = "q: angle, exposed; r: angle, exposed; x: angle, exposed as state; y: angle, exposed as state"
    f = Pattern.from_text(f"{outer}; a(q, ~x); b(q=r, x=~y)")
    assert (f.automorphisms(), f.automorphisms(fix_interface=True)) == (2, 1)
    swapped = f.rename(junctions={"x": "y", "y": "x"})
    assert f.isomorphic(swapped) is not None and f.isomorphic(swapped, fix_interface=True) is None
    one = Pattern.from_text("x: angle, exposed as state; a(~x)")
    assert one.isomorphic(one.rename(junctions={"x": "z"}), fix_interface=True) is None
    assert one.isomorphic(one, fix_interface=True) is not None


def test_handles_get_names_that_are_free():
    many = Pattern.from_text("q: angle; h: angle; i: angle; a(q, ~h, ~i); q ~ h ~ i")
    taken = Pattern.from_text("q: angle; state0(q, h=~q, i=~q)")
    found = many.isomorphic(taken)
    assert found is not None and found(many) == taken
    assert {str(found.junctions[Path.parse(name)]) for name in "hi"} == {"state1", "state2"}


def test_outer_names_may_be_held():
    f = Pattern.from_text("q: displacement, exposed; a(q)")
    g = f.rename(junctions={"q": "r"})
    found = f.isomorphic(g)
    assert found is not None and found.junctions[Path.parse("q")] == Path.parse("r") and "junction q → r" in str(found)
    assert f.isomorphic(g, fix_interface=True) is None


def test_identities_are_isomorphic_to_identities():
    f = Pattern.identity({"q": PortType(Q), "p": PortType(quantity.momentum, False)})
    g = Pattern.identity({"a": PortType(Q), "b": PortType(quantity.momentum, False)})
    found = f.isomorphic(g)
    assert found is not None and found(f) == g
    assert f.isomorphic(Pattern.from_text("q: displacement, exposed; p: momentum, exposed as state; a(q, ~p)")) is None


def rings(*counts):
    """Side by side."""
    ends = [(f"j{i}.{k}", f"j{i}.{(k + 1) % count}") for i, count in enumerate(counts) for k in range(count)]
    return Pattern({x: junction(Q) for x, _ in ends}, {f"b{k}": {"x": x, "y": y} for k, (x, y) in enumerate(ends)})


@pytest.mark.parametrize(
    ("f", "count"),
    [
        (Pattern({}, {}), 1),
        (Pattern({}, {f"b{k}": {} for k in range(5)}), 120),
        (Pattern({"q": junction(Q)}, {f"b{k}": {"x": "q"} for k in range(12)}), math.factorial(12)),
        (rings(3), 6),
        (rings(7), 14),
        (Pattern.from_text("q: displacement; a(x=q, y=q); b(x=q, y=~q)"), 2),
        # Three pairs of boxes, each on a junction of its own: swap within pairs, and pairs.
        (
            Pattern(
                {f"q{k}": junction(Q) for k in range(3)}, {f"{s}{k}": {"x": f"q{k}"} for k in range(3) for s in "ab"}
            ),
            48,
        ),
    ],
)
def test_symmetries_are_counted(f, count):
    assert f.automorphisms() == count


@given(patterns(max_boxes=2, max_inner_junctions=1))
def test_symmetries_are_those_that_a_search_finds(f):
    """By trying all permutations of boxes, ports and junctions that bear power or are exposed."""
    assume(not f.is_identity)
    named = [p for p in f.junctions if p in f.normal_form.junctions or f.junctions[p].exposed]
    assume(len(named) == len(f.junctions) and sum(len(b.ports) for b in f.boxes.values()) <= 5)
    count = 0
    for boxes in itertools.permutations(f.boxes):
        shapes = zip(f.boxes, boxes, strict=True)
        if any(len(f.boxes[a].ports) != len(f.boxes[b].ports) for a, b in shapes):
            continue
        names = [list(itertools.permutations(f.boxes[b].ports)) for b in boxes]
        for ports in itertools.product(*names):
            for junctions in itertools.permutations(f.junctions):
                new = f.rename(
                    boxes=dict(zip(f.boxes, boxes, strict=True)),
                    junctions=dict(zip(f.junctions, junctions, strict=True)),
                    ports={b: dict(zip(f.boxes[b].ports, p, strict=True)) for b, p in zip(f.boxes, ports, strict=True)},
                )
                count += new == f
    assert f.automorphisms() == count


@given(patterns())
def test_the_graph_is_bipartite_and_has_every_port(f):
    graph = f.to_networkx()
    assert nx.is_bipartite(graph)
    edges = {(box, port.junction, name, port.power) for box, c in f.boxes.items() for name, port in c.ports.items()}
    found = {
        (dict([a, b])["box"], dict([a, b])["junction"], k, p) for a, b, k, p in graph.edges(keys=True, data="power")
    }
    assert found == edges and graph.number_of_edges() == len(edges)
    for path, j in f.junctions.items():
        data = graph.nodes["junction", path]
        assert data["quantity"] == j.quantity and data["state_class"] == f.state_class(path)
        assert data["exposed"] == (None if not j.exposed else "power" if j.power else "state")
    assert {node[1] for node, side in graph.nodes(data="bipartite") if side == 0} == set(f.boxes)


def test_large_chains_are_compared():
    text = ["j0: displacement, exposed", *(f"j{k}: displacement" for k in range(1, 400))]
    text += [f"b{k}(x=j{k}, y=j{k + 1})" for k in range(399)]
    f = Pattern.from_text("; ".join(text))
    g = f.rename(boxes={f"b{k}": f"c{398 - k}" for k in range(399)})
    found = f.isomorphic(g)
    assert found is not None and found(f) == g and f.automorphisms() == 1
