"""Errors of reflection points are drawn perpendicular to the face, or along the one coordinate that is known."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from erm.letter.figures import plot_face_errors, plot_ordinates


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def test_every_point_is_joined_to_its_foot_on_the_faces_line():
    face, points = np.array([[0.0, 0.0], [0.0, 10.0]]), np.array([[1.0, 4.0], [-2.0, 12.0]])
    axes = plot_face_errors(points, face)
    (joined,) = [item for item in axes.collections if len(item.get_paths()) == 2 and item.get_zorder() == 2]
    np.testing.assert_allclose(joined.get_segments()[0], [[1, 4], [0, 4]])
    np.testing.assert_allclose(joined.get_segments()[1], [[-2, 12], [0, 12]])  # beyond the face: to its line
    assert axes.get_aspect() == 1


def test_northings_are_joined_to_their_faces():
    axes = plot_ordinates([1.0, 5.5], [0.0, 5.0], {"south": 0.0, "north": 5.0})
    assert {text.get_text() for text in axes.texts} == {"south", "north"}
    drawn = [item for item in axes.collections if hasattr(item, "get_segments")]
    np.testing.assert_allclose(drawn[0].get_segments(), [[[1, 1], [1, 0]], [[2, 5.5], [2, 5]]])
