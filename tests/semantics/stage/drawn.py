"""Programs of the staged language, drawn; and every way to run one, in one table."""

from dataclasses import dataclass
from fractions import Fraction
from random import Random

import numpy as np
from hypothesis import strategies as st

from ephs.semantics.stage import PLAIN, Duals, Entry, Program, staged, vector
from ephs.semantics.stage.duals import StagedDual
from ephs.semantics.stage.intervals import INTERVALS, Interval
from ephs.semantics.stage.symbolic import SYMBOLIC, Expression, expression, sp

INPUTS, VARIABLES, OUTPUTS = 3, 2, 4
CONSTANTS = (0.5, -1.0, 1.0, 2.0, 3.25, -0.125, 0.78125)
"""Without zero: what is known to be zero is dropped, which the sign of a zero can tell."""
UNARY = ("sqrt", "absolute", "floor", "sin", "cos", "exp", "log")
BINARY = ("atan2", "copysign", "minimum", "maximum", "/")
TAME = ("absolute", "floor", "sin", "cos", "minimum", "maximum")
"""Functions of finite values that do not tell the sign of a zero, for ways in which more is known while staging."""


def bodies(functions=(*UNARY, *BINARY), branches=True):
    """Draw bodies: Hypothesis draws their size and a seed, which makes them in one go."""
    seeds = st.tuples(st.integers(1, 4), st.integers(0, 2**32 - 1))
    return seeds.map(lambda drawn: Draw(Random(drawn[1]), functions, branches).body(*drawn[:1]))


@dataclass(frozen=True)
class Draw:
    """Programs by chance."""

    random: Random
    functions: tuple[str, ...]
    branches: bool

    def body(self, depth):
        return [self.statement(depth) for _ in range(self.random.randint(1, 3))]

    def statement(self, depth):
        kinds = ["set", "store", *(["loop", "loop"] if depth > 1 else [])]
        kind = self.random.choice([*kinds, *(["when", "repeat"] if depth > 1 and self.branches else [])])
        match kind:
            case "set":
                return kind, self.random.randrange(VARIABLES), self.expression(depth)
            case "store":
                return kind, self.random.randrange(OUTPUTS), self.expression(depth)
            case "loop":
                return kind, self.random.randint(0, 3), self.random.random() < 0.5, self.body(depth - 1)
            case "when":
                return kind, self.condition(depth), self.body(depth - 1), self.body(depth - 1)
            case _:
                return kind, self.condition(depth), self.random.randint(1, 4), self.body(depth - 1)

    def expression(self, depth):
        leaves = [
            ("x", self.random.randrange(INPUTS)),
            ("v", self.random.randrange(VARIABLES)),
            ("c", self.random.choice(CONSTANTS)),
            ("i",),
        ]
        if depth == 0:
            return self.random.choice(leaves)
        kinds = ["leaf", *"+-*+*", "negative", "select", "staged", *self.random.sample(self.functions, 4)]
        kind = self.random.choice(kinds)
        if kind == "leaf":
            return self.random.choice(leaves)
        if kind == "select":
            return kind, self.condition(depth), self.expression(depth - 1), self.expression(depth - 1)
        parts = [self.expression(depth - 1) for _ in range(1 if kind in UNARY or kind == "negative" else 2)]
        # What is made of constants alone may be zero, and what is known to be zero is dropped.
        return (kind, *parts) if any(part[0] != "c" for part in parts) else parts[0]

    def condition(self, depth):
        kind = self.random.choice(["<", "<=", ">", ">=", "both", "either"] if depth > 1 else ["<", ">="])
        part = self.condition if kind in ("both", "either") else self.expression
        return kind, part(depth - 1), part(depth - 1)


@staged
def helper(on, a, b):
    return on.select(a < b, a * 2.0 - b, b / (1.0 + a * a))


def run(on, body, x, out, constant=lambda number: number):
    """Run a drawn program; `constant` makes its constants numbers of the evaluator's, which are not rounded before."""
    variables = [on.variable(constant(0.5)), on.variable(constant(-1.5))]

    def value(e, i):
        match e:
            case ("x", k):
                return x[k]
            case ("v", k):
                return variables[k].value
            case ("c", number):
                return constant(number)
            case ("i",):
                return constant(on.real(i))
            case ("select", c, a, b):
                return on.select(truth(c, i), value(a, i), value(b, i))
            case ("staged", a, b):
                return helper(on, value(a, i), value(b, i))
            case ("+", a, b):
                return value(a, i) + value(b, i)
            case ("-", a, b):
                return value(a, i) - value(b, i)
            case ("*", a, b):
                return value(a, i) * value(b, i)
            case ("/", a, b):
                return value(a, i) / value(b, i)
            case ("negative", a):
                return -value(a, i)
            case (name, *arguments):
                return getattr(on, name)(*(value(a, i) for a in arguments))

    def truth(c, i):
        match c:
            case ("both" | "either" as name, a, b):
                return getattr(on, name)(truth(a, i), truth(b, i))
            case ("<", a, b):
                return value(a, i) < value(b, i)
            case ("<=", a, b):
                return value(a, i) <= value(b, i)
            case (">", a, b):
                return value(a, i) > value(b, i)
            case (_, a, b):
                return value(a, i) >= value(b, i)

    def do(statements, i):
        for statement in statements:
            match statement:
                case ("set", k, e):
                    variables[k].value = value(e, i)
                case ("store", k, e):
                    out[k] = value(e, i)
                case ("loop", n, down, inner):
                    on.loop(n, lambda j, inner=inner: do(inner, j), down=down)
                case ("when", c, yes, no):
                    on.when(truth(c, i), lambda yes=yes: do(yes, i), lambda no=no: do(no, i))
                case ("repeat", c, n, inner):
                    rounds = on.counter(0)

                    def once(c=c, n=n, inner=inner, rounds=rounds):
                        do(inner, i)
                        rounds.value = rounds.value + 1
                        return on.either(rounds.value >= n, truth(c, i))

                    on.repeat(once)

    do(body, 1)
    for variable in range(VARIABLES):
        out[OUTPUTS - VARIABLES + variable] = out[OUTPUTS - VARIABLES + variable] + variables[variable].value


def entry(body):
    return Entry(lambda on, x, out: run(on, body, x, out), x=vector(INPUTS), out=vector(OUTPUTS))


def by_call(call, x):
    out = np.zeros(OUTPUTS)
    call(np.array(x), out)
    return out


def plain(body, x):
    return by_call(Program("drawn", run=entry(body)).plain()["run"], x)


def compiled(body, x):
    return by_call(Program("drawn", run=entry(body)).compiled()["run"], x)


def unrolled(body, x):
    return by_call(Program("drawn", run=entry(body).given()).compiled()["run"], x)


def tangent(body, x):
    values, slopes = (np.array(x), np.ones((INPUTS, 2))), (np.zeros(OUTPUTS), np.zeros((OUTPUTS, 2)))
    Program("drawn", run=entry(body).tangent("x", "out", directions=2)).compiled()["run"](values, slopes)
    return slopes[0]


def dual(body, x):
    with np.errstate(all="ignore"):
        out = [StagedDual(0.0, (0.0,))] * OUTPUTS
        run(Duals(PLAIN), body, [StagedDual(np.float64(value), (np.float64(1.0),)) for value in x], out)
    return np.array([number.value if isinstance(number, StagedDual) else number for number in out])


def members(body, x):
    """One of four members, the others elsewhere."""
    wide, out = np.array(x)[:, None] + np.array([0.25, -1.0, 0.0, 3.0]), np.zeros((OUTPUTS, 4))
    Program("drawn", run=entry(body)).compiled(members=4)["run"](wide, out)
    return out[:, 2].copy()


def batch(body, x):
    wide, out = np.array(x)[:, None] + np.array([0.0, 1.0, -2.0]), np.zeros((OUTPUTS, 3))
    Program("drawn", run=entry(body)).arrays()["run"](wide, out)
    return out[:, 0].copy()


EXACT = {"compiled": compiled, "tangent": tangent, "dual": dual}
"""Ways to run a program that give the bits of the float run."""


def bounds(body, x):
    """Lower and upper bounds of each output."""
    out = [Interval(0.0, 0.0)] * OUTPUTS
    run(INTERVALS, body, [Interval(value, value) for value in x], out, lambda c: Interval(c, c))
    return [(n.low, n.high) if isinstance(n, Interval) else (n, n) for n in out]


def exact(body, x):
    """Each output as an exact number of SymPy."""
    out = [0.0] * OUTPUTS

    def number(value):
        return Expression(sp.Rational(*Fraction(float(value)).as_integer_ratio()))

    run(SYMBOLIC, body, [number(value) for value in x], out, number)
    return [expression(number) for number in out]
