"""Storages and losses of relative poses that are quadratic in logarithms, for Python and in machine code."""

from collections.abc import Callable

import numpy as np

from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.derive import relations
from ephs.semantics.derive.logarithm_loss import LogarithmLoss
from ephs.semantics.derive.logarithms import LogarithmStep
from ephs.semantics.derive.pose_edges import PoseEdges
from ephs.semantics.primitives.forms import StorageForm
from ephs.semantics.primitives.primitives import Kernel, Point


def logarithm_form(edges: tuple[tuple[int, int], ...], parameters: tuple[float, ...], label: str) -> StorageForm:
    """The form of E = ½ Δᵀ K Δ; states are poses relative to one another, each 1 at rest.

    Parameters
    ----------
    edges
        Numbers of the poses that each edge goes from and to: 0 is the one that does not move, others are the ports in
        their order.
    parameters
        (6 edges,) logarithms of the edges without stress, rad, m; then (6 edges · 6 edges,) K, symmetric and
        non-negative, row by row.
    """
    relation = LogarithmStep(PoseEdges(edges))

    def over(x: Point, v: Array) -> tuple[Array, float]:
        """Efforts over a step, and the energy at its end; NaN where it is not finite."""
        given = {name: np.zeros(size) for name, size in relations.sizes(relation).items()}
        given |= {"p": np.array(parameters), "x0": np.concatenate(list(x.values())), "v": np.asarray(v, dtype=float)}
        call = relations.bare(relation).compiled()["value"]
        status = call(np.array(relation.dimensions), *(np.ascontiguousarray(array) for array in given.values()))
        scale = np.nan if status else 1.0
        return scale * given["e"], scale * float(given["c"][0])

    still = np.zeros(relation.dimensions[0])
    return StorageForm(
        lambda x: over(x, still)[1],
        lambda x: over(x, still)[0],
        lambda x, v: over(x, v)[0],
        Kernel(label, relation, parameters),
    )


def logarithm_loss(
    edges: tuple[tuple[int, int], ...], parameters: tuple[float, ...], label: str
) -> tuple[Callable[[Point, Array, Reference], Array], Kernel]:
    """M (n, n) of states, efforts and reference, and the kernel, of the loss μ = Bᵀ R B; ports of rates, then entropy.

    Parameters
    ----------
    edges, parameters
        As of a `logarithm_form`, with R in place of K.
    """
    relation = LogarithmLoss(PoseEdges(edges))

    def matrix(x: Point, e: Array, reference: Reference) -> Array:
        n, call = len(e), relations.at_rest(relation).compiled()["value"]
        given = {name: np.zeros(size) for name, size in relations.sizes(relation).items()}
        given |= {"p": np.array(parameters), "x0": np.concatenate(list(x.values())), "scal": np.array([0.0, 1.0, 0.0])}
        mu = np.zeros((n - 1, n - 1))
        for column, unit in enumerate(np.eye(n)[:-1]):
            given["e"] = unit
            call(np.array(relation.dimensions), *given.values())
            mu[:, column] = given["f"][:-1]
        mu, u, theta = 0.5 * (mu + mu.T), e[:-1], e[-1] + reference.temperature
        drag = (mu @ u)[:, None]
        return np.block([[theta * mu, -drag], [-drag.T, np.array([[u @ drag[:, 0] / theta]])]])

    return matrix, Kernel(label, relation, parameters)
