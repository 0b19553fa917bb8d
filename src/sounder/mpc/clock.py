"""The clock that drifts while the horn turns, and the variance that it adds to the delays."""

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Integers = NDArray[np.int64]


def scan_order(time: Real | None, azimuths: int, elevations: int) -> Integers:
    """Number of each direction in the order of the scan, from 0; shape (direction,), azimuth-major.

    Parameters
    ----------
    time : array (azimuth, elevation) or None
        When each direction was recorded; unknown times come last. None: all azimuths at each elevation in turn.
    azimuths, elevations : int
    """
    if time is None:
        return np.arange(azimuths * elevations).reshape(elevations, azimuths).T.ravel()
    order = np.empty(time.size, dtype=np.int64)
    order[np.argsort(time.ravel(), kind="stable")] = np.arange(time.size)
    return order


def clock_variance(beam: Integers, weight: Real, order: Integers, step: float) -> Real:
    """Variance of delays due to a drifting clock.

    The clock is a random walk with steps of standard deviation ``q`` from one direction to the next, 0 at the first.
    Between the directions number ``i`` and ``j`` it has the covariance ``q^2 min(i, j)``. A delay is the mean of those
    in the path's beams, weighted by their information, so that its variance is ``q^2 sum_ij w_i w_j min(i, j)``.

    Parameters
    ----------
    beam, weight : array (mpc, near)
        From :func:`sounder.mpc.uncertainty.best_beams`.
    order : array (direction,)
        From `scan_order`.
    step : float
        ``q`` [s].

    Returns
    -------
    array (mpc,)
        [s2]
    """
    number = order[beam]
    covariance = np.minimum(number[:, :, None], number[:, None, :])
    variance: Real = step**2 * np.einsum("pi,pij,pj->p", weight, covariance, weight)
    return variance
