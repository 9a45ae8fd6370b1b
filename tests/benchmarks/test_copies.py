"""Copies of one part in a system: what is inside each, by the numbers of the flattened system."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.copies import copies_of
from ephs import AssemblyError, Pattern, System, junction
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
