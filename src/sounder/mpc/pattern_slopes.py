"""Derivatives of an antenna's pattern by the direction of a path, for many directions and beams at once."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.extraction.scan_view import cut_table

Real = NDArray[np.float64]


class Cuts(NamedTuple):
    """Cuts of a pattern and their slopes, from `cut_table`, and its floor [neper]."""

    azimuth: Real
    elevation: Real
    floor: float

    @classmethod
    def of(cls, pattern: Pattern) -> Self:
        """Tabulate a pattern."""
        return cls(cut_table(pattern.azimuth_cut), cut_table(pattern.elevation_cut), np.log(10) / 20 * pattern.floor)


def slopes(azimuth: Real, elevation: Real, directions: Real, cuts: Cuts) -> Real:
    """Amplitude pattern (3, ..., beam) toward directions (...) [degree]: itself, by azimuth and by elevation.

    In the frame of an antenna that directions at ``b`` a path at an azimuth and an elevation has

    ``x = cos e cos(a - a_b) cos e_b + sin e sin e_b``, ``y = cos e sin(a - a_b)``,
    ``z = sin e cos e_b - cos e cos(a - a_b) sin e_b``,

    and the angles ``atan2(y, x)`` and ``asin(z)``, of which the cuts are functions. By one degree. The plain twin is
    :meth:`sounder.instrument.antenna_pattern.Pattern.beam_gain`.
    """
    look, tilt = np.radians(directions.T)
    azimuth, up = np.radians(azimuth)[..., None], np.radians(elevation)[..., None]
    cos_up, sin_up, cos_tilt, sin_tilt = np.cos(up), np.sin(up), np.cos(tilt), np.sin(tilt)
    ahead = cos_up * (np.cos(azimuth) * np.cos(look) + np.sin(azimuth) * np.sin(look))
    y = cos_up * (np.sin(azimuth) * np.cos(look) - np.cos(azimuth) * np.sin(look))
    x, z = ahead * cos_tilt + sin_up * sin_tilt, sin_up * cos_tilt - ahead * sin_tilt
    across2 = np.maximum(x * x + y * y, 1e-12)
    across = np.sqrt(across2)
    beyond = (sin_up * ahead / cos_up, sin_up * y / cos_up)  # less of both by elevation
    by_turn = -y * cos_tilt, ahead, y * sin_tilt
    by_up = cos_up * sin_tilt - beyond[0] * cos_tilt, -beyond[1], cos_up * cos_tilt + beyond[0] * sin_tilt
    gain, slope_azimuth = _cut(cuts.azimuth, np.arctan2(y, x))
    more, slope_elevation = _cut(cuts.elevation, np.arctan2(z, across))
    gain = gain + more
    g = np.exp(np.maximum(gain, cuts.floor))
    rise = np.where(gain > cuts.floor, np.radians(1.0) * g, 0.0)
    turned, raised = (
        rise * (slope_azimuth * (x * by[1] - y * by[0]) / across2 + slope_elevation * by[2] / across)
        for by in (by_turn, by_up)
    )
    return np.stack([g, turned, raised])


def _cut(table: Real, angle: Real) -> tuple[Real, Real]:
    """Level and its slope at angles [radian], from `cut_table`."""
    last = table.shape[1] - 1
    place = (angle / (2 * np.pi) + 0.5) * last
    left = np.minimum(place.astype(int), last - 1)
    right = place - left
    low, high = table[:, left], table[:, left + 1]
    level, slope = low + (high - low) * right
    return level, slope
