"""Wiring diagrams of Catlab and hypergraphs of DisCoPy: there and back, with what is lost told."""

import json

import pytest
from discopy.frobenius import Box, Hypergraph, Ty
from hypothesis import assume, given
from hypothesis import strategies as st

from ephs.operad import Path, Pattern, PatternError, Port, junction, quantity
from ephs.operad.catlab import from_catlab, to_catlab
from ephs.operad.hypergraphs import from_discopy, to_discopy
from ephs.testing import patterns

Q = quantity.displacement
plain = patterns(state_ports=False, links=False, identities=False)


def without_states(f):
    """The pattern as others see it: all ports bear power, no states are shared."""
    junctions = {path: junction(j.quantity, j.exposed) for path, j in f.junctions.items()}
    boxes = {
        b or Path(("identity",)): {p: Port(w.junction, True) for p, w in c.ports.items()} for b, c in f.boxes.items()
    }
    try:
        return Pattern(junctions, boxes)
    except PatternError:
        assume(False)


@given(plain)
def test_nothing_is_lost_of_patterns_without_states(f):
    there = to_catlab(f)
    back = from_catlab(there.result)
    assert there.lost == back.lost == () and back.result == f


@given(patterns())
def test_what_is_lost_is_told(f):
    mine = without_states(f)
    there = to_catlab(f)
    states = sum(not port.power for box in f.boxes.values() for port in box.ports.values())
    states += sum(not kind.power for kind in f.interface.values())
    assert len(there.lost) == states + len(f.links) + f.is_identity
    back = from_catlab(there.result).result
    assert back == mine and (back == f) == (not there.lost)


@given(patterns())
def test_hypergraphs_are_the_pattern_but_for_names(f):
    mine = without_states(f)
    back = from_discopy(to_discopy(f).result).result
    outer = {name: Path((f"out{k}",)) for k, name in enumerate(sorted(f.interface), 1)}
    found = mine.isomorphic(back)
    assert found is not None and {found.junctions[name] for name in outer} == set(outer.values())
    assert {box: set(content.ports) for box, content in back.boxes.items()} == {
        box: set(content.ports) for box, content in mine.boxes.items()
    }


@given(st.data(), plain.filter(lambda f: f.boxes))
def test_discopy_s_composition_is_substitution(data, f):
    """An oracle by others: DisCoPy's composition along the ports of a box, a pushout, gives what `substitute` gives."""
    a = data.draw(st.sampled_from(sorted(f.boxes)))
    ports = f.boxes[a].ports
    g = data.draw(patterns(interface=f.boxes[a].interface, state_ports=False, links=False, identities=False))
    whole, inner, outer = to_discopy(f.substitute({a: g})).result, to_discopy(g).result, to_discopy(f).result
    k = list(f.boxes).index(a)
    places = dict(zip(ports, outer.box_wires[k][1], strict=True))
    around = Hypergraph(
        inner.cod,
        outer.cod,
        outer.boxes[:k] + outer.boxes[k + 1 :],
        (tuple(places[p] for p in sorted(ports)), outer.box_wires[:k] + outer.box_wires[k + 1 :], outer.cod_wires),
        spider_types=outer.spider_types,
    )
    named = tuple(Box(f"{a}.{box.name}", box.dom, box.cod, data=box.data) for box in inner.boxes)
    composed = Hypergraph(inner.dom, inner.cod, named, inner.wires, spider_types=inner.spider_types) >> around
    assert ordered(composed) == ordered(whole)
    if composed.boxes:  # the control
        assert ordered(Hypergraph(Ty(), composed.cod, composed.boxes[1:], dropped(composed))) != ordered(whole)


def ordered(h):
    """The boxes sorted by name, since their order counts in comparisons."""
    order = sorted(range(len(h.boxes)), key=lambda k: h.boxes[k].name)
    wires = h.dom_wires, tuple(h.box_wires[k] for k in order), h.cod_wires
    return Hypergraph(h.dom, h.cod, tuple(h.boxes[k] for k in order), wires, spider_types=h.spider_types)


def dropped(h):
    """The wires without the first box."""
    return h.dom_wires, h.box_wires[1:], h.cod_wires


RELATION = {
    "Box": [{"_id": 1, "name": "R"}, {"_id": 2, "name": "S"}, {"_id": 3, "name": "R"}],
    "Port": [
        {"_id": 1, "box": 1, "junction": 1},
        {"_id": 2, "box": 1, "junction": 2},
        {"_id": 3, "box": 2, "junction": 2},
        {"_id": 4, "box": 3, "junction": 2},
        {"_id": 5, "box": 3, "junction": 3},
    ],
    "OuterPort": [{"_id": 1, "outer_junction": 1}],
    "Junction": [{"_id": 1, "variable": "x"}, {"_id": 2, "variable": "y"}, {"_id": 3, "variable": "z"}],
    "Name": [],
    "VarName": [],
}
"""What Catlab writes of `@relation (x,) begin R(x,y); S(y); R(y,z) end`: an untyped relation diagram."""


def read(document, quantities=Q):
    return from_catlab(json.dumps(document), quantities)


def test_a_relation_diagram_of_catlab():
    found = read(RELATION)
    junctions = "x: displacement, exposed; y: displacement; z: displacement"
    boxes = "R(port1=x, port2=y); S(port1=y); R2(port1=y, port2=z)"
    assert found.result == Pattern.from_text(f"{junctions}; {boxes}")
    assert found.lost == ("box 3 is called R2 in place of R, which is taken",)


def test_what_catlab_reads():
    """The form that ACSets.jl documents: tables of rows, numbers from 1 on, types that agree."""
    f = Pattern.from_text("q: displacement; p: momentum, exposed; spring(q); mass(p); couple(q, p)")
    assert json.loads(to_catlab(f).result) == {
        "Box": [{"_id": 1, "name": "spring"}, {"_id": 2, "name": "mass"}, {"_id": 3, "name": "couple"}],
        "Port": [
            {"_id": 1, "box": 1, "junction": 1, "port_type": "displacement", "port_name": "q"},
            {"_id": 2, "box": 2, "junction": 2, "port_type": "momentum", "port_name": "p"},
            {"_id": 3, "box": 3, "junction": 1, "port_type": "displacement", "port_name": "q"},
            {"_id": 4, "box": 3, "junction": 2, "port_type": "momentum", "port_name": "p"},
        ],
        "OuterPort": [{"_id": 1, "outer_junction": 2, "outer_port_type": "momentum", "outer_port_name": "p"}],
        "Junction": [
            {"_id": 1, "junction_type": "displacement", "variable": "q"},
            {"_id": 2, "junction_type": "momentum", "variable": "p"},
        ],
        "Type": [],
        "Name": [],
        "VarName": [],
    }


def changed(**tables):
    return RELATION | tables


TYPED = changed(Junction=[{"junction_type": "velocity"}, {"junction_type": "momentum"}, {"junction_type": "momentum"}])


def test_types_are_quantities_or_are_told():
    found = read(TYPED, {"velocity": quantity.angle}).result
    assert [j.quantity for j in found.junctions.values()] == [quantity.angle, quantity.momentum, quantity.momentum]
    with pytest.raises(PatternError, match="junction 1: found the type velocity"):
        read(TYPED, None)


def test_what_has_no_place_in_a_pattern_is_told():
    found = read(
        changed(
            Box=[{"name": "x"}, {"colour": 1}, {}], Junction=[*RELATION["Junction"], {"variable": "w"}], Colour=[{}]
        )
    )
    assert set(map(str, found.result.boxes)) == {"x2", "box2", "box3"}
    assert found.lost == (
        "column colour of table Box",
        "table Colour",
        "junction w has no port",
        "box 1 is called x2 in place of x, which is taken",
    )
    named = read(changed(OuterPort=[{"outer_junction": 1, "outer_port_name": "left"}]))
    assert set(map(str, named.result.interface)) == {"left"}
    assert named.lost[0] == "the junction of outer port left was called x"


@pytest.mark.parametrize(
    "document, words",
    [
        ([], "no wiring diagram can be read: document: found"),
        ({"Box": []}, "no table Junction"),
        (changed(Port={}), "Port: found"),
        (changed(Port=[1]), r"Port\[0\]: found 1, expected an object"),
        (changed(Port=[{"box": 1}]), r"Port\[0\]\.junction: found None, expected a whole number"),
        (changed(Port=[{"box": 4, "junction": 1}]), r"Port\[0\]\.box: found 4, expected a number from 1 to 3"),
        (changed(Port=[{"box": 1, "junction": 0}]), r"Port\[0\]\.junction: found 0"),
        (changed(Box=[{"_id": 2}]), r"Box\[0\]\._id: found 2, expected 1"),
        (changed(Box=[{"name": 1}]), r"Port\[2\]\.box|Box\[0\]\.name: found 1"),
        (changed(Box=[{"name": "a b"}, {}, {}]), "box 1: found .*white space"),
        (changed(Junction=[{"junction_type": {"_var": 1}}, {}, {}]), r"Junction\[0\]\.junction_type"),
        (changed(OuterPort=[{"outer_junction": 1}] * 2), "outer port 2: found a second outer port on junction 1"),
        (changed(OuterPort=[{"outer_junction": 1, "outer_port_type": "T"}]), r"OuterPort\[0\]: found the type T"),
        (
            changed(Junction=[*RELATION["Junction"], {}], OuterPort=[{"outer_junction": 4}]),
            "diagram: .*no inner port",
        ),
    ],
)
def test_what_is_no_diagram_is_refused(document, words):
    with pytest.raises(PatternError, match=words):
        read(document)


def test_a_hypergraph_of_discopy():
    x = Ty("displacement")
    f, g = Box("f", x, x @ x), Box("g", x, Ty())
    found = from_discopy(
        (f.to_hypergraph() >> Hypergraph.id(x) @ g.to_hypergraph()) >> f.to_hypergraph().dagger().dagger()
    )
    text = """out1: displacement, exposed; out2: displacement, exposed; in1: displacement, exposed
        a: displacement; b: displacement
        f(in1, out1=a, out2=b); g(in1=b); f2(in1=a, out1, out2)"""
    assert found.result.isomorphic(Pattern.from_text(text)) is not None
    assert "box f has 1 inputs" in found.lost and "box f2 is called so in place of f, which is taken" in found.lost
    with pytest.raises(PatternError, match="second outer port"):
        from_discopy(Hypergraph.spiders(1, 1, x))
    with pytest.raises(PatternError, match="found the type y"):
        from_discopy(Box("f", Ty("y"), Ty()).to_hypergraph())
    assert from_discopy(Box("f", Ty("y"), Ty()).to_hypergraph(), {"y": Q}).result.interface["in1"].quantity == Q
