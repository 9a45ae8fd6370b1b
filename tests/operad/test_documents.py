"""Patterns as documents: dictionaries, JSON, the compact text form, and back."""

import contextlib
import json
import subprocess
import sys

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.operad import Path, Pattern, PatternError, Quantity, Space, junction, law, quantity
from ephs.operad.documents import SCHEMA_FILE
from ephs.testing import law_inputs, nestings, paths, patterns, quantities

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
    run = [sys.executable, "-c", code]
    found = {
        subprocess.run(run, env={"PYTHONHASHSEED": seed, "PYTHONPATH": "."}, capture_output=True, check=True).stdout
        for seed in ("1", "2")
    }
    assert len(found) == 1


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


BROKEN_TEXT = {
    "q: distance\na(q)": "line 1: found distance",
    "q: displacement; a(q": r"found the end of the text, expected \",\" or \"\)\"",
    "q: displacement\na(q) b(q)": "line 2: found b, expected the end of the line",
    "q: displacement\n\na(r)": "there is no junction r",
    "q displacement": 'found displacement, expected ":"',
    "q: displacement, hidden\na(q)": 'found hidden, expected "exposed"',
    "q: displacement, exposed as power\na(q)": 'found power, expected "state"',
    "q: relative_pose(screw)\na(q)": "quantity|relative pose screw",
    "q: relative_pose(screw, pitch=steep)\na(q)": "found steep, expected a number",
    "q: relative_pose(hinge)\na(q)": "expected one of cylindrical",
    "q: displacement\nq: displacement\na(q)": "q is given twice",
    "q: displacement\na(q, q)": "q is given twice",
    "q: displacement\n.(q)": "an identity",
    "q: displacement @ \na(q)": "the name of a frame",
    'q: {"kind": 1}\na(q)': "line 1.quantity",
    'q: {"kind"\na(q)': "the object of a quantity",
    '"q: displacement': "found",
    "a()\n): x": "a name",
}


@pytest.mark.parametrize("text", BROKEN_TEXT)
def test_what_is_no_text_is_refused(text):
    with pytest.raises(PatternError, match=BROKEN_TEXT[text]):
        Pattern.from_text(text)


FINE = {"format": 1, "junctions": {"q": {"quantity": "displacement"}}, "boxes": {"a": {"x": "q"}}}


def _own(**said):
    plain = {"kind": "x", "space": {"name": "real", "dim": 1, "size": 1}, "parity": 1}
    return FINE | {"junctions": {"q": {"quantity": plain | said}}}


BROKEN = {
    "no object": ([], "document: found"),
    "no format": ({}, "no key format"),
    "another format": (FINE | {"format": 2}, "format: found 2, expected 1"),
    "true as format": (FINE | {"format": True}, "format: found True"),
    "key too many": (FINE | {"colour": 1}, "found key colour"),
    "no boxes": ({"format": 1, "junctions": {}}, "no key boxes"),
    "junctions as a list": (FINE | {"junctions": []}, "junctions: found"),
    "no quantity": (FINE | {"junctions": {"q": {}}}, r"junctions\.q: found no key quantity"),
    "unknown quantity": (FINE | {"junctions": {"q": {"quantity": "luck"}}}, r"junctions\.q\.quantity: found luck"),
    "quantity as a number": (FINE | {"junctions": {"q": {"quantity": 1}}}, r"junctions\.q\.quantity: found 1"),
    "exposed as true": (
        FINE | {"junctions": {"q": {"quantity": "displacement", "exposed": True}}},
        r"junctions\.q\.exposed: found True",
    ),
    "exposed as null": (
        FINE | {"junctions": {"q": {"quantity": "displacement", "exposed": None}}},
        r"junctions\.q\.exposed: found None",
    ),
    "pair of a scalar": (FINE | {"junctions": {"q": {"quantity": "entropy", "pair": "screw"}}}, "found entropy"),
    "pair without pitch": (FINE | {"junctions": {"q": {"quantity": "relative_pose", "pair": "screw"}}}, "pitch"),
    "pair beside a description": (
        FINE | {"junctions": {"q": {"quantity": {}, "pair": "screw"}}},
        "found key pair",
    ),
    "frame as a number": (FINE | {"junctions": {"q": {"quantity": "pose", "frame": 1}}}, r"q\.frame: found 1"),
    "wire as null": (FINE | {"boxes": {"a": {"x": None}}}, r"boxes\.a\.x: found None"),
    "wire to nowhere": (FINE | {"boxes": {"a": {"x": "r"}}}, "there is no junction r"),
    "link as text": (FINE | {"links": ["q"]}, r"links\[0\]: found q, expected a list"),
    "parity zero": (
        FINE
        | {"junctions": {"q": {"quantity": {"kind": "x", "space": {"name": "r", "dim": 1, "size": 1}, "parity": 0}}}},
        "parity",
    ),
    "domain of three": (_own(domain=[0, 1, 2]), "domain: found .*two numbers"),
    "domain without length": (_own(domain=[1, 1]), "the domain is"),
    "charges as a list": (_own(charges=["H"]), "charges: found"),
    "charge of two": (_own(charges={"H": [1, 2]}), "1 finite number each"),
    "charge as a word": (_own(charges={"H": ["two"]}), "charges.H: found two"),
    "unit of nothing": (_own(unit="kg//s"), "the unit 'kg//s'"),
    "huge parameter": (
        FINE
        | {
            "junctions": {
                "q": {
                    "quantity": {
                        "kind": "x",
                        "space": {"name": "r", "dim": 1, "size": 1, "parameters": {"p": 10**400}},
                        "parity": 1,
                    }
                }
            }
        },
        "too many digits",
    ),
    "identity and boxes": (FINE | {"identity": {}}, "found key boxes"),
    "box at the root": (FINE | {"boxes": {".": {"q": "q"}}}, "root"),
    "empty name": (FINE | {"boxes": {"": {"x": "q"}}}, "at least one letter"),
    "malformed name": (FINE | {"boxes": {"a b": {"x": "q"}}}, "no white space"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_what_is_no_document_is_refused(case):
    document, words = BROKEN[case]
    with pytest.raises(PatternError, match=words):
        Pattern.from_dict(document)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "line 1, column 1"),
        ("{", "line 1, column 2"),
        ('{"format": 1, "format": 1}', "the key format twice"),
        ('{"format": NaN}', "found NaN"),
        ("[" * 100_000, "depth|JSON"),
        ('{"format": ' + "9" * 5000 + "}", "JSON|format"),
        (b"\xff\xfe\xfa", "UTF-8|JSON"),
        (None, "found NoneType"),
    ],
)
def test_what_is_no_json_is_refused(text, words):
    with pytest.raises(PatternError, match=words):
        Pattern.from_json(text)


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=10,
)


def _places(value, here=()):
    yield here
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield from _places(inner, (*here, key))


@given(patterns(), ANYTHING, st.data())
def test_a_damaged_document_is_read_or_refused(f, junk, data):
    document = json.loads(f.to_json())
    *way, last = data.draw(st.sampled_from([place for place in _places(document) if place]))
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
        lambda long: Pattern({"q": junction(Q)}, {"a": {"x": "q"}}).rename(boxes={"a": long}),
        lambda long: Pattern({"q": junction(Q)}, {"a": {"x": "q"}}).substitute({long: Pattern({}, {})}),
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


def test_a_counterexample_is_replayed(models):
    """What a law that does not hold would print: both sides as trees, and how to see it again."""
    equation = law("right unit")(models.DAMPED, Path.parse("osc"))
    names = {"Pattern": Pattern, "Path": Path, "law": law, "junction": junction, "quantity": quantity}
    again = eval(equation.replay, names)
    assert (again.left, again.right) == (equation.left, equation.right) and equation.holds
    wrong = type(equation)(equation.left, models.OSCILLATOR, equation.law, equation.inputs)
    assert "right unit" in str(wrong) and wrong.replay in str(wrong)
    assert "mf: p on p, s on s" in str(wrong) and "pkc: q on q, p on p" in str(wrong)


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
