"""Frames: a state has one at most, and all bracketings of a composite agree on it, or none is defined."""

import pytest
from hypothesis import Phase, assume, find, given, settings
from hypothesis import strategies as st

from ephs import System
from ephs.operad import Junction, Nesting, Path, Pattern, PatternError, PortType, junction, quantity
from ephs.testing import nestings, reversibles

Q = quantity.displacement
FRAMES = st.sampled_from([None, None, "A", "B"])
FINDING = settings(max_examples=5000, database=None, deadline=None, phases=[Phase.generate])
few = st.sampled_from([Q, quantity.momentum])


@st.composite
def framed(draw, nesting):
    """The nesting with other frames at all levels: those of two levels need not agree."""
    f = nesting.pattern
    frames = {group: draw(FRAMES) for group in sorted({min(f.state_class(path)) for path in f.junctions})}
    quantities = {path: j.quantity.in_frame(frames[min(f.state_class(path))]) for path, j in f.junctions.items()}
    if f.is_identity:
        pattern = Pattern.identity({path: PortType(quantities[path], t.power) for path, t in f.interface.items()})
    else:
        junctions = {path: Junction(quantities[path], j.exposed, j.power) for path, j in f.junctions.items()}
        pattern = Pattern(junctions, f.boxes, f.links)
    return Nesting(pattern, {box: draw(framed(child)) for box, child in nesting.children.items()})


drawn = nestings(of=few).flatmap(framed)


def one_by_one(nesting):
    """Every box in turn, the innermost ones last, in the opposite order of `Nesting.top_down`."""
    result, pending = nesting.pattern, list(nesting.children.items())
    while pending:
        box, child = pending.pop()
        result = result.substitute({box: child.pattern})
        pending += [(box / inner, grandchild) for inner, grandchild in child.children.items()]
    return result


ORDERS = [Nesting.flatten, Nesting.bottom_up, Nesting.top_down, one_by_one]


def outcome(make, *arguments):
    """The value, or None where a state has two frames."""
    try:
        return make(*arguments)
    except PatternError as error:
        assert error.kind == "frames"
        return None


def agree(nesting):
    found = [outcome(order, nesting) for order in ORDERS]
    return all(each == found[0] for each in found)


@settings(max_examples=200)
@given(drawn)
def test_all_orders_of_substitution_agree(nesting):
    assert agree(nesting)


def conflicting(nesting):
    return outcome(Nesting.flatten, nesting) is None


def gained(nesting):
    found = outcome(Nesting.flatten, nesting)
    return found is not None and found.interface != nesting.pattern.interface


def lifted(nesting):
    """A box gains a frame from the level above it."""
    found = outcome(Nesting.flatten, nesting)
    return found is not None and any(
        found.boxes[box / name].interface != content.interface
        for box, child in nesting.children.items()
        for name, content in child.pattern.boxes.items()
        if name not in child.children and not child.pattern.is_identity
    )


@pytest.mark.parametrize("reached", [conflicting, gained, lifted])
def test_what_is_drawn(reached):
    find(drawn, reached, settings=FINDING)


def test_orders_differ_where_frames_match_as_a_wildcard(monkeypatch):
    """The control: a junction keeps its own frame, or none, whatever comes to it."""

    def wildcard(junctions, at, kind, box, port):
        mine, other = junctions[at].quantity.frame, kind.frame
        if None not in (mine, other) and mine != other:
            raise PatternError("frames", box=box, junction=at, found=other, expected=mine)
        return False

    monkeypatch.setattr("ephs.operad.substitution.met", wildcard)
    find(drawn, lambda n: not agree(n), settings=FINDING)


@st.composite
def composites(draw):
    """A nesting, and a component for each open box, in frames of its own."""
    nesting = draw(nestings(of=few, max_depth=2).flatmap(framed))

    def components(inner, path):
        for box, content in inner.pattern.boxes.items():
            if box in inner.children:
                yield from components(inner.children[box], path / box)
                continue
            ports = {p: PortType(t.quantity.in_frame(draw(FRAMES)), t.power) for p, t in content.interface.items()}
            reads = tuple(p for p, t in ports.items() if not t.power)
            yield path / box, draw(reversibles(ports, reads=reads))

    return nesting, dict(components(nesting, Path()))


def names(paths):
    return set(map(str, paths))


def nested(nesting, components, path=Path()):  # noqa: B008 - a path is a value
    parts = {
        box: nested(nesting.children[box], components, path / box)
        if box in nesting.children
        else components[path / box]
        for box in nesting.pattern.boxes
    }
    return System.of(nesting.pattern, parts)


def flat(nesting, components):
    return System.of(nesting.flatten(), components)


@given(composites())
def test_systems_are_defined_by_all_routes_or_by_none(composite):
    one, other = outcome(nested, *composite), outcome(flat, *composite)
    assert (one is None) == (other is None)
    assume(one is not None)
    assert one.flatten() == other and one.interface == other.interface


def test_a_subsystem_that_shows_one_state_at_two_ports_unites_their_frames():
    inside = Pattern.from_text("x: displacement, exposed; y: displacement, exposed; a(x, y); x ~ y")
    (part,) = inside.boxes.values()
    of = find(reversibles(part.interface), lambda _: True, settings=FINDING)
    subsystem = System.of(inside, {"a": of})
    middle = System.of(
        Pattern.from_text("v: displacement, exposed; w: displacement, exposed; s(x=v, y=w)"), {"s": subsystem}
    )
    assert [names(group) for group in (*subsystem.shared_ports, *middle.shared_ports)] == [{"x", "y"}, {"v", "w"}]
    for frames, expected in ((("A", None), {"A"}), ((None, None), {None})):
        j, k = (junction(Q.in_frame(frame), True) for frame in frames)
        found = System.of(Pattern({"j": j, "k": k}, {"s": {"v": "j", "w": "k"}}), {"s": middle})
        assert {t.quantity.frame for t in found.interface.values()} == expected
    outer = Pattern.from_text("j: displacement @ A; k: displacement @ B; s(v=j, w=k)")
    with pytest.raises(
        PatternError, match="one state in two frames: found frame A at junction j, frame B at junction k"
    ):
        System.of(outer, {"s": middle})


def test_the_conflict_names_both_places():
    lower = Pattern.from_text("q: displacement @ C, exposed; a(q)")
    upper = Pattern.from_text("j: displacement @ B; box(q=j)")
    with pytest.raises(PatternError, match=r"frame B at junction j, frame C at box box, port q") as caught:
        upper.substitute(box=lower)
    assert (str(caught.value.box), str(caught.value.junction)) == ("box", "j")
