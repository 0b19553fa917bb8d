"""Many directions, many threads."""

import numpy as np
import pytest

from erm.common.errors import DataError
from sounder.kernels.compiler.warm import warm
from sounder.kernels.correlation.any_template import TemplateCorrelator
from sounder.kernels.correlation.directions import average_directions
from sounder.kernels.correlation.m_sequence import MSequenceCorrelator


@pytest.fixture
def iq():
    return np.random.default_rng(3).integers(-5000, 5000, (13, 35, 1022, 2)).astype(np.int16)


def test_threads_do_not_matter_to_the_last_bit(m_sequence, path, iq):
    correlator = MSequenceCorrelator(m_sequence(9), 2)
    warm(correlator)
    mean, power = average_directions(iq, correlator, threads=1)
    for direction in (0, 12):
        np.testing.assert_array_equal(mean[direction], correlator.average(iq[direction])[0])
    for threads in (2, 3, 8, None):
        got_mean, got_power = average_directions(iq, correlator, threads)
        np.testing.assert_array_equal(got_mean, mean)
        np.testing.assert_array_equal(got_power, power)


def test_any_template_too(iq):
    correlator = TemplateCorrelator(np.exp(1j * np.arange(1022.0) ** 2))
    warm(correlator)
    mean, _ = average_directions(iq[:3], correlator, threads=2)
    np.testing.assert_array_equal(mean[2], correlator.average(iq[2])[0])


def test_complex_captures_too(m_sequence, path, iq):
    correlator = MSequenceCorrelator(m_sequence(9), 2)
    warm(correlator, complex_captures=True)
    floats = (iq[:3, ..., 0] + 1j * iq[:3, ..., 1]).astype(np.complex64)
    mean, _ = average_directions(floats, correlator, threads=2)
    np.testing.assert_array_equal(mean[1], correlator.average(floats[1])[0])


def test_no_directions_make_no_averages(m_sequence):
    correlator = MSequenceCorrelator(m_sequence(9), 2)
    mean, power = average_directions(np.empty((0, 4, 1022, 2), np.int16), correlator)
    assert mean.shape == power.shape == (0, 1022)


def test_an_error_in_a_thread_is_told(m_sequence, iq):
    correlator = MSequenceCorrelator(m_sequence(9), 2)
    with pytest.raises(DataError, match="expected 1022 samples"):
        average_directions(iq[:, :, :1000], correlator, threads=2)
    with pytest.raises(DataError, match="threads"):
        average_directions(iq, correlator, threads=0)
