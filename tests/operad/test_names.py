"""Paths are the free monoid on names; directories are a monad over them."""

import copy
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.operad import ROOT, Directory, Path, PatternError
from ephs.testing import paths
from ephs.testing.patterns import fresh_paths


@st.composite
def directories(draw, values=None, max_size=4):
    values = st.integers(0, 9) if values is None else values
    if draw(st.integers(0, 5)) == 5:
        return Directory.unit(draw(values))
    return Directory([(p, draw(values)) for p in fresh_paths(draw, draw(st.integers(0, max_size)), ())])


@given(paths(min_size=0), paths(min_size=0), paths(min_size=0))
def test_concatenation_is_associative_and_has_the_root_as_unit(a, b, c):
    assert (a / b) / c == a / (b / c)
    assert ROOT / a == a == a / ROOT
    assert len(a / b) == len(a) + len(b)


@given(paths(min_size=0), paths(min_size=0))
def test_prefix_is_left_divisor(a, b):
    assert a.is_prefix_of(a / b)
    assert (a / b).relative_to(a) == b
    assert a.is_prefix_of(b) == any(a / Path(b[k:]) == b for k in range(len(b) + 1))


@given(paths(min_size=0))
def test_a_path_reads_back(path):
    assert Path.parse(str(path)) == path == Path.of(eval(repr(path)))
    assert Path.of(tuple(path)) == Path.of(str(path)) == Path.of(path) == pickle.loads(pickle.dumps(path))
    assert isinstance(Path.of(tuple(path)), Path)


def test_a_path_joins_with_dotted_text():
    assert str(Path.parse("a") / "b.c") == "a.b.c" == str("a" / Path.parse("b.c"))
    assert f"{Path.parse('a.b'):>5}" == "  a.b"
    assert str(ROOT) == "." and Path.parse(".") == ROOT


@pytest.mark.parametrize("text", ["", "a..b", ".a", "a.", "~a", "a.~b", "a b", "a.\t", "\n"])
def test_a_malformed_name_is_refused(text):
    with pytest.raises(PatternError, match="choose another name") as caught:
        Path.parse(text)
    assert caught.value.kind == "name"


@given(directories())
def test_directory_left_and_right_unit(d):
    assert Directory.unit(d).flatten() == d == d.map(Directory.unit).flatten()


@given(directories(directories(directories(max_size=2), max_size=2), max_size=2))
def test_directory_flatten_is_associative(d):
    assert d.flatten().flatten() == d.map(Directory.flatten).flatten()


@given(directories(), st.randoms(use_true_random=False))
def test_directories_are_equal_up_to_order(d, random):
    items = list(d.items())
    random.shuffle(items)
    again = Directory(items)
    assert again == d and hash(again) == hash(d)
    assert eval(repr(d)) == d == pickle.loads(pickle.dumps(d)) == copy.deepcopy(d)
    if items:
        path, value = items[0]
        assert Directory([*items[1:], (path, value + 1)]) != d


@given(directories(), directories())
def test_prefixing_merging_and_cutting_out_are_inverse(d, e):
    both = d.prefixed("left.x").merge(e.prefixed("right"))
    assert both.below("left.x") == d and both.below("right") == e
    assert len(both) == len(d) + len(e)
    assert both == Directory({"left": d.prefixed("x"), "right": e}).flatten()
    assert all((value % 2 == 0) == (path in d.filter(lambda v: v % 2 == 0)) for path, value in d.items())


def test_a_directory_is_found_by_dotted_names():
    d = Directory({"a.b": 1, ("a", "c"): 2, Path.parse("d"): 3})
    assert d["a.b"] == d["a", "b"] == d[Path.parse("a.b")] == 1
    assert "a.c" in d and "a" not in d and "a..b" not in d and d.get("nowhere") is None
    assert d.to_nested() == {"a": {"b": 1, "c": 2}, "d": 3}
    assert str(d) == "a\n  b: 1\n  c: 2\nd: 3"
    with pytest.raises(KeyError):
        d["a"]


@pytest.mark.parametrize("names", [["a", "a.b"], ["a.b", "x", "a.b.c"], [".", "a"], ["a", "b", "a"]])
def test_a_directory_is_prefix_free(names):
    with pytest.raises(PatternError, match=r"rename one of them"):
        Directory([(name, 0) for name in names])


def test_names_which_only_look_like_prefixes_may_stand_together():
    assert len(Directory({"a": 0, "ab": 1, "a1.b": 2, "b.a": 3})) == 4


def test_a_directory_cannot_be_changed():
    d = Directory({"a": 1})
    with pytest.raises(AttributeError):
        d._items = {}
    with pytest.raises(TypeError):
        d["a"] = 2
