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
    f = Pattern.from_text("q: displacement; a(q)")
    with pytest.raises(AttributeError):
        f.links = frozenset()
    assert f != "pattern"


# ---- refused


def patterns_of(texts):
    """What reads each of the texts."""
    return {name: lambda text=text: Pattern.from_text(text) for name, text in texts.items()}


WRITTEN = {
    "p5 equal": "a: displacement; a(q=a)",
    "p5 junction under box": "a.q: displacement; a(q=a.q)",
    "p5 box under junction": "q: displacement; q.a(q); b()",
    "junctions clash": "q: displacement; q.r: displacement; a(x=q, y=q.r)",
    "boxes clash": "q: displacement; a(x=q); a.b(x=q)",
    "ports clash": "q: displacement; a(x=q, x.y=q)",
    "junction given twice": "q: displacement; q: momentum; a(x=q)",
    "no such junction": "q: displacement; a(x=r)",
    "exposed junction without inner port": "q: displacement, exposed; a()",
    "floating junction": "q: displacement; p: momentum; a(q)",
    "floating junctions, linked": "q: displacement, exposed; r: displacement, exposed; a(); q ~ r",
    "linked handle without port": "q: displacement; r: displacement; a(x=q); q ~ r",
    "junctions without boxes": "q: displacement",
    "pass-through": "q: displacement, exposed; r: displacement, exposed; a(q)",
    "link of different quantities": "q: displacement; p: momentum; a(q, p); q ~ p",
    "link across frames": ("a: displacement @ A; b: displacement; c: displacement @ C; x(a, b, c); a ~ b; b ~ c"),
    "link to nowhere": "q: displacement; a(q); q ~ r",
}
REFUSED = patterns_of(WRITTEN) | {
    "link of one": lambda: Pattern({"q": junction(Q)}, {"a": {"q": "q"}}, [("q", "q")]),
    "link as text": lambda: Pattern({"q": junction(Q)}, {"a": {"q": "q"}}, ["q"]),
    "box at the root": lambda: Pattern({"q": junction(Q, exposed=True)}, {".": {"q": "q"}}),
    "junction at the root": lambda: Pattern({".": junction(Q)}, {}),
    "identity with a port at the root": lambda: Pattern.identity({".": PortType(Q, True)}),
    "port at the root": lambda: Pattern({"q": junction(Q)}, {"a": {".": "q"}}),
    "no junction": lambda: Pattern({"q": Q}, {"a": {"q": "q"}}),
    "no ports": lambda: Pattern({"q": junction(Q)}, {"a": "q"}),
    "no wire": lambda: Pattern({"q": junction(Q)}, {"a": {"q": 1}}),
    "no name": lambda: Pattern({"~q": junction(Q)}, {}),
    "identity's box renamed": lambda: Pattern.identity({"q": PortType(Q, True)}).rename(boxes={".": "a"}),
    "identity renamed differently inside and outside": lambda: Pattern.identity({"q": PortType(Q, True)}).rename(
        junctions={"q": "r"}, ports={".": {"q": "s"}}
    ),
    "renaming of nothing": lambda: Pattern.from_text("q: displacement; a(q)").rename(boxes={"b": "c"}),
    "renaming of no port": lambda: Pattern.from_text("q: displacement; a(q)").rename(ports={"a": {"p": "r"}}),
    "renaming to one name": lambda: Pattern.from_text("q: displacement; a(q); b()").rename(boxes={"a": "c", "b": "c"}),
    "renaming that clashes": lambda: Pattern.from_text("q: displacement; a(q)").rename(boxes={"a": "q.a"}),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_pattern_is_refused_in_any_process(case):
    """`words.json` has what is said."""
    with pytest.raises(PatternError) as caught:
        REFUSED[case]()
    error = caught.value
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.kind, again.box) == (str(error), error.kind, error.box)


ALLOWED = patterns_of(
    {
        "outer power port over state ports only": "q: displacement, exposed; a(~q); b(~q)",
        "outer state port over power ports": "q: displacement, exposed as state; a(q); b(q)",
        "outer ports of two boxes on one junction": "q: displacement; a(q); b(q)",
        "two ports of one box on one junction": "q: displacement; a(x=q, y=q)",
        "closed port": "q: displacement; a(q)",
        "ignored state port": "q: displacement; a(~q)",
        "box without ports": "a()",
        "empty pattern": "",
        "state read and stored by nobody": "q: displacement; a(x=~q); b(x=q)",
        "linked balances": "q: displacement; r: displacement; a(q, r); q ~ r",
        "link of a balance and a handle": "q: displacement; r: displacement; a(q, ~r); q ~ r",
        "exposed junction whose ports lie on a linked one": (
            "q: displacement, exposed as state; r: displacement; a(r); q ~ r"
        ),
    }
)


def test_the_empty_pattern_is_an_operation_without_inputs_and_outputs():
    empty = Pattern({}, {})
    assert empty.interface == Directory({})
    whole = Pattern.from_text("q: displacement; a(q); b()")
    assert whole.substitute(b=empty) == Pattern.from_text("q: displacement; a(q)")
    assert empty != Pattern({}, {"a": {}}) and empty != Pattern.identity({})


def test_power_speaks_of_the_exposure_only():
    boxes = {"a": {"q": "q"}}
    assert Pattern({"q": junction(Q, power=False)}, boxes) == Pattern({"q": junction(Q)}, boxes)
    assert Pattern({"q": junction(Q, True, False)}, boxes) != Pattern({"q": junction(Q, True)}, boxes)


def test_boxes_are_called_with_elements_of_an_algebra():
    calls = []
    f = Pattern.from_text("q: displacement; a.b(q); c(q)")

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
    f = Pattern.from_text("q: displacement; r: momentum; a(x=q, y=r); b(x=q)")
    g = f.rename(boxes={"a": "b", "b": "a"}, junctions={"q": "r", "r": "q"}, ports={"a": {"x": "y", "y": "x"}})
    assert g == Pattern.from_text("r: displacement; q: momentum; b(y=r, x=q); a(x=r)")
    assert f.rename() is f and ROOT not in g.boxes
