"""Whitened samples of beams, and the pulse of a path of amplitude 1 in them, for the fits of several paths."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from sounder.cir.matched_filter import OVERSAMPLING, MatchedFilter, whitening_matrix
from sounder.kernels.extraction.scan_view import beam_table

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

PADDING = 6
"""Samples that are fitted before the first and after the last path; chosen, not derived."""
MAX_OFFSET = 1.0
"""How far from the middle sample a path of a `CentredPulse` may be [sample]."""
MIN_STRENGTH = 0.1
"""Combinations of samples in which pulses are weaker than this share of the strongest are left out."""
POINT_STRIDE = 2
"""Points of the pulse's table that make one of a `WindowPulse`; linear interpolation between them is good to -68 dB."""


@dataclass(frozen=True)
class BeamSamples:
    """Samples of some beams.

    Attributes
    ----------
    directions : array (beam, 2)
        Azimuth and elevation [degree].
    noise : array (beam,)
        Noise power of a sample.
    samples : array complex (beam, combination)
        Whitened; the noise power is 1 in every beam.
    """

    directions: Real
    noise: Real
    samples: Complex

    @cached_property
    def table(self) -> NDArray[np.record]:
        """Directions of the beams for the kernels."""
        return beam_table(self.directions)

    def with_pattern_error(self, gain_error: float, beamwidth_error: float) -> Self:
        """Count what is not known of the antenna's pattern as further noise.

        The amplitude of a Gaussian lobe ``x`` neper below its peak has the relative error
        ``gain_error + 2 beamwidth_error x``.
        """
        power = np.maximum(np.sum(np.abs(self.samples) ** 2, axis=1) - self.samples.shape[1], 1e-3)
        error = gain_error + beamwidth_error * np.log(power.max() / power)
        increase = 1 + 2 * error**2 * power
        return type(self)(self.directions, self.noise * increase, self.samples / np.sqrt(increase)[:, None])


@dataclass(frozen=True)
class CentredPulse:
    """Pulses that arrive within `MAX_OFFSET` of the middle of ``2 PADDING + 1`` samples.

    Attributes
    ----------
    whitener : array complex (combination, sample)
        To unit noise in each combination, for noise of power 1 a sample. Only combinations that see such pulses.
    pulse, slope : array complex (point, combination)
        Whitened pulses of amplitude 1, `OVERSAMPLING` points per sample from ``-MAX_OFFSET`` to ``MAX_OFFSET``, and
        their derivatives by delay [1/sample].
    """

    whitener: Complex
    pulse: Complex
    slope: Complex

    @classmethod
    def of(cls, matched: MatchedFilter, noise: Real) -> Self:
        """Tabulate for noise of a spectral density (sample,) of mean 1."""
        lags = np.arange(2 * PADDING + 1)
        white = whitening_matrix(noise, lags.size)
        middle = matched.pulse.size // 2
        points = np.arange(-int(MAX_OFFSET * OVERSAMPLING), int(MAX_OFFSET * OVERSAMPLING) + 1)
        pulses = matched.pulse[middle + OVERSAMPLING * (lags - PADDING) - points[:, None]] @ white.T
        _, strength, right = np.linalg.svd(pulses, full_matrices=False)
        seen = right[strength > MIN_STRENGTH * strength[0]]
        pulses = pulses @ seen.conj().T
        return cls(seen.conj() @ white, pulses, np.gradient(pulses, 1 / OVERSAMPLING, axis=0))

    def at(self, delay: Real) -> tuple[Complex, Complex]:
        """Pulse and slope (..., combination) at delays (...) after the middle sample."""
        place = (np.clip(delay, -MAX_OFFSET, MAX_OFFSET) + MAX_OFFSET) * OVERSAMPLING
        left = np.minimum(place.astype(int), len(self.pulse) - 2)
        right = (place - left)[..., None]
        return tuple(table[left] * (1 - right) + table[left + 1] * right for table in (self.pulse, self.slope))


@dataclass(frozen=True)
class WindowPulse:
    """Pulses that arrive anywhere in a window of samples.

    Attributes
    ----------
    whitener : array complex (combination, sample)
        To unit noise in each combination, for noise of power 1 a sample.
    pulse, slope : array complex (point, combination)
        Whitened pulses of amplitude 1, ``OVERSAMPLING / POINT_STRIDE`` points per sample from the window's first sample
        on, and their derivatives by delay [1/sample].
    """

    whitener: Complex
    pulse: Complex
    slope: Complex

    @classmethod
    def of(cls, matched: MatchedFilter, noise: Real, size: int) -> Self:
        """Tabulate for ``size`` samples in noise of a spectral density (sample,) of mean 1."""
        lags = np.arange(size)
        white = whitening_matrix(noise, size)
        delays = POINT_STRIDE * np.arange((size - 1) * OVERSAMPLING // POINT_STRIDE + 1)[:, None]
        point = matched.pulse.size // 2 + OVERSAMPLING * lags - delays
        inside = (point >= 0) & (point < matched.pulse.size)
        pulse = np.where(inside, matched.pulse[np.where(inside, point, 0)], 0) @ white.T
        return cls(white, pulse, np.gradient(pulse, POINT_STRIDE / OVERSAMPLING, axis=0))

    def at(self, delay: Real) -> tuple[Complex, Complex]:
        """Pulse and slope (..., combination) at delays (...) after the window's first sample."""
        place = np.clip(delay * (OVERSAMPLING // POINT_STRIDE), 0, len(self.pulse) - 1.001)
        left = place.astype(int)
        right = (place - left)[..., None]
        before, after = self.pulse[left], self.pulse[left + 1]
        return before * (1 - right) + after * right, self.slope[left] * (1 - right) + self.slope[left + 1] * right
