"""Captures to calibrated channel impulse responses (CIR)."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from erm.common.errors import DataError
from sounder.cir.amplitudes import WALL, amplitude_wall, rail, within_range
from sounder.cir.deembedding import Deembedding, make_deembedding
from sounder.cir.phase_alignment import AlignedMean, align_snapshots, average_on_line, common_offsets
from sounder.cir.power_average import PowerAverage
from sounder.cir.responses import Correlator, correlator_of, power_of_responses
from sounder.kernels.compiler.machine import processors
from sounder.kernels.correlation.clipping import count_rails
from sounder.kernels.correlation.m_sequence import MSequenceCorrelator
from sounder.options import Averaging, require_choice
from sounder.recordings.recording import CLIPPED_SHARE, MAX_AGC_GAIN, BackToBack, Captures, Recording, clipped_share
from sounder.remark import Code, Remark

BLOCK_BYTES = 2**20
"""Size of the blocks in which captures are read. They fit the second-level cache of a processor."""


def calibrate(b2b: BackToBack, recording: Recording | BackToBack) -> Deembedding:
    """Make the de-embedding filter for a recording from a back-to-back recording.

    Parameters
    ----------
    b2b : BackToBack
        Recorded by the same sounder, with an attenuator in place of the antennas.
    recording : Recording or BackToBack
        Recordings of the same description and scale factor can share the filter.

    Returns
    -------
    Deembedding
        For :func:`impulse_responses`.

    Raises
    ------
    DataError
        The captures are clipped, empty or not finite, or are not of the recording's sounder.

    Examples
    --------
    >>> import sounder
    >>> from sounder import shipped
    >>> recordings, b2b = [shipped.calibration("recording-132ghz.h5")], shipped.calibration("back-to-back-132ghz.h5")
    >>> [job], _ = sounder.gather(recordings, calibration=b2b)
    >>> deembedding = sounder.calibrate(job.b2b, job.recording)
    >>> float(abs(deembedding.pulse[0]).round(6))  # a path of amplitude 1 has a peak of 1
    1.0
    """
    captures = b2b.captures
    if not within_range(captures):
        raise DataError(f"{b2b.source}: back-to-back samples are NaN, infinite or huge; record it again")
    ratio = 20 * abs(np.log10(b2b.scale_factor) - np.log10(recording.scale_factor))
    if ratio > MAX_AGC_GAIN:
        raise DataError(
            f"{recording.source}: scale_factor {recording.scale_factor:g} and that of {b2b.source}, "
            f"{b2b.scale_factor:g}, are {ratio:.0f} dB apart; expected at most {MAX_AGC_GAIN:g} dB"
        )
    if clipped_share(captures) > CLIPPED_SHARE:
        raise DataError(f"{b2b.source}: the back-to-back captures are clipped; record them with less gain")
    complex_captures = captures if captures.dtype.kind == "c" else captures[..., 0] + 1j * captures[..., 1]
    mean = complex_captures.mean(axis=0, dtype=complex)
    if b2b.kind != recording.kind:
        raise DataError(
            f"{b2b.source}: the back-to-back is {b2b.kind}, the recording {recording.source} is {recording.kind}; "
            "expected the same kind of captures"
        )
    if mean.size == recording.sounder.waveform.samples:
        mean = correlator_of(b2b.kind, recording.sounder).correlate_mean(mean)
    return make_deembedding(b2b, mean, recording.sounder, recording.scale_factor)


def impulse_responses(
    recording: Recording,
    deembedding: Deembedding,
    *,
    averaging: Averaging = "coherent",
    threads: int | None = None,
) -> tuple[xr.Dataset, list[Remark]]:
    """Correlate, average and de-embed the captures of every direction.

    Captures are read in blocks of about :data:`BLOCK_BYTES`, so memory does not grow with the recording. One thread
    averages all snapshots of a direction in order, so the result is the same to the last bit for any number of threads.

    Parameters
    ----------
    recording : Recording
    deembedding : Deembedding
        From :func:`calibrate`.
    averaging : {"coherent", "phase-aligned", "power"}
        Over the snapshots of a direction. ``coherent``: the complex mean. ``phase-aligned``: the complex mean after the
        common phase of each snapshot is removed, for an oscillator that drifts; a direction too weak for that is turned
        at the carrier offset of its neighbours in time. ``power``: the root of the mean power,
        with the phase of the complex mean, for a channel that changes between snapshots.
    threads : int, optional
        Number of directions processed at a time; default one per processor.

    Returns
    -------
    dataset : xarray.Dataset
        ``cir`` (azimuth, elevation, delay): complex amplitude gain including the receive antenna, NaN where nothing
        was recorded. ``delay`` is the propagation delay [s], modulo the period of the sequence. ``coherence`` (azimuth,
        elevation), unless powers are averaged: power of the mean over mean power, at the strongest delay; 1 for a
        stable phase, one over the number of snapshots for a random phase. Phase-aligned averaging adds
        ``carrier_offset``, the slope of the phase [degree per snapshot], NaN if the phase is not on a line, and
        ``phase_drift``, its circular standard deviation about the line [degree].
    remarks : list of Remark
        Directions whose samples are all zero or not finite (left out), clipped or compressed (used).

    Raises
    ------
    DataError
        No direction holds a signal.

    Examples
    --------
    >>> import sounder
    >>> from sounder import shipped
    >>> recordings, b2b = [shipped.calibration("recording-132ghz.h5")], shipped.calibration("back-to-back-132ghz.h5")
    >>> [job], _ = sounder.gather(recordings, calibration=b2b)
    >>> deembedding = sounder.calibrate(job.b2b, job.recording)
    >>> cir, remarks = sounder.impulse_responses(job.recording, deembedding)
    >>> strongest = abs(cir["cir"]).sel(azimuth=10, elevation=0)
    >>> f"{float(strongest.idxmax()) * 1e9:.1f} ns"  # the direct path takes 101.6 ns, the samples are 0.83 ns apart
    '101.7 ns'
    """
    require_choice("averaging", averaging, Averaging)
    waveform = recording.sounder.waveform
    correlator = correlator_of(recording.kind, recording.sounder)
    shape = (recording.azimuth.size, recording.elevation.size)
    cir = np.full((*shape, waveform.samples), np.nan + 0j, np.complex64)
    coherence, offset, drift = np.full((3, *shape), np.nan)
    remarks: list[Remark] = []
    average_of = _averager(averaging, correlator, deembedding)

    def average(place: NDArray[np.intp]) -> DirectionAverage:
        blocks = _Blocks(recording, int(place[1]), int(place[0]), deembedding.wall)
        return average_of(blocks)

    def on_line(place: NDArray[np.intp], offset: float) -> DirectionAverage:
        blocks = _Blocks(recording, int(place[1]), int(place[0]), deembedding.wall)
        return _on_line(blocks, correlator, offset)

    together = threads or processors()
    with ThreadPoolExecutor(together) as pool:
        in_turn = map if together == 1 else pool.map  # handing directions to one thread costs a tenth of all
        places = np.argwhere(recording.valid.T)
        directions = list(in_turn(average, places))
        if averaging == "phase-aligned":
            offsets = common_offsets(np.array([direction.offset for direction in directions]), recording.snapshots)
            weak = [k for k, direction in enumerate(directions) if direction.mean is None]
            for k, direction in zip(weak, in_turn(on_line, places[weak], offsets[weak]), strict=True):
                directions[k] = direction
        for (e, a), direction in zip(places, directions, strict=True):
            if direction.problem:
                azimuth, elevation = float(recording.azimuth[a]), float(recording.elevation[e])
                remarks.append(replace(direction.problem, azimuth=azimuth, elevation=elevation))
            if direction.mean is not None and np.isfinite(direction.mean).all():
                cir[a, e] = direction.mean * 10 ** (-recording.agc_gain[a, e] / 20)
                coherence[a, e] = direction.coherence
                offset[a, e], drift[a, e] = np.degrees([direction.offset, direction.drift])
    if averaging != "power":  # de-embedding is linear, so it may follow the mean
        for a in range(len(cir)):
            cir[a] = deembedding.apply(cir[a])
    if np.isnan(cir).all():
        what = remarks[0].meaning if remarks else "no direction was recorded"
        raise DataError(f"{recording.source}: {recording.name}: {what}, in all directions; record the position again")
    dataset = xr.Dataset(
        {
            "cir": (
                ("azimuth", "elevation", "delay"),
                cir,
                {"units": "1", "long_name": "channel impulse response, including the receive antenna"},
            )
        },
        coords={
            "azimuth": ("azimuth", recording.azimuth, AZIMUTH),
            "elevation": ("elevation", recording.elevation, ELEVATION),
            "delay": ("delay", np.arange(waveform.samples) / waveform.sample_rate, DELAY),
        },
        attrs={"averaging": averaging, "snapshots": recording.snapshots},
    )
    if averaging != "power":
        dataset["coherence"] = (("azimuth", "elevation"), coherence, COHERENCE)
    if averaging == "phase-aligned":
        dataset["carrier_offset"] = (("azimuth", "elevation"), offset, CARRIER_OFFSET)
        dataset["phase_drift"] = (("azimuth", "elevation"), drift, PHASE_DRIFT)
        dataset.attrs["aligned_directions"] = int(np.isfinite(drift).sum())
    return dataset, remarks


AZIMUTH = {"units": "degree", "long_name": "horn azimuth, counter-clockwise from east"}
ELEVATION = {"units": "degree", "long_name": "horn elevation above the horizon"}
DELAY = {"units": "s", "long_name": "propagation delay"}
COHERENCE = {"units": "1", "long_name": "share of the power at the strongest delay that averaging keeps"}
CARRIER_OFFSET = {"units": "degree", "long_name": "phase per snapshot of a steady carrier offset"}
PHASE_DRIFT = {"units": "degree", "long_name": "circular standard deviation of the phase about its line over snapshots"}


class DirectionAverage(NamedTuple):
    """Average over the snapshots of one direction.

    ``mean`` (sample,) is the mean correlation, or the CIR if powers are averaged; None if there is no signal. The last
    two are those of :class:`~sounder.cir.phase_alignment.AlignedMean`.
    """

    mean: NDArray[np.complexfloating] | None
    coherence: float
    problem: Remark | None
    offset: float = np.nan
    drift: float = np.nan


class _Blocks:
    """Captures of one direction in blocks; their health is checked as they are read."""

    def __init__(self, recording: Recording, azimuth: int, elevation: int, wall: float = 0.0) -> None:
        self._recording = recording
        self._bound = max(WALL, 2 * wall)
        self._wall = 0.0
        self._rail = 0.0, 1.0
        self._directions = int(np.count_nonzero(recording.valid))
        self._place = (azimuth, elevation)
        self.snapshots, self.source = recording.snapshots, recording.source
        self._step = max(BLOCK_BYTES // (4 * recording.sounder.waveform.samples), 1)
        self.signal = False
        self._finite = True
        self._clipped = 0
        self._numbers = 0

    def __iter__(self) -> Iterator[Captures]:
        self._clipped = self._numbers = 0
        for first in range(0, self._recording.snapshots, self._step):
            captures = self._recording.captures(*self._place, slice(first, first + self._step))
            if captures.dtype == np.int16:
                clipped, signal = count_rails(captures)
                self._clipped += clipped
                self._numbers += captures.size
                self.signal = self.signal or signal
            else:
                self.signal = self.signal or bool(captures.any())
                if not within_range(captures):
                    self._finite, captures = False, np.full_like(captures, np.nan)
            if first == 0 and self._recording.kind == "iq":
                self._rail, self._wall = rail(captures[0], self._directions), amplitude_wall(captures[0])
            yield captures

    @property
    def problem(self) -> Remark | None:
        """What is wrong with the captures read so far, without their direction."""
        if not self._finite:
            return Remark(Code.NOT_FINITE)
        if not self.signal:
            return Remark(Code.ALL_ZERO)
        if self._clipped > CLIPPED_SHARE * self._numbers:
            return Remark(Code.CLIPPED, figure=self._clipped / self._numbers, bound=CLIPPED_SHARE)
        share, most = self._rail
        if share > most:
            return Remark(Code.CLIPPED, figure=share, bound=most)
        if self._wall > self._bound:
            return Remark(Code.COMPRESSED, figure=self._wall, bound=self._bound)
        return None


def _coherent(blocks: _Blocks, correlator: Correlator) -> DirectionAverage:
    sums = correlator.accumulator()
    for captures in blocks:
        sums.add(captures)
    if not blocks.signal:
        return DirectionAverage(None, np.nan, blocks.problem)
    mean, power = sums.result()
    strongest = int(np.argmax(power))
    coherence = float(np.abs(mean[strongest]) ** 2 / power[strongest])
    return DirectionAverage(mean, coherence, blocks.problem)


def _phase_aligned(blocks: _Blocks, correlator: Correlator) -> DirectionAverage:
    return _of_aligned(blocks, align_snapshots(blocks, _of_sequence(blocks, correlator)))


def _on_line(blocks: _Blocks, correlator: Correlator, offset: float) -> DirectionAverage:
    return _of_aligned(blocks, average_on_line(blocks, _of_sequence(blocks, correlator), offset))


def _of_sequence(blocks: _Blocks, correlator: Correlator) -> MSequenceCorrelator:
    if not isinstance(correlator, MSequenceCorrelator):
        raise DataError(f"{blocks.source}: phase-aligned averaging needs IQ captures of an m-sequence")
    return correlator


def _of_aligned(blocks: _Blocks, found: AlignedMean | None) -> DirectionAverage:
    if found is None or not blocks.signal:
        return DirectionAverage(None, np.nan, blocks.problem)
    return DirectionAverage(found.mean, found.coherence, blocks.problem, found.offset, found.drift)


def _power(blocks: _Blocks, average: Callable[[_Blocks], NDArray[np.complexfloating]]) -> DirectionAverage:
    cir = average(blocks)
    return DirectionAverage(cir if blocks.signal else None, np.nan, blocks.problem)


def _averager(
    averaging: Averaging, correlator: Correlator, deembedding: Deembedding
) -> Callable[[_Blocks], DirectionAverage]:
    """Average of one direction."""
    if averaging == "coherent":
        return partial(_coherent, correlator=correlator)
    if averaging == "phase-aligned":
        return partial(_phase_aligned, correlator=correlator)
    if isinstance(correlator, MSequenceCorrelator):
        return partial(_power, average=PowerAverage(correlator.template, deembedding))
    return partial(_power, average=partial(power_of_responses, correlator=correlator, deembed=deembedding.apply))
