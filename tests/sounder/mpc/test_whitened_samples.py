"""Whitened samples hold the pulse where it is, noise of unit power, and what is not known of the pattern as noise."""

import numpy as np

from sounder.mpc.whitened_samples import PADDING, BeamSamples, CentredPulse, WindowPulse


def pulse_at(bench, lags):
    """Pulse of amplitude 1 at lags after its delay [sample], by its spectrum."""
    frequency = np.fft.fftfreq(bench.filter_.weight.size)
    return np.exp(2j * np.pi * np.multiply.outer(lags, frequency)) @ bench.filter_.weight / bench.filter_.weight.sum()


def test_pulses_are_where_they_arrive(bench):
    centred = CentredPulse.of(bench.filter_.matched_filter, bench.filter_.noise)
    window = WindowPulse.of(bench.filter_.matched_filter, bench.filter_.noise, 20)
    # Linear between points of 1/64 and 1/32 sample a pulse of band 0.45 cycles a sample is good to
    # (2 pi 0.45 / 64)^2 / 8 and four times that. The whitener amplifies the edges of the band 30 times at most, by the
    # smallest eigenvalue that it keeps, 1e-3 in power.
    for delay in (-0.9, 0.0, 0.37):
        exact = centred.whitener @ pulse_at(bench, np.arange(-PADDING, PADDING + 1) - delay)
        made, _ = centred.at(np.array([delay]))
        assert np.abs(made[0] - exact).max() < 30 * (2 * np.pi * 0.45 / 64) ** 2 / 8
    for delay in (0.0, 7.3, 18.9):
        exact = window.whitener @ pulse_at(bench, np.arange(20) - delay)
        made, _ = window.at(np.array([delay]))
        assert np.abs(made[0] - exact).max() < 30 * (2 * np.pi * 0.45 / 32) ** 2 / 8


def test_noise_becomes_white(bench):
    window = WindowPulse.of(bench.filter_.matched_filter, bench.filter_.noise, 12)
    noise = bench.noise(np.random.default_rng(1), 400)[:, :972].reshape(-1, 12)
    white = noise @ window.whitener.T
    covariance = white.conj().T @ white / len(white)
    # 400 rows of 81 neighbouring blocks, nearly independent: entries good to 1 / sqrt(32400) = 0.0056; five of that
    np.testing.assert_allclose(covariance, np.eye(len(covariance)), atol=0.03)


def test_error_of_the_pattern_counts_as_noise():
    """A relative error ``e`` of an amplitude whose power is ``p`` noise powers: ``2 e^2 p`` noise powers more."""
    power = np.array([1e4, 1e2, 0.0])
    samples = np.sqrt(power + 1)[:, None].astype(complex)
    beams = BeamSamples(np.zeros((3, 2)), np.array([1.0, 2.0, 3.0]), samples).with_pattern_error(0.01, 0.02)
    # the second is 20 dB down, log(10) neper
    error = 0.01 + 2 * 0.02 * np.array([0.0, np.log(10)])
    expected = np.append(1 + 2 * error**2 * power[:2], 1.0)
    np.testing.assert_allclose(beams.noise / [1.0, 2.0, 3.0], expected, rtol=1e-3)
    np.testing.assert_allclose(beams.samples, samples / np.sqrt(expected)[:, None], rtol=1e-3)
