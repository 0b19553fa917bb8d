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
    """Amplitude pattern of beams toward paths, and its derivatives.

    In the frame of an antenna that looks at ``b``, a path at an azimuth and an elevation has

    ``x = cos e cos(a - a_b) cos e_b + sin e sin e_b``, ``y = cos e sin(a - a_b)``,
    ``z = sin e cos e_b - cos e cos(a - a_b) sin e_b``,

    and the angles ``atan2(y, x)`` and ``asin(z)``, of which the cuts are functions. The plain twin is
    :meth:`sounder.instrument.antenna_pattern.Pattern.beam_gain`.

    Parameters
    ----------
    azimuth, elevation : array (...)
        Directions of the paths [degree].
    directions : array (beam, 2)
        Where the beams look [degree].
    cuts : Cuts

    Returns
    -------
    array (3, ..., beam)
        The amplitude relative to boresight, and its derivatives by azimuth and by elevation [1/degree].
    """
    look, tilt = np.radians(directions.T)
    azimuth, up = np.radians(azimuth)[..., None], np.radians(elevation)[..., None]
    cos_up, sin_up, cos_tilt, sin_tilt = np.cos(up), np.sin(up), np.cos(tilt), np.sin(tilt)
    ahead = cos_up * (np.cos(azimuth) * np.cos(look) + np.sin(azimuth) * np.sin(look))
    y = cos_up * (np.sin(azimuth) * np.cos(look) - np.cos(azimuth) * np.sin(look))
    x, z = ahead * cos_tilt + sin_up * sin_tilt, sin_up * cos_tilt - ahead * sin_tilt
    horizontal2 = np.maximum(x * x + y * y, 1e-12)
    horizontal = np.sqrt(horizontal2)
    ahead_loss, y_loss = sin_up * ahead / cos_up, sin_up * y / cos_up  # minus their derivatives by elevation
    by_azimuth = -y * cos_tilt, ahead, y * sin_tilt
    by_elevation = cos_up * sin_tilt - ahead_loss * cos_tilt, -y_loss, cos_up * cos_tilt + ahead_loss * sin_tilt
    gain_azimuth, slope_azimuth = _interpolate(cuts.azimuth, np.arctan2(y, x))
    gain_elevation, slope_elevation = _interpolate(cuts.elevation, np.arctan2(z, horizontal))
    gain = gain_azimuth + gain_elevation
    g = np.exp(np.maximum(gain, cuts.floor))
    scale = np.where(gain > cuts.floor, np.radians(1.0) * g, 0.0)
    derivatives = (
        scale * (slope_azimuth * (x * dy - y * dx) / horizontal2 + slope_elevation * dz / horizontal)
        for dx, dy, dz in (by_azimuth, by_elevation)
    )
    return np.stack([g, *derivatives])


def _interpolate(table: Real, angle: Real) -> tuple[Real, Real]:
    """Level and its slope at angles [radian], from `cut_table`."""
    last = table.shape[1] - 1
    place = (angle / (2 * np.pi) + 0.5) * last
    left = np.minimum(place.astype(int), last - 1)
    right = place - left
    low, high = table[:, left], table[:, left + 1]
    level, slope = low + (high - low) * right
    return level, slope
