"""A function and its record are one thing: wrong parts are refused, whatever they hide behind; right ones are not."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import Pattern
from ephs import quantity as Q
from ephs.semantics import Reference, StructureError, library
from ephs.semantics.verdicts.recorded import DEFINED
from ephs.testing import check_primitive
from tests.semantics.zoo import hidden

QP = {"q": Q.displacement, "p": Q.momentum}
PS = {"p": Q.momentum, "s": Q.entropy}
SOURCE = np.random.default_rng(1)
TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


def friction(d, **more):
    """Friction of the coefficient d(p, s)."""
    return lambda: ephs.irreversible(PS, lambda p, s: d(p, s) * np.array([[s, -p], [-p, p * p / s]]), **more)


def stored(energy, gradient=None, q=Q.displacement, **more):
    return lambda: ephs.storage({"q": q}, energy, gradient, **more)


def pair(energy, gradient):
    return lambda: ephs.storage({"q": Q.displacement, "x": Q.charge}, energy, gradient)


def gyrator(ratio):
    return lambda: ephs.gyrator({**QP, "~x": Q.displacement}, lambda x: ratio(x) * TURN)


def counted(answer):
    """A function of the number of its calls so far."""
    calls = []

    def function(*_):
        calls.append(None)
        return answer(len(calls))

    return function


def remembering():
    """A function of the argument of the call before."""
    last = [1.0]

    def function(q):
        before, last[0] = last[0], float(q)
        return float(q) ** 2 + abs(before)

    return function


def at_room_temperature(s):
    return abs(s - 293.15) < 1.0


def rotation(q):
    w, x, y, z = q[:4]
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def pulled(q):
    """½ r² of a pose, whose slope is Rᵀ r."""
    return 0.5 * (q[4] ** 2 + q[5] ** 2 + q[6] ** 2)


def pull(part):
    return lambda q: np.concatenate([np.zeros(3), part * (rotation(q).T @ q[4:])])


WRONG = {
    # ---- the function is not its record --------------------------------------------------------------------------
    "asks np.isscalar": (friction(lambda p, s: -1.0 if np.isscalar(p) else 1.0), "unlike"),
    "asks isinstance": (friction(lambda p, s: 2.0 if isinstance(s, float) else 1.0), "unlike"),
    "asks isinstance of NumPy": (friction(lambda p, s: 2.0 if isinstance(s, np.floating) else 1.0), "unlike"),
    "asks for a method": (friction(lambda p, s: 2.0 if hasattr(p, "is_integer") else 1.0), "unlike"),
    "asks in a window": (
        friction(lambda p, s: -1.0 if np.isscalar(s) and at_room_temperature(s) else 1.0), "unlike"
    ),
    "asks in a thin window": (friction(lambda p, s: -1.0 if np.isscalar(p) and abs(p - 7.3) < 1e-9 else 1.0), "unlike"),
    "asks where it is large": (friction(lambda p, s: 3.0 if np.isscalar(p) and p > 1e4 else 1.0), "unlike"),
    "asks where it is small": (friction(lambda p, s: 3.0 if np.isscalar(p) and 0 < p < 1e-4 else 1.0), "unlike"),
    "energy that asks": (stored(lambda q: q**2 * (2.0 if np.isscalar(q) else 1.0)), "unlike"),
    "energy of a pose that asks": (
        stored(lambda q: pulled(q) * (1.0 + (np.asarray(q).dtype == float)), q=Q.pose), "unlike"
    ),
    "gyrator that asks": (gyrator(lambda x: 2.0 if np.isscalar(x) else 1.0), "unlike"),
    "gyrator that is no number": (gyrator(lambda x: math.nan if isinstance(x, float) else 1.0), "unlike"),
    "a formula of another energy": (
        lambda: type(made := stored(lambda q: q**2)())(
            "w", made.interface, lambda x: 3.0 * float(next(iter(x.values()))[0]) ** 2, formula=made.formula
        ), "unlike",
    ),
    # ---- the function changes ------------------------------------------------------------------------------------
    "counts its calls": (friction(counted(float)), "changing"),
    "counts its calls, hidden": (friction(hidden(counted(float))), "changing"),
    "gyrator that counts": (gyrator(counted(float)), "changing"),
    "draws": (friction(lambda p, s: SOURCE.uniform()), "changing"),
    "remembers": (stored(remembering()), "changing"),
    # ---- windows -------------------------------------------------------------------------------------------------
    "negative about 293.15 K": (friction(lambda p, s: -1.0 if at_room_temperature(float(s)) else 1.0), "definite"),
    "negative between 297 K and 298.5 K": (
        friction(lambda p, s: -1.0 if 297.0 < float(s) < 298.5 else 1.0), "definite"
    ),
    "negative just above 411.25 K": (friction(lambda p, s: -1.0 if 0.0 < s - 411.25 < 1e-9 else 1.0), "definite"),
    "negative just below a speed": (
        friction(lambda p, s, limit=2.75: -1.0 if 0.0 < limit - abs(p) < 1e-9 else 1.0), "definite"
    ),
    "negative by a helper": (
        friction(lambda p, s: -1.0 if at_room_temperature(float(s)) and p > 0 else 1.0), "definite"
    ),
    # ---- gradients -----------------------------------------------------------------------------------------------
    "off by 1e-4": (stored(lambda q: q**4, lambda q: [4.0004 * q**3]), "gradient"),
    "off by 1e-8": (stored(lambda q: q**4, lambda q: [4.00000004 * q**3]), "gradient"),
    "off by 1e-4, hidden": (stored(lambda q: float(q) ** 4, lambda q: [4.0004 * q**3]), "gradient"),
    "off by a constant": (stored(lambda q: np.cosh(q), lambda q: [np.sinh(q) + 1e-5]), "gradient"),
    "off along one direction": (
        pair(lambda q, x: q**2 * x**2, lambda q, x: [2 * q * x**2 + 1e-4 * x, 2 * q**2 * x - 1e-4 * q]), "gradient"
    ),
    "off along one direction, hidden": (
        pair(
            lambda q, x: float(q) ** 2 + float(x) ** 2,
            lambda q, x: [2 * q + 1e-4 * x, 2 * x - 1e-4 * q],
        ), "gradient",
    ),
    "off in a pose": (stored(pulled, pull(1.0001), q=Q.pose), "gradient"),
    "off in a pose, hidden": (stored(lambda q: float(pulled(q)), pull(1.0001), q=Q.pose), "gradient"),
    "in world axes": (
        stored(pulled, lambda q: np.concatenate([np.zeros(3), q[4:]]), q=Q.pose), "gradient"
    ),
    # ---- no value ------------------------------------------------------------------------------------------------
    "√p⁴ by a root of p": (friction(lambda p, s: np.sqrt(p) ** 4), "no-value"),
    "√q⁴ as an energy": (stored(lambda q: np.sqrt(q) ** 4), "no-value"),
    "a logarithm": (stored(lambda q: q * np.log(q)), "no-value"),
    "a root of a gyrator": (gyrator(lambda x: np.sqrt(x)), "no-value"),
    "an arc": (gyrator(lambda x: np.arcsin(x)), "no-value"),
}  # fmt: skip
"""Name -> (what makes it, which condition it breaks)."""

RIGHT = {
    "constant": friction(lambda p, s: 1.0),
    "cosh": stored(lambda q: np.cosh(q) - 1.0, lambda q: [0.5 * (np.exp(q) - np.exp(-q))]),
    "exponentials": stored(lambda q: 0.5 * (np.exp(q) + np.exp(-q)), lambda q: [np.sinh(q)]),
    "cosh, hidden": stored(lambda q: math.cosh(float(q)), lambda q: [math.sinh(float(q))]),
    "cancelling": stored(lambda q: q**4 - q**2, lambda q: [4.0 * q**3 - 2.0 * q]),
    "cancelling, hidden": stored(lambda q: float(q) ** 4 - float(q) ** 2, lambda q: [4.0 * q**3 - 2.0 * q]),
    "fast": stored(lambda q: math.sin(1e3 * float(q)), lambda q: [1e3 * math.cos(1e3 * float(q))]),
    "pole": stored(lambda q: 1.0 / float(q) ** 2, lambda q: [-2.0 / q**3]),
    "pieces": stored(lambda q: q**2 if q > 0 else 2 * q**2, lambda q: [2 * q if q > 0 else 4 * q]),
    "logarithm": stored(lambda q: np.log(1.0 + q**2), lambda q: [2.0 * q / (1.0 + q**2)]),
    "pose": stored(pulled, pull(1.0), q=Q.pose),
    "two states": pair(lambda q, x: q**2 * x**2 + q * x, lambda q, x: [2 * q * x**2 + x, 2 * q**2 * x + q]),
    "overflows": friction(lambda p, s: 1.0 / (1.0 + np.exp(-(p**2)))),
    "sums": friction(lambda p, s: np.sum(np.array([0.1 * p * p] * 20)) + 0.3),
    "limited": friction(lambda p, s: 1.0 if abs(p) < 2.75 else 2.0),
    "root in its domain": stored(lambda q: q * np.log(q), domain={"q": (0.0, math.inf)}),
    "closes over a list": friction(lambda p, s, k=[2.0]: k[0]),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_part_is_refused(name):
    make, kind = WRONG[name]
    with pytest.raises(StructureError) as caught:
        make()
    assert caught.value.kind == kind, str(caught.value)
    assert caught.value.witness is not None and str(caught.value.witness) in str(caught.value)


def test_there_are_more_than_thirty():
    assert len(WRONG) >= 30


@pytest.mark.parametrize("name", RIGHT)
def test_a_right_part_is_not(name):
    assert RIGHT[name]().verdict in ("proved", "searched")


def test_a_difference_names_arguments_and_both_answers():
    with pytest.raises(StructureError, match=r"function says -1\.0, expected 1\.0 .*entry \(0, 0\).*p = 1, s = 1"):
        WRONG["asks np.isscalar"][0]()


@given(st.floats(-5.0, 5.0), st.floats(0.5, 400.0))
def test_what_changes_later_changes_nothing(p, s):
    """Relations say what runs do, whatever happens to a closure: d p² of heat."""
    ratio = [2.0]
    part = ephs.irreversible(PS, lambda p, s: ratio[0] * np.array([[s, -p], [-p, p * p / s]]))
    ratio[0] = -5.0
    reference = Reference(1.0, 0.0)
    flow = part.flow({}, np.array([p, s - 1.0]), reference)
    assert np.allclose(flow, [2.0 * p, -2.0 * p * p / s], rtol=1e-13, atol=1e-13 * (abs(p) + p * p))


@settings(max_examples=30)
@given(st.floats(150.0, 900.0), st.floats(1e-6, 3.0), st.booleans())
def test_friction_that_is_negative_in_a_drawn_window_is_refused(middle, width, asks):
    """Whether it hides from its record or cannot be recorded; without the window it passes."""

    def part(value):
        def d(p, s):
            inside = (np.isscalar(s) if asks else True) and abs((s if asks else float(s)) - middle) < width
            return value if inside else 1.0

        return friction(d)

    with pytest.raises(StructureError, match=f"witness: .*s = {str(middle)[:2]}" if width < 1e-3 else "witness"):
        part(-1.0)()


def test_check_primitive_finds_the_window():
    part = friction(lambda p, s: -1.0 if at_room_temperature(float(s)) else 1.0, domain=None)
    with pytest.raises(StructureError):
        part()
    assert check_primitive(friction(lambda p, s: 1.0 if float(s) > 0 else 2.0)(), max_examples=50) == "searched"


def test_single_points_without_a_value_are_named_and_do_not_refuse():
    """Coulomb's friction is 0/0 at rest."""
    verdict = friction(lambda p, s: 1.0 / abs(p))().verdict
    assert verdict == "searched" and [c.statement for c in verdict.open] == [DEFINED]
    assert "p = 0" in verdict.text


def test_a_relation_without_a_value_says_where():
    system = Pattern.from_text("q: displacement, exposed; p: momentum, exposed; x: displacement; g(q, p, ~x); k(q=x)")(
        g=gyrator(lambda x: np.log(abs(x)))(), k=library.spring(k=1.0)
    )
    with pytest.raises(StructureError, match=r"the matrix L has no value at x = 0\.0"):
        system.relation().at({"k.q": 0.0})
    assert not system.relation().at({"k.q": 2.0}).empty


def test_the_library_says_what_its_kernels_say():
    part = library.friction(d=0.3)
    found = part.matrix({}, np.array([2.0, 99.0]), Reference(1.0, 0.0))
    assert np.allclose(found, 0.3 * np.array([[100.0, -2.0], [-2.0, 0.04]]), rtol=1e-14)
