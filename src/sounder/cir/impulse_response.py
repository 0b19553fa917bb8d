"""Captures to calibrated channel impulse responses (CIR)."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from erm.common.errors import DataError
from sounder.cir.deembedding import Deembedding, make_deembedding
from sounder.instrument.waveform import chips
from sounder.kernels.correlation.clipping import count_rails
from sounder.kernels.correlation.directions import processors
from sounder.kernels.correlation.m_sequence import MSequenceCorrelator
from sounder.options import Averaging
from sounder.recordings.recording import CLIPPED_SHARE, BackToBack, Captures, Recording, clipped_share


@dataclass(frozen=True)
class Problem:
    """What is wrong with one direction, what was or is to be done about it, and the share of its samples."""

    azimuth: float
    elevation: float
    what: str
    then: str
    share: float = 1.0


def calibrate(b2b: BackToBack, recording: Recording) -> Deembedding:
    """Make the de-embedding filter of a recording from its back-to-back captures.

    Raises
    ------
    DataError
        The two do not belong together; see :func:`sounder.cir.deembedding.make_deembedding`.
    """
    waveform = recording.sounder.waveform
    captures = b2b.captures
    if not np.isfinite(captures).all():
        raise DataError(f"{b2b.source}: back-to-back samples are NaN or infinite; record it again")
    if clipped_share(captures) > CLIPPED_SHARE:
        raise DataError(f"{b2b.source}: the back-to-back captures are clipped; record them with less gain")
    complex_captures = captures if captures.dtype.kind == "c" else captures[..., 0] + 1j * captures[..., 1]
    mean = complex_captures.mean(axis=0, dtype=complex)
    if mean.size == waveform.samples:
        mean = MSequenceCorrelator(chips(waveform), waveform.samples_per_chip).correlate_mean(mean)
    return make_deembedding(b2b, mean, recording.sounder, recording.scale_factor)


def impulse_responses(
    recording: Recording,
    filter_: Deembedding,
    *,
    averaging: Averaging = "coherent",
    threads: int | None = None,
    progress: Callable[[], None] | None = None,
) -> tuple[xr.Dataset, list[Problem]]:
    """Correlate, average and de-embed every direction of a recording.

    Captures are read in blocks of about :data:`BLOCK` bytes, so that memory does not grow with the recording. A
    direction is averaged by one thread from its first snapshot to its last: the result does not depend on the number
    of threads, to the last bit.

    Parameters
    ----------
    recording : Recording
    filter_ : Deembedding
        From :func:`calibrate`.
    averaging : {"coherent", "phase-aligned", "power"}
        Over the snapshots of a direction: the mean; the mean after each snapshot's common phase is turned to the
        others' (for a drifting oscillator); or the root of the mean power with the phase of the coherent mean (for a
        channel that moves between snapshots).
    threads : int, optional
        Directions worked on at a time; default one a processor.
    progress : callable, optional
        Called after each direction.

    Returns
    -------
    dataset : xarray.Dataset
        ``cir`` (azimuth, elevation, delay), complex amplitude gain including the receive antenna, NaN where nothing
        was recorded; ``delay`` is the propagation delay [s], modulo the sequence's period. With coherent averaging
        also ``coherence`` (azimuth, elevation): the power that averaging kept at the strongest delay, over the mean
        power there; 1 for a stable phase, one over the number of snapshots for a random one.
    problems : list of Problem
        Directions with all samples zero (left out) or clipped (used).

    Raises
    ------
    DataError
        No direction holds a signal.
    """
    waveform = recording.sounder.waveform
    correlator = MSequenceCorrelator(chips(waveform), waveform.samples_per_chip)
    shape = (recording.azimuth.size, recording.elevation.size)
    cir = np.full((*shape, waveform.samples), np.nan + 0j, np.complex64)
    coherence = np.full(shape, np.nan)
    problems: list[Problem] = []

    def work(place: NDArray[np.intp]) -> Direction:
        blocks = _Blocks(recording, int(place[1]), int(place[0]))
        return AVERAGES[averaging](blocks, correlator, filter_)

    with ThreadPoolExecutor(threads or processors()) as pool:
        places = np.argwhere(recording.valid.T)
        for (e, a), direction in zip(places, pool.map(work, places), strict=True):
            if direction.problem:
                azimuth, elevation = float(recording.azimuth[a]), float(recording.elevation[e])
                problems.append(Problem(azimuth, elevation, *direction.problem))
            if direction.mean is not None and np.isfinite(direction.mean).all():
                cir[a, e] = direction.mean * 10 ** (-recording.agc_gain[a, e] / 20)
                coherence[a, e] = direction.coherence
            if progress is not None:
                progress()
    if averaging != "power":  # de-embedding is linear, so that it may follow the average
        for a in range(len(cir)):
            cir[a] = filter_.apply(cir[a])
    if np.isnan(cir).all():
        what = problems[0].what if problems else "no direction was recorded"
        raise DataError(f"{recording.source}: {recording.name}: {what}, in all directions; record the position again")
    dataset = xr.Dataset(
        {
            "cir": (
                ("azimuth", "elevation", "delay"),
                cir,
                {"units": "1", "long_name": "channel impulse response, receive antenna included"},
            )
        },
        coords={
            "azimuth": ("azimuth", recording.azimuth, AZIMUTH),
            "elevation": ("elevation", recording.elevation, ELEVATION),
            "delay": ("delay", np.arange(waveform.samples) / waveform.sample_rate, DELAY),
        },
        attrs={"averaging": averaging, "snapshots": recording.snapshots},
    )
    if averaging == "coherent":
        dataset["coherence"] = (("azimuth", "elevation"), coherence, COHERENCE)
    return dataset, problems


BLOCK = 2**20
"""Samples read at a time, in bytes: they stay in the processor's second-level cache."""
ZERO = ("all samples are zero", "left out", 1.0)
NOT_FINITE = ("samples are NaN or infinite", "left out", 1.0)
RAILS = ("samples are clipped", "lower the receiver gain")
AZIMUTH = {"units": "degree", "long_name": "horn azimuth, counter-clockwise from east"}
ELEVATION = {"units": "degree", "long_name": "horn elevation above the horizon"}
DELAY = {"units": "s", "long_name": "propagation delay"}
COHERENCE = {"units": "1", "long_name": "share of the power at the strongest delay kept by coherent averaging"}


class Direction(NamedTuple):
    """Average of one direction, complex (sample,): correlation, or CIR for powers; None if there is no signal."""

    mean: NDArray[np.complexfloating] | None
    coherence: float
    problem: tuple[str, str, float] | None


class _Blocks:
    """Captures of one direction in blocks; looks at their health when they first pass."""

    def __init__(self, recording: Recording, azimuth: int, elevation: int) -> None:
        self._recording = recording
        self._place = (azimuth, elevation)
        self.snapshots = recording.snapshots
        self._step = max(BLOCK // (4 * recording.sounder.waveform.samples), 1)
        self.signal = False
        self._finite = True
        self._rails = 0
        self._numbers = 0

    def __iter__(self) -> Iterator[Captures]:
        self._rails = self._numbers = 0
        for first in range(0, self._recording.snapshots, self._step):
            captures = self._recording.captures(*self._place, slice(first, first + self._step))
            if captures.dtype == np.int16:
                rails, signal = count_rails(captures)
                self._rails += rails
                self._numbers += captures.size
                self.signal = self.signal or signal
            else:
                self.signal = self.signal or bool(captures.any())
                self._finite = self._finite and bool(np.isfinite(captures).all())
            yield captures

    @property
    def problem(self) -> tuple[str, str, float] | None:
        """What is wrong with the captures that have passed; the last three fields of :class:`Problem`."""
        if not self._finite:
            return NOT_FINITE
        if not self.signal:
            return ZERO
        if self._rails > CLIPPED_SHARE * self._numbers:
            return (*RAILS, self._rails / self._numbers)
        return None


def _coherent(blocks: _Blocks, correlator: MSequenceCorrelator, _filter: Deembedding) -> Direction:
    sums = correlator.accumulator()
    for captures in blocks:
        sums.add(captures)
    if not blocks.signal:
        return Direction(None, np.nan, ZERO)
    mean, power = sums.result()
    strongest = int(np.argmax(power))
    coherence = float(np.abs(mean[strongest]) ** 2 / power[strongest])
    return Direction(mean, coherence, blocks.problem)


def _phase_aligned(blocks: _Blocks, correlator: MSequenceCorrelator, _filter: Deembedding) -> Direction:
    """Mean after turning each snapshot to the common phase, by its inner product with the mean so far."""
    first = next(iter(blocks))
    reference = correlator.correlate(first[:1])[0].astype(complex)
    for _ in range(2):  # the second pass aligns to the mean instead of one noisy snapshot
        total = np.zeros_like(reference)
        for captures in blocks:
            each = correlator.correlate(captures).astype(complex)
            total += np.exp(-1j * np.angle(each @ np.conj(reference))) @ each
        reference = total / blocks.snapshots
    return Direction(reference if blocks.signal else None, np.nan, blocks.problem)


def _power(blocks: _Blocks, correlator: MSequenceCorrelator, filter_: Deembedding) -> Direction:
    total = np.zeros(correlator.samples)
    mean = np.zeros(correlator.samples, complex)
    for captures in blocks:
        responses = filter_.apply(correlator.correlate(captures))
        total += np.sum(np.abs(responses) ** 2, axis=0)
        mean += responses.sum(axis=0)
    cir = np.sqrt(total / blocks.snapshots) * np.exp(1j * np.angle(mean))
    return Direction(cir if blocks.signal else None, np.nan, blocks.problem)


AVERAGES: dict[Averaging, Callable[[_Blocks, MSequenceCorrelator, Deembedding], Direction]] = {
    "coherent": _coherent,
    "phase-aligned": _phase_aligned,
    "power": _power,
}
