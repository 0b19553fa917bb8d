"""Starts of the search for groups of paths of one image."""

import numpy as np

from erm.reconstruction.search.starts import _solved


def test_a_place_that_azimuths_say_nothing_of_stops_no_search():
    """One pair of many has gone so far that its equations are singular: it moves along the other direction alone."""
    far = np.array([[1.0, 0.0], [0.0, 0.0]])
    steps = _solved(np.stack([np.diag([2.0, 4.0]), far]), np.array([[2.0, 4.0], [3.0, 0.0]]))
    np.testing.assert_allclose(steps, [[1.0, 1.0], [3.0, 0.0]])
