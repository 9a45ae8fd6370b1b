"""Storages of relative poses whose energy is quadratic in logarithms, for Python and in machine code."""

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.derive import relations
from ephs.semantics.derive.logarithms import LogarithmStep
from ephs.semantics.primitives.forms import StorageForm
from ephs.semantics.primitives.primitives import Kernel, Point


def logarithm_form(edges: tuple[tuple[int, int], ...], rest: Array, stiffness: Array, label: str) -> StorageForm:
    """The form of E = ½ Δᵀ K Δ; states are poses relative to one another, each 1 at rest.

    Parameters
    ----------
    edges
        Numbers of the poses that each edge goes from and to: 0 is the one that does not move, others are the ports in
        their order.
    rest
        (6 edges,) logarithms of the edges without stress: rad, m.
    stiffness
        (6 edges, 6 edges) K, symmetric and non-negative.
    """
    relation = LogarithmStep(edges)
    kernel = Kernel(label, relation, (*rest.ravel().tolist(), *stiffness.ravel().tolist()))
    numbers, sizes, dims = np.array(kernel.parameters), relations.sizes(relation), np.array(relation.dimensions)

    def over(x: Point, v: Array) -> tuple[Array, float]:
        """Efforts over a step, and the energy at its end; NaN where it is not finite."""
        given = {name: np.zeros(size) for name, size in sizes.items()}
        given |= {"p": numbers, "x0": np.concatenate(list(x.values())), "v": np.asarray(v, dtype=float)}
        call = relations.bare(relation).compiled()["value"]
        status = call(dims, *(np.ascontiguousarray(array) for array in given.values()))
        scale = np.nan if status else 1.0
        return scale * given["e"], scale * float(given["c"][0])

    still = np.zeros(relation.dimensions[0])
    return StorageForm(
        lambda x: over(x, still)[1], lambda x: over(x, still)[0], lambda x, v: over(x, v)[0], kernel
    )  # fmt: skip
