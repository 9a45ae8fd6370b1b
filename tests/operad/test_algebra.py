"""Filling patterns with elements of an algebra: what is refused, and by which name; folds of nestings."""

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.operad import (
    ALGEBRA_LAWS,
    LAWS,
    MAP_LAWS,
    Algebra,
    AlgebraMap,
    Interface,
    Nesting,
    Path,
    Pattern,
    PatternError,
    law,
)
from ephs.semantics import System, library
from ephs.testing import nestings


@dataclass(frozen=True)
class Boxes:
    """How many boxes there are."""

    interface: Interface
    count: int = 1

    @property
    def algebra(self):
        return BOXES


BOXES = Algebra(
    "boxes",
    lambda element: element.interface if isinstance(element, Boxes) else None,
    lambda pattern, parts: Boxes(pattern.interface, sum(part.count for part in parts.values())),
)
PAIR = Pattern.from_text("p: momentum, exposed; l(p); r(p)")
OTHER = Pattern.from_text("q: displacement; s: momentum; l(q, p=s); r(p=s)")
ONE = Boxes(PAIR.interface)
NESTING = Nesting(PAIR, {"l": PAIR})
MASS = library.point_mass(m=1.0)
REFUSED = {
    "a box without element": (lambda: PAIR.apply(BOXES, {"l": ONE}), ("fillings", "r", "l", "l, r")),
    "an element without box": (
        lambda: PAIR.apply(BOXES, {"l": ONE, "r": ONE, "x": ONE}),
        ("fillings", "x", "l, r, x", "l, r"),
    ),
    "a foreign element": (lambda: PAIR.apply(BOXES, {"l": ONE, "r": MASS}), ("foreign", "r", "Storage", "boxes")),
    "a wrong interface": (
        lambda: OTHER.apply(BOXES, {"l": ONE, "r": ONE}),
        ("interface", "l", "{p: momentum on real}", "{p: momentum on real, q: displacement on real}"),
    ),
    "a leaf that is missing": (
        lambda: NESTING.fold(BOXES, {"r": ONE, "l.l": ONE}),
        ("fillings", "l.r", "l.l, r", "l.l, l.r, r"),
    ),
    "a leaf too many": (
        lambda: NESTING.fold(BOXES, {"r": ONE, "l": ONE, "l.l": ONE, "l.r": ONE}),
        ("fillings", "l", "l, l.l, l.r, r", "l.l, l.r, r"),
    ),
    "a foreign leaf": (
        lambda: NESTING.fold(BOXES, {"r": ONE, "l.l": ONE, "l.r": 3}),
        ("foreign", "l.r", "int", "boxes"),
    ),
    "an inner interface": (
        lambda: Nesting(OTHER, {"l": PAIR}).fold(BOXES, {"l.l": ONE, "l.r": ONE, "r": ONE}),
        ("interface", "l", "{p: momentum on real}", "{p: momentum on real, q: displacement on real}"),
    ),
    "several algebras": (
        lambda: PAIR(l=ONE, r=MASS),
        ("mixed", "l", "boxes in l, systems in r", "elements of one algebra"),
    ),
    "several algebras in another order": (
        lambda: PAIR(r=MASS, l=ONE),
        ("mixed", "l", "boxes in l, systems in r", "elements of one algebra"),
    ),
    "what is of no algebra": (lambda: PAIR(l=MASS, r=3), ("not-an-element", "r", "int", "an element")),
    "a call that leaves a box": (lambda: PAIR(l=MASS), ("fillings", "r", "l", "l, r")),
    "a call with a wrong interface": (
        lambda: PAIR(l=MASS, r=library.spring(k=1.0)),
        ("interface", "r", "{q: displacement on real}", "{p: momentum on real}"),
    ),
    "a map of a foreign element": (
        lambda: AlgebraMap(BOXES, BOXES, lambda element: element)(3),
        ("foreign", ".", "int", "boxes"),
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_fit_is_refused_by_box_found_and_expected(case):
    make, (kind, box, found, expected) = REFUSED[case]
    with pytest.raises(PatternError) as caught:
        make()
    error = caught.value
    assert (error.kind, error.box, error.found, error.expected) == (kind, box, found, expected)
    assert f"box {box}" in str(error) and found in str(error)


def test_a_call_composes_in_the_algebra_of_its_fillings():
    assert PAIR(l=ONE, r=Boxes(PAIR.interface, 2)) == Boxes(PAIR.interface, 3)
    assert isinstance(PAIR(l=MASS, r=MASS), System)


def test_the_nullary_pattern_can_be_called_and_filled():
    nothing = Pattern({}, {})
    assert nothing.apply(BOXES, {}).count == 0
    system = nothing()
    assert isinstance(system, System) and not system.states and system.flatten() == system
    isolated = Pattern.from_text("p: momentum; m(p); n()")(m=MASS, n=system)
    assert [str(path) for path in isolated.states] == ["m.p"]


@given(nestings(), st.data())
def test_a_fold_is_the_flattened_pattern_filled(nesting, data):
    flat = nesting.flatten()
    leaves = {box: Boxes(content.interface, data.draw(st.integers(0, 9))) for box, content in flat.boxes.items()}
    assert nesting.fold(BOXES, leaves) == flat.apply(BOXES, leaves)
    assert nesting.fold(BOXES, leaves).count == sum(leaf.count for leaf in leaves.values())


def test_a_fold_goes_deeper_than_recursion():
    """Names of boxes are no limit here: those on the way are the root, of identities."""
    nesting = Nesting(PAIR)
    for _ in range(5000):
        nesting = Nesting(Pattern.identity(PAIR.interface), {".": nesting})
    assert nesting.fold(BOXES, {"l": ONE, "r": ONE}).count == 2


def test_maps_compose():
    double = AlgebraMap(BOXES, BOXES, lambda element: Boxes(element.interface, 2 * element.count), "double")
    assert double.then(double)(ONE).count == 4
    assert repr(double.then(double)) == "double, then double" and repr(double) == "double"


def test_every_law_is_found_by_its_name():
    every = (*LAWS, *ALGEBRA_LAWS, *MAP_LAWS)
    assert len({each.name for each in every}) == len(every)
    assert all(law(each.name) is each for each in every)


def test_a_path_moves_with_its_shortest_known_prefix():
    names = {Path.parse("a"): Path.parse("x.y"), Path.parse("a.b"): Path.parse("no"), Path.parse("c"): Path()}
    moved = {str(Path.parse(path).moved(names)) for path in ("a.b.c", "a", "c.d", "b")}
    assert moved == {"x.y.b.c", "x.y", "d", "b"}


@pytest.mark.parametrize("name", ["box0", "box0.q"])
def test_ports_may_be_called_as_the_box_that_renames_them(name):
    """Its name is no beginning of theirs."""
    box, names = Path.parse("l"), {Path.parse("p"): Path.parse(name)}
    assert law("equivariance in names of ports")(BOXES, PAIR, box, names, {box: ONE, Path.parse("r"): ONE}).holds
