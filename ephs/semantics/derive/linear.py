"""Relations whose numbers are matrices of any size, or a pose: programs compiled once for all of them.

They have the arguments of `ephs.semantics.descriptor.kernel_table`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, final

from ephs.semantics.spaces import so3
from ephs.semantics.spaces.vectors import apply, combine, hat, product, scale, transposed
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.kinds import pointer
from ephs.semantics.stage.memory import Integers, Vector
from ephs.semantics.stage.numbers import Integer, Real
from ephs.semantics.stage.programs import Entry, Program


def _dot(on: Evaluator, count: Integer, entry: Callable[[Integer], Real]) -> Real:
    """Σ of so many entries."""
    total = on.variable(0.0)

    def add(i: Integer) -> None:
        total.value = total.value + entry(i)

    on.loop(count, add)
    return total.value


def no_effort(
    on: Evaluator, dims: Integers, scal: Vector, p: Vector, x0: Vector, v: Vector, e: Vector, lam: Vector, f: Vector,
    c: Vector, jac: Vector, work: Vector,
) -> Integer:  # fmt: skip
    """The environment, and storages without energy: e = 0."""
    n = dims[0]

    def row(i: Integer) -> None:
        e[i] = 0.0

        def entry(j: Integer) -> None:
            f[i * n + j] = 0.0

        on.loop(n, entry)

    on.loop(n, row)
    c[0] = 0.0
    return 0


def quadratic(
    on: Evaluator, dims: Integers, scal: Vector, p: Vector, x0: Vector, v: Vector, e: Vector, lam: Vector, f: Vector,
    c: Vector, jac: Vector, work: Vector,
) -> Integer:  # fmt: skip
    """E = ½ xᵀ Q x on a vector space, e = Q (x⁰ + v/2); p = Q (n, n)."""
    n = dims[0]
    total = on.variable(0.0)

    def row(i: Integer) -> None:
        e[i] = _dot(on, n, lambda j: p[i * n + j] * (x0[j] + 0.5 * v[j]))
        end = _dot(on, n, lambda j: p[i * n + j] * (x0[j] + v[j]))
        total.value = total.value + 0.5 * (x0[i] + v[i]) * end

        def entry(j: Integer) -> None:
            f[i * n + j] = 0.5 * p[i * n + j]

        on.loop(n, entry)

    on.loop(n, row)
    c[0] = total.value
    return 0


def constant_structure(
    on: Evaluator, dims: Integers, scal: Vector, p: Vector, x0: Vector, v: Vector, e: Vector, lam: Vector, f: Vector,
    c: Vector, jac: Vector, work: Vector,
) -> Integer:  # fmt: skip
    """f = L e + Cᵀ λ, 0 = C e; p = L (n, n), C (k, n)."""
    n, k, m = dims[0], dims[1], dims[2]
    width, below = n + k + m, n * n

    def fill(count: Integer, at: Integer, entry: Callable[[Integer], Real]) -> None:
        def each_entry(j: Integer) -> None:
            jac[at + j] = entry(j)

        on.loop(count, each_entry)

    def flow(i: Integer) -> None:
        f[i] = _dot(on, n, lambda j: p[i * n + j] * e[j]) + _dot(on, k, lambda j: p[below + j * n + i] * lam[j])
        fill(n, i * width, lambda j: p[i * n + j])
        fill(k, i * width + n, lambda j: p[below + j * n + i])
        fill(m, i * width + n + k, lambda j: 0.0)

    def condition(i: Integer) -> None:
        c[i] = _dot(on, n, lambda j: p[below + i * n + j] * e[j])
        fill(n, (n + i) * width, lambda j: p[below + i * n + j])
        fill(k + m, (n + i) * width + n, lambda j: 0.0)

    on.loop(n, flow)
    on.loop(k, condition)
    return 0


def frame_change(
    on: Evaluator, dims: Integers, scal: Vector, p: Vector, x0: Vector, v: Vector, e: Vector, lam: Vector, f: Vector,
    c: Vector, jac: Vector, work: Vector,
) -> Integer:  # fmt: skip
    """f = Cᵀ λ, 0 = C e with C = [−Ad_{o⁻¹}, 1]; p = o, a pose."""
    place, back = [p[i] for i in range(4, 7)], transposed(so3.matrix([p[i] for i in range(4)]))
    moment = [scale(-1.0, row) for row in product(back, hat(place))]
    carried = [[*row, 0.0, 0.0, 0.0] for row in back] + [[*one, *two] for one, two in zip(moment, back, strict=True)]
    twist, wrench = [e[i] for i in range(6)], [lam[i] for i in range(6)]
    for i, (seen, pulled) in enumerate(zip(apply(carried, twist), combine(carried, wrench), strict=True)):
        c[i] = e[6 + i] - seen
        f[i], f[6 + i] = -1.0 * pulled, wrench[i]
    for i in range(18):
        for j in range(18):
            jac[18 * i + j] = 0.0
    for i in range(6):
        for j in range(6):
            jac[18 * j + 12 + i] = jac[18 * (12 + i) + j] = -1.0 * carried[i][j]
        jac[18 * (6 + i) + 12 + i] = jac[18 * (12 + i) + 6 + i] = 1.0
    return 0


FUNCTIONS: Final = (no_effort, quadratic, constant_structure, frame_change)


@cache
def linear_program() -> Program:
    """Return the program of these relations."""
    names = ("scal", "p", "x0", "v", "e", "lam", "f", "c", "jac", "work")
    kinds: dict[str, Any] = {"dims": pointer("integers", 4)} | {name: pointer("reals", None) for name in names}
    return Program("linear", **{each.__name__: Entry(each, **kinds) for each in FUNCTIONS})


@final
@dataclass(frozen=True, slots=True)
class Linear:
    """One of the relations of this file, by its function's name."""

    name: str

    @property
    def program(self) -> Program:
        """The program of all of them."""
        return linear_program()
