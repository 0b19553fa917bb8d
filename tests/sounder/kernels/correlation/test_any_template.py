"""Correlation with any template."""

import pickle

import numpy as np
import pytest

from erm.common.errors import DataError
from sounder.kernels.correlation import reference
from sounder.kernels.correlation.any_template import TemplateCorrelator
from sounder.kernels.correlation.m_sequence import MSequenceCorrelator

# A float32 FFT of 2**m samples errs by about m * 2**-24 rms of the output's own rms.
OF_PEAK = 1e-6


def zadoff_chu(length: int, root: int = 25) -> np.ndarray:
    n = np.arange(length)
    return np.exp(-1j * np.pi * root * n * (n + length % 2) / length)


@pytest.fixture
def rng():
    return np.random.default_rng(73)


@pytest.mark.parametrize("length", [64, 839, 1021, 1022, 1024, 4000])
@pytest.mark.parametrize("kind", ["int16", "complex64"])
def test_agrees_with_float64(path, rng, length, kind):
    template = zadoff_chu(length)
    iq = rng.integers(-32768, 32768, (37, length, 2)).astype(np.int16)
    if kind == "complex64":
        iq = reference.as_complex(iq).astype(np.complex64)
    mean, power = reference.average(iq, template)
    correlator = TemplateCorrelator(template)
    got_mean, got_power = correlator.average(iq)
    each = reference.correlate(iq, template)
    assert np.abs(got_mean - mean).max() <= OF_PEAK * np.abs(mean).max()
    assert np.abs(got_power - power).max() <= OF_PEAK * power.max()
    assert np.abs(correlator.correlate(iq) - each).max() <= OF_PEAK * np.abs(each).max()


def test_zadoff_chu_has_one_peak_where_the_delay_is(rng):
    length = 839
    template = zadoff_chu(length)
    correlator = TemplateCorrelator(template)
    delayed = np.roll(template, 100)
    c = correlator.correlate(delayed[np.newaxis].astype(np.complex64))[0]
    expected = np.zeros(length)
    expected[100] = length
    np.testing.assert_allclose(c, expected, atol=OF_PEAK * length)
    np.testing.assert_allclose(correlator.correlate_mean(delayed), expected, atol=1e-12 * length)


def test_m_sequence_is_a_template_as_any_other(m_sequence, rng):
    chips = m_sequence(9)
    iq = rng.integers(-3000, 3000, (20, 1022, 2)).astype(np.int16)
    mean, power = MSequenceCorrelator(chips, 2).average(iq)
    got_mean, got_power = TemplateCorrelator(reference.chip_template(chips, 2)).average(iq)
    np.testing.assert_allclose(got_mean, mean, atol=OF_PEAK * np.abs(mean).max())
    np.testing.assert_allclose(got_power, power, atol=OF_PEAK * power.max())


def test_blocks_of_128_give_the_same_bits(path, rng):
    correlator = TemplateCorrelator(zadoff_chu(1021))
    iq = rng.integers(-3000, 3000, (300, 1021, 2)).astype(np.int16)
    mean, power = correlator.average(iq)
    sums = correlator.accumulator()
    for block in np.split(iq, [128, 256]):
        sums.add(block)
    got_mean, got_power = sums.result()
    np.testing.assert_array_equal(got_mean, mean)
    np.testing.assert_array_equal(got_power, power)


def test_correlators_travel(rng):
    correlator = pickle.loads(pickle.dumps(TemplateCorrelator(zadoff_chu(64))))
    assert correlator.samples == 64


@pytest.mark.parametrize("template", [np.zeros(8), np.ones((2, 4)), [], [1, np.nan]])
def test_templates_that_are_none_are_refused(template):
    with pytest.raises(DataError, match="template"):
        TemplateCorrelator(template)
