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
from sounder.kernels.extraction.records import ARTEFACT
from sounder.kernels.extraction.scan_view import ScanView, beam_table
from sounder.mpc.directions import beam_directions, beam_gains, wrap
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
    """The beams of a position.

    Beams are in the order of `sounder.mpc.directions.beam_directions`.

    Attributes
    ----------
    cir : array complex64 (beam, delay)
        CIRs; NaN where nothing was recorded.
    azimuth, elevation : array (azimuth,), (elevation,)
        Axes of the scan [degree].
    noise : array (beam,)
        Mean noise power; NaN where nothing was recorded.
    threshold : array (beam,)
        Least power of a path; infinite where nothing was recorded.
    filter_ : Deembedding
        The filter that made the CIRs. Its pulse is the shape of a path.
    sounder : Sounder
        Description of the receive antenna, the clock, and the copies that the instrument makes of paths.
    """

    cir: NDArray[np.complex64]
    azimuth: Real
    elevation: Real
    noise: Real
    threshold: Real
    filter_: Deembedding
    sounder: Sounder

    @classmethod
    def of(cls, cir: xr.Dataset, filter_: Deembedding, sounder: Sounder, threshold: str | Threshold = "cfar") -> Self:
        """Read the CIRs of a position.

        Parameters
        ----------
        cir : xarray.Dataset
            ``cir`` (azimuth, elevation, delay).
        filter_ : Deembedding
        sounder : Sounder
        threshold : str or Threshold
            See :func:`sounder.mpc.threshold.detection_threshold`.
        """
        azimuth, elevation = (cir[axis].values.astype(float) for axis in ("azimuth", "elevation"))
        beams = np.ascontiguousarray(cir["cir"].values.reshape(azimuth.size * elevation.size, -1), np.complex64)
        looks = looks_of(cir)
        noise = noise_power(np.abs(beams) ** 2, looks).astype(float)
        independent = independent_samples(filter_)
        least = detection_threshold(beams, noise, Threshold.of(threshold), independent=independent, looks=looks)
        return cls(beams, azimuth, elevation, noise, least, filter_, sounder)

    @property
    def period(self) -> int:
        """Delays of a CIR [sample]."""
        return self.cir.shape[1]

    @cached_property
    def directions(self) -> Real:
        """Azimuth and elevation (beam, 2) [degree]."""
        return beam_directions(self.azimuth, self.elevation)

    @cached_property
    def recorded(self) -> Integers:
        """Numbers of the beams that were recorded."""
        return np.flatnonzero(np.isfinite(self.noise))

    @cached_property
    def pattern(self) -> Pattern:
        """Of the receive antenna."""
        return Pattern.of(self.antenna)

    @cached_property
    def cuts(self) -> Cuts:
        """Of the pattern, with their slopes."""
        return Cuts.of(self.pattern)

    @property
    def antenna(self) -> Antenna:
        """The receive antenna."""
        return self.sounder.rx_antenna

    @property
    def pattern_margin(self) -> float:
        """Amplitude over the pattern's prediction that still counts as the same path."""
        return float(10 ** (self.antenna.margin_above / 20))

    @cached_property
    def beamwidth(self) -> Real:
        """Half-power beamwidths (2,) in azimuth and elevation [degree]; 360 and 180 for one without a lobe."""
        return np.array([self.antenna.hpbw_azimuth or 360.0, self.antenna.hpbw_elevation or 180.0])

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

    def delay_after(self, delay: Real, reference: Real | float) -> Real:
        """Delays after a reference [sample], the short way round."""
        return wrap(delay - reference, self.period)

    def gains(self, azimuth: Real, elevation: Real) -> Real:
        """Relative gains (path, beam) of all beams toward paths [dB]."""
        return beam_gains(azimuth, elevation, self.directions, self.pattern)

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
        step = float(np.diff(self.azimuth).max()) if self.azimuth.size > 1 else 0.0
        # The azimuths close a circle if the gap between last and first is a step of the scan, or hardly more.
        gap = self.azimuth[0] + 360 - self.azimuth[-1]
        copies = self.sounder.processing.artefact
        rate = self.filter_.sample_rate
        sidelobes = 10 ** (self.pattern.sidelobe_level / 20) if self.pattern.directive else 0.0
        return ScanView(
            beams=beam_table(self.noise, self.threshold, self.directions),
            azimuth_cut=self.cuts.azimuth,
            elevation_cut=self.cuts.elevation,
            pulse=self.filter_.matched_filter.pulse,
            matched=self.filter_.matched_filter.taps,
            artefacts=np.array([(copy.delay * rate, 10 ** (copy.level / 20)) for copy in copies], ARTEFACT),
            oversampling=OVERSAMPLING,
            azimuths=self.azimuth.size,
            elevations=self.elevation.size,
            full_circle=bool(self.azimuth.size > 1 and gap <= 1.5 * step),
            azimuth_reach=max(step, self.beamwidth[0] / 2),
            lowest=self.elevation.min() - 2 * self.beamwidth[1],
            highest=self.elevation.max() + 2 * self.beamwidth[1],
            beamwidth=self.beamwidth[1],
            floor=self.pattern.floor
            * np.log(10)
            / 20,  # differs from `Cuts.floor` in the last bit, which products show
            amplitude_variance=self.filter_.matched_filter.amplitude_variance,
            margin_above=self.pattern_margin,
            margin_below=float(10 ** (self.antenna.margin_below / 20)),
            delay_resolution=self.resolution,
            azimuth_resolution=self.beamwidth[0] / 2,
            elevation_resolution=self.beamwidth[1],
            remainder=CANCELLATION_RESIDUAL if removes else self.pattern_margin,
            sidelobe_remainder=self.pattern_margin if removes else 0.0,
            sidelobe_level=sidelobes if removes else 0.0,
        )
