"""Substitution: the names it gives, what it absorbs, what it links, what it refuses."""

import pytest
from hypothesis import given

from ephs.operad import Directory, Nesting, Pattern, PatternError, PortType, junction, quantity
from ephs.testing import patterns

Q = quantity.displacement


def names(paths):
    return {str(path) for path in paths}


def test_damped_oscillator(models):
    flat = models.DAMPED.substitute(osc=models.OSCILLATOR)
    assert names(flat.junctions) == {"p", "s", "osc.q"}
    assert names(flat.boxes) == {"osc.pe", "osc.ke", "osc.pkc", "mf", "env"}
    assert flat == Pattern.from_text(
        "p: momentum; s: entropy; osc.q: displacement; osc.pe(q=osc.q); osc.ke(p); "
        "osc.pkc(q=osc.q, p); mf(p, s); env(s)"
    )
    assert flat == models.DAMPED.substitute({"osc": models.OSCILLATOR})


def absorbed(upper: Pattern, box: str, lower: Pattern) -> Pattern:
    """The naive substitution: an outer state port is absorbed like an outer power port."""
    powered = {p: junction(j.quantity, j.exposed) for p, j in lower.junctions.items()}
    wires = {
        b: {p: str(w).lstrip("~") if str(b) == box else str(w) for p, w in c.ports.items()}
        for b, c in upper.boxes.items()
    }
    boxes = {b: {p: str(w) for p, w in c.ports.items()} for b, c in lower.boxes.items()}
    return Pattern(upper.junctions, wires).substitute({box: Pattern(powered, boxes)})


def test_a_state_port_does_not_merge_power_balances():
    lower = Pattern.from_text("l: displacement, exposed as state; a(x=l); b(x=l)")
    upper = Pattern.from_text("j: displacement; box(l=~j); c(x=j); d(x=j)")
    whole, naive = upper.substitute(box=lower), absorbed(upper, "box", lower)
    assert names(whole.junctions) == {"j", "box.l"} and names(naive.junctions) == {"j"}
    assert [names(group) for group in whole.links] == [{"j", "box.l"}]
    assert whole != naive
    assert [(remark.kind, *map(str, remark.junctions)) for remark in whole.lint()] == [
        ("linked-balances", "box.l", "j")
    ]


@pytest.mark.parametrize(
    ("lower", "upper"),
    [
        ({"a": {"x": "l"}}, {"box": {"l": "~j"}, "c": {"x": "~j"}}),
        ({"a": {"x": "~l"}}, {"box": {"l": "~j"}, "c": {"x": "j"}}),
        ({"a": {"x": "~l"}}, {"box": {"l": "~j"}, "c": {"x": "~j"}}),
    ],
)
def test_where_one_side_bears_no_power_a_single_junction_is_left(lower, upper):
    inner = Pattern({"l": junction(Q, exposed=True, power=False)}, lower)
    whole = Pattern({"j": junction(Q)}, upper).substitute(box=inner)
    assert len(whole.junctions) == 1 and not whole.links and not whole.lint()


def test_a_lower_class_exposed_twice_joins_two_upper_classes():
    lower = Pattern.from_text("l: displacement, exposed as state; m: displacement, exposed as state; a(x=l); l ~ m")
    upper = Pattern.from_text("j: displacement; k: displacement; box(l=~j, m=~k); c(x=j); d(x=k)")
    whole = upper.substitute(box=lower)
    assert not upper.links and [names(group) for group in whole.links] == [{"box.l", "j", "k"}]
    # box.m was a mere handle, and is gone
    assert names(whole.junctions) == {"box.l", "j", "k"}


def test_links_of_absorbed_junctions_are_kept():
    lower = Pattern.from_text("l: displacement, exposed; m: displacement; a(x=l, y=m); l ~ m")
    upper = Pattern.from_text("j: displacement; box(l=j); c(x=j)")
    assert [names(group) for group in upper.substitute(box=lower).links] == [{"j", "box.m"}]


def test_two_ports_of_a_box_on_one_junction_absorb_two_lower_junctions():
    lower = Pattern.from_text("l: displacement, exposed; m: displacement, exposed; a(x=l); b(x=m)")
    upper = Pattern.from_text("j: displacement; box(l=j, m=j)")
    assert upper.substitute(box=lower) == Pattern.from_text("j: displacement; box.a(x=j); box.b(x=j)")


@given(patterns(state_ports=False, links=False))
def test_patterns_without_state_ports_substitute_without_links(f):
    assert not f.links
    assert all(port.power for box in f.boxes.values() for port in box.ports.values())
    whole = f.substitute(
        {
            box: Pattern(
                {p: junction(t.quantity, True) for p, t in c.interface.items()},
                {"x": {p: str(p) for p in c.ports}},
            )
            for box, c in f.boxes.items()
            if not any(str(p).split(".")[0] == "x" for p in c.ports)
        }
    )
    assert not whole.links


def test_what_fills_an_identity_is_in_the_frames_of_both():
    """And keeps all else: inner junctions, links, and what fills it in turn."""
    plain, tagged = PortType(Q), PortType(Q.in_frame("C"))
    lower = Pattern.from_text("q: displacement @ C, exposed; r: displacement @ C; s: momentum; a(q, r, s); q ~ r")
    deep = Pattern(
        {p: junction(t.quantity, True) for p, t in lower.boxes["a"].interface.items()},
        {"x": {"y": "q", "z": "r", "w": "s"}},
    )
    whole = Nesting(Pattern.identity({"q": plain}), {".": Nesting(lower, {"a": deep})}).flatten()
    assert whole.interface == Directory({"q": tagged})
    assert whole.junctions["r"] == junction(Q.in_frame("C")) and [names(g) for g in whole.links] == [{"q", "r"}]
    assert names(whole.boxes) == {"a.x"}
    inner = Nesting(Pattern.identity({"q": plain}), {".": Pattern.identity({"q": tagged})}).flatten()
    assert inner.is_identity and inner.interface == Directory({"q": tagged})
    with pytest.raises(PatternError, match=r"box b: .*differing q"):
        upper = Pattern.from_text("q: displacement; b(q)")
        wrong = Nesting(Pattern.identity({"q": plain}), {".": Pattern.from_text("q: momentum, exposed; x(q)")})
        Nesting(upper, {"b": wrong}).flatten()


def test_a_class_without_power_and_outer_name_is_named_by_its_shortest_path():
    lower = Pattern.from_text("a: displacement, exposed as state; x(q=~a)")
    upper = Pattern.from_text("z: displacement; b(a=~z); c(q=~z)")
    assert names(upper.substitute(b=lower).junctions) == {"z"}


def test_interfaces_stay_the_same_objects_where_no_frame_changes():
    lower = Pattern.from_text("q: displacement, exposed; r: displacement; x(q, r)")
    upper = Pattern.from_text("q: displacement; a(q)")
    assert upper.substitute(a=lower).boxes["a.x"].interface is lower.boxes["x"].interface
    framed = Pattern.from_text("q: displacement @ C; a(q)").substitute(a=lower)
    assert framed.boxes["a.x"].interface["q"].quantity == Q.in_frame("C")
    assert framed.boxes["a.x"].interface["r"].quantity == Q


UPPER = Pattern.from_text("q: displacement; s: entropy; a(q, s); b(s)")


def filling(**junctions) -> Pattern:
    return Pattern(junctions, {"x": {name: name for name in junctions}})


MISFITS = {
    "unknown box": {"c": filling()},
    "no pattern": {"a": "no pattern"},
    "missing port": {"a": filling(q=junction(Q, True))},
    "extra port": {"a": filling(q=junction(Q, True), s=junction(quantity.entropy, True), t=junction(Q, True))},
    "other quantity": {"a": filling(q=junction(quantity.momentum, True), s=junction(quantity.entropy, True))},
    "other kind of port": {"a": filling(q=junction(Q, True, False), s=junction(quantity.entropy, True))},
    "other name": {"a": filling(r=junction(Q, True), s=junction(quantity.entropy, True))},
}


def test_an_identity_refuses_what_does_not_fit():
    with pytest.raises(PatternError, match="missing q"):
        Pattern.identity({"q": PortType(Q, True)}).substitute({".": filling()})
