"""Linear subspaces: each operation against its closed form in the plane and in space."""

import numpy as np
import pytest

from tests.semantics.subspace import Subspace

DIAGONAL = np.array([[1.0], [1.0]]) / np.sqrt(2.0)


def line(*vector):
    return Subspace.from_span(np.array([vector], dtype=float).T)


@pytest.mark.parametrize(
    ("matrix", "vectors"),
    [
        ([[1.0, -1.0]], [[1.0], [1.0]]),
        ([[2.0, -2.0], [1.0, -1.0]], [[1.0, 3.0], [1.0, 3.0]]),
        ([[1.0, 0.0], [1e-6, 1e-6]], [[0.0], [0.0]]),  # rows of any size count alike
        ([[0.0, 0.0]], [[1.0, 0.0], [0.0, 1.0]]),
        ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0.0], [0.0], [1.0]]),
    ],
)
def test_a_kernel_is_the_span_of_its_solutions(matrix, vectors):
    kernel, span = Subspace.from_kernel(np.array(matrix)), Subspace.from_span(np.array(vectors))
    assert kernel.ambient == span.ambient == len(vectors)
    assert kernel.dimension == span.dimension == np.linalg.matrix_rank(vectors)
    assert kernel.distance(span) <= 1e-15
    assert np.abs(kernel.basis.T @ kernel.basis - np.eye(kernel.dimension)).max(initial=0.0) <= 1e-15


def test_without_equations_all_is_possible_and_without_vectors_nothing():
    assert Subspace.from_kernel(np.zeros((0, 3))).dimension == 3
    assert Subspace.from_span(np.zeros((3, 0))).dimension == 0
    assert Subspace.from_span(np.zeros((3, 0))).ambient == 3


def test_projections_have_their_dimension():
    plane = Subspace.from_kernel(np.array([[1.0, 1.0, 1.0]]))
    assert plane.project([0]).dimension == 1
    assert plane.project([1, 0]).dimension == 2


def test_distance_is_that_of_projectors_and_contains_that_of_a_vector():
    assert Subspace(DIAGONAL).projector == pytest.approx(np.full((2, 2), 0.5))
    assert Subspace(DIAGONAL).distance(line(1.0, 0.0)) == pytest.approx(0.5)
    assert Subspace(DIAGONAL).contains(np.array([3.0, 0.0])) == pytest.approx(np.sqrt(0.5))
    assert Subspace(DIAGONAL).contains(np.array([3.0, 3.0])) <= 1e-15
    assert Subspace(np.zeros((2, 0))).contains(np.zeros(2)) == 0.0
    with pytest.raises(ValueError, match="ℝ\\^2 and ℝ\\^3"):
        Subspace(DIAGONAL).distance(line(1.0, 0.0, 0.0))
