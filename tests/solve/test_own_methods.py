"""Methods of one's own: what a recording keeps, which order its coefficients have, what is refused."""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.methods.explicit import tableau
from ephs.solve.methods.orders import MOST, density, order_of, power_of, trees
from ephs.solve.methods.own import Method, coefficients_of, halved
from tests.numerics import largest

ORDERS = {"rk54": (5, 5), "rk87": (8, 6, 4)}
"""Order of a built-in method, and powers of h with which its estimates fall."""


class Kutta(Method):
    """Kutta's 3/8 rule."""

    def stages(self, step):
        h = step.h
        k1 = step.rates()
        k2 = step.rates(h * k1 / 3)
        k3 = step.rates(h * (k2 - k1 / 3))
        k4 = step.rates(h * (k1 - k2 + k3))
        return h * (k1 + 3 * k2 + 3 * k3 + k4) / 8


@dataclass(frozen=True)
class Ralston(Method):
    """The methods of two stages and order 2, with an estimate by the rates at the start."""

    at: float = 2 / 3

    def stages(self, step):
        k1 = step.rates()
        k2 = step.rates(self.at * step.h * k1)
        weight = 1 / (2 * self.at)
        return step.h * ((1 - weight) * k1 + weight * k2)

    def estimate(self, step, rates, end):
        return step.h * (rates[1] - rates[0]) / (2 * self.at)


def _rational(a, b):
    """Order in ℚ: the definition, without any of the package's sums."""

    def phi(tree):
        found = [Fraction(1)] * len(b)
        for each in tree:
            inner = phi(each)
            found = [x * sum((w * y for w, y in zip(row, inner, strict=False)), Fraction(0))
                     for x, row in zip(found, a, strict=True)]  # fmt: skip
        return found

    for nodes in range(1, 6):
        for tree in trees(nodes):
            if sum(w * x for w, x in zip(b, phi(tree), strict=True)) != Fraction(1, density(tree)):
                return nodes - 1
    return 5


def test_rooted_trees_are_counted_as_by_cayley():
    assert [len(trees(n)) for n in range(1, MOST + 1)] == [1, 1, 2, 4, 9, 20, 48, 115, 286]
    assert [density(tree) for tree in trees(3)] in ([3, 6], [6, 3])


@pytest.mark.parametrize("name", ORDERS)
def test_built_in_methods_have_the_orders_that_they_are_named_after(name):
    method = tableau(name)
    a, b = method.arrays["a"][:-1], method.arrays["a"][-1]
    with_end = np.block([method.arrays["a"], np.zeros((b.size + 1, 1))])
    assert (order_of(a, b), *(power_of(with_end, each) for each in method.estimates)) == ORDERS[name]
    assert a.sum(axis=1) == pytest.approx(method.c, rel=1e-14)
    a[-1, 0] += 1e-9  # a control: the condition of order 2 sees it
    try:
        assert order_of(a, b) == 1
    finally:
        a[-1, 0] -= 1e-9


@settings(max_examples=50)
@given(st.data())
def test_the_order_of_drawn_coefficients_is_that_of_the_conditions_in_rational_numbers(data):
    """Of rational coefficients, which sums of floats meet or miss as exact ones do."""
    size = data.draw(st.integers(2, 3), label="stages")
    entry = st.sampled_from([Fraction(n, d) for d in (1, 2, 3, 4) for n in range(-d, d + 1)])
    a = [[data.draw(entry) for _ in range(i)] for i in range(size)]
    c = [sum(row, Fraction(0)) for row in a]
    b = [data.draw(entry) for _ in range(size)]
    if data.draw(st.booleans(), label="order 2 wanted") and c[1] not in (0, *c[2:]):
        rest = sum(w * x for w, x in zip(b[2:], c[2:], strict=True))
        b[1] = (Fraction(1, 2) - rest) / c[1]
    b[0] = 1 - sum(b[1:])
    full = [[*row, *[Fraction(0)] * (size - len(row))] for row in a]
    assert order_of(np.array(full, dtype=float), np.array(b, dtype=float)) == _rational(full, b)


def test_a_recording_keeps_all_coefficients():
    found = coefficients_of(Kutta(), chosen=False)
    third = 1.0 / 3.0
    wanted = [[0, 0, 0, 0], [third, 0, 0, 0], [-third, 1, 0, 0], [1, -1, 1, 0]]
    assert largest(found.a - wanted) <= 1e-16
    assert found.b.tolist() == [0.125, 0.375, 0.375, 0.125]
    assert (found.order, Kutta().name, Ralston(0.5).name) == (4, "Kutta", "Ralston(at=0.5)")


def test_two_half_steps_are_two_half_steps():
    """On ẏ = λ y: the step is R(z/2)², the estimate the difference from R(z) over 2ᵖ − 1; its power is p + 1."""
    found, z = coefficients_of(Kutta()), 0.3
    assert (found.order, found.power) == (4, 5)
    y, k = 1.0, []
    for row in found.a:
        k.append(z * (y + sum(w * x for w, x in zip(row, k, strict=False))))
    whole = sum(z**n / np.prod(range(1, n + 1)) for n in range(5))
    half = sum((z / 2) ** n / np.prod(range(1, n + 1)) for n in range(5)) ** 2
    assert y + found.b @ k == pytest.approx(half, rel=1e-15)
    assert found.error[:-1] @ k == pytest.approx((half - whole) / 15.0, rel=1e-10)
    plain = coefficients_of(Kutta(), chosen=False)
    assert halved(plain.a, plain.b, plain.order).b.size == 3 * plain.b.size - 1


def test_an_estimate_of_ones_own_has_its_power():
    found = coefficients_of(Ralston())
    assert (found.order, found.power) == (2, 2)


class _Broken(Method):
    """A method that does with a step what is given."""

    def __init__(self, stages, estimate=None):
        object.__setattr__(self, "_made", (stages, estimate))

    def stages(self, step):
        return self._made[0](step)

    def estimate(self, step, rates, end):
        return None if self._made[1] is None else self._made[1](step, rates, end)


WRONG = {
    "the product of two rates": (lambda s: s.h * s.rates() * s.rates(), None, "a product with"),
    "a square of h": (lambda s: s.h * s.h * s.rates(), None, "product of step.h and itself"),
    "h twice": (lambda s: s.h * (s.h * s.rates()), None, "the square of step.h"),
    "a power": (lambda s: s.h * s.rates() ** 2, None, "a power of it"),
    "a division": (lambda s: s.h / s.rates(), None, "a division"),
    "a condition": (lambda s: s.h * s.rates() if s.rates() else None, None, "a condition on it"),
    "a number": (lambda s: float(s.rates()), None, "a number of it"),
    "a function of NumPy": (lambda s: s.h * np.sin(s.rates()), None, None),
    "a rate in place of a change": (lambda s: s.rates(), None, "a change: step.h times rates"),
    "a rate to evaluate at": (lambda s: s.h * s.rates(s.rates()), None, "step.h times rates"),
    "a sum of a rate and a change": (lambda s: s.rates() + s.h * s.rates(), None, "the sum of a rate and a change"),
    "nothing": (lambda s: None, None, "a change: step.h times rates"),
    "weights whose sum is not 1": (lambda s: s.h * s.rates() / 2, None, "weights whose sum is 0.5"),
    "no finite number": (lambda s: s.h * (np.nan * s.rates()), None, "a product with nan"),
    "an estimate as large as the step": (
        lambda s: s.h * s.rates(),
        lambda s, rates, end: s.h * end,
        "of the size of the step itself",
    ),
    "an estimate that is zero": (
        lambda s: s.h * s.rates(),
        lambda s, rates, end: s.h * (end - end),
        r"of order h\^10 or none",
    ),
    "an estimate with further rates": (
        lambda s: s.h * s.rates(),
        lambda s, rates, end: s.h * (s.rates(s.h * end) - end),
        "those of the stages and of the end",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_no_explicit_method_is_refused(what):
    stages, estimate, text = WRONG[what]
    with pytest.raises((ephs.OptionError, TypeError) if text is None else ephs.OptionError, match=text):
        coefficients_of(_Broken(stages, estimate))
