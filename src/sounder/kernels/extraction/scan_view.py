"""What beams see a path with: their directions, the antenna's pattern, the pulse and its matched filter."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import part

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

NOISE, LOOK_AZIMUTH, LOOK_ELEVATION, COS_AZIMUTH, SIN_AZIMUTH, COS_ELEVATION, SIN_ELEVATION = range(7)
"""Columns of `View.beam`: mean noise power, NaN for beams that were not recorded, and where the beam looks [degree]."""
GAIN, SLOPE = 0, 1
REACH, LOWEST, HIGHEST, BEAMWIDTH, FLOOR, SPREAD = range(6)
"""Entries of `View.limits`."""
N_AZIMUTHS, N_ELEVATIONS, AROUND, OVER = range(4)
"""Entries of `View.grid`."""
RADIANS = math.pi / 180.0


class View(NamedTuple):
    """What the beams see a path with.

    Attributes
    ----------
    beam : array (beam, 7)
        Noise and direction of each beam, azimuth-major.
    azimuth_cut, elevation_cut : array (2, angle)
        The pattern [neper] tabulated evenly from -180 to 180 degree, linear between, and its slope [neper/radian].
    pulse, matched : array complex (point,)
        The pulse of a path of amplitude 1, and the filter that measures the amplitude, conjugated;
        ``grid[OVER]`` points a sample.
    limits : array (6,)
        How far from its beam a path may be fitted in azimuth; lowest and highest elevation; half-power beamwidth in
        elevation [degree]; the pattern's floor [neper]; variance of a measured amplitude, in noise powers.
    grid : array (4,)
        Number of azimuths and elevations, whether the azimuths close a circle, and points of the pulse a sample.
    """

    beam: Real
    azimuth_cut: Real
    elevation_cut: Real
    pulse: Complex
    matched: Complex
    limits: Real
    grid: npt.NDArray[np.int64]


def table_of(cut: Real) -> Real:
    """Gain [neper] and slope [neper/radian] of a cut [dB], shape (2, angle): slopes are central differences."""
    gain = np.log(10) / 20 * cut
    return np.stack([gain, np.gradient(gain, 2 * np.pi / (cut.size - 1))])


def beams_of(noise: Real, looks: Real) -> Real:
    """Rows of `View.beam` from noise powers (beam,) and directions (beam, 2) [degree]."""
    turn, tilt = np.radians(looks.T)
    return np.column_stack([noise, looks, np.cos(turn), np.sin(turn), np.cos(tilt), np.sin(tilt)])


@part
def aim(azimuth: float, elevation: float, direction: Real) -> None:
    """Fill ``direction`` (4,) with cosine and sine of an azimuth and an elevation [degree]."""
    direction[0], direction[1] = math.cos(azimuth * RADIANS), math.sin(azimuth * RADIANS)
    direction[2], direction[3] = math.cos(elevation * RADIANS), math.sin(elevation * RADIANS)


@part
def pattern(view: View, direction: Real, b: int, slopes: Real) -> float:
    """Amplitude of a beam's pattern toward a direction, from `aim`, relative to its boresight.

    ``slopes`` (2,) is filled with its derivatives by azimuth and elevation [1/degree]. The plain-numpy twin is
    :meth:`sounder.instrument.antenna_pattern.Pattern.beam_gain`.
    """
    beam = view.beam
    cos_up, sin_up = direction[2], direction[3]
    # cosine and sine of the turn between them
    ahead = direction[0] * beam[b, COS_AZIMUTH] + direction[1] * beam[b, SIN_AZIMUTH]
    aside = direction[1] * beam[b, COS_AZIMUTH] - direction[0] * beam[b, SIN_AZIMUTH]
    cos_tilt, sin_tilt = beam[b, COS_ELEVATION], beam[b, SIN_ELEVATION]
    x = cos_up * ahead * cos_tilt + sin_up * sin_tilt
    y = cos_up * aside
    z = sin_up * cos_tilt - cos_up * ahead * sin_tilt
    level2 = x * x + y * y
    level = math.sqrt(level2)
    points = view.azimuth_cut.shape[1] - 1
    place = (math.atan2(y, x) / (2 * math.pi) + 0.5) * points
    left = int(place)
    if left >= points:
        left = points - 1
    right = place - left
    gain = view.azimuth_cut[GAIN, left] * (1 - right) + view.azimuth_cut[GAIN, left + 1] * right
    by_azimuth = view.azimuth_cut[SLOPE, left] * (1 - right) + view.azimuth_cut[SLOPE, left + 1] * right
    place = (math.atan2(z, level) / (2 * math.pi) + 0.5) * points
    left = int(place)
    right = place - left
    gain += view.elevation_cut[GAIN, left] * (1 - right) + view.elevation_cut[GAIN, left + 1] * right
    by_elevation = view.elevation_cut[SLOPE, left] * (1 - right) + view.elevation_cut[SLOPE, left + 1] * right
    if gain < view.limits[FLOOR] or level2 < 1e-12:
        slopes[0] = slopes[1] = 0.0
        return math.exp(view.limits[FLOOR]) if gain < view.limits[FLOOR] else math.exp(gain)
    g = math.exp(gain)
    # by turn: (x, y, z)' = (-cos_up aside cos_tilt, cos_up ahead, cos_up aside sin_tilt)
    x_turn, y_turn, z_turn = -y * cos_tilt, cos_up * ahead, y * sin_tilt
    # by elevation: (x, y, z)' = (-sin_up ahead cos_tilt + cos_up sin_tilt, -sin_up aside, cos_up cos_tilt + ...)
    x_up = cos_up * sin_tilt - sin_up * ahead * cos_tilt
    y_up = -sin_up * aside
    z_up = cos_up * cos_tilt + sin_up * ahead * sin_tilt
    slopes[0] = g * RADIANS * (by_azimuth * (x * y_turn - y * x_turn) / level2 + by_elevation * z_turn / level)
    slopes[1] = g * RADIANS * (by_azimuth * (x * y_up - y * x_up) / level2 + by_elevation * z_up / level)
    return g
