"""A function and its record are one thing: wrong parts are refused, whatever they hide behind; right ones are not."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs import Pattern
from ephs import quantity as Q
from ephs.semantics import Reference, StructureError, library
from ephs.semantics.verdicts.recorded import DEFINED
from ephs.semantics.verdicts.trials import trial_of
from tests.semantics.verdicts.right_parts import turn
from tests.semantics.verdicts.wrong_parts import QP, TURN, X, gyrator, stored
from tests.semantics.zoo import drag

POSE = {"q": Q.pose}


def reading(ratio):
    """A gyrator of this ratio of a state."""
    return gyrator({**QP, **X}, lambda x: ratio(x) * TURN)


def at_room_temperature(s):
    return abs(s - 293.15) < 1.0


def pulled(q):
    """½ r² of a pose, whose slope is Rᵀ r."""
    return 0.5 * (q[4] ** 2 + q[5] ** 2 + q[6] ** 2)


def pull(part):
    return lambda q: np.concatenate([np.zeros(3), part * (turn(q).T @ q[4:])])


WRONG = {
    "energy of a pose that asks": (
        stored(lambda q: pulled(q) * (1.0 + (np.asarray(q).dtype == float)), ports=POSE), "unlike"
    ),
    "gyrator that is no number": (reading(lambda x: math.nan if isinstance(x, float) else 1.0), "unlike"),
    "a formula of another energy": (
        lambda: type(made := stored(lambda q: q**2)())(
            "w", made.interface, lambda x: 3.0 * float(next(iter(x.values()))[0]) ** 2, formula=made.formula
        ), "unlike",
    ),
    "negative just above 411.25 K": (drag(lambda p, s: -1.0 if 0.0 < s - 411.25 < 1e-9 else 1.0), "definite"),
    "negative just below a speed": (
        drag(lambda p, s, limit=2.75: -1.0 if 0.0 < limit - abs(p) < 1e-9 else 1.0), "definite"
    ),
    "negative by a helper": (
        drag(lambda p, s: -1.0 if at_room_temperature(float(s)) and p > 0 else 1.0), "definite"
    ),
    "off in a pose, hidden": (stored(lambda q: float(pulled(q)), pull(1.0001), ports=POSE), "gradient"),
    "in world axes": (
        stored(pulled, lambda q: np.concatenate([np.zeros(3), q[4:]]), ports=POSE), "gradient"
    ),
    "√p⁴ by a root of p": (drag(lambda p, s: np.sqrt(p) ** 4), "no-value"),
    "a root of a gyrator": (reading(lambda x: np.sqrt(x)), "no-value"),
}  # fmt: skip
"""Name -> (what makes it, which condition it breaks), beside the drawn kinds."""

RIGHT = {
    "cancelling, hidden": stored(lambda q: float(q) ** 4 - float(q) ** 2, lambda q: [4.0 * q**3 - 2.0 * q]),
    "fast": stored(lambda q: math.sin(1e3 * float(q)), lambda q: [1e3 * math.cos(1e3 * float(q))]),
    "pole": stored(lambda q: 1.0 / float(q) ** 2, lambda q: [-2.0 / q**3]),
    "pieces": stored(lambda q: q**2 if q > 0 else 2 * q**2, lambda q: [2 * q if q > 0 else 4 * q]),
    "pose": stored(pulled, pull(1.0), ports=POSE),
    "overflows": drag(lambda p, s: 1.0 / (1.0 + np.exp(-(p**2)))),
    "sums": drag(lambda p, s: np.sum(np.array([0.1 * p * p] * 20)) + 0.3),
    "root in its domain": stored(lambda q: q * np.log(q), domain={"q": (0.0, math.inf)}),
    "closes over a list": drag(lambda p, s, k=[2.0]: k[0]),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_part_is_refused(name):
    make, kind = WRONG[name]
    with pytest.raises(StructureError) as caught:
        make()
    assert caught.value.kind == kind, str(caught.value)
    assert caught.value.witness is not None and str(caught.value.witness) in str(caught.value)


@pytest.mark.parametrize("name", RIGHT)
def test_a_right_part_is_not(name):
    assert RIGHT[name]().verdict in ("proved", "searched")


def test_a_difference_names_arguments_and_both_answers():
    with pytest.raises(StructureError, match=r"function says -1\.0, expected 1\.0 .*entry \(0, 0\).*p = 1, s = 1"):
        drag(lambda p, s: -1.0 if np.isscalar(p) else 1.0)()


@given(st.floats(-5.0, 5.0), st.floats(0.5, 400.0))
def test_what_changes_later_changes_nothing(p, s):
    """Relations say what runs do, whatever happens to a closure: d p² of heat."""
    ratio = [2.0]
    part = drag(lambda p, s: ratio[0])()
    ratio[0] = -5.0
    reference = Reference(1.0, 0.0)
    flow = part.flow({}, np.array([p, s - 1.0]), reference)
    assert np.allclose(flow, [2.0 * p, -2.0 * p * p / s], rtol=1e-13, atol=1e-13 * (abs(p) + p * p))


@pytest.mark.parametrize(
    ("part", "place"),
    [
        (drag(lambda p, s: 1.0 / abs(p)), "p = 0"),
        (gyrator({**QP, **X, "~y": Q.displacement}, lambda x, y: np.sin(x - y) / (x - y) * TURN), "x = 1, y = 1"),
    ],
)
def test_single_points_without_a_value_are_named_and_do_not_refuse(part, place):
    """Coulomb's friction is 0/0 at rest; a ratio of two states is where these are equal."""
    verdict = part().verdict
    assert verdict == "searched" and [c.statement for c in verdict.open] == [DEFINED]
    assert place in verdict.text


def test_a_relation_without_a_value_says_where():
    system = Pattern.from_text("q: displacement, exposed; p: momentum, exposed; x: displacement; g(q, p, ~x); k(q=x)")(
        g=reading(lambda x: np.log(abs(x)))(), k=library.spring(k=1.0)
    )
    with pytest.raises(StructureError, match=r"the matrix L has no value at x = 0\.0"):
        system.relation().at({"k.q": 0.0})
    assert not system.relation().at({"k.q": 2.0}).empty


def test_a_witness_has_no_negative_zeros():
    primitive = reading(lambda x: x)()
    assert str(trial_of(primitive, [-0.0], Reference()).witness(primitive)) == "x = 0"
