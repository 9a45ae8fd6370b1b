"""Sparse LU in a fixed order: numbers only, no search, no allocation. See `sparse.Elimination`."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.semantics.spaces import jit

kernel = jit.lean_kernel


@kernel
def copy(source, out):
    """out = source, of one length. Assigning whole arrays would make lean kernels allocate."""
    for i in range(out.shape[0]):
        out[i] = source[i]


@kernel
def factorise(place, start, column, diagonal, data, value, row, floor, ratio):
    """Factors of the matrix with entries ``data`` into ``value``; False where a pivot is zero or below its floor.

    ``ratio`` (n,) receives |pivot|/|largest of its row|, ``floor`` (n,) is what this may come down to. Entries whose
    place is negative do not take part. ``row`` (n,) is scratch.
    """
    n = diagonal.shape[0]
    value[:] = 0.0
    for k in range(place.shape[0]):
        if place[k] >= 0:
            value[place[k]] += data[k]
    for i in range(n):
        first, last, middle = start[i], start[i + 1], diagonal[i]
        largest = 0.0
        for p in range(first, last):
            row[column[p]] = value[p]
            largest = max(largest, abs(value[p]))
        for p in range(first, middle):
            k = column[p]
            factor = row[k]
            if factor != 0.0:
                factor *= value[diagonal[k]]  # holds the reciprocal pivot
                row[k] = factor
                for q in range(diagonal[k] + 1, start[k + 1]):
                    row[column[q]] -= factor * value[q]
        for p in range(first, last):
            value[p] = row[column[p]]
        pivot = value[middle]
        if not abs(pivot) > 0.0:
            return False
        ratio[i] = abs(pivot) / largest
        if ratio[i] < floor[i]:
            return False
        value[middle] = 1.0 / pivot
    return True


@kernel
def solve(rows, columns, start, column, diagonal, value, right, x, row):
    """x with A x = right, from the factors. ``row`` (n,) is scratch; right and x may be the same array."""
    n = diagonal.shape[0]
    for i in range(n):
        total = right[rows[i]]
        for p in range(start[i], diagonal[i]):
            total -= value[p] * row[column[p]]
        row[i] = total
    for i in range(n - 1, -1, -1):
        total = row[i]
        for p in range(diagonal[i] + 1, start[i + 1]):
            total -= value[p] * row[column[p]]
        row[i] = total * value[diagonal[i]]
    for i in range(n):
        x[columns[i]] = row[i]


@kernel
def fill(first, column, start, out, link, mark):
    """The pattern of L + U by rows, in this order of rows and columns without further pivoting.

    The rows of A, their diagonals included, are column[first[i]:first[i+1]], ascending. ``start`` (n + 1,) and ``out``
    receive the pattern of the factors, ascending too; ``link`` (n + 1,) and ``mark`` (n,) are scratch. Returns the
    number of entries, or minus the row at which ``out`` was full, less one.
    """
    n = start.shape[0] - 1
    count = 0
    start[0] = 0
    mark[:] = -1
    for i in range(n):
        # The row as a linked list in ascending order, n at its end; what is in it is marked.
        head = column[first[i]]
        for p in range(first[i], first[i + 1]):
            mark[column[p]] = i
        for p in range(first[i], first[i + 1] - 1):
            link[column[p]] = column[p + 1]
        link[column[first[i + 1] - 1]] = n
        k = head
        while k < i:
            # Row k of U is merged in, behind its diagonal.
            here = k
            for q in range(start[k], start[k + 1]):
                j = out[q]
                if j > k:
                    if mark[j] != i:
                        while link[here] < j:
                            here = link[here]
                        link[j] = link[here]
                        link[here] = j
                        mark[j] = i
                    here = j
            k = link[k]
        k = head
        while k < n:
            if count == out.shape[0]:
                return -i - 1
            out[count] = k
            count += 1
            k = link[k]
        start[i + 1] = count
    return count
