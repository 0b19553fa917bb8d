"""Angular spreads by the definitions in use, right across 0 and 360 degree.

All come from the mean of the unit vectors of the paths, weighted by their shares ``p_i`` of the power,
``mu = sum_i p_i exp(j phi_i)``, ``R = |mu|``. Paths of power 0 do not count. Without any power the result is NaN.
Turning all angles, or scaling all powers, changes no spread. The spread of zenith angles is that of elevations.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Spread = Literal["tr38901", "fleury"]
"""Definition of an angular spread: ``sqrt(-2 ln R)`` (TR 38.901), or ``sqrt(1 - R^2)`` (Fleury)."""
ROUNDING = 1e-12
"""A mean vector shorter than this is 0: the rounding of the sum of some thousand unit vectors [1]."""

Real = NDArray[np.float64]


def mean_angle(angle: Real, power: Real) -> Real:
    """Direction of the mean vector.

    Parameters
    ----------
    angle : array (..., path)
        [degree]
    power : array (..., path)
        Linear.

    Returns
    -------
    array (...)
        [degree], 0 to 360; NaN without power, or if the paths cancel, as two opposite ones of the same power.

    Examples
    --------
    >>> print(mean_angle(np.array([350.0, 20.0]), np.array([1.0, 1.0])).round(9))
    5.0
    """
    vector = (power * np.exp(1j * np.radians(angle))).sum(axis=-1)
    total = power.sum(axis=-1)
    known = np.abs(vector) > ROUNDING * total
    return np.asarray(np.where(known, np.degrees(np.angle(vector)) % 360, np.nan))


def angular_spread(angle: Real, power: Real, definition: Spread = "tr38901") -> Real:
    """Angular spread of azimuths, or of elevations.

    ``tr38901``: ``sqrt(-2 ln R)``, the circular standard deviation. It is the standard deviation of a narrow spectrum,
    and infinite where the paths cancel (``R = 0``), as two opposite ones of the same power.
    ``fleury``: ``sqrt(1 - R^2) = sqrt(sum_i p_i |exp(j phi_i) - mu|^2)``, from 0 to 1, times 180 / pi; where the paths
    cancel it is 57.3 degree.

    Sources: 3GPP TR 38.901, Annex A.1, Eq. (A-1). B. H. Fleury, First- and second-order characterization of direction
    dispersion and space selectivity in the radio channel, IEEE Trans. Inf. Theory 46 (2000) 2027-2044.

    Parameters
    ----------
    angle : array (..., path)
        [degree]; NaN: not known.
    power : array (..., path)
        Linear.
    definition : {"tr38901", "fleury"}

    Returns
    -------
    array (...)
        [degree]; 0 for one path, NaN without power or with an unknown angle.

    Examples
    --------
    >>> angle, power = np.array([359.0, 1.0]), np.array([1.0, 1.0])
    >>> print(angular_spread(angle, power).round(4), angular_spread(angle, power, "fleury").round(4))
    1.0 0.9999
    """
    centre = mean_angle(angle, power)[..., None]
    total = power.sum(axis=-1, keepdims=True)
    share = np.where(total > 0, power / np.where(total > 0, total, 1), np.nan)
    from_centre = np.radians(angle - np.nan_to_num(centre))
    # 1 - R from the squares of small angles: 1 - cos(x) = 2 sin(x/2)^2 keeps their digits
    shortfall = (2 * share * np.sin(from_centre / 2) ** 2).sum(axis=-1) if power.shape[-1] else np.nan
    cancelled = np.isnan(centre[..., 0]) & (total[..., 0] > 0) & np.isfinite(angle).all(axis=-1)
    shortfall = np.where(cancelled, 1.0, np.where(total[..., 0] > 0, shortfall, np.nan))
    with np.errstate(divide="ignore"):
        square = -2 * np.log1p(-shortfall) if definition == "tr38901" else shortfall * (2 - shortfall)
    return np.asarray(np.degrees(np.sqrt(square)))


def direction_spread(azimuth: Real, elevation: Real, power: Real) -> Real:
    """Spread of directions on the sphere: ``sqrt(1 - |sum_i p_i e_i|^2)`` with the unit vectors ``e_i``.

    Source: Fleury (2000), as :func:`angular_spread`.

    Parameters
    ----------
    azimuth, elevation : array (..., path)
        [degree]
    power : array (..., path)
        Linear.

    Returns
    -------
    array (...)
        0 to 1; 0 for one path, NaN without power or with an unknown angle.

    Examples
    --------
    >>> up_and_down = np.array([90.0, -90.0])
    >>> print(direction_spread(np.zeros(2), up_and_down, np.ones(2)))
    1.0
    """
    if not power.shape[-1]:
        return np.full(power.shape[:-1], np.nan)
    total = power.sum(axis=-1)
    share = power / np.where(total > 0, total, np.nan)[..., None]
    vectors = unit_vectors(azimuth, elevation)
    mean = (share[..., None] * vectors).sum(axis=-2, keepdims=True)
    return np.asarray(np.sqrt((share * np.sum((vectors - mean) ** 2, axis=-1)).sum(axis=-1)))


def unit_vectors(azimuth: Real, elevation: Real) -> Real:
    """Unit vectors (..., 3), east, north, up, of directions (...) [degree]."""
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e) * np.ones_like(a)], axis=-1)
