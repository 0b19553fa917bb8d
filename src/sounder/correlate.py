"""Captures to calibrated channel impulse responses (CIR)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from erm.errors import DataError
from sounder.calibration import Deembedding, deembedding
from sounder.kernels.average import MSequenceCorrelator
from sounder.kernels.rails import count_rails
from sounder.recording import BackToBack, Captures, Recording
from sounder.waveform import chips

Averaging = Literal["coherent", "phase-aligned", "power"]

CLIPPED = 1e-3
"""Fraction of numbers at the converter's ends from which a direction counts as clipped."""


@dataclass(frozen=True)
class Problem:
    """What is wrong with one direction, and whether it was still used."""

    azimuth: float
    elevation: float
    what: str


def calibrate(b2b: BackToBack, recording: Recording) -> Deembedding:
    """Make the de-embedding filter of a recording from its back-to-back captures.

    Raises
    ------
    DataError
        The two do not belong together; see :func:`sounder.calibration.deembedding`.
    """
    waveform = recording.sounder.waveform
    captures = b2b.captures
    complex_captures = captures if captures.dtype.kind == "c" else captures[..., 0] + 1j * captures[..., 1]
    mean = complex_captures.mean(axis=0, dtype=complex)
    if mean.size == waveform.samples:
        mean = MSequenceCorrelator(chips(waveform), waveform.samples_per_chip).correlate_mean(mean)
    return deembedding(b2b, mean, recording.sounder, recording.scale_factor)


def impulse_responses(
    recording: Recording,
    filter_: Deembedding,
    *,
    averaging: Averaging = "coherent",
    progress: Callable[[], None] | None = None,
) -> tuple[xr.Dataset, list[Problem]]:
    """Correlate, average and de-embed every direction of a recording.

    Parameters
    ----------
    recording : Recording
    filter_ : Deembedding
        From :func:`calibrate`.
    averaging : {"coherent", "phase-aligned", "power"}
        Over the snapshots of a direction: the mean; the mean after each snapshot's common phase is turned to the
        others' (for a drifting oscillator); or the root of the mean power with the phase of the coherent mean (for a
        channel that moves between snapshots).
    progress : callable, optional
        Called after each direction.

    Returns
    -------
    dataset : xarray.Dataset
        ``cir`` (azimuth, elevation, delay), complex amplitude gain including the receive antenna, NaN where nothing
        was recorded; ``delay`` is the propagation delay [s], modulo the sequence's period.
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
    problems: list[Problem] = []
    for e, a in np.argwhere(recording.valid.T):
        captures = recording.captures(int(a), int(e))
        problem = _health(captures)
        if problem:
            problems.append(Problem(float(recording.azimuth[a]), float(recording.elevation[e]), problem))
        if problem != ZERO:
            gain = 10 ** (-recording.agc_gain[a, e] / 20)
            cir[a, e] = _direction(captures, correlator, filter_, averaging) * gain
        if progress is not None:
            progress()
    if np.isnan(cir).all():
        raise DataError(f"{recording.source}: {recording.name}: all samples are zero; record the position again")
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
    return dataset, problems


ZERO = "all samples are zero; left out"
AZIMUTH = {"units": "degree", "long_name": "horn azimuth, counter-clockwise from east"}
ELEVATION = {"units": "degree", "long_name": "horn elevation above the horizon"}
DELAY = {"units": "s", "long_name": "propagation delay"}


def _health(captures: Captures) -> str | None:
    if not captures.any():
        return ZERO
    if captures.dtype == np.int16:
        clipped = count_rails(np.ascontiguousarray(captures, np.int16).reshape(-1)) / captures.size
        if clipped > CLIPPED:
            return f"{100 * clipped:.1f} % of the samples are clipped; lower the receiver gain"
    return None


def _direction(
    captures: Captures, correlator: MSequenceCorrelator, filter_: Deembedding, averaging: Averaging
) -> NDArray[np.complex128]:
    """Averaged CIR of one direction, complex (sample,)."""
    if averaging == "coherent":
        return filter_.apply(correlator.average(captures)[0])
    each = correlator.correlate(captures).astype(complex)
    if averaging == "phase-aligned":
        return filter_.apply(_aligned_mean(each))
    responses = filter_.apply(each)
    return np.sqrt(np.mean(np.abs(responses) ** 2, axis=0)) * np.exp(1j * np.angle(responses.mean(axis=0)))


def _aligned_mean(each: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Mean after turning each snapshot to the common phase, by its inner product with the mean so far."""
    reference = each[0]
    for _ in range(2):  # the second pass aligns to the mean instead of one noisy snapshot
        turn = np.exp(-1j * np.angle(each @ np.conj(reference)))
        reference = (each * turn[:, None]).mean(axis=0)
    return reference
