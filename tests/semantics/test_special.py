"""Functions beyond the elementary ones: the same for numbers, symbols and compiled programs."""

import math

import mpmath
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from ephs.semantics.primitives.special import SHORT, log_mean, sinhc
from ephs.semantics.symbols.tracing import Sinhc, SinhcSlope, trace
from tests.numerics import EPS

Z = sp.Symbol("z", real=True)
SIZES = st.one_of(
    st.floats(-30.0, 30.0), st.floats(-2 * SHORT, 2 * SHORT), st.sampled_from([0.0, 1e-300, SHORT, -SHORT])
)


def exact(z, slope):
    """With digits to spare: the slope loses two thirds of them where z is small."""
    with mpmath.workdps(60):
        x = mpmath.mpf(z)
        if abs(x) < 1e-15:
            return float(x / 3) if slope else 1.0
        return float((mpmath.cosh(x) - mpmath.sinh(x) / x) / x if slope else mpmath.sinh(x) / x)


@given(SIZES)
def test_numbers_and_symbols_agree(z):
    assert sinhc(z) == pytest.approx(exact(z, False), rel=16 * EPS)
    if abs(z) > SHORT:
        assert float(Sinhc(Z).subs(Z, z).evalf(30)) == pytest.approx(exact(z, False), rel=16 * EPS)
        assert float(SinhcSlope(Z).subs(Z, z).evalf(60)) == pytest.approx(exact(z, True), rel=1e-12)


def test_symbols_know_values_signs_and_derivatives():
    assert Sinhc(sp.Integer(0)) == 1 and SinhcSlope(sp.Integer(0)) == 0
    assert Sinhc(-Z) == Sinhc(Z) and SinhcSlope(-Z) == -SinhcSlope(Z)
    assert Sinhc(Z).is_positive and sp.Symbol("w").is_real is None and Sinhc(sp.Symbol("w")).is_positive is None
    assert sp.diff(Sinhc(3 * Z), Z) == 3 * SinhcSlope(3 * Z)
    for z in (0.3, 4.0):
        twice = sp.diff(Sinhc(Z), Z, 2).subs(Z, z).evalf()
        assert float(twice) == pytest.approx(float(sp.diff(sp.sinh(Z) / Z, Z, 2).subs(Z, z)), rel=1e-12)
    traced = trace(lambda a: sinhc(2.0 * a), {"a": Z})
    assert traced.numbered.item() == Sinhc(2 * Z) and "sinhc" in sp.latex(Sinhc(Z))


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_the_logarithmic_mean_lies_between_the_others(a, b):
    mean = log_mean(a, b)
    assert math.exp(0.5 * (a + b)) * (1 - 8 * EPS) <= mean <= 0.5 * (math.exp(a) + math.exp(b)) * (1 + 64 * EPS)
    # and makes differences of differences of logarithms
    assert mean * (a - b) == pytest.approx(
        math.exp(a) - math.exp(b), rel=1e-13, abs=64 * EPS * max(math.exp(a), math.exp(b))
    )


def test_what_overflows_is_infinite():
    assert sinhc(800.0) == math.inf and log_mean(0.0, 0.0) == 1.0
