"""Structures are proved, searched for counterexamples, or refused with the smallest one."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import Pattern
from ephs import quantity as Q
from ephs.semantics import StructureError, library
from ephs.semantics.bundles.bundle import Bundle
from ephs.semantics.library import power_ports
from ephs.semantics.stage.store import STORE
from ephs.semantics.verdicts import proving as prover
from ephs.semantics.verdicts.checks import _apart
from ephs.semantics.verdicts.proving import conditions_of
from ephs.semantics.verdicts.verdict import Condition, StructureVerdict
from ephs.testing import check_entropy_production, check_primitive
from tests.processes import printed
from tests.semantics.test_primitives import ARGUMENTS, made
from tests.semantics.zoo import AB, MALFORMED, QP, ZOO, conduct, conduction_matrix, drag, hidden, outer

FAR = 5e4
"""Beyond it, numbers are not of human size."""
DIGITS = 7
"""Of a number of human size: of 300.003 next to 300."""


def refused(make):
    with pytest.raises(StructureError) as caught:
        make()
    return caught.value


def numbers(witness):
    """Its numbers but those of poses, whose quaternions are of length 1."""
    for value in (*witness.states.values(), *witness.efforts.values()):
        if isinstance(value, tuple):
            yield from value[4:] if len(value) == 7 else value
        else:
            yield value


@pytest.mark.parametrize("name", ZOO)
def test_wrong_primitives_are_refused_with_a_witness_of_human_size(name):
    make, kind = ZOO[name]
    error = refused(make)
    assert error.kind == kind, str(error)
    witness = error.witness
    assert witness is not None and f"witness: {witness}" in str(error)
    for value in numbers(witness):
        assert value == 0.0 or 1e-5 < abs(value) < FAR, str(witness)
        assert float(f"{value:.{DIGITS}g}") == value, str(witness)
    if kind in ("isotropy", "conservation", "symmetry", "energy", "gradient"):
        assert witness.entry and str(witness.entry) in str(error)
    if kind != "finite" and name != "temperature of zero":
        assert witness.size != 0.0 or kind in ("even", "cold")
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.kind, again.path, again.witness) == (str(error), error.kind, error.path, witness)


@pytest.mark.parametrize("name", MALFORMED)
def test_what_has_no_structure_is_refused_without_a_witness(name):
    make, kind = MALFORMED[name]
    error = refused(make)
    assert error.kind == kind and error.witness is None


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("conducts by a − b", "a = 1, b = 2"),
        ("conducts by the sign of a − b, hidden", "a = 1, b = 2"),
        ("drives around |v| = 4", "p = 4, s = 1"),
        ("a bump at x = 3", "x = 3"),
        ("negative temperature for s < −3", "s = -4"),
        ("drives where x is negative", "p = 1, s = 1, x = -1"),
    ],
)
def test_witnesses_are_the_smallest(name, text):
    assert str(refused(ZOO[name][0]).witness) == text


@pytest.mark.parametrize("name", library.__all__)
def test_the_library_is_proved(name):
    verdict = made(name).verdict
    assert verdict == "proved", verdict.text
    assert all(condition.how for condition in verdict.conditions)


@pytest.mark.parametrize("name", ["lever", "friction", "heat_transfer", "resistor"])
@pytest.mark.parametrize("value", [0.0, -2.0, 1e-9])
def test_proofs_hold_for_all_numbers_of_a_sign(name, value):
    (key,) = ARGUMENTS[name]
    if value < 0.0 and name != "lever":
        assert refused(lambda: getattr(library, name)(**{key: value})).kind == "parameter"
    else:
        assert getattr(library, name)(**{key: value}).verdict == "proved"


@pytest.mark.parametrize("name", [name for name in library.__all__ if made(name).formula is not None])
def test_the_formulas_of_the_library_are_proved_symbolically(name):
    primitive = replace(made(name), proof=None, trusted=True)
    assert all(condition.proved for condition in conditions_of(primitive)), primitive.verdict.text


@pytest.fixture
def proofs(tmp_path, monkeypatch):
    """Kinds of claims that were proved so far, with an empty store on disk."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(STORE, "usable", True)
    done = []

    def counted(claim, prove=prover.evidence_of):
        done.append(claim.kind)
        return prove(claim)

    monkeypatch.setattr(prover, "evidence_of", counted)
    return done


@pytest.mark.parametrize("name", ["friction", "heat_transfer", "point_mass", "lever"])
def test_proofs_on_disk_are_those_of_the_prover(name, proofs):
    primitive = replace(made(name), proof=None, trusted=True)
    first = conditions_of(primitive)
    assert len(proofs) == 1
    assert conditions_of(primitive) == first
    assert len(proofs) == 1


def test_proofs_of_other_signs_and_of_foreign_functions_are_not_taken_from_disk(proofs):
    for d in (1.0, 0.0, 2.0):
        conditions_of(replace(library.friction(d=d), proof=None, trusted=True))
    assert len(proofs) == 2
    own = ephs.storage({"q": Q.displacement}, lambda q: 0.5 * q * q)
    for _ in range(2):
        assert all(condition.proved for condition in conditions_of(own))
    assert proofs.count("storage") >= 2


def test_the_library_is_proved_without_symbols():
    """Making and checking a system of library parts must not load SymPy."""
    code = (
        "import sys\nfrom tests.semantics.test_primitives import ARGUMENTS, made\n"
        "for name in ARGUMENTS:\n"
        "    assert made(name).verdict == 'proved'\n"
        "assert 'sympy' not in sys.modules"
    )
    printed(code)


RIGHT = {
    "conduction by a square": conduct(lambda a, b: (a - b) ** 2 + 1e-3),
    "conduction that waves": conduct(lambda a, b: 1.0 + 0.5 * np.cos(a - b)),
    "polynomial without roots": drag(lambda p, s: p**4 - 2.0 * p**2 + 1.5),
    "polynomial with double roots": drag(lambda p, s: p**4 - 2.0 * p**2 + 1.0),
    "Stribeck friction": drag(lambda p, s: 0.2 + 0.3 * np.exp(-((p / 0.1) ** 2))),
    "three bodies": lambda: ephs.irreversible(
        {"a": Q.entropy, "b": Q.entropy, "c": Q.entropy},
        lambda a, b, c: outer([b, -a, 0 * c]) + 2.0 * outer([0 * a, c, -b]) + 0.5 * outer([c, 0 * b, -a]),
    ),
    "soft gas": lambda: ephs.storage({"s": Q.entropy, "v": Q.volume}, lambda s, v: np.exp(s) / v + 1.0 / v**2),
}  # fmt: skip


@pytest.mark.parametrize("name", RIGHT)
def test_right_primitives_that_can_be_traced_are_proved(name):
    verdict = RIGHT[name]().verdict
    assert verdict == "proved", verdict.text


HIDDEN = {
    "radiation": conduct(hidden(lambda a, b: 5e-8 * (a**2 + b**2) * (a + b))),
    "friction": drag(hidden(lambda p, s: 0.1 + abs(p) ** 1.7)),
    "spring": lambda: ephs.storage({"q": Q.displacement}, lambda q: math.cosh(float(q))),
    "gyrator": lambda: ephs.gyrator(
        {**QP, "~x": Q.displacement}, lambda x: math.floor(x) * np.array([[0.0, -1.0], [1.0, 0.0]])
    ),
}


@pytest.mark.parametrize("name", HIDDEN)
def test_right_primitives_that_cannot_be_traced_are_searched(name):
    verdict = HIDDEN[name]().verdict
    assert verdict == "searched"
    assert verdict.open and "states and efforts" in verdict.text


def test_a_verdict_is_a_word_with_its_conditions():
    verdict = StructureVerdict([Condition("a", True, ("stated", "x")), Condition("b", False, ("off", "y"))])
    assert verdict == "searched" and verdict.open == (Condition("b", False, ("off", "y")),)
    assert verdict.text == "searched\n  a: proved, as whoever made it states, by construction: x\n  b: searched, y"
    assert pickle.loads(pickle.dumps(verdict)).conditions == verdict.conditions


def test_equal_and_unequal_are_not_asked_of_symbols():
    """Else a function that compares its argument to a number would be traced as if they differed."""
    assert ephs.storage({"q": Q.displacement}, lambda q: q**2 + (q == 3.0)).verdict == "searched"
    assert ephs.storage({"q": Q.displacement}, lambda q: q**2 + (q != 3.0)).verdict == "searched"


# ---- for other people's suites ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["conducts by a − b, hidden", "drives around |v| = 4, hidden", "odd beyond a hundred"])
def test_check_primitive_finds_what_is_trusted_wrongly(name, monkeypatch):
    make, kind = ZOO[name]
    expected = refused(make).witness
    with monkeypatch.context() as context:
        context.setattr("ephs.semantics.primitives.primitives.examine", lambda _: StructureVerdict([]))
        primitive = make()
    with pytest.raises(AssertionError, match=f"^{kind}: ") as caught:
        check_primitive(primitive)
    assert f"witness: {expected}" in str(caught.value)


def test_check_primitive_gives_the_verdict():
    assert check_primitive(library.friction(d=0.3), max_examples=20) == "proved"
    assert check_primitive(HIDDEN["friction"](), max_examples=50) == "searched"


@settings(max_examples=3)
@given(st.sampled_from(["friction", "spring"]))
def test_check_primitive_runs_inside_of_property_tests(name):
    assert check_primitive(HIDDEN[name](), max_examples=20) == "searched"


def forged():
    """A conduction that passed its checks, and then changed its sign for a < b."""
    honest = [True]

    def matrix(a, b):
        return (1.0 if float(a) >= float(b) or honest[0] else -1.0) * conduction_matrix(a, b)

    made = ephs.irreversible(AB, matrix)
    honest[0] = False
    return made


def test_entropy_production_fails_with_the_temperatures_and_the_path():
    pattern = Pattern.from_text("a: entropy; b: entropy; hot(s=a); cold(s=b); wall(a, b)")
    body = library.thermal_capacity(c1=300.0, c2=1.0)
    system = pattern(hot=body, cold=body, wall=forged())
    with pytest.raises(AssertionError, match=r"entropy production: wall: .*negative.*witness: a = 1, b = 2"):
        check_entropy_production(system)
    check_entropy_production(pattern(hot=body, cold=body, wall=HIDDEN["radiation"]()))


def test_printed_components_and_checks_say_the_verdict():
    pattern = Pattern.from_text("a: entropy; b: entropy; hot(s=a); cold(s=b); wall(a, b)")
    body = library.thermal_capacity(c1=300.0, c2=1.0)
    system = pattern(hot=body, cold=body, wall=HIDDEN["radiation"]())
    assert "[irreversible, searched]" in str(system) and "[storage, proved]" in str(system)
    item = next(item for item in system.check().items if item.name == "structure")
    assert item.ok and "2 of them by proof" in item.detail and "watched in runs: wall" in item.detail


PORTS = {name: Q.momentum for name in ("a", "b", "c")}
TURNED = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
HELD = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, -1.0]])
SHIFT = HELD.T @ np.array([[0.3, 0.0, 1.0], [0.0, -2.0, 0.5]])
STRUCTURES = {
    "other rows of the same span": (TURNED, np.array([[2.0, -1.0], [1.0, 3.0]]) @ HELD, 0.0),
    "what multipliers take up": (TURNED + SHIFT - SHIFT.T, HELD, 0.0),
    "up to rounding of evaluations": (TURNED, HELD[::-1] * (1.0 + 1e-12), 0.0),
    "another span": (TURNED, HELD + np.array([[0.0, 0.0, 1e-3], [0.0, 0.0, 0.0]]), 5e-4),
    "a constraint less": (TURNED, HELD * np.array([[1.0], [0.0]]), 0.5),
    "another turn": (TURNED + np.outer([0, 0, 1], [1.0, 0, 0]) - np.outer([1.0, 0, 0], [0, 0, 1]), HELD[:1], 0.5),
}


@pytest.mark.parametrize("name", STRUCTURES)
def test_structures_are_compared_as_relations(name):
    skew, constraint, least = STRUCTURES[name]
    bundle = Bundle.of(power_ports(**PORTS))
    found = _apart(bundle, (TURNED, HELD[: len(constraint)]), (skew, constraint))
    assert found == 0.0 if least == 0.0 else found >= least
