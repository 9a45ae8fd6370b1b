"""A system of repeated parts, numbered kind by kind, has the numbers of its flattening."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import AssemblyError, Pattern, System, junction
from ephs import library as lib
from ephs import quantity as Q
from ephs.semantics.descriptor import kinds
from ephs.semantics.descriptor.descriptor import Descriptor, assemble, descriptor_of
from ephs.semantics.descriptor.kinds import number_by_kinds, repeats
from ephs.semantics.descriptor.numbering import Numbering, number_flat
from ephs.testing import fillings, nestings, systems

ARRAYS = ("wires", "reads", "outer")


def same(one, other):
    """Whether two numberings say the same of every component, junction and state."""
    values = [
        [numbering.primitives[i] for i in numbering.primitive]
        + [numbering.quantities[i] for i in (*numbering.junctions, *numbering.states)]
        for numbering in (one, other)
    ]
    return (
        len(values[0]) == len(values[1])
        and all(a is b or a == b for a, b in zip(*values, strict=True))
        and all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ARRAYS)
    )


def flat_numbers(system):
    """The numbering of the flattened system; None where there is none."""
    try:
        return number_flat(system.flatten())
    except AssemblyError:
        return None


@st.composite
def copied(draw, part):
    """A level on which one part fills several boxes; their ports meet, are exposed, and share states as drawn."""
    junctions, boxes, of = {}, {}, {}
    for i in range(draw(st.integers(1, 3))):
        wires = {}
        for port, port_type in part.interface.items():
            fitting = [name for name, quantity in of.items() if quantity.matches(port_type.quantity)]
            name = draw(st.sampled_from([*fitting, f"j{len(of)}"]))
            of.setdefault(name, port_type.quantity)
            wires[port] = name if port_type.power else f"~{name}"
        boxes[f"c{i}"] = wires
    for name, quantity in of.items():
        exposed, power = draw(st.sampled_from([(False, True), (True, True), (True, False)]))
        junctions[name] = junction(quantity, exposed, power)
    pairs = [(a, b) for a in of for b in of if a < b and of[a] == of[b]]
    links = draw(st.lists(st.sampled_from(pairs), max_size=2, unique=True)) if pairs else []
    parts = {box: draw(st.sampled_from([part, remade(part)])) for box in boxes}
    return System.of(Pattern(junctions, boxes, links), parts)


def remade(filling):
    """The same pattern, filled with other objects, as of a joint with other numbers."""
    if isinstance(filling, System):
        return System.of(filling.pattern, {box: remade(part) for box, part in filling.fillings.items()})
    return replace(filling, trusted=True)


@st.composite
def repeating(draw):
    """Parts of parts, each drawn once and used several times."""
    system = draw(systems(max_depth=2, isolated=False)) if draw(st.booleans()) else draw(fillings(draw(nestings())))
    for _ in range(draw(st.integers(1, 2))):
        system = draw(copied(system))
    return system


@settings(max_examples=60)
@given(repeating())
def test_numbers_by_kinds_are_those_of_the_flattened_system(system):
    flat, found = flat_numbers(system), number_by_kinds(system)
    assert (flat is None) == (found is None)
    if flat is not None:
        assert same(found, flat)
        by_kinds, plain = Descriptor(system, found), assemble(system.flatten())
        assert by_kinds.outer == plain.outer
        assert (by_kinds.states, by_kinds.junctions) == (plain.states, plain.junctions)
        assert by_kinds.components == plain.components


def test_parts_that_differ_by_numbers_are_of_one_kind():
    cells = [remade(CELL) for _ in range(20)]
    level = chain(CELL, 20)
    system = System.of(level.pattern, dict(zip(level.pattern.boxes, cells, strict=True)))
    assert repeats(system)
    found, flat = number_by_kinds(system), flat_numbers(system)
    assert same(found, flat)
    assert [id(found.primitives[i]) for i in found.primitive] == [id(flat.primitives[i]) for i in flat.primitive]
    assert [part.components.shape for part in found.parts] == [(20, len(CELL.fillings))]


def test_parts_that_read_other_ports_are_of_several_kinds():
    interface = {"c": Q.charge, "f": Q.flux_linkage, "~x": Q.displacement, "~y": Q.displacement}
    one = ephs.gyrator(interface, lambda x, y: [[0, x], [-x, 0]])
    other = replace(one, reads=one.reads[::-1])
    wire = Pattern.from_text(
        "c: charge; f: flux_linkage; x: displacement, exposed; y: displacement, exposed; r(c, f, x=~x, y=~y); C(q=c);"
        "L(b=f); u(q=x); v(q=y)"
    )
    rest = {"C": lib.capacitor(c=1.0), "L": lib.inductor(l=1.0), "u": lib.spring(k=1.0), "v": lib.spring(k=2.0)}
    parts = [wire(r=each, **rest) for each in (one, other)]
    whole = Pattern.from_text(
        "a: displacement; b: displacement; c: displacement; d: displacement; p(x=a, y=b); q(x=c, y=d)"
    )
    system = whole(p=parts[0], q=parts[1])
    assert parts[0].pattern is parts[1].pattern
    assert same(number_by_kinds(system), flat_numbers(system))


def test_a_system_wired_in_another_way_has_other_numbers():
    found = number_by_kinds(chain(CELL, 3))
    others = (found.primitives, found.quantities, found.primitive, found.wires[::-1], found.reads)
    assert same(found, flat_numbers(chain(CELL, 3)))
    assert not same(Numbering(*others, found.junctions, found.outer, found.states), found)


def joined():
    """Two copies of a part that makes its two outer states one; what one stores, a reader of the other reads."""
    wire = Pattern.from_text(
        "a: displacement, exposed as state; b: displacement, exposed as state; a ~ b; c: charge; f: flux_linkage;"
        "e(q=c, p=f, a=~a); C(q=c); L(b=f)"
    )
    turn = ephs.gyrator({"q": Q.charge, "p": Q.flux_linkage, "~a": Q.displacement}, lambda a: [[0, 1 + a], [-1 - a, 0]])
    part = wire(e=turn, C=lib.capacitor(c=1.0), L=lib.inductor(l=1.0))
    top = Pattern.from_text(
        "j: displacement; k: displacement; m: displacement; s(q=j); v(a=~j, b=~k); w(a=~k, b=~m);"
        "c: charge; f: flux_linkage; r(q=c, p=f, a=~m); C(q=c); L(b=f)"
    )
    return top(s=lib.spring(k=2.0), v=part, w=part, r=turn, C=lib.capacitor(c=1.0), L=lib.inductor(l=1.0))


def test_a_part_that_joins_two_states_joins_those_around_it():
    system = joined()
    found = number_by_kinds(system)
    assert same(found, flat_numbers(system))
    assert set(found.reads[-4:].tolist()) >= {0}  # the last reader reads the spring's state, two parts away


def test_forgetting_what_parts_join_is_noticed(monkeypatch):
    monkeypatch.setattr(kinds, "_labels", lambda pattern, copies: np.arange(len(pattern.junctions)))
    assert number_by_kinds(joined()) is None


CELL = Pattern.from_text(
    "q: charge, exposed; b: flux_linkage; out: charge, exposed; s: entropy; left(q, b); right(q=out, b); coil(b);"
    "res(b, s); heat(s); cap(q=out)"
)(
    left=lib.emc(),
    right=ephs.gyrator({"q": Q.charge, "b": Q.flux_linkage}, [[0.0, -1.0], [1.0, 0.0]]),
    coil=lib.inductor(l=0.5),
    res=lib.resistor(r=0.3),
    heat=lib.thermal_capacity(c1=293.15 * 4.0, c2=4.0),
    cap=lib.capacitor(c=0.2),
)


def chain(part, count, ports=("q", "out")):
    """Copies of a part one behind the other; the first port of the first is open."""
    names = [f"j{i}" for i in range(count + 1)]
    quantity = part.interface[ports[0]].quantity
    junctions = {name: junction(quantity, exposed=name in (names[0], names[-1])) for name in names}
    boxes = {f"c{i}": dict(zip(ports, (names[i], names[i + 1]), strict=True)) for i in range(count)}
    return System.of(Pattern(junctions, boxes), dict.fromkeys(boxes, part))


def test_parts_of_parts_run_as_their_flattening_does():
    system = chain(chain(CELL, 5), 6, ("j0", "j5"))
    assert repeats(system) and not descriptor_of(system).system.is_flat
    run = {"initial": {"c2.c3.cap.q": 0.1}, "inputs": {"j0": {"effort": np.sin}, "j6": {"flow": 0.0}}, "step": 0.05}
    nested, flat = (ephs.simulate(one, 2.0, **run) for one in (system, system.flatten()))
    assert nested.states.keys() == flat.states.keys()
    for path in flat.states:
        np.testing.assert_array_equal(nested[path], flat[path])
    for totals in ("energy", "exergy", "entropy", "heat", "work"):
        np.testing.assert_array_equal(getattr(nested, totals), getattr(flat, totals))


def test_what_does_not_repeat_is_flattened():
    assert not repeats(chain(CELL, 2))
    assert descriptor_of(chain(CELL, 2)).system.is_flat


@pytest.mark.parametrize("fault", ["two-storages", "unread-state"])
def test_faults_inside_parts_are_named_as_in_the_flattened_system(fault):
    text = "q: displacement, exposed; x: charge; a(q); b(q); r(q)"
    part = Pattern.from_text(text.replace("x: charge; ", ""))(
        a=lib.spring(k=1.0), b=lib.spring(k=2.0), r=lib.spring(k=3.0)
    )
    if fault == "unread-state":
        read = ephs.gyrator({"c": Q.charge, "f": Q.flux_linkage, "~x": Q.displacement}, lambda x: [[0, x], [-x, 0]])
        part = Pattern.from_text("c: charge, exposed; f: flux_linkage; x: displacement; r(c, f, x=~x); L(b=f)")(
            r=read, L=lib.inductor(l=1.0)
        )
    (port,) = part.interface
    boxes = {f"c{i}": {port: f"j{i}"} for i in range(20)}
    junctions = {f"j{i}": junction(part.interface[port].quantity) for i in range(20)}
    system = System.of(Pattern(junctions, boxes), dict.fromkeys(boxes, part))
    assert repeats(system)
    with pytest.raises(AssemblyError) as raised:
        system.descriptor()
    assert raised.value.kind == fault
    assert str(raised.value.path).startswith("c0")


def test_frames_from_the_levels_above_are_no_part_of_numbers():
    part = Pattern.from_text("a: displacement, exposed as state; b: displacement; a ~ b; k(q=b)")(k=lib.spring(k=1.0))
    framed = Pattern(
        junctions={name: junction(Q.displacement.in_frame("world")) for name in ("x", "y")},
        boxes={"p": {"a": "~x"}, "q": {"a": "~y"}},
    )
    system = framed(p=part, q=part)
    assert "world" in {each.quantity.frame for each in system.flatten().pattern.junctions.values()}
    by_kinds, plain = Descriptor(system, number_by_kinds(system)), assemble(system.flatten())
    assert by_kinds.junctions == plain.junctions and len(plain.junctions) == 2
