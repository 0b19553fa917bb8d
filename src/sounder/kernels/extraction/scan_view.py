"""Data of a scan for the kernels: beams, antenna pattern, pulse, and the limits that make a peak a path."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.records import BEAM

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Records = npt.NDArray[np.record]
Direction = tuple[float, float, float, float]

GAIN, SLOPE = 0, 1
"""Rows of a cut."""
RADIANS = math.pi / 180.0


class ScanView(NamedTuple):
    """What the kernels need of a scan.

    Attributes
    ----------
    beams : array of `sounder.kernels.extraction.records.BEAM` (beam,)
        Azimuth-major.
    azimuth_cut, elevation_cut : array (2, angle)
        The pattern [neper] tabulated evenly from -180 to 180 degree, linear between, and its slope [neper/radian].
    pulse, matched : array complex (point,)
        The pulse of a path of amplitude 1, and the filter that measures the amplitude, conjugated;
        ``oversampling`` points per sample.
    artefacts : array of `sounder.kernels.extraction.records.ARTEFACT` (artefact,)
    oversampling : int
    azimuths, elevations : int
        Size of the scan.
    full_circle : bool
        Whether the azimuths close a circle.
    azimuth_reach : float
        How far from its beam a path may be fitted in azimuth [degree].
    lowest, highest : float
        Elevations between which paths may be [degree].
    beamwidth : float
        Half-power beamwidth in elevation [degree].
    floor : float
        Least gain of the pattern, relative to boresight [neper].
    amplitude_variance : float
        Variance of a measured amplitude [noise power].
    margin_above, margin_below : float
        How far the amplitude in a beam may exceed what the pattern predicts, or stay under it, and still be that of
        the same path.
    delay_resolution, azimuth_resolution, elevation_resolution : float
        Paths within all three are one [sample, degree, degree].
    remainder : float
        Amplitude under which what remains at a path's delay is its own remainder, relative to the path in that beam.
    sidelobe_remainder, sidelobe_level : float
        The same in the sidelobes, relative to the pattern; of the main lobe no more than the highest sidelobe counts.
    """

    beams: Records
    azimuth_cut: Real
    elevation_cut: Real
    pulse: Complex
    matched: Complex
    artefacts: Records
    oversampling: int
    azimuths: int
    elevations: int
    full_circle: bool
    azimuth_reach: float
    lowest: float
    highest: float
    beamwidth: float
    floor: float
    amplitude_variance: float
    margin_above: float
    margin_below: float
    delay_resolution: float
    azimuth_resolution: float
    elevation_resolution: float
    remainder: float
    sidelobe_remainder: float
    sidelobe_level: float


def cut_table(cut: Real) -> Real:
    """Gain [neper] and slope [neper/radian] of a cut [dB], shape (2, angle): slopes are central differences."""
    gain = np.log(10) / 20 * cut
    return np.stack([gain, np.gradient(gain, 2 * np.pi / (cut.size - 1))])


def beam_table(noise: Real, threshold: Real, directions: Real) -> Records:
    """Beams from noise powers (beam,), thresholds (beam,) and directions (beam, 2) [degree]."""
    beams = np.empty(len(directions), BEAM)
    beams["noise"], beams["threshold"] = noise, threshold
    for axis, angle in zip(("azimuth", "elevation"), directions.T, strict=True):
        radians = np.radians(angle)
        beams[axis], beams[f"cos_{axis}"], beams[f"sin_{axis}"] = angle, np.cos(radians), np.sin(radians)
    return beams


@part
def toward(azimuth: float, elevation: float) -> Direction:
    """Cosine and sine of an azimuth and an elevation [degree]."""
    return (
        math.cos(azimuth * RADIANS),
        math.sin(azimuth * RADIANS),
        math.cos(elevation * RADIANS),
        math.sin(elevation * RADIANS),
    )


@part
def pattern(view: ScanView, b: int, direction: Direction) -> tuple[float, float, float]:
    """Amplitude of a beam's pattern in a direction from `toward`, relative to boresight.

    And its derivatives by azimuth and elevation [1/degree]. The plain-numpy twin is
    :meth:`sounder.instrument.antenna_pattern.Pattern.beam_gain`.
    """
    beam = view.beams[b]
    cos_azimuth, sin_azimuth, cos_up, sin_up = direction
    # cosine and sine of the azimuth between them
    ahead = cos_azimuth * beam.cos_azimuth + sin_azimuth * beam.sin_azimuth
    aside = sin_azimuth * beam.cos_azimuth - cos_azimuth * beam.sin_azimuth
    cos_tilt, sin_tilt = beam.cos_elevation, beam.sin_elevation
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
    if gain < view.floor or level2 < 1e-12:
        return math.exp(view.floor) if gain < view.floor else math.exp(gain), 0.0, 0.0
    g = math.exp(gain)
    # by azimuth: (x, y, z)' = (-cos_up aside cos_tilt, cos_up ahead, cos_up aside sin_tilt)
    x_turn, y_turn, z_turn = -y * cos_tilt, cos_up * ahead, y * sin_tilt
    # by elevation: (x, y, z)' = (-sin_up ahead cos_tilt + cos_up sin_tilt, -sin_up aside, cos_up cos_tilt + ...)
    x_up = cos_up * sin_tilt - sin_up * ahead * cos_tilt
    y_up = -sin_up * aside
    z_up = cos_up * cos_tilt + sin_up * ahead * sin_tilt
    slope_azimuth = g * RADIANS * (by_azimuth * (x * y_turn - y * x_turn) / level2 + by_elevation * z_turn / level)
    slope_elevation = g * RADIANS * (by_azimuth * (x * y_up - y * x_up) / level2 + by_elevation * z_up / level)
    return g, slope_azimuth, slope_elevation
