"""Drawn right parts, by kinds: none is to be refused."""

import math

import numpy as np

import ephs
from ephs import library
from ephs import quantity as Q
from ephs.operad import Quantity, Space
from tests.semantics.verdicts.wrong_parts import CB, QP, TURN, X, conduct, drag, gyrator, hidden, large, some, stored

RESTS = (
    lambda x: np.log(1.0 + x**2) - x**2 / (1.0 + x**2), lambda x: np.cosh(x) - 1.0 - 0.5 * x**2,
    lambda x: x**2 - np.sin(x) ** 2, lambda x: np.sqrt(1.0 + x**2) - 1.0,
)  # fmt: skip
"""None is negative, by their series and slopes."""


def motor(source):
    """A constant gyrator between odd quantities, in a magnet's field; with the numbers as a product leaves them."""
    k = some(source) * 0.1 / 0.3
    return gyrator({"p": Q.momentum, "b": Q.flux_linkage}, k * TURN, external_field=True)


def circulator(source):
    a, b, c = (source.uniform(-2.0, 2.0) for _ in "abc")
    ports = {name: Q.momentum for name in ("p", "q", "r")}
    return gyrator(ports, [[0.0, a, -b], [-a, 0.0, c], [b, -c, 0.0]], external_field=True)


def lorentz(source):
    """A charge in a field of its place."""
    b = source.uniform(0.1, 2.0)
    ports = {"p": Q.momentum, "r": Q.momentum, **X}
    return gyrator(ports, lambda x: b * np.cosh(x) * TURN, external_field=True)


def two_units(source):
    whole = np.zeros((4, 4))
    whole[:2, :2], whole[2:, 2:] = large(source) * TURN, some(source) * TURN
    return gyrator({**QP, **CB}, whole)


def turned(source):
    """A coupling of three axes in turned coordinates: a product of matrices, which rounds."""
    angle = source.uniform(0.0, 6.0)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    block = turn @ np.diag([source.uniform(0.5, 2.0), 1e3]) @ turn.T
    whole = np.block([[np.zeros((2, 2)), -block], [block.T, np.zeros((2, 2))]])
    ports = {"x": Q.displacement, "y": Q.displacement, "p": Q.momentum, "r": Q.momentum}
    return gyrator(ports, whole)


def skew_of_states(source):
    a, b = source.uniform(-2.0, 2.0), source.uniform(-2.0, 2.0)
    hide = hidden(source)

    def matrix(x):
        y = hide(x)
        k = 1.0 + a * y + b * y**2
        return [[0.0, -k], [k, 0.0]]

    return gyrator({**QP, **X}, matrix)


def written_in_two_ways(source):
    a = source.uniform(0.5, 2.0)
    return gyrator({**QP, **X}, lambda x: [[0.0, (x + a) ** 2 - a**2], [-x * (x + 2.0 * a), 0.0]])


def lever(source):
    length = source.uniform(0.5, 2.0)
    ports = {"p": Q.momentum, "r": Q.momentum, "~a": Q.angle}
    return lambda: ephs.transformer(ports, lambda a: [[length * np.cos(a)]])


def rolling(source):
    radius = source.uniform(0.1, 2.0)
    ports = {"x": Q.momentum, "y": Q.momentum, "w": Q.angular_momentum, "~a": Q.angle}
    return lambda: ephs.constraint(
        ports, lambda a: [[1.0, 0.0, -radius * np.cos(a)], [0.0, 1.0, -radius * np.sin(a)]], multipliers=2
    )


def turn(q):
    """The rotation of a pose, of any numbers."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def rotated_pair(source):
    k = source.uniform(0.5, 2.0)

    def matrix(a):
        whole = np.zeros((12, 12), dtype=object)
        whole[:3, 6:9], whole[6:9, :3] = -k * turn(a), k * turn(a).T
        whole[3:6, 9:], whole[9:, 3:6] = -turn(a), turn(a).T
        return whole

    return gyrator({"q": Q.pose, "p": Q.body_momentum, "~a": Q.pose}, matrix)


def convex(source):
    a, b = some(source), some(source)
    energy, gradient = source.choice((
        (lambda q: a * q**4 + b * q**2, lambda q: [4.0 * a * q**3 + 2.0 * b * q]),
        (lambda q: a * (np.cosh(b * q) - 1.0), lambda q: [a * b * np.sinh(b * q)]),
        (lambda q: a * np.sqrt(b + q**2), lambda q: [a * q / np.sqrt(b + q * q)]),
        (lambda q: a * np.log(b + q**2), lambda q: [2.0 * a * q / (b + q**2)]),
        (lambda q: a * np.log(np.exp(q) + np.exp(-q)), lambda q: [a * np.tanh(q)]),
    ))  # fmt: skip
    return stored(energy, gradient)


def convex_hidden(source):
    a, b = some(source), some(source)
    energy, gradient = source.choice((
        (lambda q: a * float(q) ** 4 + b, lambda q: [4.0 * a * float(q) ** 3]),
        (lambda q: a * math.cosh(b * float(q)), lambda q: [a * b * math.sinh(b * float(q))]),
        (lambda q: a * abs(float(q)) ** 3, lambda q: [3.0 * a * float(q) * abs(float(q))]),
        (lambda q: a * math.atan(b * float(q)), lambda q: [a * b / (1.0 + (b * float(q)) ** 2)]),
    ))  # fmt: skip
    return stored(energy, gradient)


def several_states(source):
    a = np.array([[source.uniform(-1.0, 1.0) for _ in range(3)] for _ in range(3)])
    k = a @ a.T
    k = 0.5 * (k + k.T)

    def energy(x, y, z):
        v = np.array([x, y, z])
        return 0.5 * (v @ k @ v) + x**2 * y**2

    def gradient(x, y, z):
        return list(k @ np.array([x, y, z]) + np.array([2.0 * x * y**2, 2.0 * x**2 * y, 0.0 * z]))

    return stored(energy, gradient, ports={"x": Q.displacement, "y": Q.charge, "z": Q.angle})


def warm(source):
    a, b = some(source), source.uniform(1.0, 300.0)
    energy = source.choice((
        lambda s: a * np.exp(s / b),
        lambda s: a * b * s + np.log(1.0 + np.exp(s)),
        lambda s: a * (s + np.sqrt(b + s**2)),
    ))  # fmt: skip
    return stored(energy, ports={"s": Q.entropy})


def damper(source):
    a, b = some(source), some(source)
    d = source.choice((
        lambda p, s: a, lambda p, s: abs(p), lambda p, s: p**2, lambda p, s: a * abs(p) + b * p**2,
        lambda p, s: a * np.exp(-b * p**2), lambda p, s: a / np.sqrt(b + p**2), lambda p, s: a * np.exp(-s / 300.0),
        lambda p, s: a if abs(p) < b else 2.0 * a, lambda p, s: a + b * math.tanh(float(s)),
    ))  # fmt: skip
    return drag(d)


def cancelling(source):
    """Drag that is the rest of large terms, none of whose digits is right at low speeds."""
    a, b = some(source), some(source)
    return drag(source.choice(tuple(lambda p, s, rest=rest: a * rest(b * p) for rest in RESTS)))


def valve(source):
    a = some(source)
    return drag(lambda p, s: a * (1.0 + np.tanh(p)), one_sided=True)


def conductor(source):
    a = some(source)
    k = source.choice((
        lambda x, y: a, lambda x, y: a * x * y, lambda x, y: a * (x + y), lambda x, y: a * (x**2 + y**2) * (x + y),
        lambda x, y: math.sqrt(float(x) * float(y)),
    ))  # fmt: skip
    return conduct(k)


def friction_of_two(source):
    """Both bodies of a contact are heated; a matrix of rank one, and a lawful block of other units."""
    a, b = some(source), large(source)

    def matrix(p, r, s, x, y):
        n = np.array([s, -s, r - p, 0.0 * x, 0.0 * y])
        m = a * np.outer(n, n) / s
        m[3:, 3:] = b * np.array([[y / x, -1.0], [-1.0, x / y]])
        return m

    ports = {"p": Q.momentum, "r": Q.momentum, "s": Q.entropy, "x": Q.entropy, "y": Q.entropy}
    return lambda: ephs.irreversible(ports, matrix)


def sheared(source):
    """A damper in three directions, whose matrix is a product that rounds."""
    a = np.array([[source.uniform(-1.0, 1.0) for _ in range(3)] for _ in range(3)])
    d = a.T @ a

    def matrix(p, s):
        force = d @ p
        m = np.zeros((4, 4), dtype=object)
        m[:3, :3], m[:3, 3], m[3, :3], m[3, 3] = s * d, -force, -force, (p @ force) / s
        return m

    return lambda: ephs.irreversible({"p": Quantity("momentum", Space("real", 3, 3), -1), "s": Q.entropy}, matrix)


def frozen(source):
    """A process that stops in the cold: its matrix is below the smallest normal number there."""
    size, activation = some(source), source.uniform(735.0, 743.0)
    return drag(lambda p, s: size * math.exp(-activation * 273.15 / float(s)), domain={"s": (270.0, math.inf)})


def small_store(source):
    """An energy that a shift of its zero takes all digits from, at a state of many heat capacities."""
    capacity = source.uniform(2.0, 9.0) * 1e-3
    return lambda: library.thermal_capacity(c1=10.0 ** source.uniform(100.0, 150.0), c2=capacity)


def large_beside_a_sine(source):
    """A number of the formula is an angle, too, whose sine says nothing."""
    size = 10.0 ** source.uniform(17.0, 150.0)
    return gyrator({**QP, **X}, lambda x: size * np.cos(x) * TURN)


def faint(source):
    """A process whose matrix is below the smallest normal number."""
    size = some(source)
    return drag(lambda p, s: 1e-160 * s * (size * 1e-160))


PROVED = (
    motor, circulator, lorentz, two_units, turned, lever, rolling, rotated_pair, several_states, warm, valve,
    conductor, friction_of_two, sheared, faint, small_store, large_beside_a_sine,
)  # fmt: skip
RIGHT = (*PROVED, skew_of_states, written_in_two_ways, convex, convex_hidden, damper, cancelling, frozen)
