"""The compiled control of steps against the same in plain Python, and its measures against their formulas."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.mechanics.engine import march_kernels as march
from ephs.mechanics.engine import rate_kernels, tables
from ephs.mechanics.engine.tables import Scheme
from ephs.mechanics.reduced.explicit import tableau
from ephs.mechanics.solve.control import Proportional

NAMES = {
    name: getattr(room, name) for room in (tables, rate_kernels, march) for name in vars(room) if name.startswith("C_")
}
errors = st.lists(
    st.sampled_from([0.0, 1e-12, 1e-6, 0.03, 0.4, 1.0, 1.1, 20.0, 1e4, math.inf, math.nan]), min_size=1, max_size=12
)


def fresh(exponent, share, damping, span, h, most=math.inf, least=0.0):
    control = np.zeros(max(NAMES.values()) + 1)
    values = {
        "EXPONENT": exponent, "SHARE": share, "DAMPING": damping, "SPAN": span, "STRICT": Proportional.STRICT,
        "BEFORE": 1e-4, "H": h, "MOST": most, "LEAST_STEP": least,
    }  # fmt: skip
    for name, value in values.items():
        control[NAMES[f"C_{name}"]] = value
    return control


@given(errors, st.sampled_from([(5.0, 0.5, 0.4), (8.0, 0.5, 0.4), (4.0, 0.0, 0.4), (5.0, 0.0, 0.0)]))
def test_steps_are_judged_as_in_plain_python(found, setting):
    exponent, share, damping = setting
    policy = Proportional(lambda: exponent, share, damping)
    control = fresh(exponent, share, damping, 2.0, 0.1)
    h = 0.1
    for error in found:
        accepted, wanted = policy.judge(h, error, 2.0)
        assert march.judge(control, h, error) == accepted
        assert control[NAMES["C_H"]] == pytest.approx(wanted, rel=1e-14)
        h = wanted


def test_a_step_is_not_wanted_longer_than_is_allowed_nor_shorter_than_the_least():
    control = fresh(5.0, 0.0, 0.0, 1.0, 0.1, most=0.15)
    assert march.judge(control, 0.1, 1e-9) and control[NAMES["C_H"]] == 0.15
    control = fresh(5.0, 0.0, 0.0, 1.0, 0.1, least=0.09)
    assert march.judge(control, 0.1, 1.0) and control[NAMES["C_H"]] == pytest.approx(0.09)
    control = fresh(5.0, 0.0, 0.0, 1.0, 0.1, least=0.5)  # what is accepted was long enough
    assert march.judge(control, 0.1, 1.0) and control[NAMES["C_H"]] == pytest.approx(0.1)
    control = fresh(5.0, 0.0, 0.0, 1.0, 0.1)  # a step that was cut short does not lengthen the next ones
    assert march.judge(control, 0.05, 1e-6) and control[NAMES["C_H"]] == 0.1


def test_the_size_of_an_estimate_is_a_root_mean_square_and_that_of_two_their_blend():
    rng = np.random.default_rng(3)
    fine, coarse, allowed = rng.standard_normal(5), rng.standard_normal(5), rng.uniform(0.5, 2.0, 5)
    one, two = np.mean((fine / allowed) ** 2), np.mean((coarse / allowed) ** 2)
    assert march.measure(fine, coarse, allowed, False) == pytest.approx(math.sqrt(one), rel=1e-14)
    # Hairer, Nørsett and Wanner, II.10: the estimate of order 5 times its share of both
    expected = math.sqrt(one) * math.sqrt(one / (one + 0.01 * two))
    assert march.measure(fine, coarse, allowed, True) == pytest.approx(expected, rel=1e-14)
    assert march.measure(0.0 * fine, coarse, allowed, True) == 0.0
    assert march.measure(fine[:1], coarse[:1], allowed[:1], False) == pytest.approx(
        abs(fine[0] / allowed[0]), rel=1e-14
    )
    assert march.measure(np.zeros(0), np.zeros(0), np.zeros(0), True) == 0.0


@pytest.mark.parametrize("h", [0.1, -0.1])
def test_stiffness_of_a_linear_equation_is_its_eigenvalue(h):
    """Two joints' increments, rates, and an entropy: every entry falls at 7 per second."""
    n, nv, size = 2, 3, 3 + 2 + 1
    scheme: Scheme = tableau("rk54").scheme
    stages = scheme.b.shape[0]
    rng = np.random.default_rng(1)
    b, y1, k = rng.standard_normal(size), rng.standard_normal(size), rng.standard_normal((stages + 1, size))
    k[stages - 1], k[stages] = -7.0 * b, -7.0 * y1
    k[:, n], b[n], y1[n] = 1e3, 1e3, -1e3  # the increment of a cut joint counts for nothing
    allowed = rng.uniform(0.5, 2.0, 2 * n + 1)
    assert march.stiffness(scheme, b, k, y1, h, n, nv, allowed) == pytest.approx(0.7, rel=1e-13)
    assert march.stiffness(scheme, b, k, b, h, n, nv, allowed) == 0.0


def test_stability_has_to_hold_steps_back_many_times_and_is_forgiven_after_six():
    control = fresh(5.0, 0.0, 0.0, 1.0, 0.1)
    limit, stiff, held = (NAMES[f"C_{name}"] for name in ("LIMIT", "STIFF", "HELD"))
    control[limit], control[stiff] = 3.0, 3.5
    answers = [march.held_back(control) for _ in range(march.PATIENCE)]
    assert answers == [False] * (march.PATIENCE - 1) + [True]
    control[stiff] = 3.0
    for i in range(6):
        assert control[held] == march.PATIENCE, i
        assert not march.held_back(control)
    assert control[held] == 0.0
    control[stiff] = 3.5
    assert not march.held_back(control) and control[held] == 1.0


def test_a_row_keeps_time_element_and_what_follows_the_increments():
    control = fresh(5.0, 0.0, 0.0, 1.0, 0.1)
    times, elements, values = np.zeros((3, 2)), np.zeros((3, 2)), np.zeros((3, 2))
    for i in range(2):
        march.keep(control, times, elements, values, 0.5 + i, -1.0, np.array([1.0, 2.0]), np.arange(5.0), 3)
    assert control[NAMES["C_ROWS"]] == 2.0
    assert np.array_equal(times, [[0.5, -1.0], [1.5, -1.0], [0.0, 0.0]])
    assert np.array_equal(elements, [[1.0, 2.0], [1.0, 2.0], [0.0, 0.0]])
    assert np.array_equal(values, [[3.0, 4.0], [3.0, 4.0], [0.0, 0.0]])
