"""A linear relation of half the dimension that gives no power is (S + A, C), in one way."""

import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from ephs import ModelicaError
from ephs.modelica.flat import DOMAINS, Connector, Flat, ZeroResidual
from ephs.modelica.relation import relation_of
from ephs.modelica.structure import stored_energy, structure_of

NUMBERS = st.integers(-3, 3)


def flat_of(loss, skew, constraint, mix):
    """Equations f = (S + A) e + Cᵀλ, 0 = C e of pins, each replaced by a sum of all."""
    n, k = loss.rows, constraint.rows
    ports = tuple(Connector(f"p{j}", DOMAINS[0], *sympy.symbols(f"p{j}.v p{j}.i", real=True)) for j in range(n))
    e, f = (sympy.Matrix([getattr(port, of) for port in ports]) for of in ("potential", "flow"))
    multipliers = sympy.Matrix(sympy.symbols(f"m:{k}", real=True))
    rows = [f - (loss + skew) * e, sympy.zeros(0, 1)]
    if k:
        rows = [rows[0] - constraint.T * multipliers, constraint * e]
    residuals = mix * sympy.Matrix.vstack(*rows)
    units = (
        {port.potential: "V" for port in ports} | {port.flow: "A" for port in ports} | dict.fromkeys(multipliers, "")
    )
    return Flat("any", ports, tuple(ZeroResidual(sympy.expand(each), str(each)) for each in residuals), units, {}, {})


def numbers(draw, rows, columns):
    return sympy.Matrix(rows, columns, [draw(NUMBERS) for _ in range(rows * columns)])


@st.composite
def structures(draw):
    """S, A and C of full rank, and a matrix of determinant one that mixes the equations."""
    n = draw(st.integers(1, 3))
    k = draw(st.integers(0, n - 1))
    root, skew = numbers(draw, n, n), numbers(draw, n, n)
    right = numbers(draw, k, n - k)
    constraint = sympy.Matrix.hstack(sympy.eye(k), right) if k else sympy.zeros(0, n)
    size = n + k
    upper = sympy.Matrix(size, size, lambda i, j: 1 if i == j else (draw(NUMBERS) if j > i else 0))
    return root * root.T, skew - skew.T, constraint, upper * upper.T


@settings(max_examples=15, deadline=None)
@given(structures())
def test_a_structure_is_found_from_any_equations_of_it(of):
    loss, skew, constraint, mix = of
    flat = flat_of(loss, skew, constraint, mix)
    relation = relation_of(flat, flat.equations)
    found = structure_of("any", relation, stored_energy("any", relation, {}), {})
    assert sympy.Matrix.vstack(found.constraint, constraint).rank() == constraint.rank() == found.constraint.rows
    allowed = sympy.Matrix.hstack(*constraint.nullspace()) if constraint.rows else sympy.eye(len(relation.ports))
    for one, other in ((found.loss, loss), (found.skew, skew)):
        assert allowed.T * (one - other) * allowed == sympy.zeros(allowed.cols)
    assert found.loss.is_positive_semidefinite
    assert found.skew == -found.skew.T


@settings(max_examples=8, deadline=None)
@given(structures(), st.integers(1, 3))
def test_power_that_is_given_is_refused(of, amount):
    """The control: a source of power along an effort that the constraints allow."""
    loss, skew, constraint, mix = of
    e = (constraint.nullspace() if constraint.rows else sympy.eye(loss.rows).columnspace())[0]
    gain = (amount + (e.T * loss * e)[0]) * e * e.T / (e.T * e)[0] ** 2
    flat = flat_of(loss - gain, skew, constraint, mix)
    with pytest.raises(ModelicaError, match="makes energy") as caught:
        structure_of("any", relation_of(flat, flat.equations), sympy.zeros(0, 0), {})
    assert caught.value.fault == "power"


@pytest.mark.parametrize("extra", [True, False])
def test_too_many_or_too_few_equations_are_no_relation(extra):
    flat = flat_of(sympy.eye(2), sympy.zeros(2), sympy.zeros(0, 2), sympy.eye(2))
    more = (*flat.equations, ZeroResidual(flat.ports[0].flow, "p0.i = 0")) if extra else flat.equations[:1]
    with pytest.raises(ModelicaError) as caught:
        relation_of(flat, more)
    assert caught.value.fault == "count"


@settings(max_examples=10, deadline=None)
@given(st.floats(1.0, 100.0), st.floats(-100.0, 1.0))
def test_a_start_is_the_number_that_its_expression_has(parts, v0, v1):
    """Of a modification, of an initial equation, which counts before it, and of a temperature."""
    for name in ("Charged", "Initial"):
        found = parts.read(f"Parts.{name}", v0=v0, v1=v1).initial["stored.v"]
        assert found == pytest.approx(0.5 * (2.0 * v0 - v1), rel=1e-15)
    warm = parts.read("Parts.Warm", v0=v0, v1=v1).system.flatten()
    (made,) = (primitive for _, primitive in warm.leaves())
    assert dict(made.parameters)["c1"] == pytest.approx(20.0 * (2.0 * v0 - v1), rel=1e-15)
    assert parts.read("Parts.Capacitor").initial["stored.v"] == 1.5
