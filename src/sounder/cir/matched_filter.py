"""The pulse of a single path, and the filter that measures its amplitude and delay best, between the samples."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

OVER = 64
"""Points of a table a sample; linear between, so that cancellation is good to -80 dB."""
PULSE_REACH = 16
"""Resolution cells to each side of the pulse's peak in its table: beyond it is under -90 dB."""
MATCHED_REACH = 5
"""Resolution cells to each side in the filter's table; more gain 2 %, and bring in more of other paths."""
CAUTION = 0.01
"""Noise density added to the one measured, relative to its maximum: keeps the filter short; costs 3 % of deviation."""

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class Matched:
    """Tables of pulse and matched filter, and what they measure to.

    A path gives the spectrum ``a P exp(-j2 pi f d)`` in noise of density ``S``. The best linear measure of its
    amplitude, and of its delay by the magnitude's maximum, has the spectrum ``conj(P) / S`` (Kay, Detection Theory,
    1998, section 13.3). The filter kept is ``P / (S + CAUTION max(S))``, tapered to `MATCHED_REACH`.

    Attributes
    ----------
    pulse, matched : array complex (point,)
        From minus to plus the reach and a sample more, `OVER` points a sample; ``matched`` is conjugated and not
        scaled.
    amplitude_variance : float
        Variance of a complex amplitude in noise of power 1 [1].
    delay_variance : float
        Variance of a delay for an amplitude of 1 in one beam with noise of power 1 [sample2].
    """

    pulse: Complex
    matched: Complex
    amplitude_variance: float
    delay_variance: float

    @classmethod
    def of(cls, weight: Real, noise: Real) -> "Matched":
        """Tabulate for a pulse of a spectrum (sample,), of any scale, in noise of a density (sample,), mean 1."""
        size = weight.size
        frequency = np.fft.fftfreq(size)
        pulse = weight * size / weight.sum()
        cell = 1 / np.ptp(frequency[weight > 0])
        best = pulse / (noise + CAUTION * noise.max())
        best[0] = (best[1] + best[-1]) / 2  # no noise there since nothing is measured there
        reach = _reach(MATCHED_REACH, cell, size)
        late = (np.arange(size) + size // 2) % size - size // 2
        kept = np.conj(np.fft.fft(np.fft.ifft(best) * _taper(late, reach)))
        kept /= np.sum(pulse * kept)
        mean = np.sum(frequency * pulse * kept).real
        curvature = np.sum(frequency**2 * pulse * kept).real - mean**2
        through = size * noise * np.abs(kept) ** 2
        points = 2 * (reach + 1) * OVER + 1
        return cls(
            pulse=_table(pulse, _reach(PULSE_REACH, cell, size)),
            matched=np.conj(_table(best, reach) * _taper(np.linspace(-reach - 1, reach + 1, points), reach)),
            amplitude_variance=float(through.sum()),
            delay_variance=float(np.sum((frequency - mean) ** 2 * through) / (8 * np.pi**2 * curvature**2)),
        )


def _reach(cells: int, cell: float, size: int) -> int:
    """Samples to each side: no more than there are in half a period."""
    return min(int(np.ceil(cells * cell)), (size - 1) // 2)


def _taper(late: NDArray[np.number], reach: int) -> Real:
    """Hann window that ends a sample beyond the reach: no jumps when a delay moves on to the next samples."""
    taper: Real = np.cos(np.pi / 2 * np.clip(late / (reach + 1), -1, 1)) ** 2
    return taper


def _table(spectrum: Complex | Real, reach: int) -> Complex:
    """Transform at `OVER` points a sample, ``reach + 1`` samples to each side, by zero-padding the spectrum."""
    half = spectrum.size // 2  # beyond the band kept on either side the spectrum is zero
    padded = np.concatenate([spectrum[:half], np.zeros(spectrum.size * (OVER - 1)), spectrum[half:]])
    points = np.fft.ifft(padded) * OVER
    table: Complex = np.roll(points, (reach + 1) * OVER)[: 2 * (reach + 1) * OVER + 1]
    return table
