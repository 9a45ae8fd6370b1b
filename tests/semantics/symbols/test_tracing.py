"""Tracing: what functions say of symbols is what they say of numbers; derivatives, kernels and messages follow."""

import math
from math import sin

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs import library
from ephs import quantity as Q
from ephs.mechanics.elements import components
from ephs.operad import Path
from ephs.semantics import Reference
from ephs.semantics.primitives.forms import storage_form
from ephs.semantics.symbols.tracing import Untraceable, trace
from ephs.semantics.symbols.voices import formula_text
from ephs.semantics.verdicts.checks import random_point
from tests.numerics import generators, largest, slope
from tests.oscillator import free_oscillator
from tests.semantics.derive.test_relations import ENERGIES
from tests.semantics.derive.test_relations import made as energies
from tests.semantics.test_primitives import ARGUMENTS, made

UNARY = [np.sin, np.cos, np.tanh, np.arctan, np.exp, np.cosh, np.sinh, np.expm1, abs]


def branches():
    """Random functions of two numbers, of which none leaves its domain on [0.3, 2]²."""
    leaf = st.one_of(st.sampled_from(["x", "y"]), st.floats(0.3, 2.0))
    return st.recursive(
        leaf,
        lambda inner: st.one_of(
            st.tuples(st.sampled_from(UNARY), inner),
            st.tuples(st.sampled_from(["+", "-", "*"]), inner, inner),
            st.tuples(st.just("pow"), inner, st.sampled_from([2, 3, 2.0])),
        ),
        max_leaves=6,
    )


def value(tree, x, y):
    if isinstance(tree, str):
        return x if tree == "x" else y
    if isinstance(tree, float):
        return tree
    if tree[0] in UNARY:
        return tree[0](value(tree[1], x, y))
    a = value(tree[1], x, y)
    if tree[0] == "pow":
        return a ** tree[2]
    b = value(tree[2], x, y)
    return {"+": a + b, "-": a - b, "*": a * b}[tree[0]]


@given(branches(), st.floats(0.3, 2.0), st.floats(0.3, 2.0))
def test_symbols_say_what_numbers_say(tree, x, y):
    one, two = sp.symbols("x y", real=True)
    traced = trace(lambda x, y: value(tree, x, y), {"x": one, "y": two})
    with np.errstate(over="ignore", invalid="ignore"):
        expected = float(value(tree, x, y))
    if not abs(expected) < 1e6:
        return
    found = float(traced.numbered.item().subs({one: x, two: y}))
    assert abs(found - expected) <= 1e-9 * (1.0 + abs(expected))


def helper(q):
    return sin(q) + math.exp(-q)


def test_functions_of_math_are_traced_also_in_helpers():
    q = sp.Symbol("q", real=True)
    assert trace(helper, {"q": q}).outputs.item() == sp.sin(q) + sp.exp(-q)
    assert (
        trace(lambda q: 2.5 * helper(q), {"q": q}).numbered.item().equals(sp.Rational(5, 2) * (sp.sin(q) + sp.exp(-q)))
    )
    assert math.sin(0.5) == sin(0.5)  # the functions themselves are left alone


@pytest.mark.parametrize(
    "function",
    [
        lambda q: q if q > 0 else -q,
        lambda q: float(q) ** 2,
        lambda q: np.where(q > 0.0, q, 0.0),
        lambda q: 1j * q,
        lambda q: "energy",
        lambda q: int(q),
        lambda q: [q, [q]],
        lambda q: q.no_such_thing,
    ],
)
def test_what_needs_numbers_is_not_traced(function):
    with pytest.raises(Untraceable):
        trace(function, {"q": sp.Symbol("q", real=True)})


def test_functions_that_differ_in_numbers_share_one_program():
    def spring(k, power):
        return ephs.storage({"q": Q.displacement}, lambda q: k * abs(q) ** power + np.cos(k * q))

    one, other, third = spring(1.5, 4), spring(2.25, 4), spring(1.5, 2)
    assert one.kernel.relation == other.kernel.relation != third.kernel.relation
    assert one.kernel.parameters != other.kernel.parameters


@pytest.mark.parametrize("name", ENERGIES)
@given(rng=generators)
def test_gradients_are_the_left_trivialised_derivatives(name, rng):
    ports, energy = ENERGIES[name]
    storage = energies(name)[0]
    x, v = random_point(storage.bundle, storage.reads, rng), rng.standard_normal(storage.bundle.size)
    v *= 0.1 if name == "gas" else 1.0  # whose volume stays positive
    gradient = storage_form(library.power_ports(**ports), energy).gradient(x)
    rate = slope(lambda t: storage.energy(storage.retract(x, t * v)), 2e-3, 1)
    size = 1.0 + np.abs(gradient) @ np.abs(v) + max(map(largest, x.values())) ** 4
    assert abs(gradient @ v - rate) <= 1e-8 * size


# ---- the library -----------------------------------------------------------------------------------------------


# In these the numbers of an instance are multiplied out, or the matrix fills a page: the docstring has the equation.
EXPANDED = ("coil", "winding", "orifice", "reaction", "ideal_mixture")


@pytest.mark.parametrize("name", [name for name in ARGUMENTS if name not in ("environment", *EXPANDED)])
def test_docstrings_show_what_the_formula_says(name):
    primitive = made(name)
    assert formula_text(primitive) in " ".join(getattr(library, name).__doc__.split())


@pytest.mark.parametrize("name", [name for name in ARGUMENTS if name != "environment"])
@given(rng=generators)
def test_what_is_simulated_is_what_the_formula_says(name, rng):
    primitive = made(name)
    _agrees(primitive, rng)


def test_thermal_nodes_of_scenes_are_what_their_formula_says():
    _agrees(components.thermal_node(50.0, 300.0), np.random.default_rng(0))


def _agrees(primitive, rng):
    bundle, reference = primitive.bundle, Reference()
    given = {name: dict(primitive.parameters)[name] for name in primitive.formula.parameters}
    x, other = (random_point(bundle, primitive.reads, rng) for _ in range(2))

    def formula(values):
        return primitive.formula.function(**{str(p): float(v[0]) for p, v in values.items()}, **given)

    if primitive.kind == "storage":
        rise = primitive.energy(x) - primitive.energy(other)
        assert abs(formula(x) - formula(other) - rise) <= 1e-13 * (abs(formula(x)) + abs(formula(other)))
    elif primitive.kind == "reversible":
        for matrix, expected in zip(formula(x), primitive.structure(x), strict=True):
            assert np.array_equal(np.zeros(expected.shape) if matrix is None else np.array(matrix, float), expected)
    else:
        e = rng.standard_normal(bundle.size)
        energy = bundle.split(e + bundle.intensive(reference))
        expected = primitive.matrix(x, e, reference)
        assert np.allclose(np.array(formula({**energy, **x}), float), expected, rtol=1e-13, atol=0.0)


# ---- runs ------------------------------------------------------------------------------------------------------


def oscillator(energy, domain=None):
    return free_oscillator(pe=ephs.storage({"q": Q.displacement}, energy, domain=domain))


def test_a_traced_component_moves_as_one_that_is_called_back():
    def traced(q):
        return 0.75 * q * q + 0.1 * q**4

    def opaque(q):
        return 0.75 * float(q) * q + 0.1 * q**4

    initial = {"pe.q": 1.0}
    one, other = (ephs.simulate(oscillator(f), 2.0, initial=initial, step=0.01) for f in (traced, opaque))
    assert largest(one["pe.q"] - other["pe.q"]) <= 1e-9
    assert one.summary()["max_energy_error"] <= 1e-13


@pytest.mark.parametrize(
    ("energy", "least"),
    [
        (lambda q: 0.5 * q**2 + np.log(1.2 + q), -1.2),
        (lambda q: 0.5 * q**2 - np.sqrt(1.1 + q), -1.1),
    ],
)
def test_leaving_the_domain_of_a_function_is_reported(energy, least):
    """A function without a value in a part of its domain is refused; one that a run takes out of its domain ends it."""
    with pytest.raises(ephs.StructureError, match=r"has no value at q = .*declare a domain"):
        oscillator(energy)
    with pytest.raises(ephs.SimulationError, match="not a finite number") as caught:
        ephs.simulate(
            oscillator(energy, domain={"q": (least, np.inf)}),
            10.0,
            initial={"pe.q": 0.5, "ke.p": -3.0},
            step=0.01,
        )
    assert caught.value.path == "pe"
    assert 0.0 < caught.value.time < 10.0
    assert len(caught.value.partial) >= 2
    assert np.all(np.isfinite(caught.value.partial["pe.q"]))


def test_states_too_large_for_a_kernel_are_called_back():
    from ephs import Quantity, Space

    wide = Quantity("field", Space("real", 40, 40), 1)
    storage = ephs.storage({"x": wide}, lambda x: 0.5 * x @ x)
    reading = ephs.gyrator(
        {"q": Q.displacement, "p": Q.momentum, "~x": wide},
        lambda x: (1.0 + x @ x) * np.array([[0.0, -1.0], [1.0, 0.0]]),
    )
    assert storage.kernel is None
    assert reading.kernel is None
    x = {Path.of("x"): np.arange(40.0)}
    assert np.allclose(storage.energy_gradient(x), np.arange(40.0), atol=1e-8)
