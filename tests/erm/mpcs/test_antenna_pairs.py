"""Antenna positions and pairs are numbered."""

import numpy as np

from erm.mpcs.antenna_pairs import distinct_rows


def test_distinct_rows_are_those_of_numpy():
    rng = np.random.default_rng(5)
    points = rng.integers(-2, 3, (300, 3)) * 0.1
    first, place = distinct_rows(points)
    _, index, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
    np.testing.assert_array_equal(first, index)
    np.testing.assert_array_equal(place, inverse.ravel())
    assert [len(one) for one in distinct_rows(np.empty((0, 3)))] == [0, 0]
