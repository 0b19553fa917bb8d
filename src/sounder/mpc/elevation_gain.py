"""How a path's gain hangs on its elevation: what whoever learns the elevation from elsewhere makes of the gain."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.extraction.columns import NEAR

LEAST, MOST = 0.5, 15.0  # degree; the parabola is laid over a standard deviation, within these

Real = NDArray[np.float64]


def with_ridge(table: xr.Dataset, looks: tuple[Real, Real], pattern: Pattern) -> xr.Dataset:
    """Add to MPCs how their gains change with the elevation that is assumed.

    Magnitudes ``m_b = a g_b(e)`` of a path at elevation ``e`` are those of amplitude ``a g(e').g(e) / g(e').g(e')`` at
    ``e'``, by least squares over the beams about it. Beyond the edge of the fan all such pairs fit nearly as well, a
    ridge. In decibels it is a parabola where the lobe is Gaussian; in general one is laid through ``e`` and half and a
    whole standard deviation further from the horizon, where the beams do not tell.

    Parameters
    ----------
    table : xarray.Dataset
        Along ``mpc``, with ``azimuth``, ``elevation``, ``elevation_std`` [degree].
    looks : arrays (azimuth,), (elevation,)
        Directions of the scan [degree].
    pattern : Pattern
        Of the receive antenna.

    Returns
    -------
    xarray.Dataset
        The table with ``gain_slope`` [dB/degree] and ``gain_curvature`` [dB/degree2]: at elevation ``e'`` the gain is
        ``path_gain + gain_slope (e' - e) + gain_curvature (e' - e)**2 / 2``. NaN where there is no elevation.
    """
    azimuth, elevation = table["azimuth"].values[:, None], table["elevation"].values[:, None]
    look_azimuth, look_elevation = (grid.ravel() for grid in np.meshgrid(*looks, indexing="ij"))
    seen = pattern.beam_gain(azimuth, elevation, look_azimuth, look_elevation)
    near = np.argsort(-seen, axis=1)[:, :NEAR]
    beams = look_azimuth[near], look_elevation[near]
    amplitude = 10 ** (np.take_along_axis(seen, near, axis=1) / 20)

    def gain(step: Real) -> Real:
        other = 10 ** (pattern.beam_gain(azimuth, elevation + step[:, None], *beams) / 20)
        return np.asarray(20 * np.log10(np.sum(other * amplitude, axis=1) / np.sum(other**2, axis=1)))

    reach = np.clip(np.nan_to_num(table["elevation_std"].values), LEAST, MOST)
    outward = np.where(elevation[:, 0] < 0, -reach, reach)
    half, whole = gain(outward / 2), gain(outward)
    slope, curvature = (4 * half - whole) / outward, 4 * (whole - 2 * half) / outward**2
    return table.assign(
        gain_slope=("mpc", slope, {"units": "dB degree-1", "long_name": "what the gain rises a degree of elevation"}),
        gain_curvature=("mpc", curvature, {"units": "dB degree-2", "long_name": "what this slope rises a degree"}),
    )
