"""Proofs are data, replayed without search: what proves the library, and nothing that was tampered with."""

import ast
import json
import random
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs import Pattern, System
from ephs import quantity as Q
from ephs.operad import PatternError, Space
from ephs.semantics import Reference, StructureError, library
from ephs.semantics.primitives.primitives import Formula
from ephs.semantics.primitives.special import sinhc, squared_turn, turn_curve, turn_ratio
from ephs.semantics.spaces import manifold
from ephs.semantics.symbols.bounds import signs
from ephs.semantics.symbols.terms import OPERATIONS
from ephs.semantics.verdicts.checks import STATEMENTS
from ephs.semantics.verdicts.claims import Claim, Seen, frame_of
from ephs.semantics.verdicts.expansion import Expander
from ephs.semantics.verdicts.proving import proof_of, replay
from ephs.semantics.verdicts.replay import replayed
from ephs.semantics.verdicts.sums import Unexpandable, number_of, scaled
from ephs.semantics.verdicts.verdict import as_evidence
from tests.numerics import jacobian, slope
from tests.semantics.test_primitives import ARGUMENTS, made
from tests.semantics.zoo import drag

PROVED = [name for name in ARGUMENTS if name != "environment"]
SAMPLE = 24
"""Mutations of each proof."""
LARGE = {"reaction": 4, "ideal_mixture": 6}
"""The same for formulas whose replay takes a tenth of a second."""


def sent(proof):
    return json.loads(json.dumps(proof))


@pytest.mark.parametrize("name", PROVED)
def test_the_proof_of_each_library_primitive_is_replayed(name):
    primitive = made(name)
    proof = sent(proof_of(primitive))
    assert set(proof) == set(STATEMENTS[primitive.kind]) == replay(primitive, proof)


def test_a_structure_without_ports_is_proved():
    """A rigid joint has the kinematics of no freedoms: every identity of no entries holds."""
    joint = ephs.mechanics.joint("fixed")
    parts = [slot.primitive for slot in joint.flatten().descriptor().components]
    without = [part for part in parts if part.kind == "reversible" and not part.bundle.size]
    assert without
    assert all(part.verdict == "proved" for part in without)


def leaves(data, at=()):
    """Places of numbers, texts and lists inside data."""
    yield at
    for i, each in enumerate(data) if isinstance(data, list) else ():
        yield from leaves(each, (*at, i))


def changed(data, at, value):
    if not at:
        return value
    return [changed(each, at[1:], value) if i == at[0] else each for i, each in enumerate(data)]


def taken(data, at):
    for i in at:
        data = data[i]
    return data


def mutations(evidence, source, count):
    """Other evidence: a number, a text or a list changed, dropped, or put in another's place."""
    places = list(leaves(evidence))
    for _ in range(count):
        at = source.choice(places)
        old, other = taken(evidence, at), taken(evidence, source.choice(places))
        if isinstance(old, int | float):
            value = source.choice([-old, old * (1.0 + 1e-9), old + 1.0, 0.0, other])
        elif isinstance(old, list):
            drop = source.randrange(len(old)) if old else 0
            value = source.choice([old[:drop] + old[drop + 1 :], [*old, other], other])
        else:
            value = source.choice(["sin", "-", "abs", "x", "expansion", "signs", "squares", "rounding", other])
        if value != old:
            yield changed(evidence, at, value)


FUNCTIONS = {word: (least, function) for word, (least, _, function) in OPERATIONS.items()} | {
    "sinhc": (1, sinhc),
    "turn_ratio": (1, turn_ratio),
    "turn_curve": (1, turn_curve),
    "squared turn": (4, lambda *q: squared_turn(q)),
}


def number(term, x):
    """A term's value."""
    if not isinstance(term, tuple):
        return x[term] if isinstance(term, str) else term
    return FUNCTIONS[term[0]][1](*(number(each, x) for each in term[1:]))


def proves(primitive, statement, evidence):
    """By numbers at a few points: whether evidence is a proof, up to rounding."""
    form, *data = as_evidence(evidence)
    searched = {"∂E/∂s > 0": "signs", "M ⪰ 0": "squares"}.get(statement)
    if searched is None:
        return form in ("expansion", "rounding")
    if form != searched:
        return False
    rng = np.random.default_rng(0)
    numbers = {name: value for name, value in primitive.parameters if isinstance(value, float)}
    for _ in range(3):
        x = {str(port): rng.uniform(0.5, 1.5) for port in primitive.interface} | numbers
        states = {port: np.array([x[str(port)]]) for port in primitive.reads}
        if form == "signs":
            slopes = primitive.energy_gradient(states)
            hot = [i for i, (_, _, quantity) in enumerate(primitive.bundle.items()) if quantity.kind == "entropy"]
            found, expected = [number(term, x) for term in data[0]], slopes[hot][: len(data[0])]
        else:
            whole = Reference(1.0, 0.0)
            e = np.array([x[str(port)] for port in primitive.bundle.ports]) - primitive.bundle.intensive(whole)
            found = sum(
                (number(d, x) * np.outer(v, v) for d, v in ((d, [number(a, x) for a in v]) for d, v in data[0])), 0
            )
            expected = primitive.matrix(states, e, whole)
        if not np.allclose(found, expected, rtol=1e-12):
            return False
    return True


@pytest.mark.parametrize("name", PROVED)
def test_a_mutated_proof_is_refused_or_still_a_proof(name):
    primitive, source = made(name), random.Random(name)
    count, refused = LARGE.get(name, SAMPLE), 0
    for statement, evidence in sent(proof_of(primitive)).items():
        for mutant in mutations(evidence, source, count):
            if statement in replay(primitive, {statement: mutant}):
                assert proves(primitive, statement, mutant), (statement, mutant)
            else:
                refused += 1
    assert refused >= count // 2


SPOILT = {
    "friction": lambda p, s, d: [[d * s, -d * p], [-d * p, d * p**2 / s * (1.0 + 1e-12)]],
    "heat_transfer": lambda s1, s2, h: [[h * s2 / s1, -h], [-h, h * (s1 + 1e-9) / s2]],
    "resistor": lambda b, s, r: [[-r * s, r * b], [r * b, -r * b**2 / s]],
}


@pytest.mark.parametrize("name", SPOILT)
def test_the_proof_of_another_structure_is_refused(name):
    right = made(name)
    wrong = replace(right, formula=Formula(SPOILT[name], right.formula.parameters), proof=None, trusted=True)
    assert "M ⪰ 0" not in replay(wrong, proof_of(right))


def test_squares_do_not_divide_by_what_vanishes_on_a_half_line():
    """M = (|p| + p) [[s, −p], [−p, p²/s]] is right; the vector (M₁₁/M₁₁, M₂₁/M₁₁) is 0/0 for p < 0."""
    half = drag(lambda p, s: abs(p) + p, one_sided=True)()
    d = ["*", ["+", ["abs", "p"], "p"], "s"]
    slope = ["-", ["/", "p", "s"]]
    assert not replay(half, {"M ⪰ 0": ["squares", [[d, [1.0, slope]]]]})  # d is not shown to be ≥ 0 by signs
    d = ["*", ["shown", ["*", 2.0, ["abs", "p"]]], "s"]
    assert not replay(half, {"M ⪰ 0": ["squares", [[d, [1.0, slope]]]]})  # ≥ 0, but another matrix
    over = drag(lambda p, s: abs(p))()
    d = ["*", ["abs", "p"], "s"]
    assert replay(over, {"M ⪰ 0": ["squares", [[d, [1.0, slope]]]]})
    assert not replay(over, {"M ⪰ 0": ["squares", [[d, [["/", d, d], slope]]]]})


RIGHT = [
    ("sin(x)**2 + cos(x)**2", "1"),
    ("exp(x) * exp(-x)", "1"),
    ("exp(x + y)", "exp(x) * exp(y)"),
    ("abs(x)**2", "x * x"),
    ("sqrt(x * x)", "abs(x)"),
    ("sqrt(p * p)", "p"),
    ("(x * x - y * y) / (x - y)", "x + y"),
    ("cos(x - y)", "cos(y - x)"),
    ("atan(x - y)", "-atan(y - x)"),
    ("cosh(x)**2 - sinh(x)**2", "1"),
    ("exp(3 * log(p))", "p**3"),
    ("(1 + x * x)**0.5", "sqrt(x * x + 1)"),
    ("sign(x) * x", "abs(x)"),
    ("1 / (1 / p + 1 / y)", "p * y / (p + y)"),
]
WRONG = [
    ("abs(x)", "x"),
    ("sqrt(x * x)", "x"),
    ("sqrt(x * x + y * y)", "abs(x) + abs(y)"),
    ("exp(x * y)", "exp(x) * exp(y)"),
    ("sin(x)**2 + cos(y)**2", "1"),
    ("sin(x)", "sin(-x)"),
    ("cos(x)", "-cos(-x)"),
    ("0.1 * 3", "0.3"),
    ("abs(x + y)", "abs(x) + abs(y)"),
    ("(x**2)**0.25", "x**0.5"),
]
SIGNS = {ast.Add: "+", ast.Sub: "-", ast.USub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "^"}


def term_of(formula):
    """Of a text, or a node of it."""
    match ast.parse(formula, mode="eval").body if isinstance(formula, str) else formula:
        case ast.BinOp(one, sign, other):
            return [SIGNS[type(sign)], term_of(one), term_of(other)]
        case ast.UnaryOp(sign, inner):
            return [SIGNS[type(sign)], term_of(inner)]
        case ast.Call(ast.Name(word), inner):
            return [word, *map(term_of, inner)]
        case ast.Name(word):
            return word
        case ast.Constant(number):
            return float(number)


def difference(one, other):
    on = Expander()
    known = {"x": on.atom("symbol", "x", False), "y": on.atom("symbol", "y", False), "p": on.atom("symbol", "p", True)}

    def value(term):
        if isinstance(term, list):
            return on.function(term[0], *map(value, term[1:]))
        return known[term] if isinstance(term, str) else number_of(Fraction(term))

    expanded = value(one), value(other)
    for each in expanded:  # written as a term it expands to the same
        assert value(sent(on.term(each))) == each
    return on, on.add(expanded[0], scaled(expanded[1], -1))


@pytest.mark.parametrize(("one", "other"), RIGHT)
def test_identities_are_expanded(one, other):
    on, apart = difference(term_of(one), term_of(other))
    assert on.vanishes(apart)


@pytest.mark.parametrize(("one", "other"), WRONG)
def test_what_is_no_identity_does_not_expand_to_zero(one, other):
    on, apart = difference(term_of(one), term_of(other))
    assert not on.vanishes(apart)


@pytest.mark.parametrize("word", FUNCTIONS)
def test_what_a_function_expands_to_has_its_value_and_its_slope(word):
    on, (count, function) = Expander(), FUNCTIONS[word]
    more = [0.75, 0.5, 0.25][: count - 1]
    found = on.function(word, on.atom("symbol", "x", False), *(number_of(Fraction(each)) for each in more))
    x = 1.3 if word == "acosh" else 0.7
    assert number(on.term(found), {"x": x}) == pytest.approx(function(x, *more), rel=1e-14, abs=0.0)
    expected = slope(lambda d: function(x + d, *more), 1e-5)  # of which h² and ε/h are left
    assert number(on.term(on.slope(found, "x")), {"x": x}) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    "term",
    [
        ["^", 2.0, 1e9], ["^", 0.5, 1e5], ["^", ["+", "x", "y", 1.0], 1e9], ["/", 1.0, ["-", "x", "x"]], ["what", "x"],
    ],
)  # fmt: skip
def test_what_has_no_expansion_is_refused_at_once(term):
    with pytest.raises(Unexpandable):
        difference(term, 0.0)


@pytest.mark.parametrize(
    ("term", "expected"),
    [
        (("*", "x", "x"), {0, 1}),
        (("+", ("*", "x", "x"), "p"), {1}),
        (("-", "p", 1.0), {-1, 0, 1}),
        (("*", "n", "p"), {-1}),
        (("^", "n", 3.0), {-1}),
        (("+", 1.0, ("sin", "x")), {-1, 0, 1}),
        (("shown", ("+", 1.5, ("sin", "x"))), {1}),
        (("shown", ("-", ("*", "x", "x"), "p")), {-1, 0, 1}),
    ],
)
def test_signs_are_those_of_the_parts(term, expected):
    inf = float("inf")
    assert signs(term, {"x": (-inf, inf), "p": (0.0, inf), "n": (-inf, 0.0)}) == expected


def test_documents_carry_proofs_and_tampered_ones_are_refused():
    brake = drag(lambda p, s: 0.3 + abs(p))()
    pattern = Pattern.from_text("p: momentum; s: entropy; a(p, s); b(p, s)")
    system = pattern({"a": library.friction(d=2.0), "b": brake})
    text = system.to_json(proofs=True)
    assert text.count('"squares"') == 2 and '"proof"' not in system.to_json()
    assert System.from_json(text) == system
    tampered = text.replace('["squares", [[', '["squares", [[["*", 1.0000001, "s"], [1.0, 0.0]], [', 1)
    with pytest.raises(PatternError, match=r"parts\[0\].proof.M ⪰ 0.*a proof of it"):
        System.from_json(tampered)


@pytest.mark.parametrize(
    "space", [Q.pose.space, Q.direct_pose.space, Q.displacement.space, Space("SE(2)", 3, 3), Space("SO(3)", 3, 4)]
)
def test_frames_are_the_derivatives_of_retractions(space):
    group, rng = manifold(space), np.random.default_rng(3)
    symbols = tuple(f"x{i}" for i in range(group.size))
    x = group.random(rng)
    rows = frame_of(Seen(symbols, (-np.inf, np.inf), group.code, 1))
    found = [[number(entry, dict(zip(symbols, x, strict=True))) for entry in row] for row in rows]
    assert np.allclose(found, jacobian(lambda v: group.retract(x, v), group.dim, 1e-6), atol=1e-9)


def test_the_gradient_of_a_turned_energy_is_proved_and_a_wrong_one_is_not():
    """E = k z of a pose: the force is the third row of the rotation, in body axes."""

    def height(q):
        return 3.0 * q[6]

    def lift(q):
        w, a, b, c = q[0], q[1], q[2], q[3]
        return [
            np.array(
                [0.0 * w, 0.0 * w, 0.0 * w, 6.0 * (a * c - w * b), 6.0 * (b * c + w * a), 3.0 - 6.0 * (a * a + b * b)]
            )
        ]

    _, _, gradient, _ = STATEMENTS["storage"]
    lifted = ephs.storage({"q": Q.pose}, height, lift)
    assert replay(lifted, {gradient: ["expansion", "as given"]}) == {gradient}
    wrong = replace(lifted, formula=Formula(height, (), lambda q: [-lift(q)[0]]), trusted=True)
    assert not replay(wrong, {gradient: ["expansion", "as given"]})


@pytest.mark.parametrize("energy", [lambda s: s**3, lambda s: s + np.sin(s), lambda s: s * abs(s)])
def test_a_temperature_that_may_be_zero_is_not_proved(energy):
    """∂E/∂s ≥ 0 is no proof of ∂E/∂s > 0."""
    try:
        assert ephs.storage({"s": Q.entropy}, energy).verdict == "searched"
    except StructureError as error:
        assert error.kind == "cold"


@pytest.mark.parametrize("kind", ["irreversible", "storage"])
def test_what_is_decided_to_rounding_is_of_dirac_structures(kind):
    """Skewness is no symmetry, and no sign: evidence of one kind proves nothing of another."""
    seen = (Seen(("p",), (-np.inf, np.inf), 0, -1),)
    claim = Claim(kind, (0.0, -1.0, 1.0, 0.0), seen, (1, 1), (), (False, True), None, {})
    assert not replayed(claim, {statement: ("rounding",) for statement in STATEMENTS[kind]})


@given(st.floats(-12.0, 0.0), st.floats(0.0, 9.0))
def test_each_number_is_rounded_by_itself(size, large):
    """What leaks energy, or a charge, beside large numbers is not decided to be rounding."""
    leak, big = 10.0**size, 10.0**large
    energy = np.array([[0.0, -big, 0.0], [big, 0.0, leak], [0.0, leak, 0.0]])
    charge = np.array([[0.0, -big, 0.0], [big, 0.0, -leak], [0.0, leak, 0.0]])
    for matrix, place in ((energy, 0), (charge, 1)):
        claim = Claim("reversible", tuple(matrix.ravel().tolist()), (), (1, -1, 1), ((0.0, 0.0, 1.0),), (), None, {})
        statement = STATEMENTS["reversible"][place]
        assert not replayed(claim, {statement: ("rounding",)})
