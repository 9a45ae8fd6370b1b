"""Decompositions where LAPACK's fast drivers fail: the slow ones give the same, and what is not finite is named."""

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs.semantics.spaces import decompositions as of
from tests.numerics import EPS, generators, largest, seeds

SHAPES = st.tuples(st.integers(0, 3), st.integers(1, 7), st.integers(1, 7))


def failing(*_args, **_options):
    raise np.linalg.LinAlgError("SVD did not converge")


def drawn(shape, seed, rank):
    """(count, m, n) matrices, or one (m, n), of at most a rank."""
    count, m, n = shape
    rng = np.random.default_rng(seed)
    out = rng.standard_normal((count, m, rank)) @ rng.standard_normal((count, rank, n))
    return out if count else rng.standard_normal((m, rank)) @ rng.standard_normal((rank, n))


@given(SHAPES, seeds, st.integers(1, 7), st.booleans(), st.booleans())
def test_singular_values_whichever_driver_gives_them(shape, seed, rank, fails, full):
    a = drawn(shape, seed, rank)
    with pytest.MonkeyPatch.context() as patch:
        if fails:
            patch.setattr(np.linalg, "svd", failing)
        u, sigma, vt = of.svd(a, full)
        alone, inverse = of.singular_values(a), of.pseudoinverse(a, 1e-10)
    k = sigma.shape[-1]
    near = 8 * sum(a.shape[-2:]) * EPS * max(1.0, sigma.max())
    assert largest((u[..., :k] * sigma[..., None, :]) @ vt[..., :k, :] - a) <= near
    assert largest(u.mT @ u - np.eye(u.shape[-1])) <= near
    assert largest(alone - sigma) <= near
    assert np.all(np.diff(sigma) <= 0.0)
    assert u.shape[-1] == (a.shape[-2] if full else k)
    assert largest(a @ inverse @ a - a) <= 10.0 * near * max(1.0, largest(inverse) * sigma.max())


@given(SHAPES, seeds, st.integers(1, 7), st.booleans())
def test_least_squares_have_least_norm_whichever_driver_gives_them(shape, seed, rank, fails):
    a = drawn((0, *shape[1:]), seed, rank)
    right = np.random.default_rng(seed).standard_normal((a.shape[0], 2))
    inverse = of.pseudoinverse(a, 1e-10)
    with pytest.MonkeyPatch.context() as patch:
        if fails:
            patch.setattr(np.linalg, "lstsq", failing)
        found, one = of.least_squares(a, right, 1e-10), of.least_squares(a, right[:, 0], 1e-10)
    kappa = max(1.0, float(largest(inverse) * largest(a)) * a.size)
    near = 10.0 * kappa * EPS * a.size * max(1.0, float(largest(inverse)) * a.shape[0])
    assert largest(found - inverse @ right) <= near
    assert largest(one - found[:, 0]) <= near


@given(SHAPES, seeds, st.booleans())
def test_eigenvalues_whichever_driver_gives_them(shape, seed, fails):
    a = drawn((shape[0], shape[1], shape[1]), seed, shape[1])
    a = a + a.mT
    with pytest.MonkeyPatch.context() as patch:
        if fails:
            patch.setattr(np.linalg, "eigh", failing)
            patch.setattr(np.linalg, "eigvalsh", failing)
        values, ways = of.symmetric_eigen(a)
        alone = of.symmetric_eigenvalues(a)
    near = 8 * a.shape[-1] * EPS * max(1.0, float(largest(values)))
    assert largest((ways * values[..., None, :]) @ ways.mT - a) <= 4.0 * near
    assert largest(alone - values) <= near


@given(st.integers(1, 7), generators, st.booleans())
def test_eigenvalues_in_a_metric_whichever_driver_gives_them(n, rng, fails):
    """K = Aᵀ Λ A and M = Aᵀ A have the eigenvalues Λ, whatever A is."""
    true, a = np.sort(rng.standard_normal(n)), np.eye(n) + 0.5 * np.tril(rng.standard_normal((n, n)), -1)
    metric, eigh = a.T @ a, scipy.linalg.eigh

    def failing_at_first(*given, driver, **options):
        return failing() if driver == "gvd" else eigh(*given, driver=driver, **options)

    with pytest.MonkeyPatch.context() as patch:
        if fails:
            patch.setattr(scipy.linalg, "eigh", failing_at_first)
        values, ways = of.metric_eigen(a.T @ (true[:, None] * a), metric)
    near = 100.0 * n * EPS * np.linalg.cond(metric) * max(1.0, largest(true))
    assert largest(values - true) <= near
    assert largest(ways.T @ metric @ ways - np.eye(n)) <= near


@given(SHAPES, seeds)
def test_eigenvalues_of_any_matrix(shape, seed):
    """Λ of V Λ V⁻¹, and of a rotation e^{±iφ}."""
    a = drawn((shape[0], shape[1], shape[1]), seed, shape[1])
    values, ways = of.eigen(a)
    near = 100.0 * a.shape[-1] * EPS * max(1.0, float(largest(a)) * a.shape[-1])
    assert largest(a @ ways - ways * values[..., None, :]) <= near
    assert largest(np.sum(of.eigenvalues(a), axis=-1) - np.trace(a, axis1=-2, axis2=-1)) <= near
    turn = np.array([[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]])
    assert largest(np.sort_complex(of.eigenvalues(turn)) - np.exp([-1j, 1j])) <= 8.0 * EPS


@given(st.integers(2, 8), generators)
def test_a_change_of_a_matrix_changes_its_eigenvalues_by_no_more_than_its_condition_says(size, rng):
    """To first order; of a matrix in very different units by its balanced form. A defective one has no bound."""
    a, unit, part = rng.standard_normal((size, size)), 10.0 ** rng.uniform(-6.0, 6.0, size), 1e-9
    a = a * unit[:, None] / unit
    values, ways, change = of.conditioned_eigen(a)
    off, scaled = (each / unit[:, None] for each in (a @ ways - ways * values, ways))
    assert np.all(np.abs(off) <= 1e-10 * largest(scaled, axis=0))
    turned = rng.standard_normal((size, size))
    other = of.eigenvalues(a + part * turned / np.linalg.norm(turned, 2) * unit[:, None] / unit)
    for value, bound in zip(values, change, strict=True):
        if part * bound * np.linalg.norm(change) < 1e-4:
            assert np.abs(other - value).min() <= 4.0 * part * bound
    assert np.all(of.conditioned_eigen(np.array([[0.0, 1.0], [0.0, 0.0]]))[2] > 1e100)


def test_what_has_no_eigenvalues_is_named():
    for take in (of.eigen, of.conditioned_eigen, of.eigenvalues, lambda m: of.metric_eigen(m, np.eye(2))):
        with pytest.raises(ArithmeticError, match=r"of a matrix of 2 × 2 .*are not finite"):
            take(np.full((2, 2), np.nan))
    with pytest.raises(ArithmeticError, match="in a positive metric"):
        of.metric_eigen(np.eye(2), np.diag([1.0, -1.0]))


def test_a_matrix_that_is_not_finite_is_named():
    a = np.full((3, 2), np.nan)
    for take in (of.svd, of.singular_values, of.pseudoinverse, lambda m: of.least_squares(m, np.ones(3))):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(np.linalg, "svd", failing)
            patch.setattr(np.linalg, "lstsq", failing)
            with pytest.raises(ArithmeticError, match=r"of a matrix of 3 × 2 .*are not finite"):
                take(a)


def test_no_other_place_takes_the_fast_drivers():
    bare = re.compile(
        r"linalg\.(svd|svdvals|eig|eigvals|eigh|eigvalsh|lstsq|pinv|matrix_rank|cond)\("
        r"|from (?:scipy|numpy)\.linalg import .*\b(svd|svdvals|eig|eigvals|eigh|eigvalsh|lstsq|pinv|null_space|orth)\b"
    )
    package = Path(ephs.__file__).parent
    files = [path for path in package.rglob("*.py") if path.name != "decompositions.py"]
    found = [f"{path.relative_to(package)}: {line}" for path in files for line in bare.findall(path.read_text("utf-8"))]
    assert not found
