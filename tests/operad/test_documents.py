"""Patterns as documents: dictionaries, JSON, the compact text form, and back."""

import contextlib
import json

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.operad import Path, Pattern, PatternError, Quantity, Space, junction, quantity
from ephs.operad.documents import SCHEMA_FILE
from ephs.testing import law_inputs, nestings, paths, patterns, quantities
from tests.processes import printed

SCHEMA = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
Q = quantity.displacement


@given(patterns())
def test_round_trips_are_exact(f):
    for again in (Pattern.from_json(f.to_json()), Pattern.from_dict(f.to_dict()), Pattern.from_text(f.to_text())):
        assert again == f and again.interface == f.interface
    # The text form keeps names and order too.
    again = Pattern.from_text(f.to_text())
    assert list(again.junctions.items()) == list(f.junctions.items()) and list(again.boxes) == list(f.boxes)
    assert again.links == f.links


@given(patterns())
def test_documents_keep_to_the_schema(f):
    jsonschema.validate(f.to_dict(), SCHEMA)
    assert json.loads(f.to_json()) == f.to_dict()


@given(nestings(max_depth=3), st.randoms(use_true_random=False))
def test_equal_patterns_have_equal_texts(nesting, random):
    f = nesting.flatten()
    assert nesting.top_down().to_json() == f.to_json() == nesting.bottom_up().to_json()
    if not f.is_identity:
        junctions, boxes = list(f.junctions.items()), list(f.boxes.items())
        random.shuffle(junctions)
        random.shuffle(boxes)
        assert Pattern(junctions, boxes, f.links).to_json() == f.to_json()


@given(patterns(), patterns())
def test_different_patterns_have_different_texts(f, g):
    assert (f.to_json() == g.to_json()) == (f == g)


def test_texts_are_the_same_in_every_process():
    code = "from tests.operad.models import JOINT; print(JOINT.to_json(), JOINT.canonical_hash())"
    assert printed(code, PYTHONHASHSEED="1") == printed(code, PYTHONHASHSEED="2")


@given(quantities())
def test_quantities_in_documents(q):
    f = Pattern({"q": junction(q)}, {"a": {"x": "q"}})
    assert Pattern.from_json(f.to_json()).junctions["q"].quantity == q
    assert Pattern.from_text(f.to_text()).junctions["q"].quantity == q


@pytest.mark.parametrize(
    "q",
    [
        Quantity("spin", Space("SU(2)", 3, 4, (("ħ", 1.0545718e-34),)), -1, frame="lab bench"),
        Quantity("pose", Space("SE(3)", 6, 7), -1),
        Quantity("strain", Space("real", 3, 3), 1, domain=(float("-inf"), 1.0), unit="1"),
        quantity.species("Fe3+", **{"Fe": 1, "e-": -3}).in_frame("wall"),
        Quantity("relative_pose", Space("screw", 1, 1), 1),
        quantity.relative_pose("screw", pitch=-1e-300),
        quantity.joint_momentum("screw", pitch=0.1).in_frame("C₁"),
    ],
)
def test_other_quantities_in_documents(q):
    f = Pattern({"q": junction(q, True, False)}, {"a": {"x": "~q"}})
    assert Pattern.from_json(f.to_json()).junctions["q"].quantity == q
    assert Pattern.from_text(f.to_text()).junctions["q"].quantity == q
    jsonschema.validate(f.to_dict(), SCHEMA)


NAMES = st.text(st.characters(exclude_categories=["C", "Z"], exclude_characters="."), min_size=1, max_size=5)


@given(st.lists(NAMES.filter(lambda name: not name.startswith("~")), min_size=3, max_size=3, unique=True))
def test_any_name_survives(names):
    a, b, c = names
    f = Pattern({(a, "x"): junction(Q)}, {(b,): {(c, "y"): Path((a, "x"))}})
    assert Pattern.from_json(f.to_json()) == f == Pattern.from_text(f.to_text())


def test_the_text_form_is_what_one_would_write(models):
    assert (
        Pattern.from_text(
            """
            q: displacement            # the spring's length
            p: momentum, exposed
            pe(q); ke(p); pkc(q, p)
            """
        )
        == models.OSCILLATOR
    )
    assert models.JOINT.to_text().splitlines()[-5:] == [
        "hc(q_r=~q_r, p_j1, p_j2, p_r)".replace("q_r=~q_r", "~q_r"),
        "pe(q_r)",
        "pkc(q_r, p_r)",
        "mf(p_r, s)",
        "env(s)",
    ]


BROKEN_TEXT = (
    "q: distance\na(q)",
    "q: displacement; a(q",
    "q: displacement\na(q) b(q)",
    "q: displacement\n\na(r)",
    "q displacement",
    "q: displacement, hidden\na(q)",
    "q: displacement, exposed as power\na(q)",
    "q: relative_pose(screw)\na(q)",
    "q: relative_pose(screw, pitch=steep)\na(q)",
    "q: relative_pose(hinge)\na(q)",
    "q: displacement\nq: displacement\na(q)",
    "q: displacement\na(q, q)",
    "q: displacement\n.(q)",
    "q: displacement @ \na(q)",
    'q: {"kind": 1}\na(q)',
    'q: {"kind"\na(q)',
    '"q: displacement',
    "a()\n): x",
)
"""Texts that are none, with what is said of them in `words.json`."""
FINE = {"format": 1, "junctions": {"q": {"quantity": "displacement"}}, "boxes": {"a": {"x": "q"}}}


def junction_of(**said):
    """A document whose one junction is as told."""
    return FINE | {"junctions": {"q": said}}


def described(**parts):
    """A document whose one quantity is described, with some parts replaced."""
    return junction_of(quantity={"kind": "x", "space": {"name": "r", "dim": 1, "size": 1}, "parity": 1} | parts)


BROKEN = {
    "no object": [],
    "no format": {},
    "another format": FINE | {"format": 2},
    "true as format": FINE | {"format": True},
    "key too many": FINE | {"colour": 1},
    "no boxes": {"format": 1, "junctions": {}},
    "junctions as a list": FINE | {"junctions": []},
    "no quantity": junction_of(),
    "unknown quantity": junction_of(quantity="luck"),
    "quantity as a number": junction_of(quantity=1),
    "exposed as true": junction_of(quantity="displacement", exposed=True),
    "exposed as null": junction_of(quantity="displacement", exposed=None),
    "pair of a scalar": junction_of(quantity="entropy", pair="screw"),
    "pair without pitch": junction_of(quantity="relative_pose", pair="screw"),
    "pair beside a description": junction_of(quantity={}, pair="screw"),
    "frame as a number": junction_of(quantity="pose", frame=1),
    "wire as null": FINE | {"boxes": {"a": {"x": None}}},
    "wire to nowhere": FINE | {"boxes": {"a": {"x": "r"}}},
    "link as text": FINE | {"links": ["q"]},
    "parity zero": described(parity=0),
    "domain of three": described(domain=[0, 1, 2]),
    "domain without length": described(domain=[1, 1]),
    "charges as a list": described(charges=["H"]),
    "charge of two": described(charges={"H": [1, 2]}),
    "charge as a word": described(charges={"H": ["two"]}),
    "unit of nothing": described(unit="kg//s"),
    "huge parameter": described(space={"name": "r", "dim": 1, "size": 1, "parameters": {"p": 10**400}}),
    "identity and boxes": FINE | {"identity": {}},
    "box at the root": FINE | {"boxes": {".": {"q": "q"}}},
    "empty name": FINE | {"boxes": {"": {"x": "q"}}},
    "malformed name": FINE | {"boxes": {"a b": {"x": "q"}}},
}


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=10,
)


def places_in(value, here=()):
    """Keys that lead to each value inside."""
    yield here
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield from places_in(inner, (*here, key))


@given(patterns(), ANYTHING, st.data())
def test_a_damaged_document_is_read_or_refused(f, junk, data):
    document = json.loads(f.to_json())
    *way, last = data.draw(st.sampled_from([place for place in places_in(document) if place]))
    spot = document
    for key in way:
        spot = spot[key]
    spot[last] = junk
    try:
        found = Pattern.from_dict(document)
    except PatternError:
        return
    assert Pattern.from_json(found.to_json()) == found


@given(st.text(max_size=80) | st.text(':~(),;.@={}"#\n pq', max_size=40))
def test_any_text_is_read_or_refused(text):
    for read in (Pattern.from_text, Pattern.from_json):
        with contextlib.suppress(PatternError):
            assert isinstance(read(text), Pattern)


@pytest.mark.parametrize(
    "make",
    [
        lambda long: Path.parse(long),
        lambda long: Path((long,)),
        lambda long: Pattern({long: junction(Q)}, {}),
        lambda long: Pattern({"q": junction(Q)}, {"a": {"x": long}}),
        lambda long: Pattern({"q": junction(Q)}, {"a": {long: "q"}}),
        lambda long: Pattern.from_text("q: displacement; a(x=q)").rename(boxes={"a": long}),
        lambda long: Pattern.from_text("q: displacement; a(x=q)").substitute({long: Pattern({}, {})}),
        lambda long: Pattern.from_text(f"{long}: displacement"),
        lambda long: Pattern.from_json(json.dumps(FINE | {long: 1})),
        lambda long: Pattern.from_json(json.dumps(FINE | {"format": long})),
        lambda long: Pattern.from_dict(FINE | {"boxes": {"a": {"x": long}}}),
        lambda long: quantity.relative_pose(long),
    ],
)
@pytest.mark.parametrize("long", ["n" * 10**6, "n." * 500_000 + "n"], ids=["one name", "many names"])
def test_endless_names_are_refused_in_few_words(make, long):
    with pytest.raises(PatternError) as caught:
        make(long)
    assert len(str(caught.value)) < 10_000


@given(st.data())
def test_every_equation_can_be_replayed(data):
    import ephs.operad

    each = data.draw(st.sampled_from(ephs.operad.LAWS))
    equation = each(*data.draw(law_inputs(each)))
    again = eval(equation.replay, vars(ephs.operad).copy())
    assert (again.left, again.right) == (equation.left, equation.right)


@given(paths(), paths(min_size=0))
def test_paths_in_documents(a, b):
    assert Path.parse(str(a / b)) == a / b
