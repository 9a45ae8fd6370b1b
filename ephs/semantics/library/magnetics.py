"""Magnetics: windings, reluctances, saturation. The flux Φ is stored, the magnetomotive force F in A is its effort.

On a junction of fluxes all paths have one magnetomotive force, and their fluxes add up: parallel paths of a circuit;
`magnetic_series` puts paths behind one another. Eddy currents are a winding of one turn with a resistor on it.
"""

from typing import Any

import numpy as np

from ephs.operad import Quantity, quantity
from ephs.semantics.library.made import positive
from ephs.semantics.primitives.forms import stored
from ephs.semantics.primitives.primitives import Reversible, Storage, power_ports
from ephs.semantics.primitives.structures import constant_structure

__all__ = ["coil", "magnetic_series", "reluctance", "saturating_inductor", "saturating_reluctance", "winding"]


def linear(m: Any, r: Any) -> Any:
    """E = ½ r m²."""
    return r * m**2 / 2


def saturating(m: Any, r: Any, knee: Any) -> Any:
    """E = r knee² (cosh(m/knee) − 1), ½ r m² for small m."""
    return 2 * r * knee**2 * np.sinh(m / (2 * knee)) ** 2


def saturating_linkage(b: Any, l: Any, knee: Any) -> Any:  # noqa: E741 - the field's symbol
    """E = knee²/l (cosh(b/knee) − 1), b²/(2l) for small b."""
    return saturating(b, 1 / l, knee)


def reluctance(*, r: float) -> Storage:
    """Magnetic path of reluctance r in 1/H; port m, a flux: E = m**2*r/2, F = r*m."""
    positive("reluctance", r=r)
    return _stored("reluctance", "m", quantity.magnetic_flux, linear, r=r)


def saturating_reluctance(*, r: float, knee: float) -> Storage:
    """Magnetic path that saturates above a flux of ``knee`` Wb; port m.

    E = 2*knee**2*r*sinh(m/(2*knee))**2, F = r*knee*sinh(m/knee): of reluctance r in 1/H for small fluxes.
    """
    positive("saturating_reluctance", r=r, knee=knee)
    return _stored("saturating_reluctance", "m", quantity.magnetic_flux, saturating, r=r, knee=knee)


def saturating_inductor(*, l: float, knee: float) -> Storage:  # noqa: E741 - the field's symbol
    """Coil whose core saturates above a flux linkage of ``knee`` Wb; port b.

    E = 2*knee**2*sinh(b/(2*knee))**2/l. The current is knee/l*sinh(b/knee): of inductance l in H for small flux
    linkages.
    """
    positive("saturating_inductor", l=l, knee=knee)
    return _stored("saturating_inductor", "b", quantity.flux_linkage, saturating_linkage, l=l, knee=knee)


def winding(*, turns: float) -> Reversible:
    """Winding between a circuit's flux linkage and a core's flux; ports b, m: m.e = turns·b.e, b.f = −turns·m.f.

    C = [[-turns, 1]].
    """
    positive("winding", turns=turns)
    return _constant("winding", {"b": quantity.flux_linkage, "m": quantity.magnetic_flux}, None, [[-turns, 1.0]], turns)


def coil(*, turns: float) -> Reversible:
    """Winding between a node's charge and a core's flux, a gyrator; ports q, m: q.f = m.e/turns, m.f = −q.e/turns.

    L = [[0, 1/turns], [-1/turns, 0]]: the voltage is turns times the rate of the core's flux, the magnetomotive force
    turns times the current.
    """
    positive("coil", turns=turns)
    skew = [[0.0, 1.0 / turns], [-1.0 / turns, 0.0]]
    return _constant("coil", {"q": quantity.charge, "m": quantity.magnetic_flux}, skew, None, turns)


def magnetic_series() -> Reversible:
    """Two paths behind one another; ports m, m1, m2: m.e = m1.e + m2.e, one flux through all three.

    C = [[1, -1, -1]].
    """
    flux = quantity.magnetic_flux
    return _constant("magnetic_series", {"m": flux, "m1": flux, "m2": flux}, None, [[1.0, -1.0, -1.0]], None)


def _stored(name: str, port: str, of: Quantity, energy: Any, **parameters: float) -> Storage:
    return stored(name, power_ports(**{port: of}), energy, parameters)


def _constant(
    name: str,
    ports: dict[str, Quantity],
    skew: list[list[float]] | None,
    rows: list[list[float]] | None,
    turns: float | None,
) -> Reversible:
    n = len(ports)
    left = np.zeros((n, n)) if skew is None else np.array(skew)
    right = np.zeros((0, n)) if rows is None else np.array(rows)
    parameters = () if turns is None else (("turns", turns),)
    return constant_structure(name, power_ports(**ports), left, right, parameters)
