"""Antenna patterns: gain off boresight, and the angles of a direction off boresight."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sounder.instrument.antenna_cut import between_rows
from sounder.instrument.antenna_description import Antenna

ANGLE_STEP = 0.25
"""Spacing of the tabulated cuts [degree]. A Gaussian lobe of 10 degree is then wrong by less than 0.002 dB."""

Angles = NDArray[np.float64]


@dataclass(frozen=True)
class Pattern:
    """Relative gain of an antenna, separable in its own azimuth and elevation.

    ``g(x, y) = max(azimuth_cut(x) + elevation_cut(y), floor)`` [dB] is zero at boresight. The cuts are tabulated every
    :data:`ANGLE_STEP` from -180 to 180 degree, measured ones by :func:`~sounder.instrument.antenna_cut.between_rows`,
    and linear in dB between. The product of the principal cuts is exact for
    an aperture whose illumination is a product, such as a pyramidal horn.

    Attributes
    ----------
    gain : float
        Boresight gain [dBi].
    azimuth_cut, elevation_cut : array (angle,)
        Principal cuts [dB].
    floor : float
        Lower limit of the relative gain [dB].

    References
    ----------
    Balanis, Antenna Theory, 4th ed., 2016, sections 12.5 and 13.4.
    """

    gain: float
    azimuth_cut: Angles
    elevation_cut: Angles
    floor: float

    @classmethod
    def of(cls, antenna: Antenna) -> "Pattern":
        """Tabulate the pattern of a described antenna."""
        angle = _angles()
        if antenna.pattern == "flat":
            return cls(antenna.gain, np.zeros_like(angle), np.zeros_like(angle), 0.0)
        if antenna.cut is not None:
            cuts = [between_rows(angle, antenna.cut.angle, cut) for cut in (antenna.cut.azimuth, antenna.cut.elevation)]
            cuts = [cut - cut[angle.size // 2] for cut in cuts]
        else:
            # exp(-4 ln 2 (x/hpbw)^2) in power is -3.01 dB at half the beamwidth: 12 dB times (x/hpbw)^2.
            cuts = [-12.0 * (angle / (hpbw or 360.0)) ** 2 for hpbw in (antenna.hpbw_azimuth, antenna.hpbw_elevation)]
        return cls(antenna.gain, cuts[0], cuts[1], antenna.sidelobe_floor)

    @property
    def directive(self) -> bool:
        """Whether the gain depends on direction."""
        return self.floor < 0

    @property
    def sidelobe_level(self) -> float:
        """Highest relative gain [dB] outside the main lobe in either cut; the floor if there are no sidelobes."""
        levels = [self.floor]
        middle = self.azimuth_cut.size // 2
        for cut in (self.azimuth_cut, self.elevation_cut):
            for side in (cut[middle:], cut[middle::-1]):
                rises = np.flatnonzero(np.diff(side) > 0)
                if rises.size:
                    levels.append(float(side[rises[0] :].max()))
        return max(levels)

    def relative_gain(self, azimuth: Angles, elevation: Angles) -> Angles:
        """Gain relative to boresight [dB] at angles off boresight [degree]; shapes broadcast."""
        angle = _angles()
        total = np.interp(azimuth, angle, self.azimuth_cut) + np.interp(elevation, angle, self.elevation_cut)
        return np.maximum(total, self.floor)

    def beam_gain(
        self, azimuth: Angles, elevation: Angles, boresight_azimuth: Angles, boresight_elevation: Angles
    ) -> Angles:
        """Relative gain [dB] toward a direction when the antenna is pointed at another; shapes broadcast.

        Examples
        --------
        >>> from sounder import load_sounder, shipped
        >>> horn = Pattern.of(load_sounder(shipped.calibration("sounder-132ghz.toml")).rx_antenna)
        >>> float(horn.beam_gain(65.0, 0.0, 70.0, 0.0).round(1))  # half the beamwidth off boresight
        -3.0
        """
        return self.relative_gain(*off_boresight(azimuth, elevation, boresight_azimuth, boresight_elevation))


def _angles() -> Angles:
    """Angles of the tabulated cuts [degree]."""
    return np.arange(-180, 180 + ANGLE_STEP / 2, ANGLE_STEP)


def off_boresight(
    azimuth: Angles, elevation: Angles, boresight_azimuth: Angles, boresight_elevation: Angles
) -> tuple[Angles, Angles]:
    """Angles of a direction in the frame of an antenna that is pointed at another direction.

    The antenna is turned about the vertical, then tilted. Its frame has x along boresight, y to the left and z up.

    Parameters
    ----------
    azimuth, elevation : array (...)
        Direction [degree].
    boresight_azimuth, boresight_elevation : array (...)
        Direction that the antenna is pointed at [degree].

    Returns
    -------
    azimuth, elevation : array (...)
        ``atan2(y, x)`` and ``asin(z)`` [degree].
    """
    relative = np.radians(np.asarray(azimuth) - boresight_azimuth)
    up, tilt = np.radians(elevation), np.radians(boresight_elevation)
    x = np.cos(up) * np.cos(relative) * np.cos(tilt) + np.sin(up) * np.sin(tilt)
    y = np.cos(up) * np.sin(relative)
    z = np.sin(up) * np.cos(tilt) - np.cos(up) * np.cos(relative) * np.sin(tilt)
    return np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(np.clip(z, -1, 1)))
