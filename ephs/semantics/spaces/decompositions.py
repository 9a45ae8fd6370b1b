"""Decompositions that converge: singular values, least squares, pseudoinverses, eigenvalues.

LAPACK's fast drivers, which divide and conquer, do not converge on some finite matrices, and which ones depends on the
processor; the QR iterations behind `gesvd`, `gelss` and `ev` do. Where these fail, too, the error says of which matrix.
"""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any, Final

import numpy as np

TEXT: Final = "the {what} of a matrix of {shape} with entries up to {largest:.3g} {why}"
ROUNDING = 1e-15
"""Part of the largest singular value that is rounding, where no other is given."""


def _scipy() -> Any:
    """SciPy's drivers, which take a quarter of a second to load."""
    return import_module("scipy.linalg")


def svd(matrix: Any, full_matrices: bool = True) -> tuple[Any, Any, Any]:
    """u, sigma, vt of one or many matrices (…, m, n), as of `numpy.linalg.svd`.

    Raises
    ------
    ArithmeticError
        The matrix is not finite, or no driver converges; it says which matrix.
    """

    def slow(a: Any) -> Any:
        return _scipy().svd(a, full_matrices=full_matrices, lapack_driver="gesvd", check_finite=False)

    fast: Any = np.linalg.svd
    return _robust("singular values", matrix, lambda a: fast(a, full_matrices=full_matrices), slow)


def singular_values(matrix: Any) -> Any:
    """(…, min(m, n)) singular values, the largest first; errors as of `svd`."""

    def slow(a: Any) -> Any:
        return (_scipy().svd(a, compute_uv=False, lapack_driver="gesvd", check_finite=False),)

    (found,) = _robust("singular values", matrix, lambda a: (np.linalg.svd(a, compute_uv=False),), slow)
    return found


def least_squares(matrix: Any, right: Any, part: float | None = None) -> Any:
    """(n,) or (n, k) solution of least norm; singular values below a part of the largest are 0. Errors as of `svd`."""

    def slow(a: Any) -> Any:
        cut = np.finfo(float).eps * max(a.shape) if part is None else part
        found: Any = _scipy().lstsq(a, right, cond=cut, lapack_driver="gelss", check_finite=False)
        return (found[0],)

    (found,) = _robust("least squares", matrix, lambda a: (np.linalg.lstsq(a, right, rcond=part)[0],), slow, right)
    return found


def pseudoinverse(matrix: Any, part: float = ROUNDING) -> Any:
    """(…, n, m) pseudoinverse without singular values below a part of the largest; errors as of `svd`."""
    a = np.asarray(matrix)
    if not a.size:
        return np.zeros((*a.shape[:-2], a.shape[-1], a.shape[-2]), dtype=a.dtype)
    u, sigma, vt = svd(a, full_matrices=False)
    large = sigma > part * sigma.max(axis=-1, keepdims=True)
    inverse = np.divide(1.0, sigma, where=large, out=np.zeros_like(sigma))
    return vt.conj().mT @ (inverse[..., None] * u.conj().mT)


def symmetric_eigen(matrix: Any) -> tuple[Any, Any]:
    """Eigenvalues (…, n), the least first, and eigenvectors (…, n, n) of symmetric matrices; errors as of `svd`."""

    def slow(a: Any) -> Any:
        return _scipy().eigh(a, driver="ev", check_finite=False)

    return _robust("eigenvalues", matrix, lambda a: tuple(np.linalg.eigh(a)), slow)


def symmetric_eigenvalues(matrix: Any) -> Any:
    """(…, n) eigenvalues of symmetric matrices, the least first; errors as of `svd`."""

    def slow(a: Any) -> Any:
        return (_scipy().eigh(a, driver="ev", eigvals_only=True, check_finite=False),)

    (found,) = _robust("eigenvalues", matrix, lambda a: (np.linalg.eigvalsh(a),), slow)
    return found


def metric_eigen(matrix: Any, metric: Any) -> tuple[Any, Any]:
    """Eigenvalues (n,), the least first, and eigenvectors (n, n) of K v = λ M v, symmetric, M positive definite.

    Errors as of `svd`, and where the metric is not positive definite.
    """

    def taking(a: Any, driver: str) -> Any:
        if not np.isfinite(a).all():  # which this driver does not say
            raise np.linalg.LinAlgError
        return _scipy().eigh(a, metric, driver=driver, check_finite=False)

    fast, slow = (partial(taking, driver=driver) for driver in ("gvd", "gv"))
    return _robust("eigenvalues in a positive metric", matrix, fast, slow, metric)


def eigen(matrix: Any) -> tuple[Any, Any]:
    """Eigenvalues (…, n) and eigenvectors (…, n, n) of any square matrices; errors as of `svd`."""
    return _robust("eigenvalues", matrix, np.linalg.eig)


def conditioned_eigen(matrix: Any) -> tuple[Any, Any, Any]:
    """Eigenvalues (n,) and eigenvectors (n, n) of a square matrix, and by how much a change of the balanced matrix by
    its own norm would change each eigenvalue (n,), to first order: infinite where it is defective; errors as of `svd`.
    """

    def balanced(a: Any) -> tuple[Any, ...]:
        la = _scipy()
        if not np.isfinite(a).all():
            raise np.linalg.LinAlgError
        even, _, _, scale, _ = la.lapack.dgebal(a, permute=0, scale=1)
        values, left, right = la.eig(even, left=True)
        with np.errstate(divide="ignore"):
            change = np.linalg.norm(even) / np.abs(np.sum(left.conj() * right, axis=0))
        return values, scale[:, None] * right, change

    return _robust("eigenvalues", matrix, balanced)


def eigenvalues(matrix: Any) -> Any:
    """(…, n) eigenvalues of any square matrices; errors as of `svd`."""
    (found,) = _robust("eigenvalues", matrix, lambda a: (np.linalg.eigvals(a),))
    return found


def _robust(
    what: str, matrix: Any, fast: Callable[[Any], Any], slow: Callable[[Any], Any] | None = None, right: Any = None
) -> tuple[Any, ...]:
    """Results of the fast driver, else of the slow one, if there is one, matrix by matrix."""
    a = np.asarray(matrix)
    try:
        return tuple(fast(a))
    except np.linalg.LinAlgError as error:
        if a.ndim < 2:
            raise
        cause = error
    shape = " × ".join(str(size) for size in a.shape[-2:])
    if not (np.isfinite(a).all() and (right is None or np.isfinite(right).all())):
        raise ArithmeticError(TEXT.format(what=what, shape=shape, largest=np.nan, why="are not finite")) from cause
    try:
        if slow is None:
            raise cause
        found = [tuple(slow(one)) for one in a.reshape(-1, *a.shape[-2:])]
    except np.linalg.LinAlgError as error:
        largest = float(np.abs(a).max(initial=0.0))
        text = TEXT.format(what=what, shape=shape, largest=largest, why="do not converge")
        raise ArithmeticError(text) from error
    parts = (np.array(part) for part in zip(*found, strict=True))
    return tuple(part.reshape(*a.shape[:-2], *part.shape[1:]) for part in parts)
