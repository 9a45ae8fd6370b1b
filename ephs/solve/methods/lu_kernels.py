"""Sparse LU inside kernels: calls of `ephs.semantics.linear.sparse` by the addresses that an order keeps."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.semantics.calling import call_staged
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel


@kernel
def copy(source, out):
    """out = source, of one length. Assigning whole arrays would make lean kernels allocate."""
    for i in range(out.shape[0]):
        out[i] = source[i]


@kernel
def factorise(o, data, factors, row, ratio):
    """Factors of the matrix with entries ``data`` in the order o; False where a pivot is below its floor."""
    return call_staged(o.lu[0], (o.place, o.start, o.entry, o.diagonal, data, factors, row, o.floor, ratio)) == 1


@kernel
def solve(o, factors, right, x, row):
    """x with A x = right, from the factors; right and x are two arrays, ``row`` is scratch."""
    call_staged(o.lu[1], (o.rows, o.columns, o.start, o.entry, o.diagonal, factors, right, x, row))
