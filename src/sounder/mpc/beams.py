"""The beams of the antenna at one end of a scan: where they look, and their pattern."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sounder.instrument.antenna_description import Antenna
from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.extraction.scan_view import AntennaView, beam_table
from sounder.mpc.directions import beam_directions, beam_gains
from sounder.mpc.pattern_slopes import Cuts

Real = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Beams:
    """Beams of an antenna, in the order of `sounder.mpc.directions.beam_directions`.

    Attributes
    ----------
    azimuth, elevation : array (azimuth,), (elevation,)
        Axes of the scan [degree].
    antenna : Antenna
    """

    azimuth: Real
    elevation: Real
    antenna: Antenna

    @property
    def size(self) -> int:
        """Number of beams."""
        return self.azimuth.size * self.elevation.size

    @cached_property
    def directions(self) -> Real:
        """Azimuth and elevation (beam, 2) [degree]."""
        return beam_directions(self.azimuth, self.elevation)

    @cached_property
    def pattern(self) -> Pattern:
        """Of the antenna."""
        return Pattern.of(self.antenna)

    @cached_property
    def cuts(self) -> Cuts:
        """Of the pattern, with their slopes."""
        return Cuts.of(self.pattern)

    @cached_property
    def beamwidth(self) -> Real:
        """Half-power beamwidths (2,) in azimuth and elevation [degree]; 360 and 180 for one without a lobe."""
        return np.array([self.antenna.hpbw_azimuth or 360.0, self.antenna.hpbw_elevation or 180.0])

    @property
    def margin(self) -> float:
        """Amplitude over the pattern's prediction that still counts as the same path."""
        return float(10 ** (self.antenna.margin_above / 20))

    @property
    def sidelobe_level(self) -> float:
        """Amplitude of the highest sidelobe, relative to boresight; 0 for an antenna without a lobe."""
        return float(10 ** (self.pattern.sidelobe_level / 20)) if self.pattern.directive else 0.0

    def gains(self, azimuth: Real, elevation: Real) -> Real:
        """Relative gains (path, beam) of the beams toward paths [dB]."""
        return beam_gains(azimuth, elevation, self.directions, self.pattern)

    def view(self, *, end: int, stride: int) -> AntennaView:
        """What the kernels need of the antenna.

        Parameters
        ----------
        end : int
            `ARRIVAL` or `DEPARTURE`.
        stride : int
            Links from one beam to the next.
        """
        step = float(np.diff(self.azimuth).max()) if self.azimuth.size > 1 else 0.0
        # The azimuths close a circle if the gap between last and first is a step of the scan, or hardly more.
        gap = self.azimuth[0] + 360 - self.azimuth[-1]
        return AntennaView(
            end=end,
            stride=stride,
            beams=beam_table(self.directions),
            azimuth_cut=self.cuts.azimuth,
            elevation_cut=self.cuts.elevation,
            floor=self.pattern.floor
            * np.log(10)
            / 20,  # differs from `Cuts.floor` in the last bit, which products show
            azimuths=self.azimuth.size,
            elevations=self.elevation.size,
            full_circle=bool(self.azimuth.size > 1 and gap <= 1.5 * step),
            azimuth_reach=max(step, self.beamwidth[0] / 2),
            lowest=self.elevation.min() - 2 * self.beamwidth[1],
            highest=self.elevation.max() + 2 * self.beamwidth[1],
            beamwidth=self.beamwidth[1],
            azimuth_resolution=self.beamwidth[0] / 2,
            elevation_resolution=self.beamwidth[1],
        )


ONE_BEAM = Beams(np.zeros(1), np.zeros(1), Antenna(gain=0.0, pattern="flat"))
"""Of an antenna that was not turned: whatever it does to a path is part of the path's gain."""
