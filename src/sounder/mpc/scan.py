"""Data of one scan for the extraction: samples, noise and pattern of all beams. Built once, read by every step."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Self

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sounder.cir.deembedding import Deembedding
from sounder.cir.matched_filter import OVERSAMPLING
from sounder.cir.power_spectrum import looks_of, noise_power
from sounder.instrument.antenna_description import Antenna
from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import Sounder
from sounder.kernels.extraction.records import ARRIVAL, ARTEFACT, DEPARTURE
from sounder.kernels.extraction.scan_view import ScanView, link_table
from sounder.mpc.beams import ONE_BEAM, Beams
from sounder.mpc.directions import wrap
from sounder.mpc.pattern_slopes import Cuts
from sounder.mpc.threshold import detection_threshold, independent_samples
from sounder.mpc.whitened_samples import CentredPulse, WindowPulse
from sounder.options import Threshold

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Integers = NDArray[np.int64]

CANCELLATION_RESIDUAL = 0.1
"""Amplitude that cancellation may leave of a path in the beams of its main lobe, relative to the path (-20 dB)."""


@dataclass(frozen=True, eq=False)
class Scan:
    """The links of a position: all beams of the arrival for each beam of the departure.

    Where the transmit antenna was not turned, it has one beam, and links and beams are the same. Beams are in the order
    of `sounder.mpc.directions.beam_directions`.

    Attributes
    ----------
    cir : array complex64 (link, delay)
        CIRs; NaN where nothing was recorded.
    azimuth, elevation : array (azimuth,), (elevation,)
        Axes of the scan at arrival [degree].
    noise : array (link,)
        Mean noise power; NaN where nothing was recorded.
    threshold : array (link,)
        Least power of a path; infinite where nothing was recorded.
    filter_ : Deembedding
        The filter that made the CIRs. Its pulse is the shape of a path.
    sounder : Sounder
        Description of the receive antenna, the clock, and the copies that the instrument makes of paths.
    departure : Beams
        Those of the transmit antenna.
    """

    cir: NDArray[np.complex64]
    azimuth: Real
    elevation: Real
    noise: Real
    threshold: Real
    filter_: Deembedding
    sounder: Sounder
    departure: Beams = ONE_BEAM

    @classmethod
    def of(cls, cir: xr.Dataset, filter_: Deembedding, sounder: Sounder, threshold: str | Threshold = "cfar") -> Self:
        """Read the CIRs of a position.

        Parameters
        ----------
        cir : xarray.Dataset
            ``cir`` (azimuth, elevation, delay), or (tx_azimuth, tx_elevation, azimuth, elevation, delay).
        filter_ : Deembedding
        sounder : Sounder
        threshold : str or Threshold
            See :func:`sounder.mpc.threshold.detection_threshold`.
        """
        azimuth, elevation = (cir[axis].values.astype(float) for axis in ("azimuth", "elevation"))
        departure = ONE_BEAM
        if "tx_azimuth" in cir.dims:
            tx_azimuth, tx_elevation = (cir[axis].values.astype(float) for axis in ("tx_azimuth", "tx_elevation"))
            departure = Beams(tx_azimuth, tx_elevation, sounder.tx_antenna)
        links = departure.size * azimuth.size * elevation.size
        beams = np.ascontiguousarray(cir["cir"].values.reshape(links, -1), np.complex64)
        looks = looks_of(cir)
        noise = noise_power(np.abs(beams) ** 2, looks).astype(float)
        independent = independent_samples(filter_)
        least = detection_threshold(beams, noise, Threshold.of(threshold), independent=independent, looks=looks)
        return cls(beams, azimuth, elevation, noise, least, filter_, sounder, departure)

    @property
    def period(self) -> int:
        """Delays of a CIR [sample]."""
        return self.cir.shape[1]

    @cached_property
    def arrival(self) -> Beams:
        """Beams of the receive antenna."""
        return Beams(self.azimuth, self.elevation, self.sounder.rx_antenna)

    @property
    def directions(self) -> Real:
        """Azimuth and elevation (beam, 2) at arrival [degree]."""
        return self.arrival.directions

    @cached_property
    def recorded(self) -> Integers:
        """Numbers of the links that were recorded."""
        return np.flatnonzero(np.isfinite(self.noise))

    @property
    def pattern(self) -> Pattern:
        """Of the receive antenna."""
        return self.arrival.pattern

    @property
    def cuts(self) -> Cuts:
        """Of the pattern of the receive antenna, with their slopes."""
        return self.arrival.cuts

    @property
    def antenna(self) -> Antenna:
        """The receive antenna."""
        return self.sounder.rx_antenna

    @property
    def pattern_margin(self) -> float:
        """Amplitude over the receive pattern's prediction that still counts as the same path."""
        return self.arrival.margin

    @property
    def beamwidth(self) -> Real:
        """Half-power beamwidths (2,) of the receive antenna [degree]."""
        return self.arrival.beamwidth

    @cached_property
    def elevation_range(self) -> Real:
        """Lowest and highest elevation (2,) of the recorded beams [degree]."""
        elevation = self.directions[self.recorded, 1]
        return np.array([elevation.min(), elevation.max()]) if elevation.size else np.zeros(2)

    @cached_property
    def fan(self) -> Real:
        """Lowest and highest elevation (2,) in the main lobe of a recorded beam [degree]."""
        return self.elevation_range + self.beamwidth[1] / 2 * np.array([-1, 1])

    @cached_property
    def resolution(self) -> float:
        """Resolution in delay: the inverse of the band kept [sample]."""
        return float(1 / np.ptp(np.fft.fftfreq(self.filter_.weight.size)[self.filter_.weight > 0]))

    @cached_property
    def centred_pulse(self) -> CentredPulse:
        """Whitened pulse about a delay."""
        return CentredPulse.of(self.filter_.matched_filter, self.filter_.noise)

    @cached_property
    def window_pulse(self) -> Callable[[int], WindowPulse]:
        """Whitened pulse in a window of so many samples."""
        return cache(lambda size: WindowPulse.of(self.filter_.matched_filter, self.filter_.noise, size))

    def recorded_beams(self, end: int) -> NDArray[np.bool_]:
        """Whether each beam of the antenna at an end, `ARRIVAL` or `DEPARTURE`, was recorded in any link."""
        links = np.isfinite(self.noise).reshape(self.departure.size, self.arrival.size)
        recorded: NDArray[np.bool_] = np.any(links, axis=0 if end == ARRIVAL else 1)
        return recorded

    def delay_after(self, delay: Real, reference: Real | float) -> Real:
        """Delays after a reference [sample], the short way round."""
        return wrap(delay - reference, self.period)

    def gains(self, azimuth: Real, elevation: Real) -> Real:
        """Relative gains (path, beam) of all beams of the receive antenna toward paths [dB]."""
        return self.arrival.gains(azimuth, elevation)

    def pulse_at(self, lag: Real) -> Complex:
        """Pulse of a path of amplitude 1 at lags (...) after its delay [sample]: the nearest point of its table."""
        pulse = self.filter_.matched_filter.pulse
        point = np.rint(lag * OVERSAMPLING).astype(int) + pulse.size // 2
        inside = (point >= 0) & (point < pulse.size)
        return np.where(inside, pulse[np.where(inside, point, 0)], 0)

    def overlaps(self, delay: Real, first: int, last: int) -> Integers:
        """Paths whose pulse reaches into ``first`` to ``last``, for delays (path,) on the same scale [sample]."""
        reach = self.filter_.matched_filter.pulse.size / OVERSAMPLING / 2
        return np.flatnonzero((delay > first - reach) & (delay < last + reach))

    def view(self, *, removes: bool) -> ScanView:
        """What the kernels need of the scan.

        Parameters
        ----------
        removes : bool
            Whether paths are subtracted from the beams. One that stays enters all beams through their sidelobes.
        """
        copies, rate, ends = self.sounder.processing.artefact, self.filter_.sample_rate, (self.arrival, self.departure)
        margin = max(end.margin for end in ends)
        return ScanView(
            links=link_table(self.noise, self.threshold),
            arrival=self.arrival.view(end=ARRIVAL, stride=1),
            departure=self.departure.view(end=DEPARTURE, stride=self.arrival.size),
            pulse=self.filter_.matched_filter.pulse,
            matched=self.filter_.matched_filter.taps,
            artefacts=np.array([(copy.delay * rate, 10 ** (copy.level / 20)) for copy in copies], ARTEFACT),
            oversampling=OVERSAMPLING,
            amplitude_variance=self.filter_.matched_filter.amplitude_variance,
            margin_above=margin,
            margin_below=float(10 ** (max(end.antenna.margin_below for end in ends) / 20)),
            delay_resolution=self.resolution,
            remainder=CANCELLATION_RESIDUAL if removes else margin,
            sidelobe_remainder=margin if removes else 0.0,
            sidelobe_level=max(end.sidelobe_level for end in ends) if removes else 0.0,
        )
