"""The energy and dissipation structure of a linear system: ẋ = (J − R) Q x + B u, y = Bᵀ Q x + D u."""

from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import symmetric_eigenvalues

ROUNDING = 1e-12
"""Relative tolerance of a power balance: rounding of products of matrices."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class MeasuredLaw:
    """An equation with both sides; ``scale`` is the size of their terms."""

    name: str
    left: Array
    right: Array
    scale: float

    @property
    def defect(self) -> float:
        """The largest difference of the sides, relative to the terms'."""
        return largest_entry(self.left - self.right) / max(self.scale, float(np.finfo(float).tiny))

    def holds(self, rounding: float = ROUNDING) -> bool:
        """Whether the sides agree to rounding."""
        return self.defect <= rounding


@final
@dataclass(frozen=True, slots=True, eq=False)
class PortHamiltonian:
    """Port-Hamiltonian structure of a linear system: ½ xᵀ Q x is the exergy about an equilibrium, to second order.

    Parameters
    ----------
    J
        (n, n) skew: reversible exchange.
    R
        (n, n) symmetric, not negative: dissipation of exergy is (Q x)ᵀ R (Q x).
    Q
        (n, n) symmetric: the Hessian of the exergy on what the constraints allow, stiffness of preloads included.
    """

    J: Array
    R: Array
    Q: Array

    def exergy(self, x: Array) -> float:
        """½ xᵀ Q x in J."""
        return 0.5 * float(x @ self.Q @ x)

    def dissipation(self, x: Array) -> float:
        """(Q x)ᵀ R (Q x) in W, never negative."""
        effort = self.Q @ x
        return float(effort @ self.R @ effort)


@final
@dataclass(frozen=True, slots=True)
class Sizes:
    """Largest absolute terms of the solutions that matrices are parts of.

    Entries of a solution are known to κ ε of its largest: what vanishes is rounding of that, not of itself.
    """

    B: float
    C: float
    D: float

    @classmethod
    def of(cls, B: Array, C: Array, D: Array) -> "Sizes":
        """Those of matrices that are whole solutions."""
        return cls(largest_entry(B), largest_entry(C), largest_entry(D))


def laws_of(
    A: Array, B: Array, C: Array, D: Array, ph: PortHamiltonian, sizes: Sizes, *, conjugate: bool
) -> tuple[MeasuredLaw, ...]:
    """The laws of the structure, both sides of each.

    Parameters
    ----------
    sizes
        What B, C and D were solved together with.
    conjugate
        Whether the outputs are the inputs' power conjugates.
    """
    J, R, Q = ph.J, ph.R, ph.Q
    least = np.asarray(symmetric_eigenvalues(0.5 * (R + R.T)), dtype=float)
    out = [
        MeasuredLaw("A = (J − R) Q", A, (J - R) @ Q, largest_entry((np.abs(J) + np.abs(R)) @ np.abs(Q))),
        MeasuredLaw("J is skew", J, -J.T, largest_entry(J) + largest_entry(R)),
        MeasuredLaw("R is symmetric", R, R.T, largest_entry(J) + largest_entry(R)),
        MeasuredLaw("Q is symmetric", Q, Q.T, largest_entry(Q)),
        MeasuredLaw(
            "R is not negative", np.minimum(least, 0.0), np.zeros_like(least), largest_entry(J) + largest_entry(R)
        ),
    ]
    if conjugate:
        gain = np.asarray(symmetric_eigenvalues(D + D.T), dtype=float)
        out.append(
            MeasuredLaw("C = Bᵀ Q", C, B.T @ Q, max(sizes.C, sizes.B * float(np.abs(Q).sum(axis=0).max(initial=0.0))))
        )
        out.append(MeasuredLaw("D + Dᵀ is not negative", np.minimum(gain, 0.0), np.zeros_like(gain), sizes.D))
    return tuple(out)


def largest_entry(numbers: Array) -> float:
    """The largest magnitude; 0 where there is none."""
    return float(np.abs(numbers).max(initial=0.0))
