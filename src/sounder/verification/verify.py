"""Errors of a sounder against known artefacts, with their standard deviations."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from erm.common.constants import c
from erm.common.errors import DataError
from sounder.cir.deembedding import Deembedding
from sounder.cir.impulse_response import calibrate
from sounder.instrument.touchstone import read_s21
from sounder.quality.back_to_back import loss
from sounder.recordings import native
from sounder.recordings.open import open_recordings
from sounder.recordings.recording import BackToBack
from sounder.verification.description import Artefact, Verification
from sounder.verification.links import expected_link, measured_link
from sounder.verification.transfer import Transfer, dynamic_range, known_transmission, measured_transfer

COVERAGE = 2.0
"""Standard deviations within which an error agrees with none: 95 % (GUM, JCGM 100:2008)."""
UNITS = {"delay": "s", "gain": "dB", "linearity": "dB/dB", "repeatability of gain": "dB", "dynamic range": "dB"}

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Figure:
    """One figure of merit of a sounder.

    Attributes
    ----------
    artefact, quantity : str
    expected, measured : float
        NaN where nothing is expected, as of the dynamic range.
    std : float
        Standard deviation of the difference: of snapshots, calibration, and what is known of the artefact; NaN if it is
        not known.
    """

    artefact: str
    quantity: str
    expected: float
    measured: float
    std: float

    @property
    def unit(self) -> str:
        """Unit of the figure."""
        return UNITS[self.quantity]

    @property
    def error(self) -> float:
        """Measured less expected; the figure itself where nothing is expected."""
        return self.measured - (0.0 if np.isnan(self.expected) else self.expected)

    @property
    def agrees(self) -> bool | None:
        """Whether the error is within `COVERAGE` standard deviations; None where nothing is expected."""
        return None if np.isnan(self.expected) else bool(abs(self.error) <= COVERAGE * self.std)


@dataclass(frozen=True)
class Verified:
    """Figures of a verification, and what its linearity was fitted to.

    Attributes
    ----------
    verification : Verification
    figures : tuple of Figure
    sounder : str
        Name of the sounder.
    levels : array (device, 3)
        Expected and measured gain, and standard deviation of the difference [dB], of all connected devices.
    """

    verification: Verification
    figures: tuple[Figure, ...]
    sounder: str
    levels: Real

    @property
    def disagreeing(self) -> list[Figure]:
        """Figures that disagree with what is known."""
        return [figure for figure in self.figures if figure.agrees is False]


def verify(verification: Verification) -> Verified:
    """Measure known artefacts, and compare them with what is known of them.

    The standard deviation of an error has three parts: the scatter of the snapshots of artefact and calibration over
    the root of their number, or the scatter of several recordings where that is more; what the description of the
    sounder states about the back-to-back connection; and what is stated about the artefact.

    Raises
    ------
    DataError
        A file cannot be used, or does not belong to the sounder of the calibration.
    """
    b2b = native.back_to_back(verification.calibration)
    own = _own_scatter(b2b)
    figures: list[Figure] = []
    levels: list[tuple[float, float, float]] = [(-loss(b2b, b2b.sounder), -loss(b2b, b2b.sounder), own[1])]
    for artefact in verification.artefacts:
        if artefact.kind == "connected":
            found = list(_connected(artefact, b2b, own))
            levels += [(one.expected, one.measured, one.std) for one in found if one.quantity == "gain"]
            figures += found
        else:
            figures += _link(artefact, b2b)
    table = np.array(levels)
    figures += _linearity(table)
    return Verified(verification, tuple(figures), b2b.sounder.name, table)


def _own_scatter(b2b: BackToBack) -> tuple[float, float]:
    """Standard errors of delay [s] and gain [dB] of the mean of the calibration."""
    sounder = b2b.sounder
    scatter = measured_transfer(
        b2b, _calibration(b2b, b2b), known_transmission(sounder, b2b.s21, b2b.attenuation, None)
    )
    return _standard_error(scatter.delay), _standard_error(scatter.gain)


def _calibration(b2b: BackToBack, artefact: BackToBack) -> Deembedding:
    if b2b.sounder.waveform != artefact.sounder.waveform or b2b.sounder.carrier != artefact.sounder.carrier:
        raise DataError(f"{artefact.source}: recorded by another sounder than the calibration {b2b.source}")
    return calibrate(b2b, artefact)


def _standard_error(values: Real) -> float:
    return float(np.std(values, ddof=1) / np.sqrt(values.size)) if values.size > 1 else 0.0


def _connected(artefact: Artefact, b2b: BackToBack, own: tuple[float, float]) -> Iterator[Figure]:
    """Errors of delay and gain of a connected device, its repeatability, and the dynamic range."""
    half = b2b.sounder.bandwidth / 2
    band = b2b.sounder.carrier.frequency - half, b2b.sounder.carrier.frequency + half
    s21 = None if artefact.s21 is None else read_s21(artefact.s21, band=band)
    known = known_transmission(b2b.sounder, s21, artefact.attenuation, artefact.delay)
    devices = [native.back_to_back(path) for path in artefact.recordings]
    transfers = [measured_transfer(device, _calibration(b2b, device), known) for device in devices]
    mean, error = _combined(transfers)
    connection = b2b.sounder.back_to_back
    if s21 is not None or artefact.delay is not None:
        expected = _group_delay(known, b2b)
        std = _norm(error.delay[0], own[0], connection.delay_std, artefact.delay_std)
        yield Figure(artefact.name, "delay", expected, expected + mean.delay[0], std)
    at_carrier = float(20 * np.log10(np.abs(known[0])))
    std = _norm(error.gain[0], own[1], connection.attenuation_std, artefact.gain_std)
    yield Figure(artefact.name, "gain", at_carrier, at_carrier + mean.gain[0], std)
    if len(devices) > 1:
        spread = float(np.std([np.mean(one.gain) for one in transfers], ddof=1))
        # the relative standard deviation of one from n values, GUM E.4.3
        yield Figure(artefact.name, "repeatability of gain", np.nan, spread, spread / np.sqrt(2 * (len(devices) - 1)))
    ranges = np.array([dynamic_range(device) for device in devices])
    spread = _standard_error(ranges) if len(devices) > 1 else np.nan
    yield Figure(artefact.name, "dynamic range", np.nan, float(ranges.mean()), spread)


def _combined(transfers: Sequence[Transfer]) -> tuple[Transfer, Transfer]:
    """Means over all recordings, and their standard errors: of the snapshots, or of the recordings if that is more."""
    means, errors = [], []
    for name in ("delay", "gain"):
        each = [getattr(one, name) for one in transfers]
        of_snapshots = _norm(*(_standard_error(values) for values in each)) / len(each)
        averages = np.array([values.mean() for values in each])
        means.append(np.array([averages.mean()]))
        errors.append(np.array([max(of_snapshots, _standard_error(averages))]))
    return Transfer(*means), Transfer(*errors)


def _group_delay(known: NDArray[np.complex128], b2b: BackToBack) -> float:
    """Delay of a known transmission: slope of its phase over the band [s]."""
    frequency = np.fft.fftfreq(known.size, 1 / b2b.sounder.waveform.sample_rate)
    order = np.argsort(frequency)
    inside = order[np.abs(frequency[order]) <= b2b.sounder.bandwidth / 2]
    slope = np.polyfit(frequency[inside], np.unwrap(np.angle(known[inside])), 1)[0]
    return float(-slope / (2 * np.pi))


def _link(artefact: Artefact, b2b: BackToBack) -> Iterator[Figure]:
    """Errors of delay and gain of a link of known length."""
    measured = []
    for path in artefact.recordings:
        for recording in open_recordings(path):
            delay, gain = expected_link(artefact, recording.sounder.carrier.frequency)
            measured.append(measured_link(recording, calibrate(b2b, recording), delay))
    delays, delay_stds, gains, gain_stds = np.array(measured).T
    if np.isnan(delays).any():
        raise DataError(f"{artefact.name}: no path within five resolution cells of {delay * 1e9:.2f} ns was found")
    ways = 1 if artefact.side is None else 2
    per_metre = (20 if artefact.side is None else 40) / np.log(10) / (artefact.distance or 1.0)
    for quantity, expected, values, stds, known in (
        ("delay", delay, delays, delay_stds, np.hypot(artefact.delay_std, ways * artefact.distance_std / c)),
        ("gain", gain, gains, gain_stds, np.hypot(artefact.gain_std, per_metre * artefact.distance_std)),
    ):
        own = max(_norm(*stds) / len(stds), _standard_error(values))
        yield Figure(artefact.name, quantity, expected, float(values.mean()), _norm(own, float(known)))
    if len(measured) > 1:
        spread = float(np.std(gains, ddof=1))
        yield Figure(artefact.name, "repeatability of gain", np.nan, spread, spread / np.sqrt(2 * (len(gains) - 1)))


def _linearity(levels: Real) -> list[Figure]:
    """Slope of the measured over the expected gain of connected devices [dB/dB]: 1 for a linear receiver.

    Weighted least squares with an offset, which the gain error of the calibration is.
    """
    expected, measured, std = levels.T
    if np.unique(np.round(expected, 3)).size < 2:
        return []
    weight = 1 / np.maximum(std, 1e-6) ** 2
    centre = np.average(expected, weights=weight)
    moment = np.sum(weight * (expected - centre) ** 2)
    slope = float(np.sum(weight * (expected - centre) * measured) / moment)
    return [Figure("connected devices", "linearity", 1.0, slope, float(1 / np.sqrt(moment)))]


def _norm(*parts: float) -> float:
    """Root of the sum of squares."""
    return float(np.sqrt(np.sum(np.square(parts))))
