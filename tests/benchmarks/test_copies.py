"""Copies of one part in a system: what is inside each, by the numbers of the flattened system."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from benchmarks.copies import copies_of
from ephs import AssemblyError, Pattern, System, junction
from ephs import library as lib
from ephs import quantity as Q
from ephs.semantics import Storage
from ephs.semantics.descriptor.descriptor import descriptor_of
from ephs.testing import fillings, nestings, systems


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


def wired(numbering):
    """The components on each junction."""
    ports = [len(numbering.primitives[i].bundle.ports) for i in numbering.primitive]
    owner = np.repeat(np.arange(numbering.primitive.size), ports)
    return [set(owner[numbering.wires == i].tolist()) for i in range(numbering.junctions.size)]


@settings(max_examples=60)
@given(repeating())
def test_contents_of_copies_lie_together_and_alike(system):
    """Inner junctions bear ports of the copy's components alone, and those of each copy as those of the first."""
    try:
        descriptor = descriptor_of(system)
    except AssemblyError:
        return  # a state is stored twice or nowhere
    n = descriptor.numbering
    on, outer = wired(n), set(n.outer.tolist())
    stores = [(i, each) for i, (_, each) in enumerate(system.leaves()) if isinstance(each, Storage)]
    owners = [i for i, each in stores for _ in each.bundle.ports]
    found = copies_of(system)
    for each in found:
        first = [numbers[0] for numbers in (each.states, each.junctions, each.components)]
        for states, junctions, components in zip(each.states, each.junctions, each.components, strict=True):
            assert all(np.all(np.diff(numbers) == 1) for numbers in (states, junctions, components))
            inside = set(components.tolist())
            assert not outer & set(junctions.tolist()) and all(on[i] <= inside for i in junctions)
            assert {owners[i] for i in states} <= inside
            shift = components[0] - first[2][0]
            assert [{i - shift for i in on[j]} for j in junctions] == [on[j] for j in first[1]]
            assert np.array_equal(n.states[states], n.states[first[0]])
    # inner copies come first
    sizes = [each.components.shape[1] for each in found]
    assert all(size <= max(sizes[i:]) for i, size in enumerate(sizes))


def test_parts_that_differ_by_numbers_are_of_one_shape():
    cells = [remade(CELL) for _ in range(20)]
    level = chain(CELL, 20)
    system = System.of(level.pattern, dict(zip(level.pattern.boxes, cells, strict=True)))
    (found,) = copies_of(system)
    assert found.components.shape == (20, len(CELL.fillings))


def test_parts_that_read_other_ports_are_of_several_shapes():
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
    assert len(copies_of(system)) == 2


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
    assert [each.components.shape[0] for each in copies_of(system)] == [30, 6]
    run = {"initial": {"c2.c3.cap.q": 0.1}, "inputs": {"j0": {"effort": np.sin}, "j6": {"flow": 0.0}}, "step": 0.05}
    nested, flat = (ephs.simulate(one, 2.0, **run) for one in (system, system.flatten()))
    assert nested.states.keys() == flat.states.keys()
    for path in flat.states:
        np.testing.assert_array_equal(nested[path], flat[path])
    for totals in ("energy", "exergy", "entropy", "heat", "work"):
        np.testing.assert_array_equal(getattr(nested, totals), getattr(flat, totals))


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
    with pytest.raises(AssemblyError) as raised:
        system.descriptor()
    assert raised.value.kind == fault
    assert str(raised.value.path).startswith("c0")
