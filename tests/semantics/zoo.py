"""Wrong primitives, each wrong in one way, often in one place only: all are refused, with the place as the witness."""

import math

import numpy as np

import ephs
from ephs import quantity as Q
from ephs.semantics import Irreversible, Reversible, Storage
from ephs.semantics.library import power_ports
from ephs.semantics.primitives import structures

QP = {"q": Q.displacement, "p": Q.momentum}
PS = {"p": Q.momentum, "s": Q.entropy}
AB = {"a": Q.entropy, "b": Q.entropy}
ONE = power_ports(q=Q.displacement)


def friction_matrix(p, s):
    """M of friction with the coefficient 1."""
    return np.array([[s, -p], [-p, p * p / s]])


def conduction_matrix(a, b):
    """M of heat conduction with the coefficient 1."""
    return np.array([[b / a, -1.0], [-1.0, a / b]])


def conduct(k):
    """Heat conduction with the coefficient k(a, b) of the two temperatures."""
    return lambda: ephs.irreversible(AB, lambda a, b: k(a, b) * conduction_matrix(a, b))


def drag(d, **more):
    """Friction with the coefficient d(p, s) of velocity and temperature."""
    return lambda: ephs.irreversible(PS, lambda p, s: d(p, s) * friction_matrix(p, s), **more)


def hidden(function):
    """The same function, whose formula nobody sees."""
    return lambda *x: function(*map(float, x))


def twisted(bump):
    """A gyrator whose skewness a function of the state breaks."""
    return lambda: ephs.gyrator({**QP, "~x": Q.displacement}, lambda x: [[0.0, 1.0], [-1.0 + bump(x), 0.0]])


def outer(n):
    n = np.array(n)
    return np.outer(n, n)


def stored(port, of, energy, gradient=None):
    return lambda: ephs.storage({port: of}, energy, gradient)


ZOO = {
    # ---- the second law ------------------------------------------------------------------------------------------
    "conducts by a − b": (conduct(lambda a, b: a - b), "definite"),
    "conducts by a − b, hidden": (conduct(hidden(lambda a, b: a - b)), "definite"),
    "conducts by the sign of a − b, hidden": (conduct(hidden(lambda a, b: math.copysign(1.0, a - b))), "definite"),
    "conducts backward when almost equal": (
        conduct(hidden(lambda a, b: -1.0 if 0.0 < abs(a - b) < 1e-4 * a else 1.0)), "definite"
    ),
    "conducts backward when cold": (conduct(lambda a, b: np.log(a * b)), "definite"),
    "conducts backward from a half": (conduct(hidden(lambda a, b: -1.0 if a < 0.01 else 1.0)), "definite"),
    "drives": (lambda: ephs.irreversible(PS, lambda p, s: [[-s, p], [p, -p * p / s]]), "definite"),
    "drives around |v| = 4": (drag(lambda p, s: 1.0 - 2.0 * np.exp(-100.0 * (abs(p) - 4.0) ** 2)), "definite"),
    "drives around |v| = 4, hidden": (drag(hidden(lambda p, s: -1.0 if 3.9 < abs(p) < 4.1 else 1.0)), "definite"),
    "drives when fast": (drag(lambda p, s: 1.0 - 1e-8 * p**2), "definite"),
    "drives when slow": (drag(lambda p, s: p**2 - 1e-4), "definite"),
    "drives in small volumes": (
        lambda: ephs.irreversible(
            {**PS, "~v": Q.volume}, lambda p, s, v: (v - 0.2) * friction_matrix(p, s)
        ), "definite",
    ),
    "drives where x is negative": (
        lambda: ephs.irreversible(
            {**PS, "~x": Q.displacement}, lambda p, s, x: x * friction_matrix(p, s)
        ), "definite",
    ),
    "three bodies, one pair wrong": (
        lambda: ephs.irreversible(
            {"a": Q.entropy, "b": Q.entropy, "c": Q.entropy},
            lambda a, b, c: outer([b, -a, 0 * c]) + outer([0 * a, c, -b]) - 1.5 * outer([c, 0 * b, -a]),
        ), "definite",
    ),
    "made friction": (lambda: structures.dissipation("w", power_ports(**PS), np.array([[-1.0]])), "definite"),
    # ---- symmetry and the first law ------------------------------------------------------------------------------
    "not symmetric when hot": (
        lambda: ephs.irreversible(
            AB, lambda a, b: [[b / a, -1.0], [-1.0 - (1.0 if a > 300.0 else 0.0), a / b]]
        ), "symmetry",
    ),
    "loses energy at x = 3": (
        lambda: ephs.irreversible(
            {**PS, "~x": Q.displacement}, lambda p, s, x: [[s, -p], [-p, p * p / s + np.exp(-50.0 * (x - 3.0) ** 2)]]
        ), "energy",
    ),
    "time's arrow": (
        lambda: ephs.irreversible({**QP, "s": Q.entropy}, lambda p, q, s: outer([s, s, -p - q])), "parity"
    ),
    "friction tells quaternions apart": (
        lambda: ephs.irreversible(
            PS | {"~q": Q.pose}, lambda p, s, q: (2.0 + q[1]) * friction_matrix(p, s)
        ), "rotation-sign",
    ),
    "a class of one's own": (
        lambda: Irreversible("w", power_ports(**AB), lambda x, e, reference: np.diag([1.0, -1.0])), "definite"
    ),
    # ---- Dirac structures ----------------------------------------------------------------------------------------
    "a bump at x = 3": (twisted(lambda x: np.exp(-100.0 * (x - 3.0) ** 2)), "isotropy"),
    "not skew beyond a thousand": (twisted(hidden(lambda x: float(x > 1000.0))), "isotropy"),
    "not skew for small negative x": (twisted(hidden(lambda x: float(-1e-3 < x < 0.0))), "isotropy"),
    "creates entropy at x = 3": (
        lambda: ephs.gyrator(
            {**PS, "~x": Q.displacement}, lambda x: (x == 3.0) * np.array([[0.0, 1.0], [-1.0, 0.0]])
        ), "conservation",
    ),
    "constraint tells quaternions apart": (
        lambda: ephs.constraint({"p": Q.momentum, "p2": Q.momentum, "~q": Q.pose}, lambda q: [[1.0, q[1]]]),
        "rotation-sign",
    ),
    "a Dirac structure of one's own": (
        lambda: Reversible("w", power_ports(**QP), lambda x: (np.eye(2), np.zeros((0, 2)))), "isotropy"
    ),
    # ---- energies ------------------------------------------------------------------------------------------------
    "odd beyond a hundred": (stored("p", Q.momentum, lambda p: float(p) ** 2 + (p > 100.0)), "even"),
    "gradient wrong for q < 0": (stored("q", Q.displacement, lambda q: q**2, lambda q: [2.0 * abs(q)]), "gradient"),
    "a storage of one's own": (
        lambda: Storage("w", ONE, lambda x: float((x[next(iter(x))] ** 2)[0]), lambda x: np.ones(1)), "gradient"
    ),
    "negative temperature for s < −3": (stored("s", Q.entropy, lambda s: 300.0 * s + 50.0 * s**2), "cold"),
    "negative temperature for s < −3, hidden": (
        stored("s", Q.entropy, lambda s: 300.0 * float(s) + 50.0 * float(s) ** 2), "cold"
    ),
    "temperature of zero": (stored("s", Q.entropy, lambda s: 3.0 + 0.0 * s), "cold"),
    "gas that is cold when thin": (
        lambda: ephs.storage({"s": Q.entropy, "v": Q.volume}, lambda s, v: np.exp(s) * (20.0 - v)), "cold"
    ),
    "energy tells quaternions apart": (stored("q", Q.pose, lambda q: q[1]), "rotation-sign"),
    "quadratic energy that is not even": (
        lambda: structures.quadratic("w", power_ports(**QP), np.array([[1.0, 1.0], [1.0, 1.0]]), ()), "even"
    ),
    "quadratic energy that is not symmetric": (
        lambda: structures.quadratic(
            "w", power_ports(q=Q.displacement, x=Q.charge), np.array([[1.0, 2.0], [0.0, 1.0]]), ()
        ), "gradient",
    ),
    "energy without end": (stored("q", Q.displacement, lambda q: q / 0.0), "finite"),
    "energy that is nowhere a number": (stored("q", Q.displacement, lambda q: np.sqrt(-1.0 - q * q)), "finite"),
}  # fmt: skip
"""Name -> (what makes it, which condition it breaks)."""

MALFORMED = {
    "not finite": (lambda: ephs.gyrator(QP, [[0.0, np.nan], [1.0, 0.0]]), "undefined"),
    "wrong shape": (lambda: ephs.gyrator(QP, [[0.0]]), "parameter"),
    "matrix of another size": (lambda: ephs.irreversible(PS, lambda p, s: [[s]]), "parameter"),
    "complex energy": (stored("q", Q.displacement, lambda q: 1j * q), "parameter"),
    "state port": (lambda: ephs.storage({"q": Q.displacement, "~p": Q.momentum}, lambda q: q**2), "storage-ports"),
}  # fmt: skip
"""What has no structure to be right or wrong."""
