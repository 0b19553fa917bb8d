"""Snapshots of one direction see the same channel: slips between them are put right, bursts are left out."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from erm.common.significance import FALSE_ALARM
from sounder.cir.power_spectrum import noise_power
from sounder.options import Averaging

Complex = NDArray[np.complexfloating]
Real = NDArray[np.float64]

LOST_COHERENCE = 0.05
"""Share of the expected coherence that a direction may lose before its snapshots are examined one by one. It costs
time only: a slip of one snapshot in eight loses 12 %."""
MIN_SNR = 14.0
"""Least peak power over the noise of the mean for snapshots to be examined. A path of four times the power, 17 dB, has
it if half of its snapshots are shifted."""
OVERLAP = 0.9
"""Power of a cross-correlation without a shift, relative to that at the best shift, below which the shift is certain.
Held chips that are shifted by a sample of two keep (510 / 1022)^2 = 0.25; band-limited ones 0.7."""
SIGNIFICANT = 6.0
"""Amplitude of a cross-correlation over that without a shift, in amplitudes of noise. A noise of amplitude 1 exceeds 6
with the probability exp(-36): none of the shifts of a campaign does."""
STRONG = -np.log(FALSE_ALARM / 1000)
"""Power over the noise of the samples of the reference that are correlated: of a capture of a thousand samples noise
has one with `FALSE_ALARM`."""
BURST = 1.6
"""Noise of a snapshot over its usual value, and over that of the other snapshots of the direction, that is a burst:
2 dB, seven standard deviations. Strong signals bring noise of their own to all snapshots."""


def expected_coherence(snr: Real, snapshots: int) -> Real:
    """Coherence of snapshots with equal signals in independent noise.

    The mean over ``M`` snapshots has the power ``S + N/M`` at the peak, single ones have ``S + N``. With the ratio
    ``A = M S / N`` of the mean, the coherence is ``(A + 1) / (A + M)``.

    Parameters
    ----------
    snr : array (...)
        ``A``.
    snapshots : int
        ``M``.
    """
    coherence: Real = (snr + 1) / (snr + snapshots)
    return coherence


class Snapshots(NamedTuple):
    """What was found in the snapshots of one direction.

    ``shift`` (snapshot,) is the delay of each against the first good one [sample], ``good`` (snapshot,) tells those
    without a burst, ``noise`` (snapshot,) is their noise power over the usual one.
    """

    shift: NDArray[np.int64]
    good: NDArray[np.bool_]
    noise: Real


def compare_snapshots(responses: Complex, noise: float) -> Snapshots:
    """Compare the snapshots of a direction.

    The cross-correlation of two noisy copies of a response is largest at their shift. The sequence is periodic: samples
    that were lost shift it on a circle. With the strong samples of one copy as reference ``r``, noise of power
    ``N`` has the cross-correlation ``N sum |r|^2`` in the mean, exponential, at any shift.

    Parameters
    ----------
    responses : array complex (snapshot, sample)
        De-embedded response of each snapshot.
    noise : float
        Usual noise power of one snapshot.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> channel = np.zeros(1022, complex)
    >>> channel[[30, 200]] = 100, 40j
    >>> responses = channel + rng.normal(size=(4, 1022, 2)) @ [1, 1j]
    >>> responses[2:] = np.roll(responses[2:], 7, axis=-1)
    >>> compare_snapshots(responses, 2.0).shift
    array([0, 0, 7, 7])
    """
    level = noise_power(np.abs(responses) ** 2) / noise
    usual = max(1.0, float(np.median(level)))
    good = level < BURST * usual
    noise *= usual
    if not good.any():
        good = level <= level.min()
    first = responses[int(np.argmax(good))]
    reference = np.where(np.abs(first) ** 2 > STRONG * noise, first, 0)
    cross = np.abs(np.fft.ifft(np.fft.fft(responses) * np.conj(np.fft.fft(reference)))) ** 2
    best = np.argmax(cross, axis=-1)
    unshifted, largest = cross[:, 0], cross.max(axis=-1)
    by_chance = np.sqrt(noise * np.sum(np.abs(reference) ** 2))
    certain = (unshifted < OVERLAP * largest) & (np.sqrt(largest) - np.sqrt(unshifted) > SIGNIFICANT * by_chance)
    if not (certain & good).any() and good.all():
        return Snapshots(_shift_from(responses, noise), good, np.asarray(level, float))
    size = responses.shape[-1]
    shift = np.where(certain & good, (best + size // 2) % size - size // 2, 0)
    return Snapshots(shift, good, np.asarray(level, float))


def _shift_from(responses: Complex, noise: float) -> NDArray[np.int64]:
    """Shift (snapshot,) of the snapshots from one on, between the means before and after, which have less noise."""
    count, size = responses.shape
    before = np.cumsum(responses, axis=0)
    shift, largest = np.zeros(count, np.int64), SIGNIFICANT
    for first in range(1, count):
        early, late = before[first - 1] / first, (before[-1] - before[first - 1]) / (count - first)
        reference = np.where(np.abs(early) ** 2 > STRONG * noise / first, early, 0)
        cross = np.abs(np.fft.ifft(np.fft.fft(late) * np.conj(np.fft.fft(reference))))
        best = int(cross.argmax())
        by_chance = np.sqrt(noise / (count - first) * np.sum(np.abs(reference) ** 2))
        if cross[0] ** 2 < OVERLAP * cross[best] ** 2 and cross[best] - cross[0] > largest * by_chance > 0:
            largest = float((cross[best] - cross[0]) / by_chance)
            shift[:] = 0
            shift[first:] = (best + size // 2) % size - size // 2
    return shift


def mean_of(responses: Complex, found: Snapshots, averaging: Averaging) -> Complex:
    """Mean (sample,) of the good snapshots after their shifts are removed."""
    aligned = np.array([np.roll(one, -k) for one, k in zip(responses, found.shift, strict=True)])[found.good]
    if averaging == "power":
        power: Complex = np.sqrt(np.mean(np.abs(aligned) ** 2, axis=0)) * np.exp(1j * np.angle(aligned.mean(axis=0)))
        return power
    if averaging == "phase-aligned":
        phase = np.angle(aligned @ np.conj(aligned.mean(axis=0)))
        aligned = aligned * np.exp(-1j * phase)[:, None]
    mean: Complex = aligned.mean(axis=0)
    return mean
