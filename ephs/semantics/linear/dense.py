"""Dense linear algebra in place: sums, triangular solutions, Cholesky and LU factors."""

from collections.abc import Callable

from ephs.semantics.stage import Evaluator, Integer, Integers, Matrix, Real, Truth, Vector


def clear(on: Evaluator, x: Vector) -> None:
    """Put zeros into a vector."""

    def each_entry(i: Integer) -> None:
        x[i] = 0.0

    on.loop(x.size, each_entry)


def copy(on: Evaluator, source: Vector, out: Vector) -> None:
    """Copy a vector."""

    def each_entry(i: Integer) -> None:
        out[i] = source[i]

    on.loop(source.size, each_entry)


def dot(on: Evaluator, x: Vector, y: Vector) -> Real:
    """Σ x_i y_i, added in order."""
    total = on.variable(0.0)

    def add(i: Integer) -> None:
        total.value = total.value + x[i] * y[i]

    on.loop(x.size, add)
    return total.value


def add_to(out: Vector, i: Integer, value: Real) -> None:
    """The sum of an entry and a number."""
    out[i] = out[i] + value


def sum_of_squares(on: Evaluator, count: Integer, term: Callable[[Integer], Real]) -> Real:
    """Σ x_i² of so many numbers, added in order."""
    total = on.variable(0.0)

    def add(i: Integer) -> None:
        x = term(i)
        total.value = total.value + x * x

    on.loop(count, add)
    return total.value


def norm(on: Evaluator, x: Vector) -> Real:
    """Euclidean norm."""
    return on.sqrt(dot(on, x, x))


def subtract(on: Evaluator, factor: Real, y: Vector, x: Vector) -> None:
    """x ← x − factor y."""

    def each_entry(i: Integer) -> None:
        x[i] = x[i] - factor * y[i]

    on.loop(x.size, each_entry)


def cholesky(on: Evaluator, a: Matrix, factor: Matrix, first: Integers | None = None) -> Integer:
    """Factorise A = L Lᵀ by rows, L into the lower triangle of ``factor``, which may be A.

    Parameters
    ----------
    first
        (n,): where each row begins, if not with its first entry; what is before is not read.

    Returns
    -------
    Integer
        0, or 1 + the first row whose pivot is not positive, where it stops.
    """
    n = a.rows
    at, failed = on.counter(0), on.counter(0)
    rest = on.variable(0.0)

    def row() -> Truth:
        i = at.value
        own = 0 if first is None else first[i]

        def entry(j: Integer) -> None:
            other = 0 if first is None else first[j]
            rest.value = a[i, j]

            def less(k: Integer) -> None:
                rest.value = rest.value - factor[i, k] * factor[j, k]

            on.loop(j, less, start=0 if first is None else on.select(own > other, own, other))

        def left(j: Integer) -> None:
            entry(j)
            factor[i, j] = rest.value * (1.0 / factor[j, j])  # the division does not wait for the sum

        on.loop(i, left, start=own)
        entry(i)

        def pivot() -> None:
            factor[i, i] = on.sqrt(rest.value)

        def stop() -> None:
            failed.value = i + 1

        on.when(rest.value > 0.0, pivot, stop)
        at.value = i + 1
        return on.either(failed.value > 0, i + 1 >= n)

    on.when(n > 0, lambda: on.repeat(row))
    return failed.value


def forward(on: Evaluator, factor: Matrix, x: Vector) -> None:
    """x ← L⁻¹ x, L the lower triangle of ``factor`` (n, n); what x has beyond n stays."""
    rest = on.variable(0.0)

    def row(i: Integer) -> None:
        rest.value = x[i]

        def less(k: Integer) -> None:
            rest.value = rest.value - factor[i, k] * x[k]

        on.loop(i, less)
        x[i] = rest.value / factor[i, i]

    on.loop(factor.rows, row)


def backward(on: Evaluator, factor: Matrix, x: Vector) -> None:
    """x ← L⁻ᵀ x, L the lower triangle of ``factor`` (n, n); what x has beyond n stays."""
    rest = on.variable(0.0)

    def row(i: Integer) -> None:
        rest.value = x[i]

        def less(k: Integer) -> None:
            rest.value = rest.value - factor[k, i] * x[k]

        on.loop(factor.rows, less, start=i + 1)
        x[i] = rest.value / factor[i, i]

    on.loop(factor.rows, row, down=True)


def lu(on: Evaluator, a: Matrix, pivots: Integers) -> Truth:
    """Factorise P A = L U in place with partial pivoting; ``pivots`` (n,): the row exchanged with each.

    Returns
    -------
    Truth
        False where a column has no pivot but zero: the factors are of no use.
    """
    n = a.rows
    good, best, largest = on.counter(1), on.counter(0), on.variable(0.0)

    def column(k: Integer) -> None:
        best.value, largest.value = k, on.absolute(a[k, k])

        def search(i: Integer) -> None:
            size = on.absolute(a[i, k])
            best.value = on.select(size > largest.value, i, best.value)
            largest.value = on.maximum(largest.value, size)

        on.loop(n, search, start=k + 1)
        row = pivots[k] = best.value
        good.value = on.select(largest.value > 0.0, good.value, 0)

        def exchange(j: Integer) -> None:
            upper, lower = a[k, j], a[row, j]
            a[k, j], a[row, j] = lower, upper

        on.when(on.negate(on.same(row, k)), lambda: on.loop(n, exchange))
        inverse = 1.0 / a[k, k]

        def below(i: Integer) -> None:
            factor = a[i, k] * inverse
            a[i, k] = factor

            def entry(j: Integer) -> None:
                a[i, j] = a[i, j] - factor * a[k, j]

            on.loop(n, entry, start=k + 1)

        on.loop(n, below, start=k + 1)

    on.loop(n, column)
    return on.same(good.value, 1)


def lu_solve(on: Evaluator, factors: Matrix, pivots: Integers, x: Vector) -> None:
    """x ← A⁻¹ x, from the factors of `lu`."""
    n = x.size
    rest = on.variable(0.0)

    def exchange(k: Integer) -> None:
        upper, lower = x[k], x[pivots[k]]
        x[k], x[pivots[k]] = lower, upper

    on.loop(n, exchange)

    def row(i: Integer, first: Integer, last: Integer) -> None:
        rest.value = x[i]

        def less(k: Integer) -> None:
            rest.value = rest.value - factors[i, k] * x[k]

        on.loop(last, less, start=first)

    def down(i: Integer) -> None:
        row(i, 0, i)
        x[i] = rest.value

    def up(i: Integer) -> None:
        row(i, i + 1, n)
        x[i] = rest.value / factors[i, i]

    on.loop(n, down)
    on.loop(n, up, down=True)
