"""Beams that overlap see the same paths: what contradicts the others is shifted back or left out."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from sounder.instrument.antenna_pattern import Pattern
from sounder.quality.beams import (
    MIN_BEAMS,
    MIN_SNR,
    MISSING,
    Neighbours,
    contradictions,
    find_paths,
    lacking,
    shift_between,
)
from sounder.quality.clock import DRIFT_FALSE_ALARM, LEAST_DRIFT, clock_drift, lost_samples
from sounder.quality.delays import CLOSE, WINDOW, Delays, measure_delays
from sounder.quality.scan import Scan
from sounder.quality.shapes import Shapes
from sounder.quality.slips import slips, unsettled
from sounder.remark import Code, Remark

Real = NDArray[np.float64]
Integers = NDArray[np.int64]

ROUNDS = 4
"""Times that beams are compared: what is put right shows what was hidden behind it. Chosen; three are seldom used."""


def check_overlaps(scan: Scan) -> None:
    """Compare beams that overlap: delays, and powers against the antenna pattern."""
    recording, beams = scan.recording, scan.noise.size
    if not Pattern.of(recording.sounder.rx_antenna).directive or beams < MIN_BEAMS:
        return
    near = Neighbours.of(recording.azimuth, recording.elevation, recording.sounder.rx_antenna)
    snr = scan.snr
    paths = find_paths(snr, near)
    if _mend_lost_samples(scan, measure_delays(snr, paths, near, WINDOW, strict=False)):
        snr = scan.snr
        paths = find_paths(snr, near)
    if _mend_drift(scan, measure_delays(snr, paths, near, CLOSE, strict=True)):
        snr = scan.snr
        paths = find_paths(snr, near)
    shifted = np.zeros(beams, np.int64)
    against = np.zeros(beams)
    for _ in range(ROUNDS):
        shifts = slips(measure_delays(snr, paths, near, CLOSE, strict=True), _shapes(scan), recording.elevation.size)
        if not shifts.any():
            against = contradictions(paths, snr)
            shifts = _reconciling_shifts(snr, near, np.maximum(against, lacking(paths, snr)))
        if not shifts.any():
            break
        for beam in np.flatnonzero(shifts):
            scan.roll(int(beam), int(shifts[beam]))
        shifted += shifts
        snr = scan.snr
        paths = find_paths(snr, near)
    if shifted.any():  # where some have slipped others may have, which would not be certain alone
        off = unsettled(measure_delays(snr, paths, near, CLOSE, strict=False), beams, recording.elevation.size)
        for beam in np.flatnonzero((off != 0) & (against == 0)):
            scan.remark(Code.UNSETTLED, *scan.place(int(beam)), off[beam], 0.5)
        shifted[off != 0] = 0
    for beam in np.flatnonzero(shifted):
        scan.remark(Code.SLIPPED, *scan.place(int(beam)), shifted[beam], 0.0)
    for beam in np.flatnonzero(against):
        scan.remark(Code.INCONSISTENT, *scan.place(int(beam)), against[beam], MISSING)


def _shapes(scan: Scan) -> Shapes:
    """Responses of all beams as they are now."""
    return Shapes(scan.responses.reshape(scan.noise.size, -1), scan.noise.ravel())


def _reconciling_shifts(snr: NDArray[np.float32], near: Neighbours, against: Real) -> Integers:
    """Delays (beam,) of the directions that contradict the others [sample]; 0 where none reconciles them.

    A beam is compared with what several about it see, or, if these see nothing, with what several see anywhere: the
    slips of two may agree by chance.
    """
    trusted = np.where(against[:, None] > 0, 0, snr)
    shifts = np.zeros(len(snr), np.int64)
    if not against.any():
        return shifts
    everywhere = _seen_by_several(trusted)
    for beam in np.flatnonzero(against):
        around = _seen_by_several(trusted[near.beam[beam][near.beam[beam] >= 0]])
        shifts[beam] = shift_between(snr[beam], around if np.any(around > MIN_SNR) else everywhere)
        trusted[beam] = np.roll(snr[beam], -shifts[beam]) if shifts[beam] else 0
    paths = find_paths(trusted, near)
    still = np.maximum(contradictions(paths, trusted), lacking(paths, trusted))
    return np.where(still > 0, 0, shifts)


def _seen_by_several(snr: NDArray[np.float32]) -> NDArray[np.float32]:
    """Power over the noise (delay,) that `MIN_BEAMS` of the beams (beam, delay) see."""
    return np.partition(snr, -MIN_BEAMS, axis=0)[-MIN_BEAMS] if len(snr) >= MIN_BEAMS else np.zeros_like(snr[0])


def _mend_lost_samples(scan: Scan, delays: Delays) -> bool:
    """Shift back the directions after samples were lost."""
    order = scan.order.ravel()
    first, shift = lost_samples(delays, order)
    if not shift or not _shapes(scan).explain_loss(delays, order[delays.beam] >= first, shift):
        return False
    for beam in np.flatnonzero(order >= first):
        scan.roll(int(beam), shift)
    scan.remark(Code.SAMPLES_LOST, *scan.place(int(np.flatnonzero(order == first)[0])), shift, 0.0)
    return True


def _mend_drift(scan: Scan, delays: Delays) -> bool:
    """Remove the drift of the clock over the scan. The clock is right at the first direction."""
    order = scan.order
    drift, bound = clock_drift(delays, order.ravel())
    total = drift * order.size
    sample = 1 / scan.deembedding.sample_rate
    walk = 3 * scan.recording.sounder.clock.step / sample * np.sqrt(order.size)
    if abs(total) < max(LEAST_DRIFT, walk, bound * order.size):
        return False
    frequency = np.fft.fftfreq(scan.responses.shape[-1])
    ramp = np.exp(2j * np.pi * np.multiply.outer(drift * order, frequency))
    scan.responses[...] = np.fft.ifft(np.fft.fft(scan.responses) * ramp)
    scan.power[...] = np.abs(scan.responses) ** 2
    scan.delay_std = bound / -float(ndtri(DRIFT_FALSE_ALARM)) * order.size * sample
    figures = total * sample * 1e9, bound * order.size * sample * 1e9
    detail = f"the clock drifts by {figures[0]:+.2f} ns over the scan"
    scan.remarks.append(Remark(Code.CLOCK_DRIFT, figure=figures[0], bound=figures[1], detail=detail))
    return True
