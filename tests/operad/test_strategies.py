"""What the strategies reach, so that the laws are tested where they could fail."""

import pytest
from hypothesis import Phase, find, given, settings
from hypothesis import strategies as st
from hypothesis.errors import InvalidArgument

import ephs.testing
from ephs.mechanics.scene import Scene
from ephs.operad import LAWS, Path, Pattern, Quantity
from ephs.plugin import register
from ephs.semantics import System
from ephs.testing import interfaces, law_inputs, nestings, paths, patterns, quantities
from tests.processes import printed

# To reach something is enough, it need not be small.
SEARCH = settings(max_examples=20000, database=None, deadline=None, phases=[Phase.generate])


def ports_of(f):
    return [(box, port) for box, content in f.boxes.items() for port in content.ports.values()]


def two_ports_on_one_junction(f):
    return any(len({p.junction for p in c.ports.values()}) < len(c.ports) for c in f.boxes.values())


def state_of_three_levels(n):
    """A class with members of the outermost pattern, of one in a box of it, and of one in a box of that."""
    for box, child in n.children.items():
        for inner in child.children:
            for group in n.flatten().links:
                deep = {path for path in group if (box / inner).is_prefix_of(path)}
                middle = {path for path in group if box.is_prefix_of(path)} - deep
                if deep and middle and group - deep - middle:
                    return True
    return False


PATTERNS = {
    "empty": lambda f: not f.boxes,
    "identity": lambda f: f.is_identity and len(f.junctions) >= 2,
    "identity with a state port": lambda f: f.is_identity and any(not j.power for j in f.junctions.values()),
    "box without ports": lambda f: any(not c.ports for c in f.boxes.values()) and len(f.boxes) >= 2,
    "isolated": lambda f: f.boxes and not f.interface and len(f.junctions) >= 2,
    "two ports of a box on one junction": two_ports_on_one_junction,
    "state port": lambda f: any(not port.power for _, port in ports_of(f)),
    "state and power ports on one junction": lambda f: (
        {p.junction for _, p in ports_of(f) if p.power} & {p.junction for _, p in ports_of(f) if not p.power}
    ),
    "closed port": lambda f: any(
        not j.exposed and sum(port.junction == path for _, port in ports_of(f)) == 1 for path, j in f.junctions.items()
    ),
    "open-circuit port": lambda f: any(remark.kind == "open-circuit" for remark in f.lint()),
    "linked balances": lambda f: any(remark.kind == "linked-balances" for remark in f.lint()),
    "state port over a power balance": lambda f: any(
        j.exposed and not j.power and any(p.power and p.junction == path for _, p in ports_of(f))
        for path, j in f.junctions.items()
    ),
    "exposed without inner port": lambda f: {*f.junctions} - {port.junction for _, port in ports_of(f)},
    "class of three": lambda f: any(len(group) >= 3 for group in f.links),
    "dotted names": lambda f: any(len(path) > 1 for path in f.boxes) and any(len(path) > 1 for path in f.junctions),
    "frame": lambda f: any(j.quantity.frame for j in f.junctions.values()),
}
NESTINGS = {
    "four levels": lambda n: n.depth == 4,
    "filled by an identity": lambda n: any(c.pattern.is_identity for c in n.children.values()),
    "identity around another": lambda n: n.pattern.is_identity and n.depth == 2,
    "identities in identities": lambda n: any(
        each.pattern.is_identity and any(inner.pattern.is_identity for inner in each.children.values())
        for child in n.children.values()
        for each in child.children.values()
    ),
    "two boxes filled": lambda n: len(n.children) >= 2,
    "link made by substitution": lambda n: not n.pattern.links and n.bottom_up().links,
    "a state of three levels": state_of_three_levels,
    "no outer port at any level": lambda n: (
        n.depth >= 2 and not n.pattern.interface and any(not c.pattern.interface for c in n.children.values())
    ),
    "a pass-through attempt: a child's two outer ports are one state, the boxes' ports two": lambda n: any(
        len({n.pattern.state_class(n.pattern.boxes[box].ports[p].junction) for p in group}) >= 2
        for box, child in n.children.items()
        for group in (
            [p for p in members if p in child.pattern.interface and not child.pattern.interface[p].power]
            for members in child.pattern.links
        )
        if not child.pattern.is_identity
    ),
    "a handle is dropped": lambda n: any(
        not child.pattern.is_identity
        and any(not port.power for port in child.pattern.interface.values())
        and not any(box / path in n.bottom_up().junctions for path in child.pattern.interface)
        for box, child in n.children.items()
    ),
}


@pytest.mark.parametrize("what", PATTERNS)
def test_patterns_reach(what):
    assert PATTERNS[what](find(patterns(), PATTERNS[what], settings=SEARCH))


@pytest.mark.parametrize("what", NESTINGS)
def test_nestings_reach(what):
    assert NESTINGS[what](find(nestings(max_depth=4, max_boxes=2), NESTINGS[what], settings=SEARCH))


@pytest.mark.parametrize(
    "law", [law for law in LAWS if "g" in law.inputs and "f" in law.inputs], ids=lambda law: law.name
)
def test_the_inputs_of_laws_are_patterns_with_content(law):
    def full(inputs):
        found = [value for value in inputs if isinstance(value, Pattern)]
        return all(f.junctions and f.boxes and not f.is_identity for f in found)

    assert full(find(law_inputs(law), full, settings=SEARCH))


@given(st.data())
def test_patterns_keep_to_their_bounds(data):
    interface = data.draw(interfaces(min_ports=1, max_ports=3))
    assert 1 <= len(interface) <= 3
    f = data.draw(patterns(interface=interface, min_boxes=1, max_boxes=2, max_inner_junctions=1))
    assert f.interface == interface and 1 <= len(f.boxes) <= 2
    assert len(f.junctions) <= len(interface) + 1
    plain = data.draw(patterns(state_ports=False, links=False, identities=False, max_boxes=2))
    assert not plain.links and not plain.is_identity
    assert all(port.power for _, port in ports_of(plain))
    assert all(port.power for port in data.draw(interfaces(state_ports=False)).values())


def levels(nesting):
    """How many there are, identities around others not counted."""
    around = nesting.pattern.is_identity and bool(nesting.children)
    return int(not around) + max(map(levels, nesting.children.values()), default=0)


@given(nestings(max_depth=2, max_boxes=2))
def test_nestings_fit(nesting):
    assert levels(nesting) <= 2
    for box, child in nesting.children.items():
        assert child.pattern.interface == nesting.pattern.boxes[box].interface


@pytest.mark.parametrize(
    "strategy",
    [
        lambda: patterns(min_boxes=2, max_boxes=1),
        lambda: patterns(interface=find(interfaces(), len), max_boxes=0),
        lambda: interfaces(min_ports=3, max_ports=2),
        lambda: nestings(max_depth=0),
        lambda: paths(min_size=2, max_size=1),
    ],
)
def test_impossible_bounds_are_an_error_when_drawn(strategy):
    made = strategy()  # not here
    with pytest.raises(InvalidArgument):
        find(made, lambda _: True, settings=SEARCH)


@pytest.mark.parametrize("kind", [Path, Quantity, Pattern, System, Scene])
def test_registered_types_can_be_drawn(kind):
    register()
    assert isinstance(find(st.from_type(kind), lambda _: True, settings=SEARCH), kind)


def test_strategies_shrink_to_small_patterns():
    shrinking = settings(SEARCH, phases=[Phase.generate, Phase.shrink])
    f = find(patterns(), lambda f: len(f.junctions) >= 2, settings=shrinking)
    assert len(f.boxes) == 1 and len(f.junctions) == 2
    assert find(quantities(), lambda q: q.frame is not None, settings=shrinking).frame == "B"


def test_what_is_exported_exists():
    assert all(name in dir(ephs.testing) for name in ephs.testing.__all__)


def test_the_package_may_be_imported_before_hypothesis():
    """Hypothesis calls the package's plugin while it is itself being imported, by the package."""
    code = (
        "import ephs.testing, ephs\n"
        "from hypothesis import find, strategies as st\n"
        "assert find(st.from_type(ephs.Pattern), lambda p: len(p.boxes) > 1)\n"
    )
    printed(code, PYTHONWARNINGS="error")
