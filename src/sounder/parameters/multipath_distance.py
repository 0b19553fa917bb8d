"""Multipath component distance (MCD): one number for how far two MPCs are apart in delay and direction."""

import numpy as np
from numpy.typing import NDArray

from sounder.parameters.angles import unit_vectors

DELAY_WEIGHT = 5.0
"""Weight of the delay against directions, zeta; 5 is the choice of Czink et al. for measurements [1]."""

Real = NDArray[np.float64]


def delay_coordinate(delay: Real, weight: float = DELAY_WEIGHT) -> Real:
    """Delays (path,) scaled so that their differences are the delay part of the MCD.

    ``zeta t s / D^2`` with the largest difference of delays ``D`` and their standard deviation ``s``; 0 if all delays
    agree.
    """
    extent = float(np.ptp(delay)) if delay.size else 0.0
    return delay * weight * float(delay.std()) / extent**2 if extent > 0 else np.zeros_like(delay)


def features(delay: Real, azimuth: Real, elevation: Real, weight: float = DELAY_WEIGHT) -> Real:
    """Points whose Euclidean distance is the MCD.

    ``MCD^2 = (|e_i - e_j| / 2)^2 + (zeta |t_i - t_j| s / D^2)^2``, with unit vectors ``e`` toward the directions of
    arrival. Opposite directions are 1 apart. An unknown elevation counts as the horizon.

    Source: N. Czink et al., A framework for automatic clustering of parametric MIMO channel data including path powers,
    IEEE VTC 2006 Fall, Eqs. 2-4; without departure.

    Parameters
    ----------
    delay, azimuth, elevation : array (path,)
        [s], [degree], [degree].
    weight : float
        ``zeta``.

    Returns
    -------
    array (path, 4)

    Examples
    --------
    >>> points = features(np.zeros(2), np.array([0.0, 180.0]), np.zeros(2))
    >>> print(np.linalg.norm(points[0] - points[1]).round(9))
    1.0
    """
    vectors = unit_vectors(azimuth, np.nan_to_num(elevation)) / 2
    return np.concatenate([vectors, delay_coordinate(delay, weight)[:, None]], axis=1)
