"""Drawn wrong parts, by kinds of fault: what verdicts on structures are counted on.

Each kind is a function of a source of random numbers, which gives what makes a part. A wrong part leaks something by
1e-13 to 1 beside entries of other units that are larger by up to 1e9, is another function than its record, or breaks a
law in a window, along a direction, at some sizes.
"""

import math
import random
import types

import numpy as np

import ephs
from ephs import quantity as Q
from tests.semantics.zoo import AB, PS, QP, conduct, drag, friction_matrix

X = {"~x": Q.displacement}
TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


def gyrator(ports, matrix, **more):
    return lambda: ephs.gyrator(ports, matrix, **more)


def stored(energy, gradient=None, ports=None, **more):
    return lambda: ephs.storage(ports or {"q": Q.displacement}, energy, gradient, **more)


def leak(source):
    return 10.0 ** source.uniform(-13.0, 0.0)


def large(source):
    return 10.0 ** source.choice((-9.0, 9.0)) * source.uniform(0.5, 2.0)


def some(source):
    """A number of about one."""
    return source.uniform(0.1, 3.0)


def hidden(source):
    """A function that leaves numbers as they are, and records whole or not at all."""
    return source.choice((float, lambda x: x))


def beside(source, block, ports):
    """A lawful gyrator beside a block (2, 2) of other units."""
    whole = np.zeros((4, 4))
    whole[:2, :2], whole[2:, 2:] = large(source) * TURN, block
    return {**QP, **ports}, whole


CB = {"c": Q.charge, "b": Q.flux_linkage}

# ---- constants; `tests/semantics/test_constants.py` draws others --------------------------------------------------


def energy_inside_a_port(source):
    """The torque's entries are large, and the force makes energy."""
    whole = np.zeros((12, 12))
    whole[:3, 6:9], whole[6:9, :3] = -1e9 * np.eye(3), 1e9 * np.eye(3)
    whole[3, 9] = whole[9, 3] = leak(source)
    return gyrator({"q": Q.pose, "p": Q.body_momentum}, whole)


def entropy_of_a_transformer(source):
    ratio = 1.0 + leak(source)
    return lambda: ephs.transformer({"a": Q.entropy, "b": Q.entropy}, [[ratio]])


def volume_of_a_constraint(source):
    row = [1.0, -1.0 - leak(source), large(source), 0.0]
    row[3] = -row[2]
    ports = {"a": Q.volume, "b": Q.volume, "c": Q.charge, "d": Q.charge}
    return lambda: ephs.constraint(ports, [row])


# ---- functions of states -----------------------------------------------------------------------------------------


def energy_of_a_function(source):
    ports, whole = beside(source, leak(source) * np.array([[0.0, 1.0], [1.0, 0.0]]), CB)
    hide = hidden(source)
    return gyrator({**ports, **X}, lambda x: hide(x) * whole)


def entropy_of_a_function(source):
    ports, whole = beside(source, leak(source) * TURN, {"b": Q.flux_linkage, "s": Q.entropy})
    hide = hidden(source)
    return gyrator({**ports, **X}, lambda x: (1.0 + hide(x) ** 2) * whole)


def parity_of_a_function(source):
    ports, whole = beside(source, leak(source) * TURN, {"b": Q.flux_linkage, "i": Q.magnetic_flux})
    hide = hidden(source)
    return gyrator({**ports, **X}, lambda x: np.exp(hide(x)) * whole)


def energy_of_friction(source):
    size = leak(source)
    return lambda: ephs.irreversible(PS, lambda p, s: [[s, -p], [-p, (1.0 + size) * p * p / s]])


def symmetry_of_friction(source):
    size = leak(source)
    return lambda: ephs.irreversible(PS, lambda p, s: [[s, -p], [-(1.0 + size) * p, p * p / s]])


def energy_beside_friction(source):
    """Conduction loses energy beside friction with large entries."""
    size, other = leak(source), large(source)

    def matrix(p, s, a, b):
        m = np.zeros((4, 4), dtype=object)
        m[:2, :2] = other * friction_matrix(p, s)
        m[2:, 2:] = np.array([[b / a, -1.0], [-1.0, (1.0 + size) * a / b]])
        return m

    return lambda: ephs.irreversible({**PS, **AB}, matrix)


def volume_of_a_process(source):
    size = leak(source)

    def matrix(p, v, s):
        n = np.array([s, size * s, -p - size * v])
        return np.outer(n, n)

    return lambda: ephs.irreversible({"p": Q.momentum, "v": Q.volume, "s": Q.entropy}, matrix)


# ---- functions that are not their records ------------------------------------------------------------------------


def asks_scalar(source):
    factor = source.choice((-1.0, 2.0, 1.0 + 1e-6))
    return drag(lambda p, s: factor if np.isscalar(p) else 1.0)


def asks_type(source):
    kind = source.choice((float, np.floating, np.float64))
    return drag(lambda p, s: -1.0 if isinstance(s, kind) else 1.0)


def asks_type_in_a_window(source):
    middle, width = source.uniform(200.0, 600.0), 10.0 ** source.uniform(-6.0, 1.0)
    return drag(lambda p, s: -1.0 if isinstance(s, float) and abs(s - middle) < width else 1.0)


def asks_for_a_name(source):
    name = source.choice(("is_integer", "dtype", "__float__", "real", "hex"))
    has = hasattr(1.0, name)
    return drag(lambda p, s: 2.0 if hasattr(p, name) == has and isinstance(p, float) else 1.0)


def tries(source):
    def d(p, s):
        try:
            return 2.0 + math.copysign(1.0, 0.0 * float(p))
        except TypeError:
            return 1.0

    def e(p, s):
        try:
            {p: s}.get(0.5)
            return -1.0 if f"{p:.3f}" else 1.0
        except TypeError:
            return 1.0

    return drag(source.choice((d, e)))


def asks_for_text(source):
    asked = source.choice((lambda p: repr(p)[-1:].isdigit(), lambda p: str(p)[:1] in "-.0123456789"))
    return drag(lambda p, s: 3.0 if asked(p) else 1.0)


def asks_the_size(source):
    edge = 10.0 ** source.uniform(-4.0, 4.0)
    return stored(lambda q: q**2 * (2.0 if isinstance(q, float) and abs(q) > edge else 1.0))


def changes(source):
    calls, period = [0], source.randrange(2, 5)

    def d(p, s):
        calls[0] += 1
        return 1.0 + (calls[0] // period)

    return drag(d)


def remembers(source):
    last, share = [0.0], source.uniform(0.1, 2.0)

    def energy(q):
        before, last[0] = last[0], float(q)
        return float(q) ** 2 + share * abs(before)

    return stored(energy)


def draws(source):
    own = random.Random(source.random())
    return stored(lambda q: float(q) ** 2 * own.uniform(0.5, 1.5))


def in_a_global(source):
    """Counts where no closure shows it."""
    space = types.SimpleNamespace(n=0)

    def ratio(x):
        space.n += 1
        return (1.0 + space.n) * TURN

    return gyrator({**QP, **X}, ratio)


# ---- windows -----------------------------------------------------------------------------------------------------


def negative_in_a_window(source):
    middle, width = source.uniform(150.0, 900.0), 10.0 ** source.uniform(-4.0, 1.0)
    return drag(lambda p, s: -1.0 if abs(float(s) - middle) < width else 1.0)


def negative_in_a_recorded_window(source):
    middle, width = source.uniform(150.0, 900.0), 10.0 ** source.uniform(-4.0, 1.0)
    return drag(lambda p, s: 1.0 - 2.0 * (abs(s - middle) < width))


def negative_at_speeds(source):
    middle, width = source.uniform(0.1, 50.0), 10.0 ** source.uniform(-5.0, -1.0)
    return drag(lambda p, s: -1.0 if abs(abs(float(p)) - middle) < width else 1.0)


def negative_in_a_computed_window(source):
    square = float(round(source.uniform(1e4, 1e6)))
    return drag(lambda p, s: -1.0 if abs(s - math.sqrt(square)) < 1e-3 else 1.0)


def negative_between_two_temperatures(source):
    share = source.uniform(0.2, 0.8)
    return conduct(lambda a, b: -1.0 if abs(a / b - share) < 1e-4 else 1.0)


def negative_by_a_percent(source):
    """At low speeds only, where most digits cancel."""
    a, b = some(source), some(source)
    return drag(lambda p, s: a * (np.cosh(b * p) - 1.0 - 0.505 * (b * p) ** 2))


def not_skew_in_a_window(source):
    middle = source.uniform(-20.0, 20.0)

    def matrix(x):
        inside = abs(x - middle) < 1e-3
        return [[0.0, 1.0], [-1.0 + 1e-3 * inside, 0.0]]

    return gyrator({**QP, **X}, matrix)


def negative_by_a_polynomial(source):
    a, b = source.uniform(1.0, 3.0), source.uniform(3.0, 9.0)
    return drag(lambda p, s: (p**2 - a**2) * (p**2 - b**2))


def cold_beyond(source):
    edge = source.uniform(1.0, 1e3)
    return stored(lambda s: s - s**2 / (2.0 * edge), ports={"s": Q.entropy})


# ---- gradients ---------------------------------------------------------------------------------------------------


def gradient_off(source):
    factor = 1.0 + 10.0 ** source.uniform(-8.0, -1.0)
    return stored(lambda q: q**4 + q**2, lambda q: [factor * (4.0 * q**3 + 2.0 * q)])


def gradient_off_hidden(source):
    factor = 1.0 + 10.0 ** source.uniform(-4.5, -1.0)
    return stored(lambda q: float(q) ** 4, lambda q: [factor * 4.0 * q**3])


def gradient_off_along_a_direction(source):
    angle, size = source.uniform(0.0, math.pi), 10.0 ** source.uniform(-6.0, -2.0)
    c, s = size * math.cos(angle), size * math.sin(angle)
    hide = hidden(source)
    return (
        stored(
            lambda q, x: hide(q) ** 2 + hide(x) ** 2,
            lambda q, x: [2.0 * q + c * (c * q + s * x), 2.0 * x + s * (c * q + s * x)],
            ports={"q": Q.displacement, "x": Q.charge},
        )
        if source.random() < 0.5
        else stored(
            lambda q, x: hide(q) ** 2 + hide(x) ** 2,
            lambda q, x: [2.0 * q + size * x, 2.0 * x - size * q],
            ports={"q": Q.displacement, "x": Q.charge},
        )
    )


def gradient_off_in_a_window(source):
    middle = source.uniform(-9.0, 9.0)
    return stored(lambda q: q**2, lambda q: [2.0 * q + (1e-3 if abs(q - middle) < 1e-2 else 0.0)])


# ---- parity, and where there is no value -------------------------------------------------------------------------


def odd_energy(source):
    size = 10.0 ** source.uniform(-6.0, 0.0)
    return stored(lambda p: p**2 + size * p**3, ports={"p": Q.momentum})


def friction_with_a_direction(source):
    size = 10.0 ** source.uniform(-8.0, 0.0)
    return drag(lambda p, s: 2.0 + size * np.tanh(p))


def no_value(source):
    edge = source.uniform(-2.0, 2.0)
    energy = source.choice((
        lambda q: np.sqrt(q - edge) ** 4, lambda q: q * np.log(q - edge), lambda q: np.arcsin(q) * q
    ))  # fmt: skip
    return stored(energy)


def cold_of_extreme_numbers(source):
    """Quotients of the expansion are of whole numbers beyond all floats."""
    small = 10.0 ** source.uniform(-305.0, -297.0)
    return stored(lambda s: s**3 / 3.0 + small * s - 1e-3 * s, ports={"s": Q.entropy})


def energy_that_jumps(source):
    """By a turn where the angle's cut is passed: it has no gradient there."""
    size, other = some(source), some(source)
    ports = {"a": Q.displacement, "b": Q.displacement}
    return stored(lambda a, b: other * a**2 + size * np.arctan2(a, b), ports=ports)


BREAKS = {
    "isotropy": (energy_inside_a_port, energy_of_a_function, not_skew_in_a_window),
    "conservation": (
        entropy_of_a_transformer, volume_of_a_constraint,
        entropy_of_a_function, volume_of_a_process,
    ),
    "parity": (parity_of_a_function, friction_with_a_direction),
    "energy": (energy_of_friction, energy_beside_friction),
    "unlike": (asks_scalar, asks_type, asks_type_in_a_window, asks_for_a_name, tries, asks_for_text, asks_the_size),
    "unlike or changing": (changes,),
    "changing": (remembers, draws, in_a_global),
    "definite": (
        negative_in_a_window, negative_in_a_recorded_window, negative_at_speeds, negative_between_two_temperatures,
        negative_by_a_polynomial, negative_by_a_percent,
    ),
    "cold": (cold_beyond, cold_of_extreme_numbers),
    "gradient": (gradient_off, gradient_off_hidden, gradient_off_along_a_direction, gradient_off_in_a_window),
    "even": (odd_energy,),
    "no-value": (no_value,),
    # at 1e-13 of a number, or in a window whose place is the root of a number, a search may find nothing
    "symmetry or searched": (symmetry_of_friction,),
    "definite or searched": (negative_in_a_computed_window,),
    # a search looks at single states, and a jump is between two
    "gradient or searched": (energy_that_jumps,),
}  # fmt: skip
WRONG = {kind: conditions.split(" or ") for conditions, kinds in BREAKS.items() for kind in kinds}
"""Kind -> the conditions of which one is named."""
