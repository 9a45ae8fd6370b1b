"""The laws of the operad, by equality of data, on drawn patterns."""

from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import Phase, find, given, settings
from hypothesis import strategies as st

from ephs.operad import LAWS, ROOT, Directory, Path, Pattern, Port, Quantity, junction, law
from ephs.testing import check_operad_laws, law_inputs, nestings, patterns

ALL = [
    "left unit",
    "right unit",
    "sequential associativity",
    "parallel associativity",
    "full substitution",
    "equivariance in boxes",
    "equivariance in junctions",
    "equivariance in ports",
    "flattening from below",
    "flattening from above",
    "interface",
]


def test_every_law_is_stated_once():
    assert [law.name for law in LAWS] == ALL


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
@settings(max_examples=4 * settings().max_examples)
@given(data=st.data())
def test_law(law, data):
    equation = law(*data.draw(law_inputs(law)))
    assert equation.holds, f"{law.statement}\n{equation}"


@pytest.mark.parametrize("name", ["left unit", "right unit", "interface"])
def test_no_law_holds_of_a_substitution_that_forgets_what_it_is_given(name, monkeypatch):
    """A law of which a wrong substitution is no counterexample says nothing; the others compare two of them."""
    law = next(law for law in LAWS if law.name == name)

    def forgetful(nesting):
        return Pattern({}, {}) if nesting.children else nesting.pattern

    def fails(inputs):
        monkeypatch.setattr("ephs.operad.substitution.flatten", forgetful)
        try:
            return not law(*inputs).holds
        except Exception:  # names of what was forgotten are not there: that is seen, too
            return True
        finally:
            monkeypatch.undo()

    find(
        law_inputs(law),
        fails,
        settings=settings(max_examples=500, database=None, deadline=None, phases=[Phase.generate]),
    )


def test_hashes_tell_patterns_and_directories_apart():
    texts = [f"q: angle; {'; '.join(f'b{k}(q)' for k in range(count))}" for count in range(1, 9)]
    assert len({hash(Pattern.from_text(text)) for text in texts}) > 4
    assert len({hash(Directory({"a": k})) for k in range(8)}) > 4
    assert Directory({}) != 5 and Directory({}) != {} and Pattern({}, {}) != 5


@settings(max_examples=2 * settings().max_examples)
@given(nestings(max_depth=3))
def test_nestings_flatten_alike_from_above_and_from_below(nesting):
    whole = nesting.flatten()
    assert whole == nesting.bottom_up() == nesting.top_down()
    assert hash(whole) == hash(nesting.bottom_up()) == hash(nesting.top_down())
    assert list(whole.boxes) == list(nesting.bottom_up().boxes)
    # What is made without checks would pass them.
    if not whole.is_identity:
        again = Pattern(whole.junctions, whole.boxes, whole.links)
        assert again == whole and again.boxes == whole.boxes and again.links == whole.links
    assert len(whole.boxes) == nesting.size
    assert whole.interface == nesting.pattern.interface


@given(patterns(), st.randoms(use_true_random=False))
def test_patterns_are_equal_up_to_order(f, random):
    if f.is_identity:
        return
    junctions, boxes, links = list(f.junctions.items()), list(f.boxes.items()), [sorted(g) for g in f.links]
    for each in (junctions, boxes, links, *links):
        random.shuffle(each)
    # A chain of pairs generates the same relation as the group.
    pairs = [pair for group in links for pair in pairwise(group)]
    again = Pattern(junctions, boxes, pairs)
    assert again == f and hash(again) == hash(f) and again.links == f.links


@given(patterns(identities=False), st.data())
def test_another_wire_makes_another_pattern(f, data):
    """Equality is not too coarse: it sees a port moved to another junction, and a port's kind changed."""
    places = [(b, p) for b, box in f.boxes.items() for p in box.ports]
    if not places:
        return
    box, name = data.draw(st.sampled_from(places))
    port = f.boxes[box].ports[name]
    wires = {b: dict(content.ports) for b, content in f.boxes.items()}
    # A new box keeps both junctions from being without ports.
    new = Path.parse("new.junction")
    wires[Path.parse("new.box")] = {Path.parse(p): Port(j, True) for p, j in (("x", port.junction), ("y", new))}
    junctions = {**f.junctions, new: junction(f.junctions[port.junction].quantity)}

    def rewired(wire):
        return Pattern(junctions, {**wires, box: {**wires[box], name: wire}}, f.links)

    assert rewired(port) != rewired(Port(new, port.power))
    assert rewired(port) != rewired(Port(port.junction, not port.power))


@given(patterns(identities=False), st.data())
def test_another_exposure_or_quantity_makes_another_pattern(f, data):
    if not f.junctions:
        return
    path = data.draw(st.sampled_from(list(f.junctions)))
    old = f.junctions[path]
    kinds = [junction(old.quantity), junction(old.quantity, True), junction(old.quantity, True, False)]
    wires = {**f.boxes, "new.box": {"x": str(path)}}
    assert len({Pattern({**f.junctions, path: kind}, wires, f.links) for kind in kinds}) == 3
    other = Quantity("other", old.quantity.space, 1)
    changed = {p: replace(f.junctions[p], quantity=other) for p in f.state_class(path)}
    assert Pattern({**f.junctions, **changed}, f.boxes, f.links) != f


@given(patterns(links=False, identities=False), st.data())
def test_a_link_makes_another_pattern(f, data):
    paths = [(a, b) for a in f.junctions for b in f.junctions if a < b]
    paths = [(a, b) for a, b in paths if f.junctions[a].quantity == f.junctions[b].quantity]
    if not paths:
        return
    linked = Pattern(f.junctions, f.boxes, [data.draw(st.sampled_from(paths))])
    assert linked != f and Pattern(f.junctions, f.boxes) == f


def test_names_that_stay_need_not_be_given(models):
    for name in ("equivariance in boxes", "equivariance in junctions", "equivariance in ports"):
        assert law(name)(models.DAMPED, Path.parse("osc"), models.OSCILLATOR, {}).holds


def test_what_cannot_be_a_path_is_no_key():
    with pytest.raises(KeyError, match="~x"):
        Directory({"x": 1})["~x"]


def test_the_check_for_other_suites_finds_nothing():
    check_operad_laws(max_examples=5)


@given(patterns())
def test_identities_are_strict(f):
    assert Pattern.identity(f.interface).substitute({".": f}) is f
    units = {box: Pattern.identity(content.interface) for box, content in f.boxes.items()}
    assert f.substitute(units) == f and f.substitute(units).junctions == f.junctions
    assert f.substitute() is f
    assert (ROOT in f.boxes) == f.is_identity


@settings(max_examples=20)
@given(patterns(min_boxes=2, max_boxes=2))
def test_the_boxes_interfaces_follow_from_their_junctions(f):
    for content in f.boxes.values():
        for name, port in content.ports.items():
            found = content.interface[name]
            assert (found.quantity, found.power) == (f.junctions[port.junction].quantity, port.power)
