"""Averaging over snapshots whose phases are not known: aligned where they can be measured, on a line elsewhere."""

from collections.abc import Iterable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import i0e, i1e

from sounder.kernels.correlation.aligner import AlignedBlock, CaptureAligner
from sounder.kernels.correlation.captures import Captures
from sounder.kernels.correlation.m_sequence import MSequenceCorrelator

NO_LINE = 0.05
"""Probability that random phases pass for phases on a line."""
LOST_PHASE = 0.5
"""Phase that may pass over a direction unaligned [rad]: the mean loses ``x**2 / 12`` of its power, 2 %."""

Complex = NDArray[np.complexfloating]


class AlignedMean(NamedTuple):
    """Average of aligned captures.

    Attributes
    ----------
    mean : array complex (sample,)
        Mean correlation.
    coherence : float
        Power of the mean over mean power, at the strongest delay.
    offset : float
        Slope of the phase over snapshots [rad]; NaN if the phases are not on a line, or could not be measured.
    drift : float
        Circular standard deviation of the phases about the line [rad]; NaN if they could not be measured.
    """

    mean: Complex
    coherence: float
    offset: float
    drift: float


def align_snapshots(blocks: Iterable[Captures], correlator: MSequenceCorrelator) -> AlignedMean | None:
    """Average captures ``x_k = exp(j phi_k) h + noise``, where nothing is known of the phases.

    The phases are those of greatest likelihood, see :class:`~sounder.kernels.correlation.aligner.CaptureAligner`. Each
    capture then counts as much as its phase is known: given the inner product ``z_k`` with the sum of the others, the
    phase has a von Mises density about that of ``z_k``, of concentration ``kappa_k = 2 E|z| |z_k| / var(z)``, and the
    expected phasor is ``I1(kappa_k) / I0(kappa_k)`` long. That makes the gain of the mean free of bias: aligned noise
    adds to it as much as wrong phases take away.

    In noise alone the likelihood has a maximum too. The phases count as measured if what the captures have in common,
    ``|sum|**2`` less the energy of each, exceeds the most that noise of the same energy ``E`` has: the largest
    eigenvalue of the matrix of inner products of K captures of M independent samples, times K, which is
    ``K E (1 + sqrt(K / M))**2``.

    Parameters
    ----------
    blocks : iterable of array
        Captures, int16 (snapshot, sample, 2) or complex64 (snapshot, sample).
    correlator : MSequenceCorrelator

    Returns
    -------
    AlignedMean or None
        With the phase of the first snapshot. None if the phases cannot be measured.

    References
    ----------
    V. A. Marchenko and L. A. Pastur, Math. USSR Sb. 1(4), 1967: the largest eigenvalue of noise.
    K. V. Mardia and P. E. Jupp, "Directional Statistics", 2000: von Mises density, circular standard deviation.
    """
    aligner = CaptureAligner(correlator.samples, correlator.samples_per_chip)
    peak = _Peak(aligner, correlator)
    total = np.zeros(correlator.samples, complex)
    phasors: list[Complex] = []
    energy = 0.0
    for captures in blocks:
        block = aligner.align(captures)
        if not block.energy:  # zeros
            continue
        phasors.append(block.phasors)
        total += aligner.combine(captures, block.phasors * _expected_lengths(block, aligner.count, correlator))
        energy += block.energy * len(block.phasors)
        peak.add(captures, aligner.total)
    if not energy:
        return None
    common = float(np.linalg.norm(_correlate(correlator, aligner.total))) ** 2
    common = common / (correlator.samples_per_chip * (correlator.chips + 1)) - energy
    trace, trace_of_square = _filter_traces(correlator.chips, correlator.samples_per_chip)
    ratio = aligner.count * trace_of_square / trace**2
    if not common > (2 * np.sqrt(ratio) + ratio) * energy:
        return None
    phases = np.conj(np.concatenate(phasors))
    mean = _correlate(correlator, total * (phases[0] / aligner.count))
    return AlignedMean(mean, peak.coherence(mean), *phase_line(phases))


def average_on_line(blocks: Iterable[Captures], correlator: MSequenceCorrelator, offset: float) -> AlignedMean | None:
    """Average captures whose phases are on a line over snapshots, ``phi_k = offset k``.

    Parameters
    ----------
    blocks : iterable of array
        Captures, int16 (snapshot, sample, 2) or complex64 (snapshot, sample).
    correlator : MSequenceCorrelator
    offset : float
        [rad]

    Returns
    -------
    AlignedMean or None
        Offset and drift are NaN: not measured. None if all samples are zero.
    """
    aligner = CaptureAligner(correlator.samples, correlator.samples_per_chip)
    peak = _Peak(aligner, correlator)
    total: Complex = np.zeros(correlator.samples, complex)
    count = 0
    for captures in blocks:
        total += aligner.combine(captures, np.exp(-1j * offset * np.arange(count, count + len(captures))))
        count += len(captures)
        peak.add(captures, total)
    if not total.any():
        return None
    average: Complex = total / count
    mean = _correlate(correlator, average)
    return AlignedMean(mean, peak.coherence(mean), np.nan, np.nan)


class _Peak:
    """Power of single captures at the delay that is strongest in the sum of the first block."""

    def __init__(self, aligner: CaptureAligner, correlator: MSequenceCorrelator) -> None:
        self._aligner, self._correlator = aligner, correlator
        self._powers: list[NDArray[np.float32]] = []

    def add(self, captures: Captures, total: Complex) -> None:
        """Add a block; ``total`` is the sum of the captures so far."""
        if not self._powers:
            self._delay = int(np.argmax(np.abs(_correlate(self._correlator, total))))
            self._template = np.roll(self._correlator.template, self._delay).astype(np.complex64)
        self._powers.append(np.abs(self._aligner.project(captures, self._template)) ** 2)

    def coherence(self, mean: Complex) -> float:
        """Power of the mean over mean power."""
        return float(np.abs(mean[self._delay]) ** 2 / np.concatenate(self._powers).mean())


def phase_line(phasors: Complex) -> tuple[float, float]:
    """Slope of phases over snapshots, and their circular standard deviation about it [rad].

    The slope is that of the highest peak of the periodogram, refined by the step of phase from the first half to the
    second. Random phases reach a share ``R**2`` of all power there with the probability ``K exp(-K R**2)`` at most;
    above `NO_LINE` the slope is NaN, and the deviation is about the mean.

    Parameters
    ----------
    phasors : array complex (snapshot,)
        Of magnitude 1.

    Examples
    --------
    >>> [round(value, 6) for value in phase_line(np.exp(1j * (0.2 + 0.7 * np.arange(50))))]
    [0.7, 0.0]
    """
    count, half = len(phasors), len(phasors) // 2
    size = 4 << count.bit_length()
    snapshot = np.arange(count)
    slope = 2 * np.pi / size * float(np.argmax(np.abs(np.fft.fft(phasors, size))))
    for _ in range(2 if half else 0):
        turned = phasors * np.exp(-1j * slope * snapshot)
        slope += float(np.angle(turned[-half:].sum() * np.conj(turned[:half].sum()))) / (count - half)
    slope = (slope + np.pi) % (2 * np.pi) - np.pi
    resultant = abs(np.mean(phasors * np.exp(-1j * slope * snapshot)))
    if count * np.exp(-count * resultant**2) > NO_LINE:
        slope, resultant = np.nan, abs(np.mean(phasors))
    return slope, float(np.sqrt(np.maximum(-2 * np.log(resultant), 0)))


def common_offsets(offsets: NDArray[np.float64], snapshots: int) -> NDArray[np.float64]:
    """Slopes of the phase for the directions in which it could not be measured, from those before and after.

    Parameters
    ----------
    offsets : array (direction,)
        Measured slopes in the order of time [rad]; NaN where there is none.
    snapshots : int
        Of a direction.

    Returns
    -------
    array (direction,)
        Interpolated [rad]; 0 where the phase stands still over a direction, within `LOST_PHASE`.

    Examples
    --------
    >>> common_offsets(np.array([0.5, np.nan, 0.6, np.nan]), snapshots=100)
    array([0.5 , 0.55, 0.6 , 0.6 ])
    """
    known = np.flatnonzero(np.isfinite(offsets))
    if not known.size:
        return np.zeros_like(offsets)
    unwrapped = np.unwrap(offsets[known])
    slopes = np.interp(np.arange(len(offsets)), known, unwrapped)
    return np.where(np.abs(slopes) * (snapshots - 1) > LOST_PHASE, slopes, 0.0)


def _expected_lengths(block: AlignedBlock, count: int, correlator: MSequenceCorrelator) -> NDArray[np.float64]:
    """Expected lengths of the phasors of a block: I1/I0 of the concentrations of their phases."""
    others = np.maximum(np.abs(block.products).astype(float) - block.energy, 0)
    signal = np.mean(others) / max(count - 1, 1)
    rounding = float(np.finfo(np.float32).eps)
    noise = (
        np.maximum(1 - signal / block.energy, rounding)
        * block.energy
        / _filter_traces(correlator.chips, correlator.samples_per_chip)[0]
    )
    concentration = 2 * signal * (count - 1) * others / (noise * block.reference_energy)
    return i1e(concentration) / i0e(concentration)


@cache
def _filter_traces(chips: int, spc: int) -> tuple[float, float]:
    """Traces of the filter ``F`` of `sounder.kernels.correlation.alignment` and of its square."""
    samples = chips * spc
    lag = np.arange(samples)
    row = np.maximum(1 - np.minimum(lag, samples - lag) / spc, 0) - 1 / (chips + 1)
    return samples * float(row[0]), samples * float(row @ row)


def _correlate(correlator: MSequenceCorrelator, capture: Complex) -> Complex:
    correlation: Complex = correlator.correlate(capture.astype(np.complex64)[None])[0]
    return correlation
