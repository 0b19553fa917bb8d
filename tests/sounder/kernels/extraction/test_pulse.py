"""A pulse of known shape between the samples."""

import numba
import numpy as np
import pytest

from sounder.cir.matched_filter import OVERSAMPLING
from sounder.kernels.extraction import pulse

SIZE = 200


pytestmark = pytest.mark.slow  # a function is compiled anew


@numba.njit
def sample(*arguments):
    return pulse.sample(*arguments)


@numba.njit
def match(*arguments):
    return pulse.match(*arguments)


@numba.njit
def add(*arguments):
    pulse.add(*arguments)


@numba.njit
def power_around(*arguments):
    return pulse.power_around(*arguments)


def sampled(table, delay, reach):
    taps = np.empty(2 * reach + 1, complex)
    return sample(table, OVERSAMPLING, delay, taps), taps


def test_taps_are_the_pulse_at_the_samples(hann):
    table = hann.table()
    first, taps = sampled(table, 50.0, hann.reach)
    assert first == 50 - hann.reach
    np.testing.assert_array_equal(taps, table[OVERSAMPLING:-OVERSAMPLING:OVERSAMPLING])
    for delay in np.random.default_rng(1).uniform(-5, SIZE, 100):
        first, taps = sampled(table, delay, 7)
        assert abs(first + 7 - delay) <= 0.5
        # linear interpolation errs by h^2/8 times the curvature, at most (0.9 pi)^2
        late = first + np.arange(15) - delay
        np.testing.assert_allclose(taps, hann.at(late), atol=(0.9 * np.pi / OVERSAMPLING) ** 2 / 8)


def test_sums_go_round_the_circle():
    rng = np.random.default_rng(2)
    beams = rng.standard_normal((3, SIZE, 2)).astype(np.float32).view(np.complex64)[..., 0]
    taps = rng.standard_normal((9, 2)) @ [1, 1j]
    for first in (-9, -4, 0, 77, SIZE - 4, SIZE + 3):
        expected = np.sum(beams[1, (first + np.arange(9)) % SIZE].astype(complex) * taps)
        assert abs(match(beams, 1, first, taps) - expected) < 1e-12
        np.testing.assert_allclose(
            power_around(beams, 1, first + 0.3), np.mean(np.abs(beams[1, (first + np.arange(-2, 3)) % SIZE]) ** 2), 1e-6
        )


def test_what_is_added_is_taken_away_and_wraps(hann):
    for delay in (0.0, 3.3, SIZE - 0.7):
        beams = np.zeros((2, SIZE), np.complex64)
        first, taps = sampled(hann.table(), delay, hann.reach)
        add(beams, 1, first, taps, 2j)
        np.testing.assert_allclose(beams[1], 2j * hann.row(delay, SIZE), atol=2 * (0.9 * np.pi / OVERSAMPLING) ** 2 / 8)
        add(beams, 1, first, taps, -2j)
        np.testing.assert_allclose(beams, 0, atol=1e-6)
