"""Angular lobes: directions side by side that are at most 10 dB under the strongest of a power angular spectrum."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from sounder.parameters.angles import angular_spread

UNDER_STRONGEST = 10.0
"""Threshold of lobes under the strongest direction [dB], as in the point data of NYU."""

Real = NDArray[np.float64]


def mean_lobe_spreads(azimuth: Real, elevation: Real, pas: Real) -> tuple[float, float]:
    """Mean over the lobes of their angular spreads, by TR 38.901, of the directions as they were scanned.

    A lobe holds directions that share a side on the grid and are at most 10 dB under the strongest direction of all.
    Antennas are included: a single path has the spread of the beams that see it. Source: M. K. Samimi and
    T. S. Rappaport, 3-D millimeter-wave statistical channel model for 5G wireless system design, IEEE Trans. Microw.
    Theory Tech. 64 (2016) 2207-2225.

    Parameters
    ----------
    azimuth, elevation : array (azimuth,), (elevation,)
        [degree]. The ends of the azimuths are neighbours if they are one step apart.
    pas : array (azimuth, elevation)
        Power angular spectrum [dB]; NaN or -inf: nothing was received.

    Returns
    -------
    tuple of float
        Of azimuth and of elevation [degree]; NaN without power, or where one angle alone was scanned.

    Examples
    --------
    >>> lobe_across_north = np.array([[-90.0], [-130.0], [-130.0], [-90.0]])
    >>> azimuth_spread, _ = mean_lobe_spreads(np.array([45.0, 135, 225, 315]), np.zeros(1), lobe_across_north)
    >>> print(round(azimuth_spread, 1), round(float(np.degrees(np.sqrt(np.log(2)))), 1))
    47.7 47.7
    """
    power = np.nan_to_num(10 ** (pas / 10))
    if not power.any():
        return np.nan, np.nan
    lobes, _ = label(power >= power.max() * 10 ** (-UNDER_STRONGEST / 10))
    turned = np.unwrap(azimuth, period=360)
    if len(azimuth) > 1 and np.isclose(360 - np.ptp(turned), np.median(np.abs(np.diff(turned)))):
        for first, last in zip(lobes[0], lobes[-1], strict=True):
            if first and last:
                lobes[lobes == last] = first
    within = np.where(lobes == np.unique(lobes[lobes > 0])[:, None, None], power, 0)
    azimuths, elevations = (
        float(angular_spread(angle, within.sum(axis=other)).mean()) if len(angle) > 1 else np.nan
        for angle, other in ((azimuth, 2), (elevation, 1))
    )
    return azimuths, elevations
