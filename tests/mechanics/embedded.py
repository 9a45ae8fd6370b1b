"""What radau estimates its error to be on a linear equation, by the formula of Hairer and Wanner, IV.8."""

import numpy as np

from ephs.solve.methods.collocation import radau

__all__ = ["embedded_radau"]


def embedded_radau(count, matrix, y, h, at=None):
    """The filtered defect of the embedded method with so many stages, and the end of the step from y.

    (I − h γ A)⁻¹ h (γ f(y⁰) + Σ dᵢ f(Yᵢ)), where γ and d integrate polynomials up to the number of stages; ``at`` is
    put in place of y⁰ where the estimate is made a second time.
    """
    a, nodes, unit = radau(count).coefficients, radau(count).nodes, np.eye(len(y))
    whole = np.eye(len(y) * count) - h * np.kron(a, matrix)
    stages = np.linalg.solve(whole, np.tile(matrix @ y, count)).reshape(count, len(y))
    values = np.linalg.eigvals(a)
    gamma = float(np.real(values[np.abs(values.imag) < 1e-9]).item())
    right = 1.0 / np.arange(1.0, count + 1.0) - gamma * np.eye(count)[0]
    weights = np.linalg.solve(np.vander(nodes, increasing=True).T, right) - a[-1]
    begun = gamma * matrix @ (y if at is None else at)
    return np.linalg.solve(unit - h * gamma * matrix, h * (begun + weights @ stages)), y + h * a[-1] @ stages
