"""Modes of a linear system: eigenvalue, frequency, damping, and shape."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import conditioned_eigen

SHOWN = 1e-6
"""Least displayed component of a mode, relative to the largest."""

Complex = NDArray[np.complex128]
STILL = 1e-7
"""Root of rounding, to which double eigenvalues are good: imaginary parts below this part of their eigenvalue count as
zero; so do eigenvalues below this part of the largest, where rounding of the matrix may change them by as much."""
ROUNDING = 1e-12
"""Real parts below this fraction of the largest eigenvalue count as zero: rounding of the matrix, relative to its norm.
"""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """One way to move: x(t) = Re(vector · exp(eigenvalue · t)).

    Parameters
    ----------
    eigenvalue
        In 1/s; of a conjugate pair the one above the real axis.
    vector
        (states,) whose largest entry is 1.
    shape
        What moves, by name: of a scene's joint (d,) and body (6,) the left-trivialised displacement, of a system's
        state path (d,). Complex: entries of different phase do not pass through zero together.
    """

    eigenvalue: complex
    vector: Complex
    shape: Mapping[str, Complex]

    @property
    def frequency(self) -> float:
        """Damped frequency in Hz; zero without oscillation."""
        return abs(self.eigenvalue.imag) / (2.0 * np.pi)

    @property
    def damping(self) -> float:
        """Damping ratio −Re λ/|λ|: 0 undamped, 1 without oscillation, below 0 growing; NaN where nothing changes."""
        return 0.0 - self.eigenvalue.real / abs(self.eigenvalue) if self.eigenvalue else float("nan")

    @property
    def stable(self) -> bool:
        """Whether its amplitude does not grow."""
        return self.eigenvalue.real <= 0.0

    def largest(self, count: int = 3) -> list[tuple[str, float]]:
        """The names that move most, with their share of the largest, in the order of that."""
        sizes = {name: float(np.abs(value).max(initial=0.0)) for name, value in self.shape.items()}
        top = max(sizes.values(), default=0.0) or 1.0
        order = sorted(sizes, key=lambda name: -sizes[name])
        return [(name, sizes[name] / top) for name in order[:count] if sizes[name] > SHOWN * top]


def modes_of(A: Array, shapes: Mapping[str, Array]) -> tuple[Mode, ...]:
    """Modes of ẋ = A x, slowest first; ``shapes`` are maps (d, states) from the states to named outputs."""
    if not A.size:
        return ()
    values, vectors, change = conditioned_eigen(A)
    values, top = values.astype(np.complex128), float(np.abs(values).max(initial=0.0))
    still = np.abs(values) < np.minimum(STILL * top, ROUNDING * change)
    if abs(values[still].sum()) <= ROUNDING * top * values.size:  # of eigenvalues near each other the mean is known
        values[still] = 0.0
    values.imag[np.abs(values.imag) < STILL * np.abs(values)] = 0.0
    values.real[np.abs(values.real) < ROUNDING * top] = 0.0
    kept = [i for i in range(values.size) if values[i].imag >= 0.0]
    out: list[Mode] = []
    for i in sorted(kept, key=lambda i: (abs(values[i]), values[i].real)):
        largest = vectors[np.argmax(np.abs(vectors[:, i])), i]
        vector = vectors[:, i] / largest
        out.append(Mode(complex(values[i]), vector, {name: map_ @ vector for name, map_ in shapes.items()}))
    return tuple(out)
