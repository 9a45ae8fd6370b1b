"""Woodpecker on a pole in minimal coordinates, from event to event: plain NumPy and SciPy, no package code.

Coordinates are the height z of the sleeve, its inclination, and that of the bird, in the plane of both. The sleeve's
axis stays on the pole's; a spring holds the bird to it. Three small spheres, the beak and the sleeve's lower and upper
edges, may touch one side of the pole. Numbers are those of Leine, Glocker and van Campen, *Journal of Vibration and
Control* 9 (2003), 25-78, here with finite rotations.
"""

from itertools import product

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

POLE, HOLE, SLEEVE, NECK = 2.5e-3, 3.1e-3, 5.8e-3, 0.01
CENTRE, BEAK = 0.015, (0.0201, 0.02)
MASS, INERTIA = (3e-4, 4.5e-3), (5e-9, 7e-7)
SPRING, G, FRICTION, RESTITUTION = 5.6e-3, 9.81, 0.3, (0.5, 0.0, 0.0)
TIP = 1e-4
"""Radius of the spheres."""
BIRD = ((1, (NECK, 0.0)), (2, (CENTRE, 0.0)))
TIPS = (
    (BIRD[0], (2, (CENTRE - BEAK[0] + TIP, BEAK[1]))),
    ((1, (HOLE + TIP, -SLEEVE)),),
    ((1, (HOLE + TIP, SLEEVE)),),
)
"""Points by arms: coordinate that turns each, and the arm at zero."""
OPEN, STICK, UP, DOWN = range(4)
CLOSED, STILL, LATER = 1e-10, 1e-8, 1e-6
"""Gap in m, speed in m/s, and time in s after an event, below which there is none."""


def arm(terms, q, u):
    """Place (2,) of a point, its Jacobian (2, 3), and its acceleration where rates are constant."""
    place, rows, bias = np.array([0.0, q[0]]), np.zeros((2, 3)), np.zeros(2)
    rows[1, 0] = 1.0
    for i, (x, y) in terms:
        c, s = np.cos(q[i]), np.sin(q[i])
        there = np.array([c * x - s * y, s * x + c * y])
        place, bias = place + there, bias - there * u[i] ** 2
        rows[:, i] += [-there[1], there[0]]
    return place, rows, bias


def forces(q, u):
    """Mass matrix, and the forces of gravity, spring and rates."""
    _, rows, bias = arm(BIRD, q, u)
    turn = SPRING * (q[2] - q[1])
    mass = np.diag([MASS[0], *INERTIA]) + MASS[1] * rows.T @ rows
    return mass, np.array([-MASS[0] * G, turn, -turn]) - MASS[1] * rows.T @ (bias + np.array([0.0, G]))


def touching(q, u):
    """Gaps (3,), rows (3, 2, 3) of normal velocity and slip upwards, and their rates (3, 2) without accelerations."""
    gaps, rows, bias = np.zeros(3), np.zeros((3, 2, 3)), np.zeros((3, 2))
    for k, terms in enumerate(TIPS):
        place, rows[k], bias[k] = arm(terms, q, u)
        gaps[k] = place[0] - TIP - POLE
        rows[k, 1, terms[-1][0]] -= TIP
    return gaps, rows, bias


def pressed(modes, mobility, free):
    """Forces (2m,) of contacts that are open, stick, or slip up or down."""
    count = len(free)
    left, right = np.eye(count), np.zeros(count)
    for i, mode in enumerate(modes):
        if mode != OPEN:
            left[2 * i], right[2 * i] = mobility[2 * i], -free[2 * i]
        if mode == STICK:
            left[2 * i + 1], right[2 * i + 1] = mobility[2 * i + 1], -free[2 * i + 1]
        elif mode != OPEN:
            left[2 * i + 1, 2 * i] = FRICTION if mode == UP else -FRICTION
    return np.linalg.solve(left, right)


def complementary(mobility, free, ways, loose=()):
    """Modes and forces that go with each other, by trial of all.

    ``ways`` are signs of slips, 0 of none; those that are loose do not stick.
    """
    choices = [[OPEN, UP if way > 0 else DOWN] if way else [OPEN, STICK, UP, DOWN] for way in ways]
    for i in loose:
        choices[i] = [mode for mode in choices[i] if mode != STICK]
    least = -1e-9 * np.abs(free).max()
    for modes in product(*choices):
        force = pressed(modes, mobility, free)
        answer = free + mobility @ force
        if all(
            answer[2 * i] >= least
            if mode == OPEN
            else force[2 * i] >= 0.0
            and (
                abs(force[2 * i + 1]) <= FRICTION * force[2 * i]
                if mode == STICK
                else ways[i] or answer[2 * i + 1] * (1.0 if mode == UP else -1.0) >= least
            )
            for i, mode in enumerate(modes)
        ):
            return modes, force
    raise ValueError(f"no modes for {ways}")


def struck(q, u, closed):
    """Rates after Moreau's impact, with the least coefficient of those that are closed."""
    rows = touching(q, u)[1][closed].reshape(-1, 3)
    by, before = np.linalg.solve(forces(q, u)[0], rows.T), rows @ u
    e = min(RESTITUTION[i] for i in closed)
    free = before * np.tile([1.0 + e, 1.0], len(closed))
    return u + by @ complementary(rows @ by, free, [0] * len(closed))[1]


def accelerated(q, u, on):
    """Accelerations and forces (2m,) of contacts ``on``, pairs of number and mode."""
    mass, force = forces(q, u)
    free, which = np.linalg.solve(mass, force), [i for i, _ in on]
    if not on:
        return free, np.zeros(0)
    rows, bias = (each[which].reshape(2 * len(on), -1) for each in touching(q, u)[1:])
    by = np.linalg.solve(mass, rows.T)
    found = pressed([mode for _, mode in on], rows @ by, rows @ free + bias[:, 0])
    return free + by @ found, found


def watches(on, apart, begin):
    """Functions of (t, y) that fall through zero where a mode ends, and which contacts begin to slip at which."""
    found, slipping = [], {}
    for i in set(range(3)) - {i for i, _ in on}:
        found.append(lambda t, y, i=i: touching(y[:3], y[3:])[0][i] if apart[i] or t > begin + LATER else 1.0)
    for k, (i, mode) in enumerate(on):
        found.append(lambda t, y, k=k: accelerated(y[:3], y[3:], on)[1][2 * k])
        if mode == STICK:
            slipping[len(found)] = i

            def margin(t, y, k=k):
                normal, across = accelerated(y[:3], y[3:], on)[1][2 * k : 2 * k + 2]
                return FRICTION * normal - abs(across)

            found.append(margin)
        else:
            sign = 1.0 if mode == UP else -1.0
            found.append(
                lambda t, y, i=i, sign=sign: (
                    sign * touching(y[:3], y[3:])[1][i, 1] @ y[3:] if t > begin + LATER else 1.0
                )
            )
    for each in found:
        each.terminal, each.direction = True, -1.0
    return found, slipping


def simulate(q, u, until, times):
    """States (k, 6) at times, and the instants of impacts with their contacts."""
    t, loose, out, impacts = 0.0, set(), np.zeros((len(times), 6)), []
    while t < until:
        gaps, rows, bias = touching(q, u)
        closed = [i for i in range(3) if gaps[i] < CLOSED]
        if closed and (rows[closed, 0] @ u).min() < -STILL:
            u = struck(q, u, closed)
            impacts.append((t, tuple(closed)))
        held = [i for i in closed if rows[i, 0] @ u < STILL]
        on = []
        if held:
            mass, force = forces(q, u)
            mine, slips = rows[held].reshape(-1, 3), rows[held, 1] @ u
            bias = touching(q, u)[2][held].ravel()
            ways = np.where(np.abs(slips) < STILL, 0.0, np.sign(slips))
            by = np.linalg.solve(mass, mine.T)
            free = mine @ np.linalg.solve(mass, force) + bias
            modes, _ = complementary(mine @ by, free, ways, [held.index(i) for i in loose if i in held])
            on = [(i, mode) for i, mode in zip(held, modes, strict=True) if mode != OPEN]
        watched, slipping = watches(on, gaps >= CLOSED, t)
        sol = solve_ivp(
            lambda _, y, on=on: np.concatenate([y[3:], accelerated(y[:3], y[3:], on)[0]]),
            (t, until), np.concatenate([q, u]), "DOP853", events=watched, rtol=1e-10, atol=1e-12, dense_output=True,
        )  # fmt: skip
        inside = (times >= t) & (times <= sol.t[-1])
        if inside.any():
            out[inside] = sol.sol(times[inside]).T
        loose = {i for at, i in slipping.items() if len(sol.t_events[at])}
        t, q, u = sol.t[-1], sol.y[:3, -1], sol.y[3:, -1]
    return out, impacts


def start():
    """A state in which the lower edge rests on the pole and the bird swings back."""
    sleeve = brentq(lambda a: touching(np.array([0.0, a, 0.0]), np.zeros(3))[0][1] - 1e-12, -0.2, 0.0)
    return np.array([0.0, sleeve, -0.2788]), np.array([0.0, 0.0, -7.4583])
