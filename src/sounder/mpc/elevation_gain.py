"""Path gain as a function of the assumed elevation."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.extraction.records import FIT_BEAMS
from sounder.mpc.directions import beam_gains

MIN_STEP = 0.5
"""Least change of elevation over which the parabola is laid [degree]; chosen, not derived."""
MAX_STEP = 15.0
"""Most of it [degree]; chosen, not derived."""

Real = NDArray[np.float64]


def with_elevation_gain(table: xr.Dataset, directions: Real, pattern: Pattern) -> xr.Dataset:
    """Add to MPCs how their gains change with the elevation that is assumed.

    Magnitudes ``m_b = a g_b(e)`` of a path at elevation ``e`` are those of amplitude ``a g(e').g(e) / g(e').g(e')`` at
    ``e'``, by least squares over the beams about it. Beyond the edge of the fan all such pairs of elevation and
    amplitude fit nearly as well. In decibels the amplitude is a parabola where the lobe is Gaussian. In general a
    parabola is laid through ``e`` and half and a whole standard deviation further from the horizon.

    Parameters
    ----------
    table : xarray.Dataset
        Along ``mpc``, with ``azimuth``, ``elevation``, ``elevation_std`` [degree].
    directions : array (beam, 2)
        From :func:`sounder.mpc.directions.beam_directions` [degree].
    pattern : Pattern
        Of the receive antenna.

    Returns
    -------
    xarray.Dataset
        The table with ``gain_slope`` [dB/degree] and ``gain_curvature`` [dB/degree2]: at elevation ``e'`` the gain is
        ``path_gain + gain_slope (e' - e) + gain_curvature (e' - e)**2 / 2``. NaN where there is no elevation.
    """
    azimuth, elevation = table["azimuth"].values[:, None], table["elevation"].values[:, None]
    level = beam_gains(azimuth[:, 0], elevation[:, 0], directions, pattern)
    near = np.argsort(-level, axis=1)[:, :FIT_BEAMS]
    beam_azimuth, beam_elevation = directions[near, 0], directions[near, 1]
    amplitude = 10 ** (np.take_along_axis(level, near, axis=1) / 20)

    def gain_change(step: Real) -> Real:
        other = 10 ** (pattern.beam_gain(azimuth, elevation + step[:, None], beam_azimuth, beam_elevation) / 20)
        return np.asarray(20 * np.log10(np.sum(other * amplitude, axis=1) / np.sum(other**2, axis=1)))

    size = np.clip(np.nan_to_num(table["elevation_std"].values), MIN_STEP, MAX_STEP)
    outward = np.where(elevation[:, 0] < 0, -size, size)
    half, whole = gain_change(outward / 2), gain_change(outward)
    slope, curvature = (4 * half - whole) / outward, 4 * (whole - 2 * half) / outward**2
    slope_attrs = {"units": "dB degree-1", "long_name": "slope of path gain with assumed elevation"}
    curvature_attrs = {"units": "dB degree-2", "long_name": "curvature of path gain with assumed elevation"}
    return table.assign(gain_slope=("mpc", slope, slope_attrs), gain_curvature=("mpc", curvature, curvature_attrs))
