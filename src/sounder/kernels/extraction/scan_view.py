"""Data of a scan for the kernels: beams, antenna pattern, pulse, and the limits that make a peak a path."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.records import ARRIVAL, BEAM, DEPARTURE, LINK, Paths

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Records = npt.NDArray[np.record]
Direction = tuple[float, float, float, float]

GAIN, SLOPE = 0, 1
"""Rows of a cut."""
RADIANS = math.pi / 180.0


class AntennaView(NamedTuple):
    """What the kernels need of the antenna at one end: its beams and its pattern.

    Attributes
    ----------
    end : int
        `ARRIVAL` or `DEPARTURE`.
    stride : int
        Links from one beam of this antenna to the next.
    beams : array of `sounder.kernels.extraction.records.BEAM` (beam,)
        Azimuth-major.
    azimuth_cut, elevation_cut : array (2, angle)
        The pattern [neper] tabulated evenly from -180 to 180 degree, linear between, and its slope [neper/radian].
    floor : float
        Least gain of the pattern, relative to boresight [neper].
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
    azimuth_resolution, elevation_resolution : float
        Paths within both, and within the resolution in delay, are one [degree].
    """

    end: int
    stride: int
    beams: Records
    azimuth_cut: Real
    elevation_cut: Real
    floor: float
    azimuths: int
    elevations: int
    full_circle: bool
    azimuth_reach: float
    lowest: float
    highest: float
    beamwidth: float
    azimuth_resolution: float
    elevation_resolution: float


class ScanView(NamedTuple):
    """What the kernels need of a scan.

    Attributes
    ----------
    links : array of `sounder.kernels.extraction.records.LINK` (link,)
        All beams of the arrival for each beam of the departure.
    arrival, departure : AntennaView
        The latter has one beam where the transmit antenna was not turned.
    pulse, matched : array complex (point,)
        The pulse of a path of amplitude 1, and the filter that measures the amplitude, conjugated;
        ``oversampling`` points per sample.
    artefacts : array of `sounder.kernels.extraction.records.ARTEFACT` (artefact,)
    oversampling : int
    amplitude_variance : float
        Variance of a measured amplitude [noise power].
    margin_above, margin_below : float
        How far the amplitude in a link may exceed what the pattern predicts, or stay under it, and still be that of
        the same path.
    delay_resolution : float
        Paths within this and the resolutions in angle are one [sample].
    remainder : float
        Amplitude under which what remains at a path's delay is its own remainder, relative to the path in that link.
    sidelobe_remainder, sidelobe_level : float
        The same in the sidelobes, relative to the pattern; of the main lobe no more than the highest sidelobe counts.
    """

    links: Records
    arrival: AntennaView
    departure: AntennaView
    pulse: Complex
    matched: Complex
    artefacts: Records
    oversampling: int
    amplitude_variance: float
    margin_above: float
    margin_below: float
    delay_resolution: float
    remainder: float
    sidelobe_remainder: float
    sidelobe_level: float


def cut_table(cut: Real) -> Real:
    """Gain [neper] and slope [neper/radian] of a cut [dB], shape (2, angle): slopes are central differences."""
    gain = np.log(10) / 20 * cut
    return np.stack([gain, np.gradient(gain, 2 * np.pi / (cut.size - 1))])


def link_table(noise: Real, threshold: Real) -> Records:
    """Links from noise powers (link,) and thresholds (link,)."""
    links = np.empty(len(noise), LINK)
    links["noise"], links["threshold"] = noise, threshold
    return links


def beam_table(directions: Real) -> Records:
    """Beams from directions (beam, 2) [degree]."""
    beams = np.empty(len(directions), BEAM)
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
def beam_of(antenna: AntennaView, link: int) -> int:
    """Number of the beam of an antenna in a link."""
    return (link // antenna.stride) % antenna.beams.size


@part
def with_beam(antenna: AntennaView, link: int, b: int) -> int:
    """Link with another beam of an antenna, and the same one at the other end."""
    return link + (b - beam_of(antenna, link)) * antenna.stride


@part
def toward_path(path: Paths) -> tuple[Direction, Direction]:
    """Directions of arrival and departure of a path, from `toward`."""
    arrival, departure = path[ARRIVAL], path[DEPARTURE]
    return toward(arrival.azimuth, arrival.elevation), toward(departure.azimuth, departure.elevation)


@part
def link_gain(view: ScanView, link: int, directions: tuple[Direction, Direction]) -> float:
    """Amplitude of the patterns of a link toward a path, from `toward_path`: the product of both ends."""
    gain = pattern(view.arrival, beam_of(view.arrival, link), directions[ARRIVAL])[0]
    if view.departure.beams.size > 1:
        gain *= pattern(view.departure, beam_of(view.departure, link), directions[DEPARTURE])[0]
    return gain


@part
def pattern(antenna: AntennaView, b: int, direction: Direction) -> tuple[float, float, float]:
    """Amplitude of a beam's pattern in a direction from `toward`, relative to boresight.

    And its derivatives by azimuth and elevation [1/degree]. The plain-numpy twin is
    :meth:`sounder.instrument.antenna_pattern.Pattern.beam_gain`.
    """
    beam = antenna.beams[b]
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
    points = antenna.azimuth_cut.shape[1] - 1
    place = (math.atan2(y, x) / (2 * math.pi) + 0.5) * points
    left = int(place)
    if left >= points:
        left = points - 1
    right = place - left
    gain = antenna.azimuth_cut[GAIN, left] * (1 - right) + antenna.azimuth_cut[GAIN, left + 1] * right
    by_azimuth = antenna.azimuth_cut[SLOPE, left] * (1 - right) + antenna.azimuth_cut[SLOPE, left + 1] * right
    place = (math.atan2(z, level) / (2 * math.pi) + 0.5) * points
    left = int(place)
    right = place - left
    gain += antenna.elevation_cut[GAIN, left] * (1 - right) + antenna.elevation_cut[GAIN, left + 1] * right
    by_elevation = antenna.elevation_cut[SLOPE, left] * (1 - right) + antenna.elevation_cut[SLOPE, left + 1] * right
    if gain < antenna.floor or level2 < 1e-12:
        return math.exp(antenna.floor) if gain < antenna.floor else math.exp(gain), 0.0, 0.0
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
