"""Rewriting by double pushouts: steps are checked, reversed, natural, compositional; forged ones are refused."""

import json
from dataclasses import replace

import jsonschema
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from referencing import Registry, Resource

from ephs.operad import Path, Pattern, PatternError, Renaming, quantity
from ephs.operad.canonical import canonical
from ephs.operad.documents import SCHEMA_FILE as PATTERN_SCHEMA
from ephs.operad.parts import Junction, Port
from ephs.testing import patterns
from examples.rewriting import Derivation, Fragment, Rule
from examples.rewriting.derivation import SCHEMA_FILE
from tests.operad.test_isomorphism import renamed

Q = quantity.displacement
GLUING = {"identification", "dangling", "bare", "match", "link-quantity"}
PATTERN = Resource.from_contents(json.loads(PATTERN_SCHEMA.read_text(encoding="utf-8")))
REGISTRY = Registry().with_resource("../../ephs/operad/pattern.schema.json", PATTERN)
VALID = jsonschema.Draft202012Validator(json.loads(SCHEMA_FILE.read_text(encoding="utf-8")), registry=REGISTRY)


@st.composite
def steps(draw, pattern=None):
    """A rule whose left side is a piece of a pattern, the pattern, and where the piece is; it may not be possible."""
    f = canonical(draw(patterns(identities=False, min_boxes=1)) if pattern is None else pattern)
    boxes = draw(st.lists(st.sampled_from(sorted(f.boxes)), max_size=2, unique=True)) if f.boxes else []
    names = {box: Path((f"B{i}",)) for i, box in enumerate(boxes)}
    chosen = {}
    for box in boxes:
        ports = sorted(f.boxes[box].ports)
        some = draw(st.booleans()) and ports
        chosen[box] = draw(st.lists(st.sampled_from(ports), unique=True)) if some else ports
    on = [f.boxes[box].ports[port].junction for box in boxes for port in chosen[box]]
    more = draw(st.lists(st.sampled_from(sorted(f.junctions)), max_size=1)) if f.junctions else []
    places = {path: Path((f"J{i}",)) for i, path in enumerate(sorted({*on, *more}))}
    junctions = {new: Junction(f.junctions[old].quantity) for old, new in places.items()}
    links = [group for old in places if len(group := [places[p] for p in f.state_class(old) if p in places]) > 1]
    ports = {box: {port: Path((f"P{i}",)) for i, port in enumerate(chosen[box])} for box in boxes}
    left = {
        names[box]: {
            ports[box][port]: Port(places[f.boxes[box].ports[port].junction], f.boxes[box].ports[port].power)
            for port in chosen[box]
        }
        for box in boxes
    }
    kept = {new for new in junctions if draw(st.integers(0, 3))}
    right, also = {}, {path: junctions[path] for path in kept}
    for box, wires in left.items():
        if draw(st.booleans()):
            right[box] = {
                port: where for port, where in wires.items() if where.junction in kept and draw(st.integers(0, 3))
            }
    if draw(st.booleans()):
        also[Path(("N",))] = Junction(draw(st.sampled_from([*(j.quantity for j in junctions.values()), Q])))
    groups = [rest for group in links if len(rest := [path for path in group if path in kept]) > 1]
    if Path(("N",)) in also and draw(st.booleans()):
        groups += [[Path(("N",)), path] for path in sorted(kept) if also[path] == also[Path(("N",))]][:1]
    if also:
        for i in range(draw(st.integers(0, 2))):
            ends = draw(st.lists(st.tuples(st.sampled_from(sorted(also)), st.booleans()), min_size=1, max_size=3))
            right[Path((f"N{i}",))] = {Path((f"p{k}",)): Port(path, power) for k, (path, power) in enumerate(ends)}
        for box in [box for box in right if box in left]:
            if draw(st.booleans()):
                right[box] = right[box] | {Path(("plug",)): Port(draw(st.sampled_from(sorted(also))), True)}
    rule = Rule(Fragment(junctions, left, links), Fragment(also, right, groups))
    match = Renaming(
        {new: old for old, new in names.items()},
        {new: old for old, new in places.items()},
        {names[box]: {new: old for old, new in ports[box].items()} for box in boxes},
    )
    return rule, f, match


@st.composite
def derivations(draw, pattern=None):
    """Steps that are possible."""
    rule, f, match = draw(steps(pattern=pattern))
    try:
        return rule.apply(f, match)
    except PatternError as error:
        assert error.kind in GLUING
        assume(False)


def view(rule, pattern, match):
    """A match without the choice of a name for each state."""
    junctions = {
        path: image if path in rule.powered else pattern.state_class(image) for path, image in match.junctions.items()
    }
    return match.boxes, junctions, {box: names for box, names in match.ports.items() if names}


@given(derivations())
def test_steps_are_derivations(step):
    step.check()
    assert step.target.interface == step.source.interface
    assert canonical(step.target).to_json() == step.target.to_json()
    again = Derivation.from_json(step.to_json())
    again.check()
    assert again.to_json() == step.to_json() and (again.rule, again.target) == (step.rule, step.target)
    VALID.validate(step.to_dict())


@given(derivations())
def test_the_reversed_rule_goes_back(step):
    step.reverse.check()
    back = step.rule.reverse.apply(step.target, step.comatch)
    back.check()
    assert back.target.isomorphic(step.source, fix_interface=True) is not None


@given(derivations())
def test_matches_are_found(step):
    found = list(step.rule.matches(step.source, injective=False))
    assert view(step.rule, step.source, step.match) in [view(step.rule, step.source, each) for each in found]
    for each in found[:3]:
        try:
            step.rule.apply(step.source, each).check()
        except PatternError as error:
            assert error.kind == "bare"


@given(st.data(), derivations())
def test_matches_are_natural_under_renaming(data, step):
    f, g = step.source, data.draw(renamed(step.source))
    new = f.isomorphic(g)
    moved = Renaming(
        {name: new.boxes[image] for name, image in step.match.boxes.items()},
        {name: new.junctions[image] for name, image in step.match.junctions.items()},
        {b: {name: new.ports[step.match.boxes[b]][p] for name, p in ps.items()} for b, ps in step.match.ports.items()},
    )
    assert step.rule.apply(g, moved).target.isomorphic(step.target) is not None
    count = [sum(1 for _ in step.rule.matches(each, injective=False)) for each in (f, g)]
    assert count[0] == count[1] > 0


@given(st.data(), patterns(identities=False, min_boxes=1))
def test_rewriting_commutes_with_substitution(data, f):
    """Inside a box, where the match lifts to the whole: rewriting, then substituting, and the other way round."""
    a = data.draw(st.sampled_from(sorted(f.boxes)))
    step = data.draw(
        derivations(pattern=data.draw(patterns(identities=False, min_boxes=1, interface=f.boxes[a].interface)))
    )
    g = step.source
    whole = f.substitute({a: g})
    ports = f.boxes[a].ports

    def lifted(path):
        """A junction of g in the whole."""
        inner = g.junctions[path]
        if inner.exposed:
            return ports[path].junction if inner.power or path not in powered(g) else a / path
        return a / path

    junctions = {name: lifted(image) for name, image in step.match.junctions.items()}
    assume(set(junctions.values()) <= set(whole.junctions))
    # a junction without power ports in g that f exposes as a state is a state of the whole: the rule matches no more
    assume(all(whole.junctions[at].power for n, at in junctions.items() if step.rule.left.junctions[n].power))
    match = Renaming({n: a / b for n, b in step.match.boxes.items()}, junctions, step.match.ports)
    outside = step.rule.apply(whole, match)
    outside.check()
    inside = f.substitute({a: step.target})
    assert outside.target.isomorphic(inside, fix_interface=True) is not None


def powered(pattern):
    return {p.junction for box in pattern.boxes.values() for p in box.ports.values() if p.power}


@given(st.data(), derivations())
def test_rewriting_beside_a_box_commutes_with_substitution(data, step):
    free = sorted(step.source.boxes.keys() - set(step.match.boxes.values()))
    assume(free)
    a = data.draw(st.sampled_from(free))
    g = data.draw(patterns(interface=step.source.boxes[a].interface, identities=False, min_boxes=1))
    whole = step.source.substitute({a: g})
    assume(set(step.match.junctions.values()) <= set(whole.junctions))
    try:
        outside = step.rule.apply(whole, step.match)
    except PatternError as error:  # g may have no power port where the box had one
        assert error.kind in {"bare", "match"}
        assume(False)
    assert outside.target.isomorphic(step.target.substitute({a: g}), fix_interface=True) is not None


@given(st.data(), patterns(identities=False, min_boxes=1))
def test_opening_a_box_is_a_rule(data, f):
    """The oracle: substitution itself."""
    a = data.draw(st.sampled_from(sorted(f.boxes)))
    g = data.draw(patterns(interface=f.boxes[a].interface, identities=False, min_boxes=1))
    o, i = Path(("o",)), Path(("i",))
    ports = f.boxes[a].ports
    outer = {o / name: Junction(kind.quantity) for name, kind in f.boxes[a].interface.items()}
    left = Fragment(
        outer, {"box": {name: Port(o / name, port.power) for name, port in ports.items()}}, shared(f, ports, o)
    )
    place = {path: o / path if j.exposed and j.power else i / path for path, j in g.junctions.items()}
    inner = {place[path]: Junction(j.quantity) for path, j in g.junctions.items() if place[path] not in outer}
    boxes = {
        i / box: {name: Port(place[port.junction], port.power) for name, port in content.ports.items()}
        for box, content in g.boxes.items()
    }
    links = [[place[p], o / p] for p, j in g.junctions.items() if j.exposed and not j.power]
    links += [[place[p] for p in group] for group in g.links]
    try:
        rule = Rule(left, Fragment(outer | inner, boxes, [*shared(f, ports, o), *links]))
    except PatternError as error:  # g identifies states of its surroundings, which no linear rule can
        assert error.kind in {"rule", "link-quantity"}
        assume(False)
    match = Renaming(
        {Path(("box",)): a},
        {o / n: port.junction for n, port in ports.items()},
        {Path(("box",)): {n: n for n in ports}},
    )
    try:
        step = rule.apply(f, match)
    except PatternError as error:
        assert error.kind in {"bare", "match"}
        assume(False)
    step.check()
    assert step.target.isomorphic(f.substitute({a: g}), fix_interface=True) is not None


def shared(f, ports, o):
    names = sorted(ports)
    return [
        [o / one, o / two]
        for one in names
        for two in names
        if one < two and ports[two].junction in f.state_class(ports[one].junction)
    ]


# ---- refusals -----------------------------------------------------------------------------------------------------

TWO = "x: displacement, exposed; soft(x); stiff(x); mass(x)"
SIDE_BY_SIDE = "q: displacement; a(q); b(q) ⇒ q: displacement; c(q)"
PORTS = "; port a.q → x; port b.q → x"
FINE = f"box a → soft; box b → stiff; junction q → x{PORTS}"


def rule_of(text):
    """The sides of a rule, with an arrow between them."""
    left, _, right = text.partition("⇒")
    return Rule.from_text(left, right)


def names(text):
    """Of what `Renaming` prints, in one line."""
    found = {"box": {}, "junction": {}, "port": {}}
    for kind, old, _, new in (each.split() for each in text.split("; ")):
        *box, name = old.split(".")
        at = found["port"].setdefault(Path.of(*box), {}) if box else found[kind]
        at[Path.of(name)] = Path.of(new)
    return Renaming(*found.values())


def test_springs_side_by_side():
    f, rule = Pattern.from_text(TWO), rule_of(SIDE_BY_SIDE)
    assert len(list(rule.matches(f))) == 6
    step = rule.apply(f, names(FINE))
    assert step.target == Pattern.from_text("x: displacement, exposed; c(q=x); mass(x)")
    assert not list(rule.matches(Pattern.from_text("x: momentum; a(x); b(x)")))


GONE = "q: displacement; a(q) ⇒"
SOFT = "box a → soft; junction q → x; port a.q → x"
NO_PLACE = [
    (SIDE_BY_SIDE, TWO, FINE.replace("stiff", "soft"), "identification", "box a and box b"),
    (SIDE_BY_SIDE, TWO, FINE.replace("box b → stiff; ", ""), "match", "box b at None"),
    (SIDE_BY_SIDE, TWO, FINE.replace("stiff", "spring"), "match", "box b at spring"),
    (SIDE_BY_SIDE, TWO, FINE.replace("q → x;", "q → y;"), "match", "junction q at y"),
    (SIDE_BY_SIDE, TWO, FINE.replace(PORTS, ""), "match", r"port a\.q at None"),
    (SIDE_BY_SIDE, "x: displacement; soft(x, y=~x); stiff(x); m(x)", FINE, "dangling", "box soft goes, its port y"),
    (SIDE_BY_SIDE, "x: momentum; soft(x); stiff(x)", FINE, "match", "junction q at x: momentum"),
    (SIDE_BY_SIDE, "x: displacement; soft(~x); stiff(x)", FINE, "match", r"port a\.q at soft\.x"),
    (SIDE_BY_SIDE, "x: displacement; y: displacement; soft(x=y); stiff(x); c(x)", FINE, "match", r"port a\.q at"),
    (GONE, TWO, SOFT, "dangling", "exposed"),
    (GONE, "x: displacement; soft(x); stiff(x)", SOFT, "dangling", r"port stiff\.x on it"),
    (GONE, "x: displacement; soft(x); see(~x)", SOFT, "dangling", r"the state of x goes, which see\.x has"),
    (f"{GONE} q: displacement", "x: displacement; soft(x)", SOFT, "bare", "x would have no power port"),
    (
        "q: displacement; r: displacement; a(q, r) ⇒ q: displacement; a(q)",
        "x: displacement; soft(y=x, z=x); m(x)",
        "box a → soft; junction q → x; junction r → x; port a.q → y; port a.r → z",
        "identification",
        "junction q and junction r",
    ),
]


@pytest.mark.parametrize("rule, pattern, match, kind, words", NO_PLACE)
def test_what_is_no_place_is_refused(rule, pattern, match, kind, words):
    with pytest.raises(PatternError, match=words) as caught:
        rule_of(rule).apply(Pattern.from_text(pattern), names(match))
    assert caught.value.kind == kind


@pytest.mark.parametrize(
    "rule, words",
    [
        ("q: displacement; a(q) ⇒ q: momentum; a(q)", "junction q as momentum"),
        ("q: displacement; r: displacement; a(q, r) ⇒ q: displacement; r: displacement; a(q, r); q ~ r", "sharing"),
        ("q: displacement; r: displacement; a(q, r); q ~ r ⇒ q: displacement; r: displacement; a(q, r)", "sharing"),
        ("q: displacement, exposed; a(q) ⇒ q: displacement; a(q)", "not exposed"),
        ("a(q) ⇒", "there is no junction q"),
    ],
)
def test_what_is_no_rule_is_refused(rule, words):
    with pytest.raises(PatternError, match=words):
        rule_of(rule)


def test_a_port_is_plugged_in_elsewhere():
    rule = rule_of("q: displacement; r: displacement; a(q=q) ⇒ q: displacement; r: displacement; a(q=r)")
    f = "x: displacement; y: displacement; box(k=x); m(x); n(y)"
    step = rule.apply(Pattern.from_text(f), names("box a → box; junction q → x; junction r → y; port a.q → k"))
    assert step.target == Pattern.from_text(f.replace("k=x", "k=y"))
    step.check()


# ---- forgeries ----------------------------------------------------------------------------------------------------


READ = {"rule": rule_of, "source": Pattern.from_text, "target": Pattern.from_text, "match": names, "comatch": names}
TRUE = {
    "rule": SIDE_BY_SIDE,
    "source": "x: displacement, exposed; y: displacement; soft(x); stiff(x); mass(x, z=~y); d(y); x ~ y",
    "target": "x: displacement, exposed; y: displacement; c(q=x); mass(x, z=~y); d(y); x ~ y",
    "match": FINE,
    "comatch": "box c → c; junction q → x; port c.q → q",
}
STEP = Derivation(**{field: READ[field](text) for field, text in TRUE.items()})
FORGED = {
    "a rule that takes one": ("rule", "; b(q)", ""),
    "a rule that takes three": ("rule", "b(q)", "b(q); d(q)"),
    "a rule that adds nothing": ("rule", "; c(q)", ""),
    "a rule that adds two": ("rule", "c(q)", "c(q); d(q)"),
    "a rule that adds a state port": ("rule", "c(q)", "c(~q)"),
    "a rule that keeps one": ("rule", "c(q)", "a(q)"),
    "a rule of another quantity": ("rule", "displacement", "momentum"),
    "a source with a box more": ("source", "d(y)", "d(y); e(x)"),
    "a source without the link": ("source", "; x ~ y", ""),
    "a source with a box renamed": ("source", "mass", "forged"),
    "a target with a box renamed": ("target", "mass", "forged"),
    "a target with the new box renamed": ("target", "c(", "forged("),
    "a target without the link": ("target", "; x ~ y", ""),
    "a target that is the source": ("target", TRUE["target"], TRUE["source"]),
    "a target that is not exposed": ("target", ", exposed", ""),
    "a target exposed as state": ("target", "exposed", "exposed as state"),
    "a target of another frame": ("target", "displacement", "displacement @ B"),
    "a target wired otherwise": ("target", "q=x", "q=y"),
    "a match of the wrong box": ("match", "stiff", "mass"),
    "a match of one box": ("match", "stiff", "soft"),
    "a match elsewhere": ("match", "q → x;", "q → y;"),
    "a match of fewer ports": ("match", "; port b.q → x", ""),
    "a match of a port that is not": ("match", "b.q → x", "b.q → y"),
    "a match without a junction": ("match", "junction q → x; ", ""),
    "a match of boxes that are not": ("match", "stiff", "stuff"),
    "a match of more": ("match", "stiff", "stiff; box c → mass"),
    "a comatch of an old box": ("comatch", TRUE["comatch"], "box c → d; junction q → y; port c.q → y"),
    "a comatch of no box": ("comatch", TRUE["comatch"], "junction q → x"),
    "a comatch elsewhere": ("comatch", "q → x", "q → y"),
    "a comatch of another port": ("comatch", "c.q → q", "c.q → x"),
}
"""Which field is told otherwise, and how."""


def test_the_step_is_that_of_the_rule():
    """The control: nothing is refused of what is true."""
    STEP.check()
    assert STEP.rule.apply(STEP.source, STEP.match).to_json() == STEP.to_json()


@pytest.mark.parametrize("case", FORGED)
def test_forged_derivations_are_refused(case):
    field, old, new = FORGED[case]
    assert old in TRUE[field]
    forged = replace(STEP, **{field: READ[field](TRUE[field].replace(old, new))})
    with pytest.raises(PatternError) as caught:
        forged.check()
    assert caught.value.kind == "derivation"


@given(derivations(), st.data())
def test_a_derivation_with_anything_exchanged_is_refused_or_true(step, data):
    """A field from another step: what the checker lets pass is what the rule does there."""
    other = data.draw(derivations(pattern=step.source))
    field = data.draw(st.sampled_from(["rule", "source", "target", "match", "comatch"]))
    forged = replace(step, **{field: getattr(other, field)})
    try:
        forged.check()
    except PatternError as error:
        assert error.kind == "derivation"
        return
    made = forged.rule.apply(forged.source, forged.match)
    assert made.target.isomorphic(forged.target, fix_interface=True) is not None


DOCUMENT = STEP.to_dict()


@pytest.mark.parametrize(
    "broken, words",
    [
        ({}, "no derivation can be read: document: found no key"),
        (DOCUMENT | {"format": 2}, "format: found 2"),
        (DOCUMENT | {"rule": []}, "rule: found"),
        (DOCUMENT | {"rule": DOCUMENT["rule"] | {"left": {}}}, r"rule\.left: found no key boxes"),
        (DOCUMENT | {"match": {}}, "match: found no key boxes"),
        (DOCUMENT | {"comatch": DOCUMENT["comatch"] | {"boxes": {"c": 1}}}, r"comatch\.boxes\.c: found 1"),
        (DOCUMENT | {"source": {}}, "source: .*no key format"),
    ],
)
def test_what_is_no_derivation_s_document_is_refused(broken, words):
    with pytest.raises(PatternError, match=words):
        Derivation.from_dict(broken)
