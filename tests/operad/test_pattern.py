"""What is a pattern and what is not, and what is said about it."""

import copy
import pickle

import pytest
from hypothesis import given

from ephs.operad import (  # noqa: F401  # what repr writes is evaluated here
    ROOT,
    Algebra,
    Box,
    Directory,
    Path,
    Pattern,
    PatternError,
    Port,
    PortType,
    Quantity,
    Space,
    junction,
    quantity,
)
from ephs.testing import patterns

Q = quantity.displacement
P = quantity.momentum


@given(patterns())
def test_a_pattern_reads_back(f):
    assert eval(repr(f)) == f == pickle.loads(pickle.dumps(f)) == copy.deepcopy(f)
    assert hash(eval(repr(f))) == hash(f)


@given(patterns())
def test_a_pattern_prints_as_a_tree_of_all_its_names(f):
    text = str(f)
    assert text.startswith(f.summary)
    for path in (*f.boxes, *f.junctions):
        assert str(path)[-1] in text and (path[-1] if path else ".") in text


@given(patterns())
def test_the_classes_partition_the_junctions(f):
    for path in f.junctions:
        members = f.state_class(path)
        assert path in members
        assert all(f.state_class(member) == members for member in members)
        assert (members in f.links) == (len(members) > 1)
        assert len({f.junctions[member].quantity for member in members}) == 1


@given(patterns())
def test_the_outer_ports_are_the_exposed_junctions(f):
    exposed = {path: j for path, j in f.junctions.items() if j.exposed}
    assert set(f.interface) == set(exposed)
    assert all(f.interface[path] == PortType(j.quantity, j.power) for path, j in exposed.items())


def test_boxes_may_be_written_in_any_form():
    j = {"q": junction(Q)}
    forms = (
        {"a": {"q": "~q"}},
        {"a": {"q": Port(Path.parse("q"), False)}},
        [("a", [("q", "~q")])],
        {("a",): Directory({"q": Port(Path.parse("q"), False)})},
    )
    first, *others = (Pattern(j, {k: dict(v) for k, v in dict(form).items()}) for form in forms)
    assert all(other == first for other in others)
    assert Pattern(j, {"a": first.boxes["a"]}) == first and isinstance(first.boxes["a"], Box)


def test_a_pattern_cannot_be_changed():
    f = Pattern({"q": junction(Q)}, {"a": {"q": "q"}})
    with pytest.raises(AttributeError):
        f.links = frozenset()
    assert f != "pattern"


# ---- refused
# ---------------------------------------------------------------------------------------------------

REFUSED = {
    "p5 equal": (
        lambda: Pattern({"a": junction(Q)}, {"a": {"q": "a"}}),
        {"kind": "p5", "box": "a", "junction": "a"},
    ),
    "p5 junction under box": (
        lambda: Pattern({"a.q": junction(Q)}, {"a": {"q": "a.q"}}),
        {"kind": "p5", "box": "a", "junction": "a.q"},
    ),
    "p5 box under junction": (
        lambda: Pattern({"q": junction(Q)}, {"q.a": {"q": "q"}, "b": {}}),
        {"kind": "p5", "box": "q.a", "junction": "q"},
    ),
    "junctions clash": (
        lambda: Pattern({"q": junction(Q), "q.r": junction(Q)}, {"a": {"x": "q", "y": "q.r"}}),
        {"kind": "prefix", "found": "q and q.r"},
    ),
    "boxes clash": (
        lambda: Pattern({"q": junction(Q)}, {"a": {"x": "q"}, "a.b": {"x": "q"}}),
        {"kind": "prefix", "found": "a and a.b"},
    ),
    "ports clash": (
        lambda: Pattern({"q": junction(Q)}, {"a": {"x": "q", "x.y": "q"}}),
        {"kind": "prefix", "found": "x and x.y"},
    ),
    "junction given twice": (
        lambda: Pattern([("q", junction(Q)), ("q", junction(P))], {"a": {"x": "q"}}),
        {"kind": "duplicate", "found": "q"},
    ),
    "no such junction": (
        lambda: Pattern({"q": junction(Q)}, {"a": {"x": "r"}}),
        {"kind": "unknown-junction", "box": "a", "port": "x", "junction": "r", "expected": "q"},
    ),
    "exposed junction without inner port": (
        lambda: Pattern({"q": junction(Q, exposed=True)}, {"a": {}}),
        {"kind": "no-inner-port", "junction": "q"},
    ),
    "floating junction": (
        lambda: Pattern({"q": junction(Q), "p": junction(P)}, {"a": {"q": "q"}}),
        {"kind": "no-inner-port", "junction": "p"},
    ),
    "floating junctions, linked": (
        lambda: Pattern({"q": junction(Q, True), "r": junction(Q, True)}, {"a": {}}, [("q", "r")]),
        {"kind": "no-inner-port"},
    ),
    "linked handle without port": (
        lambda: Pattern({"q": junction(Q), "r": junction(Q)}, {"a": {"x": "q"}}, [("q", "r")]),
        {"kind": "no-inner-port", "junction": "r"},
    ),
    "junctions without boxes": (
        lambda: Pattern({"q": junction(Q)}, {}),
        {"kind": "no-inner-port", "junction": "q"},
    ),
    "pass-through": (
        lambda: Pattern({"q": junction(Q, exposed=True), "r": junction(Q, exposed=True)}, {"a": {"q": "q"}}),
        {"kind": "no-inner-port", "junction": "r"},
    ),
    "link of different quantities": (
        lambda: Pattern({"q": junction(Q), "p": junction(P)}, {"a": {"q": "q", "p": "p"}}, [("q", "p")]),
        {"kind": "link-quantity", "junction": "p and q"},
    ),
    "link across frames": (
        lambda: Pattern(
            {"a": junction(Q.in_frame("A")), "b": junction(Q), "c": junction(Q.in_frame("C"))},
            {"x": {"a": "a", "b": "b", "c": "c"}},
            [("a", "b"), ("b", "c")],
        ),
        {"kind": "frames", "junction": "a"},
    ),
    "link to nowhere": (
        lambda: Pattern({"q": junction(Q)}, {"a": {"q": "q"}}, [("q", "r")]),
        {"kind": "link-junction", "junction": "r", "expected": "q"},
    ),
    "link of one": (
        lambda: Pattern({"q": junction(Q)}, {"a": {"q": "q"}}, [("q", "q")]),
        {"kind": "link-size"},
    ),
    "link as text": (lambda: Pattern({"q": junction(Q)}, {"a": {"q": "q"}}, ["q"]), {"kind": "link-size"}),
    "box at the root": (
        lambda: Pattern({"q": junction(Q, exposed=True)}, {".": {"q": "q"}}),
        {"kind": "root-box", "box": "."},
    ),
    "junction at the root": (
        lambda: Pattern({".": junction(Q)}, {}),
        {"kind": "root-junction", "junction": "."},
    ),
    "identity with a port at the root": (
        lambda: Pattern.identity({".": PortType(Q, True)}),
        {"kind": "root-junction"},
    ),
    "port at the root": (
        lambda: Pattern({"q": junction(Q)}, {"a": {".": "q"}}),
        {"kind": "root-port", "box": "a", "port": "."},
    ),
    "no junction": (lambda: Pattern({"q": Q}, {"a": {"q": "q"}}), {"kind": "junction-type", "junction": "q"}),
    "no ports": (lambda: Pattern({"q": junction(Q)}, {"a": "q"}), {"kind": "box-type", "box": "a"}),
    "no wire": (
        lambda: Pattern({"q": junction(Q)}, {"a": {"q": 1}}),
        {"kind": "port-type", "box": "a", "port": "q", "found": "1"},
    ),
    "no name": (lambda: Pattern({"~q": junction(Q)}, {}), {"kind": "name"}),
    "identity's box renamed": (
        lambda: Pattern.identity({"q": PortType(Q, True)}).rename(boxes={".": "a"}),
        {"kind": "root-rename", "box": "."},
    ),
    "identity renamed differently inside and outside": (
        lambda: Pattern.identity({"q": PortType(Q, True)}).rename(junctions={"q": "r"}, ports={".": {"q": "s"}}),
        {"kind": "root-rename", "found": "q, ."},
    ),
    "renaming of nothing": (
        lambda: Pattern({"q": junction(Q)}, {"a": {"q": "q"}}).rename(boxes={"b": "c"}),
        {"kind": "rename", "found": "b", "expected": "a"},
    ),
    "renaming of no port": (
        lambda: Pattern({"q": junction(Q)}, {"a": {"q": "q"}}).rename(ports={"a": {"p": "r"}}),
        {"kind": "rename", "found": "p", "expected": "q"},
    ),
    "renaming to one name": (
        lambda: Pattern({"q": junction(Q)}, {"a": {"q": "q"}, "b": {}}).rename(boxes={"a": "c", "b": "c"}),
        {"kind": "duplicate", "found": "c"},
    ),
    "renaming that clashes": (
        lambda: Pattern({"q": junction(Q)}, {"a": {"q": "q"}}).rename(boxes={"a": "q.a"}),
        {"kind": "p5", "box": "q.a", "junction": "q"},
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_pattern_is_refused(case):
    make, facts = REFUSED[case]
    with pytest.raises(PatternError) as caught:
        make()
    error = caught.value
    assert {name: getattr(error, name) for name in facts} == facts
    assert all(str(value) in str(error) for name, value in facts.items() if name != "kind")
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.kind, again.box) == (str(error), error.kind, error.box)
    assert isinstance(error, ValueError)


def test_a_passed_through_port_is_told_to_fork_outside():
    with pytest.raises(PatternError, match="fork outside: expose it once"):
        REFUSED["pass-through"][0]()


# ---- allowed
# ---------------------------------------------------------------------------------------------------

ALLOWED = {
    "outer power port over state ports only": (
        lambda: Pattern({"q": junction(Q, exposed=True)}, {"a": {"q": "~q"}, "b": {"q": "~q"}}),
        ["open-circuit"],
    ),
    "outer state port over power ports": (
        lambda: Pattern({"q": junction(Q, exposed=True, power=False)}, {"a": {"q": "q"}, "b": {"q": "q"}}),
        [],
    ),
    "outer ports of two boxes on one junction": (
        lambda: Pattern({"q": junction(Q)}, {"a": {"q": "q"}, "b": {"q": "q"}}),
        [],
    ),
    "two ports of one box on one junction": (
        lambda: Pattern({"q": junction(Q)}, {"a": {"x": "q", "y": "q"}}),
        [],
    ),
    "closed port": (lambda: Pattern({"q": junction(Q)}, {"a": {"q": "q"}}), []),
    "ignored state port": (lambda: Pattern({"q": junction(Q)}, {"a": {"q": "~q"}}), []),
    "box without ports": (lambda: Pattern({}, {"a": {}}), []),
    "empty pattern": (lambda: Pattern({}, {}), []),
    "state read and stored by nobody": (
        lambda: Pattern({"q": junction(Q)}, {"a": {"x": "~q"}, "b": {"x": "q"}}),
        [],
    ),
    "linked balances": (
        lambda: Pattern({"q": junction(Q), "r": junction(Q)}, {"a": {"q": "q", "r": "r"}}, [("q", "r")]),
        ["linked-balances"],
    ),
    "link of a balance and a handle": (
        lambda: Pattern({"q": junction(Q), "r": junction(Q)}, {"a": {"q": "q", "r": "~r"}}, [("q", "r")]),
        [],
    ),
    "exposed junction whose ports lie on a linked one": (
        lambda: Pattern({"q": junction(Q, True, False), "r": junction(Q)}, {"a": {"r": "r"}}, [("q", "r")]),
        [],
    ),
}


@pytest.mark.parametrize("case", ALLOWED)
def test_what_is_allowed_is_remarked_on_where_it_is_hardly_meant(case):
    make, kinds = ALLOWED[case]
    f = make()
    assert [remark.kind for remark in f.lint()] == kinds
    for remark in f.lint():
        assert all(str(path) in str(remark) for path in remark.junctions)


def test_the_empty_pattern_is_an_operation_without_inputs_and_outputs():
    empty = Pattern({}, {})
    assert empty.interface == Directory({})
    whole = Pattern({"q": junction(Q)}, {"a": {"q": "q"}, "b": {}})
    assert whole.substitute(b=empty) == Pattern({"q": junction(Q)}, {"a": {"q": "q"}})
    assert empty != Pattern({}, {"a": {}}) and empty != Pattern.identity({})


def test_power_speaks_of_the_exposure_only():
    boxes = {"a": {"q": "q"}}
    assert Pattern({"q": junction(Q, power=False)}, boxes) == Pattern({"q": junction(Q)}, boxes)
    assert Pattern({"q": junction(Q, True, False)}, boxes) != Pattern({"q": junction(Q, True)}, boxes)


def test_boxes_are_called_with_elements_of_an_algebra():
    calls = []
    f = Pattern({"q": junction(Q)}, {"a.b": {"q": "q"}, "c": {"q": "q"}})

    class Element:
        interface = f.boxes["c"].interface

        @property
        def algebra(self):
            return algebra

    def compose(pattern, fillings):
        calls.append((pattern, fillings))
        return "composed"

    algebra = Algebra("own", lambda element: getattr(element, "interface", None), compose)
    one, two = Element(), Element()
    assert f({"c": two}, **{"a.b": one}) == "composed"
    assert calls == [(f, {Path.parse("a.b"): one, Path.parse("c"): two})]
    with pytest.raises(PatternError, match="c is given twice"):
        f({"c": one}, c=two)


def test_names_may_be_swapped():
    f = Pattern({"q": junction(Q), "r": junction(P)}, {"a": {"x": "q", "y": "r"}, "b": {"x": "q"}})
    g = f.rename(boxes={"a": "b", "b": "a"}, junctions={"q": "r", "r": "q"}, ports={"a": {"x": "y", "y": "x"}})
    assert g == Pattern({"r": junction(Q), "q": junction(P)}, {"b": {"y": "r", "x": "q"}, "a": {"x": "r"}})
    assert f.rename() is f and ROOT not in g.boxes
