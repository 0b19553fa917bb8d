"""The matched filter measures as well as its own variances say, near what is possible."""

import numpy as np
import pytest

from sounder.cir.matched_filter import OVERSAMPLING
from sounder.mpc.cramer_rao import Band


def taps(table, delay, reach):
    place = (np.arange(-reach, reach + 1) - delay) * OVERSAMPLING + (table.size - 1) / 2
    left = np.floor(place).astype(int)
    right = place - left
    return table[left] * (1 - right) + table[left + 1] * right


def measured(matched, row, delay):
    """Amplitude of a path at ``delay`` samples in a row of CIR."""
    reach = matched.taps.size // (2 * OVERSAMPLING) - 1
    filter_, pulse = taps(matched.taps, delay, reach), taps(matched.pulse, delay, reach)
    return row[np.arange(-reach, reach + 1)] @ filter_ / (pulse @ filter_)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [None, 2, 5])
def test_errors_are_as_stated_and_near_the_bound(bench_maker, seed):
    """Amplitude and delay of a path in noise of one beam, through a random instrument, at any place between samples."""
    bench = bench_maker(seed=seed)
    matched, size = bench.filter_.matched_filter, bench.filter_.weight.size
    rng = np.random.default_rng(7)
    draws, step, sigma = 600, 0.05, 1e-2
    noise = sigma * bench.noise(rng, draws)
    frequency = np.fft.fftfreq(size)
    pulse = bench.filter_.weight * size / bench.filter_.weight.sum()
    amplitude, late = np.empty(draws, complex), np.empty(draws)
    for i, delay in enumerate(rng.uniform(-0.5, 0.5, draws)):
        row = np.fft.ifft(pulse * np.exp(-2j * np.pi * frequency * delay)) + noise[i]
        before, amplitude[i], after = (measured(matched, row, delay + shift) for shift in (-step, 0, step))
        # vertex of the parabola: the magnitude's maximum, to a hundredth of its distance
        late[i] = step * 0.5 * (abs(before) - abs(after)) / (abs(before) - 2 * abs(amplitude[i]) + abs(after))
    assert abs(amplitude.mean() - 1) < 4 * sigma / np.sqrt(draws)
    # 600 draws tell a deviation to 1 / sqrt(1200), 3 %; three of these
    spread = np.std(amplitude - 1)
    assert spread / sigma == pytest.approx(np.sqrt(matched.amplitude_variance), rel=0.09)
    assert late.std() / sigma == pytest.approx(np.sqrt(matched.delay_variance), rel=0.09)
    band = Band.of(bench.filter_)
    rate = bench.filter_.sample_rate
    # 1 / (2 pi B sqrt(2 snr)) with the RMS bandwidth B; the window took from the peak's SNR what the data still know
    bound = rate / (2 * np.pi * band.rms * np.sqrt(2 * band.density.sum()))
    assert 0.99 < np.sqrt(matched.delay_variance) / bound < 1.08


def test_no_other_filter_of_the_samples_is_much_better(bench_maker):
    """Best linear unbiased: ``1 / (p^H C^-1 p)``, C the covariance of noise in the samples that the filter uses."""
    bench = bench_maker(seed=5)
    matched, noise = bench.filter_.matched_filter, bench.filter_.noise
    reach = matched.taps.size // (2 * OVERSAMPLING) - 1
    covariance = np.fft.ifft(noise)
    place = np.arange(-reach, reach + 1)
    c = covariance[(place[:, None] - place) % noise.size]
    p = taps(matched.pulse, 0.0, reach)
    best = 1 / np.real(np.conj(p) @ np.linalg.solve(c, p))
    assert 1 <= matched.amplitude_variance / best < 1.06
