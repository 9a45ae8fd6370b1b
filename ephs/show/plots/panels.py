"""Panels of a solution: named curves over time with a unit, for figures and for pages."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.show.plots.series import Array, motion_lines, state_panels
from ephs.show.shared.palette import BLACK, BLUE, CYCLE, GREEN, ORANGE, PURPLE, RED, SKY

ROUNDING = 1e-12
"""Relative size of differences that count as rounding."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Values (n,) at the last n instants of a solution, with a name and a colour."""

    name: str
    values: Array
    colour: str


@final
@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """Curves with one axis.

    Attributes
    ----------
    title : str
        Name and unit of the axis, as in ``energy [J]``.
    curves : tuple of Curve
        In the order of the legend.
    noise : float
        Span below which differences are rounding, in the panel's unit.
    residual : bool
        Whether the values are residuals, of which only the order of magnitude matters.
    height : float
        Relative to other panels.
    """

    title: str
    curves: tuple[Curve, ...]
    noise: float = 0.0
    residual: bool = False
    height: float = 1.0


def motion_panels(sol: Any) -> list[Panel]:
    """Joint coordinates, positions of the centres of mass and temperatures; of a system, its states, too."""
    found = motion_lines(sol) | (state_panels(sol) if sol.scene is None else {})
    panels: list[Panel] = []
    for title, lines in (found or {"state": []}).items():
        curves = tuple(Curve(name, values, CYCLE[k % len(CYCLE)]) for k, (name, values) in enumerate(lines))
        panels.append(Panel(title, curves, noise=ROUNDING * _size(curves)))
    return panels


def energy_panels(sol: Any) -> list[Panel]:
    """The ledger of energy, and the defect of its balance relative to the energy turned over."""
    heat, work = _array(sol.heat), _array(sol.work)
    paid = [Curve("heat", heat, RED), Curve("work supplied", work, ORANGE)]
    if sol.kinetic is not None and sol.potential is not None:
        kinetic, potential = _array(sol.kinetic), _array(sol.potential)
        potential = potential - potential[0]
        curves = [Curve("kinetic", kinetic, BLUE), Curve("potential (change)", potential, GREEN), *paid]
        curves.append(Curve("sum less work", kinetic + potential + heat - work, BLACK))
    else:
        energy = _array(sol.energy)
        curves = [Curve("energy (change)", energy - energy[0], BLACK), *paid]
    defect = Curve("defect", _array(sol.energy_error), PURPLE)
    return [_ledger("energy [J]", curves), Panel("relative defect [1]", (defect,), residual=True)]


def exergy_panels(sol: Any) -> list[Panel]:
    """Stored exergy, the work supplied, and destroyed exergy."""
    exergy, work = _array(sol.exergy), _array(sol.work)
    curves = [
        Curve("exergy (change)", exergy - exergy[0], BLUE),
        Curve("work supplied", work, ORANGE),
        Curve("destroyed", exergy[0] + work - exergy, RED),
    ]
    return [_ledger("exergy [J]", curves)]


def entropy_panels(sol: Any) -> list[Panel]:
    """Entropy gained since the start, and the least production of a component in each step."""
    entropy, production = _array(sol.entropy), _array(sol.entropy_production)
    # An entry for the start too has no step before it.
    production = production[1:] if len(production) == len(sol.t) else production
    noise = ROUNDING * float(np.abs(entropy).max(initial=0.0))
    gained, least = Curve("entropy", entropy - entropy[0], BLUE), Curve("least production", production, GREEN)
    return [
        Panel("entropy (change) [J/K]", (gained,), noise=noise, height=1.3),
        Panel("least produced [J/K a step]", (least,), noise=noise),
    ]


def constraint_panels(sol: Any) -> list[Panel]:
    """Largest residual of the joints at each time, of positions and of velocities."""
    position = Curve("position", _array(sol.constraint_error), BLUE)
    velocity = Curve("velocity", _array(sol.velocity_error), SKY)
    return [
        Panel("position [m, rad]", (position,), residual=True),
        Panel("velocity [m/s, rad/s]", (velocity,), residual=True),
    ]


def _array(values: Any) -> Array:
    return np.asarray(values, dtype=float)


def _size(curves: tuple[Curve, ...]) -> float:
    return max((float(np.nanmax(np.abs(curve.values), initial=0.0)) for curve in curves), default=0.0)


def _ledger(title: str, curves: list[Curve]) -> Panel:
    booked = _booked(curves)
    return Panel(title, booked, noise=ROUNDING * _size(booked), height=1.7)


def _booked(curves: list[Curve]) -> tuple[Curve, ...]:
    """The entries of a ledger without empty ones (but never without the first)."""
    return tuple(curve for k, curve in enumerate(curves) if k == 0 or np.any(curve.values != 0.0))
