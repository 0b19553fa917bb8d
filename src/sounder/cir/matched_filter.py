"""The pulse of a single path, and the filter that measures its amplitude and delay between the samples."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

OVERSAMPLING = 64
"""Table points per sample. Linear interpolation between them errs by less than -80 dB of the pulse's peak."""
PULSE_REACH = 16
"""Length of the pulse table to each side of the peak [resolution cells]; beyond, the pulse is below -90 dB."""
FILTER_REACH = 5
"""Length of the filter to each side [resolution cells]; a longer one gains 2 % and lets in more of other paths."""
NOISE_REGULARISATION = 0.01
"""Noise density added to the measured one, relative to its maximum. It keeps the filter short and costs 3 % of the
standard deviation."""
RANK_TOLERANCE = 1e-3
"""Eigenvalues of the noise covariance below this share of the largest count as zero; chosen, not derived."""

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class MatchedFilter:
    """Tables of the pulse and of its matched filter, and the variances that the filter attains.

    A path of amplitude ``a`` and delay ``d`` has the spectrum ``a P exp(-j2 pi f d)`` in noise of density ``S``. The
    best linear estimate of its amplitude has the spectrum ``conj(P) / S``; the maximum of its magnitude is the best
    estimate of its delay (Kay, Detection Theory, 1998, section 13.3). The filter here is
    ``P / (S + NOISE_REGULARISATION max(S))``, tapered to `FILTER_REACH`.

    Attributes
    ----------
    pulse : array complex (point,)
        Pulse of amplitude 1 at `OVERSAMPLING` points per sample, from minus to plus its reach and one sample more.
    taps : array complex (point,)
        Matched filter on the same grid, conjugated and not scaled.
    amplitude_variance : float
        Variance of a complex amplitude in noise of power 1 [1].
    delay_variance : float
        Variance of the delay of a path of amplitude 1 in one beam with noise of power 1 [sample2].
    """

    pulse: Complex
    taps: Complex
    amplitude_variance: float
    delay_variance: float

    @classmethod
    def of(cls, weight: Real, noise: Real) -> "MatchedFilter":
        """Tabulate the filter of a pulse.

        Parameters
        ----------
        weight : array (sample,)
            Spectrum of the pulse, of any scale, in the order of ``numpy.fft.fftfreq``.
        noise : array (sample,)
            Density of the noise, mean 1.
        """
        size = weight.size
        frequency = np.fft.fftfreq(size)
        pulse = weight * size / weight.sum()
        cell = 1 / np.ptp(frequency[weight > 0])
        best = pulse / (noise + NOISE_REGULARISATION * noise.max())
        best[0] = (best[1] + best[-1]) / 2  # DC is not measured, so it has no noise
        reach = _reach(FILTER_REACH, cell, size)
        lag = (np.arange(size) + size // 2) % size - size // 2
        kept = np.conj(np.fft.fft(np.fft.ifft(best) * _taper(lag, reach)))
        kept /= np.sum(pulse * kept)
        mean = np.sum(frequency * pulse * kept).real
        curvature = np.sum(frequency**2 * pulse * kept).real - mean**2
        through = size * noise * np.abs(kept) ** 2
        points = 2 * (reach + 1) * OVERSAMPLING + 1
        return cls(
            pulse=_table(pulse, _reach(PULSE_REACH, cell, size)),
            taps=np.conj(_table(best, reach) * _taper(np.linspace(-reach - 1, reach + 1, points), reach)),
            amplitude_variance=float(through.sum()),
            delay_variance=float(np.sum((frequency - mean) ** 2 * through) / (8 * np.pi**2 * curvature**2)),
        )


def whitening_matrix(noise: Real, size: int) -> Complex:
    """Matrix that turns neighbouring samples into combinations of independent unit noise.

    Parameters
    ----------
    noise : array (sample,)
        Density of the noise, mean 1.
    size : int
        Number of samples combined.

    Returns
    -------
    array complex (combination, size)
        One row a combination. Noise of power 1 a sample gives noise of power 1 in each. Combinations that hold almost
        no noise are left out.
    """
    lags = np.arange(size)
    covariance = np.fft.ifft(noise)[lags[:, None] - lags]
    value, vector = np.linalg.eigh(covariance)
    kept = value > RANK_TOLERANCE * value.max()
    return np.asarray((vector[:, kept] / np.sqrt(value[kept])).conj().T)


def _reach(cells: int, cell: float, size: int) -> int:
    """Samples to each side, at most half a period."""
    return min(int(np.ceil(cells * cell)), (size - 1) // 2)


def _taper(lag: NDArray[np.number], reach: int) -> Real:
    """Hann window that ends a sample beyond the reach, so that nothing jumps when a delay moves past a sample."""
    taper: Real = np.cos(np.pi / 2 * np.clip(lag / (reach + 1), -1, 1)) ** 2
    return taper


def _table(spectrum: Complex | Real, reach: int) -> Complex:
    """Transform at `OVERSAMPLING` points per sample and ``reach + 1`` samples per side, as a chirp transform.

    With ``2 k m = k^2 + m^2 - (m - k)^2`` the sum over frequencies ``k`` at the points ``m`` is a convolution with a
    chirp, which costs what the spectrum has and not what a padded one would (Bluestein, IEEE Trans. Audio
    Electroacoust. 18, 1970).
    """
    size = spectrum.size
    k, points = np.arange(size) - size // 2, (reach + 1) * OVERSAMPLING
    m = np.arange(-points, points + 1)

    def chirp(n: NDArray[np.int64]) -> Complex:
        turn = n * n % (2 * OVERSAMPLING * size)  # exact, so that no phase is lost where n^2 is large
        return np.asarray(np.exp(1j * np.pi / (OVERSAMPLING * size) * turn))

    length = size + m.size - 1
    between = np.arange(m[0] - k[-1], m[-1] - k[0] + 1)
    filtered = np.fft.fft(np.fft.fftshift(spectrum) * chirp(k), length) * np.fft.fft(chirp(between).conj(), length)
    table: Complex = np.fft.ifft(filtered)[size - 1 :] * chirp(m) / size
    return table
