"""Laws of elements that are stated as one function: exact energies over steps, exact Jacobians, the same bits."""

from functools import cache

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs import quantity as Q
from ephs.semantics.derive import charts
from ephs.semantics.derive.functions import COMPOSED, FUNCTIONS
from ephs.semantics.derive.recording import Untraceable, record
from ephs.semantics.derive.relations import compiled, program, sizes
from ephs.semantics.derive.slopes import Slope, Slopes
from ephs.semantics.derive.tape import OPERATIONS, evaluate, over_step
from ephs.semantics.primitives.primitives import midpoint
from ephs.semantics.primitives.special import root
from ephs.semantics.spaces import codes, manifold
from ephs.semantics.stage import PLAIN
from ephs.semantics.stage.duals import Duals
from ephs.semantics.verdicts.checks import random_efforts, random_point
from tests.numerics import EPS, generators, largest, seeds, slope
from tests.semantics.zoo import conduction_matrix, drag
from tests.staged import run_both


def _rising(x, a, b):
    return (1.0 + b) * x**3 + np.sqrt((x - a) ** 2 + 0.1) + 2.0 * x


ENERGIES = {
    "number": ({"q": Q.displacement}, lambda q: 0.3 * q**4 + np.sin(q) + abs(q) ** 3),
    "two": (
        {"a": Q.displacement, "b": Q.charge},
        lambda a, b: np.exp(a / 3) * (2 + np.cos(b)) ** 1.7 + np.log(4 + a * a),
    ),
    "gas": ({"s": Q.entropy, "v": Q.volume}, lambda s, v: 5.0 * np.exp(s / 3.0) * (2.0 / v) ** 0.7),
    "vector": ({"p": Q.body_momentum}, lambda p: 0.5 * (p @ p) + p[0] ** 2 * p[5] ** 2 / (1 + p[1] ** 2)),
    "planar": ({"q": Q.relative_pose("planar")}, lambda q: np.sin(q[0]) * q[1] - q[2] ** 3),
    "rotation": ({"q": Q.relative_pose("spherical")}, lambda q: q[0] * q[1] + q[2] ** 2),
    "pose": (
        {"q": Q.pose},
        lambda q: 0.5 * (np.sqrt(q[4] ** 2 + q[5] ** 2 + q[6] ** 2) - 0.7) ** 2 + q[5] * q[1] * q[0],
    ),
    "root": (
        {"a": Q.displacement, "b": Q.charge},
        lambda a, b: root(_rising, -1.0, 1.0, np.sin(a), 1.0 / (1.0 + b * b)) ** 2 + np.sin(a + b),
    ),
    "direct": ({"q": Q.direct_pose}, lambda q: q[4] ** 2 * q[0] ** 2 + np.arctan2(q[6], 9.0 + q[5])),
}
RELATIONS = {
    "drag": drag(lambda p, s: abs(p))(),
    "conduction": ephs.irreversible(
        {"a": Q.entropy, "b": Q.entropy, "~q": Q.displacement},
        lambda a, b, q: 2.0 * (1.0 + np.tanh(q) ** 2) * conduction_matrix(a, b),
    ),
    "turning": ephs.gyrator(
        {"x": Q.displacement, "p": Q.momentum, "~q": Q.pose},
        lambda q: (1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2)) * np.array([[0.0, -1.0], [1.0, 0.0]]),
    ),
    "rod": ephs.constraint(
        {"p1": Q.momentum, "p2": Q.momentum, "~x": Q.relative_pose("planar")},
        lambda x: [[np.cos(x[0]), np.sin(x[0]) + x[1] * x[2]]],
    ),
}


def zeros(relation, parameters=()):
    """Arguments of a relation: a dict of arrays, in order."""
    a = {name: np.zeros(size) for name, size in sizes(relation).items()}
    a["scal"][:], a["p"][:] = (0.01, 300.0, 1e-3), parameters
    return a


def arguments(relation, primitive, rng, length):
    """Random ones, and the point among them."""
    bundle = primitive.bundle
    point, a = random_point(bundle, primitive.reads, rng), zeros(relation, primitive.kernel.parameters)
    a["x0"][:] = np.concatenate([point[port] for port in primitive.reads]) if primitive.reads else []
    a["v"][:] = length * rng.standard_normal(a["v"].size)
    if primitive.kind != "storage":
        a["e"][:], a["lam"][:] = random_efforts(bundle, rng), rng.standard_normal(a["lam"].size)
    return a, point


def run(function, relation, a):
    """The status, and the arguments as the function leaves them."""
    out = {name: values.copy() for name, values in a.items()}
    return function(np.array(relation.dimensions), *out.values()), out


@cache
def made(name):
    """The storage of an energy, built once for all examples, and the energy."""
    ports, energy = ENERGIES[name]
    return ephs.storage(ports, energy), energy


def moved(storage, point, v):
    """x·exp(v) and the energy there, by the groups of `ephs.semantics.spaces`."""
    there = storage.retract(point, v)
    return there, float(storage.energy(there))


@pytest.mark.parametrize("name", ENERGIES)
@given(rng=generators, length=st.sampled_from([1.0, 1e-3, 1e-7, 1e-12]))
def test_the_effort_along_the_step_is_the_difference_of_energies(name, rng, length):
    storage, _ = made(name)
    a, point = arguments(storage.kernel.relation, storage, rng, 0.15 * length)
    status, out = run(compiled(storage.kernel.relation), storage.kernel.relation, a)
    before, (_, after) = storage.energy(point), moved(storage, point, a["v"])
    effort = out["e"] + storage.bundle.intensive(ephs.Reference(300.0, 1e-3))
    scale = abs(before) + abs(after) + np.abs(effort) @ np.abs(a["v"]) + 1.0
    assert status == 0
    assert abs(effort @ a["v"] - (after - before)) <= 300 * EPS * scale
    assert abs(out["c"][0] - after) <= 300 * EPS * scale


def test_the_gradient_in_the_middle_misses_the_difference():
    """The law above fails on what holds for quadratic energies only."""
    storage, energy = made("number")
    (port,) = storage.reads
    x, v = 0.4, 0.9
    middle = storage.energy_gradient({port: np.array([x + 0.5 * v])})[0]
    assert abs(middle * v - (energy(x + v) - energy(x))) > 1e-3


@pytest.mark.parametrize("name", ENERGIES)
@given(seed=seeds)
def test_the_ends_of_a_step_may_be_exchanged(name, seed):
    storage, _ = made(name)
    _, point = arguments(storage.kernel.relation, storage, rng := np.random.default_rng(seed), 0.0)
    v = 0.15 * rng.standard_normal(storage.bundle.size)
    there, _ = moved(storage, point, v)
    one, two = storage.discrete_gradient(point, v), storage.discrete_gradient(there, -v)
    assert largest(one - two) <= 1e4 * EPS * (1.0 + largest(one))


SINGLE = [*FUNCTIONS, "tan", "asin", "acos"]
EXACT = {
    "absolute": abs,
    "asin": mpmath.asin,
    "acos": mpmath.acos,
    "atan": mpmath.atan,
    "turn_ratio": lambda x: mpmath.sqrt(x) / 2 / mpmath.sin(mpmath.sqrt(x) / 2),
    "turn_curve": lambda x: curve(x),
    "turn_curve_slope": lambda x: mpmath.diff(curve, x),
}
POSITIVE = ("sqrt", "log", "turn_ratio", "turn_curve", "turn_curve_slope")


def curve(x):
    """c of θ², as in the logarithm of a pose."""
    return (1 - mpmath.sqrt(x) / 2 * mpmath.cot(mpmath.sqrt(x) / 2)) / x


@pytest.mark.parametrize("name", SINGLE)
@given(a=st.floats(0.05, 0.9), share=st.floats(1e-12, 0.05), sign=st.sampled_from([-1.0, 1.0]))
def test_slopes_of_functions_are_difference_quotients_without_cancellation(name, a, share, sign):
    """Against 60 digits: a difference quotient in floats would be off by ε/share."""
    if name in POSITIVE:
        sign = 1.0
    start, end = np.float64(sign * a), np.float64(sign * (a + share))
    with np.errstate(all="ignore"):
        found = OPERATIONS[name](Slopes(PLAIN), Slope(start, end, {0: 1.0}))
    with mpmath.workdps(60):
        function = EXACT.get(name) or getattr(mpmath, name)
        one, two = (function(mpmath.mpf(float(x))) for x in (start, end))
        expected = float((two - one) / (mpmath.mpf(float(end)) - mpmath.mpf(float(start)))) if start != end else None
    if expected is not None:
        assert abs(found.slopes[0] - expected) <= 100 * EPS * max(1.0, abs(expected)) / (1.0 - a)
    assert abs(found.start - float(one)) <= 20 * EPS * (1.0 + abs(float(one))) / (1.0 - a)


def over(function, start, end):
    """The slope of a function, recorded, over a step."""
    recording = record(function, {"x": None})
    parameters = [np.float64(number) for number in recording.parameters]
    return over_step(Slopes(PLAIN), recording.tape, [Slope(np.float64(start), np.float64(end), {0: 1.0})], parameters)


def at(function, x):
    """The value and the derivative of a function, recorded."""
    on, recording = Duals(PLAIN, 1), record(function, {"x": None})
    parameters = [np.float64(number) for number in recording.parameters]
    return on.dual(evaluate(on, recording.tape, [on.along(np.float64(x), 0)], parameters)[0])


POWERS = st.sampled_from([k / 4.0 for k in range(1, 16)]) | st.floats(0.1, 4.0)


@given(POWERS, st.floats(-8.0, 8.0), st.just(0.0) | st.floats(-14.0, 1.0))
def test_slopes_of_powers_are_difference_quotients_without_cancellation(power, decade, apart):
    """Over steps from any positive number, and from 0, where a root is vertical."""
    end = np.float64(10.0**decade)
    start = end / (1.0 + 10.0**apart) if apart else 0.0
    found = over(lambda x: x**power, start, end)
    with mpmath.workdps(60):
        a, b, p = (mpmath.mpf(float(x)) for x in (start, end, power))
        expected = (b**p - a**p) / (b - a) if a != b else p * a ** (p - 1)
        assert abs(float(found.slopes[0] / expected) - 1.0) <= 200 * EPS / min(power, 1.0)


RESTS = (
    (lambda x, a: abs(x) ** a, True),
    (lambda x, a: (x * x) ** (0.5 * a), True),
    (lambda x, a: x * abs(x) ** a, True),
    (lambda x, a: abs(x) ** (1.0 - a), False),
    (lambda x, a: a * np.sqrt(x * x), False),
    (lambda x, a: (x * x) ** (0.5 / a), False),
)


@pytest.mark.parametrize(("function", "flat"), RESTS)
@given(st.sampled_from([1.25, 1.5, 1.75, 2.5, 3.25]) | st.floats(1.1, 4.0))
def test_what_grows_as_a_power_above_one_is_flat_at_zero(function, flat, power):
    """Values and derivatives there are those of springs and frictions at rest; a length has none."""
    with np.errstate(all="ignore"):
        found, step = at(lambda x: function(x, power), 0.0), over(lambda x: function(x, power), 0.0, 0.0)
    assert ((found.value, found.slopes[0], step.slopes.get(0, 0.0)) == (0.0, 0.0, 0.0)) == flat


@given(st.integers(65, 2000) | st.sampled_from([10**6, 10**9]), st.booleans(), st.floats(0.1, 3.0), st.booleans())
def test_whole_powers_of_any_size_have_values_on_both_sides(size, inverse, near, negative):
    """As exact arithmetic says, with the rounding of n products: x is within 1/n of one, so that no power is 0 or ∞."""
    n = -size if inverse else size
    x = (-1.0 if negative else 1.0) * (1.0 + near / size)
    found = at(lambda x: x**n, x)
    with mpmath.workdps(40):
        value = mpmath.mpf(x) ** n
        rise = n * value / mpmath.mpf(x)
        assert abs(float(found.value / value) - 1.0) <= 4 * size * EPS
        assert abs(float(found.slopes[0] / rise) - 1.0) <= 4 * size * EPS
    with np.errstate(all="ignore"):
        rest = at(lambda x: x ** (n + 0.3), x).value
    assert np.isnan(rest) == negative, "what is no whole number has none below zero"


SMALL = ["sin", "tan", "asin", "atan", "sinh", "tanh", "asinh", "atanh", "expm1", "log1p", "cos", "cosh", "acos", "exp"]


@pytest.mark.parametrize("name", SMALL)
@given(decade=st.floats(-15.0, -0.1), sign=st.sampled_from([-1.0, 1.0]))
def test_functions_and_their_derivatives_have_all_digits_near_zero(name, decade, sign):
    """Where a cosine less 1 or a quotient of nearly equal numbers would have few."""
    x, on = sign * 10.0**decade, Duals(PLAIN, 1)
    found = on.dual(OPERATIONS[name](on, on.along(np.float64(x), 0)))
    with mpmath.workdps(60):
        function = EXACT.get(name) or getattr(mpmath, name)
        here = mpmath.mpf(x)
        value, rise = function(here), mpmath.diff(function, here, h=abs(here) * mpmath.mpf(10) ** -25)
        assert abs(float(found.value / value) - 1.0) <= 16 * EPS
        assert abs(float(found.slopes[0] / rise) - 1.0) <= 16 * EPS


def test_every_function_is_tried():
    assert set(SINGLE) | {"acosh", "sinhc"} == set(FUNCTIONS) | set(COMPOSED)


ALL = {name: made(name)[0] for name in ENERGIES} | RELATIONS


@pytest.mark.parametrize("name", ALL)
@given(rng=generators)
def test_floats_and_machine_code_give_the_same_bits(name, rng):
    primitive = ALL[name]
    relation = primitive.kernel.relation
    a, _ = arguments(relation, primitive, rng, 0.3)
    run_both(program(relation), "value", np.array(relation.dimensions), *a.values(), signed=False)


@pytest.mark.parametrize("name", ALL)
@given(rng=generators)
def test_at_rest_a_relation_is_that_of_a_step_of_no_length(name, rng):
    primitive = ALL[name]
    relation = primitive.kernel.relation
    a, _ = arguments(relation, primitive, rng, 0.0)
    status, over = run(compiled(relation), relation, a)
    stepped = a | {"v": a["v"] + 0.3}  # increments are not read
    found, rest = run(compiled(relation, rest=True), relation, stepped)
    assert found == status
    values = ("e", "c") if primitive.kind == "storage" else ("f", "c")
    for argument in values:
        size = 8.0 * EPS * (1.0 + largest(over[argument], initial=0.0))
        assert over[argument] == pytest.approx(rest[argument], rel=0.0, abs=size), argument


@pytest.mark.parametrize("name", ALL)
@given(rng=generators)
def test_jacobians_are_derivatives(name, rng):
    primitive = ALL[name]
    relation = primitive.kernel.relation
    a, _ = arguments(relation, primitive, rng, 0.1)
    call = compiled(relation)
    n, k, m, _ = relation.dimensions
    stores = primitive.kind == "storage"
    groups = (("v", n),) if stores else (("e", n), ("lam", k), ("v", m))
    place = [(argument, i) for argument, size in groups for i in range(size)]
    rows = ("e",) if stores else ("f", "c")
    found = run(call, relation, a)[1]["f" if stores else "jac"].reshape(-1, len(place))
    for j, (argument, i) in enumerate(place):
        kept = a[argument][i]

        def moved_by(d, values=a[argument], i=i, kept=kept):
            values[i] = kept + d
            out = run(call, relation, a)[1]
            values[i] = kept
            return np.concatenate([out[row] for row in rows])

        expected, size = slope(moved_by, 2e-5 * max(1.0, abs(kept)), 1), largest(moved_by(0.0))
        # a difference carries ε/h of the values, and h⁴ of fifth derivatives: near half a turn the third ones are large
        assert largest(found[:, j] - expected) <= 1e-9 * (1.0 + size + largest(found))


@pytest.mark.parametrize("name", ["drag", "conduction"])
@given(rng=generators)
def test_processes_keep_energy_and_make_entropy(name, rng):
    primitive = RELATIONS[name]
    relation = primitive.kernel.relation
    a, point = arguments(relation, primitive, rng, 0.3)
    _, out = run(compiled(relation), relation, a)
    reference = ephs.Reference(300.0, 1e-3)
    energy = a["e"] + primitive.bundle.intensive(reference)
    middle = midpoint(primitive, point, dict.fromkeys(primitive.reads, a["v"]))
    terms = np.abs(energy) @ np.abs(primitive.matrix(middle, a["e"], reference)) @ np.abs(a["e"]) / 300.0
    assert abs(energy @ out["f"]) <= 16 * EPS * terms
    assert a["e"] @ out["f"] >= -16 * EPS * terms


@pytest.mark.parametrize("name", ["turning", "rod"])
@given(rng=generators)
def test_reversible_relations_exchange_power_and_lose_none(name, rng):
    primitive = RELATIONS[name]
    relation = primitive.kernel.relation
    a, _ = arguments(relation, primitive, rng, 0.3)
    _, out = run(compiled(relation), relation, a)
    power, terms = a["e"] @ out["f"] - a["lam"] @ out["c"], np.abs(a["e"]) @ np.abs(out["f"])
    assert abs(power) <= 16 * EPS * (terms + np.abs(a["lam"]) @ np.abs(out["c"]))


@pytest.mark.parametrize("code", [codes.SO3, codes.SE3, codes.SE2, codes.SO3xR3])
@given(rng=generators, length=st.sampled_from([1e-9, 1e-4, 0.1, 1.0]))
def test_points_over_a_step_are_those_of_the_groups(code, rng, length):
    """The ends by other code; their difference by the slopes."""
    space = next(
        manifold(q.space) for q in (Q.pose, Q.direct_pose, Q.relative_pose("planar"), Q.relative_pose("spherical"))
        if manifold(q.space).code == code
    )  # fmt: skip
    x, v = space.random(rng), length * rng.standard_normal(space.dim)
    numbers = charts.over(PLAIN, code, list(x), list(v), 0)
    size = 1.0 + largest(x)
    there = space.retract(x, v)
    if code != codes.SE2 and there[:4] @ [float(number.end) for number in numbers[:4]] < 0.0:
        there[:4] *= -1.0  # the same rotation
    for number, start, end, other in zip(numbers, x, there, charts.moved(PLAIN, code, list(x), list(v)), strict=True):
        change = sum(of * v[i] for i, of in number.slopes.items())
        assert number.start == start
        assert abs(number.end - end) + abs(other - end) <= 60 * EPS * size
        assert abs(change - (number.end - number.start)) <= 60 * EPS * size


def test_a_domain_bounds_both_ends_of_a_step():
    storage = ephs.storage({"q": Q.displacement}, lambda q: q * q, domain={"q": (-1.0, 1.0)})
    relation = storage.kernel.relation
    for x, v, status in ((0.5, 0.4, 0), (0.5, 0.6, 5), (1.5, -1.0, 5)):
        a = zeros(relation)
        a["x0"][:], a["v"][:] = x, v
        assert run(compiled(relation), relation, a)[0] == status


@pytest.mark.parametrize(
    ("function", "why"),
    [
        (lambda q: q if q > 0.0 else -q, "needs the value of an argument"),
        (lambda q: float(q), "needs the value of an argument"),
        (lambda q: np.maximum(q, 0.0), "needs the value of an argument"),
        (lambda q: 1j * q, "no real number"),
    ],
)
def test_what_cannot_be_recorded_names_its_line(function, why):
    with pytest.raises(Untraceable, match=why) as caught:
        record(function, {"q": None})
    assert "test_relations.py:" in str(caught.value)


@pytest.mark.parametrize("power", [0.1, 0.5, 0.9, 1.0, 1.5])
def test_slopes_of_friction_that_grows_as_a_power_of_the_speed_are_finite_at_rest(power):
    """|v|^a v has the slope (1 + a) |v|^a, also at rest, where slopes of M are infinite."""
    made = drag(lambda p, s: abs(p) ** power)()
    relation, slopes = made.kernel.relation, {}
    for speed in (0.0, 1e-200):
        a = zeros(relation, made.kernel.parameters)
        a["e"][0] = speed
        status, out = run(compiled(relation), relation, a)
        assert status == 0
        slopes[speed] = out["jac"][0]
    assert slopes[0.0] == 0.0
    assert slopes[1e-200] == pytest.approx((1.0 + power) * 1e-200**power, rel=1e-12)
